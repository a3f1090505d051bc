// Where messages wait on the wires of simulated hardware, and where the waiting begins.

/** A wire: its source and its sink, which are blocks, sides of the Manager, or the host. */
export type Way = [string, string];

/** The cycles in which each wire waited, of those that were counted; see fusesoc_firm/node/engine/watch.py. */
export interface Waits {
  first: number;
  end: number;
  cycles: number;
  counts: number[];
}

/** The part of the cycles in which a wire waited, and whether the waiting begins there. */
export interface Wait {
  share: number;
  isFirst: boolean;
}

export const HOST = "the host";
export const FROM_HOST = "from the host";
export const TO_HOST = "to the host";

export const wireKey = (source: string, sink: string) => `${source}>${sink}`;

/**
 * The waits of each wire.
 *
 * A sink that has to wait itself passes the waiting on. So the waiting begins at a wire if its sink waited less than half
 * as long on any wire of its own.
 */
export function waitsOf(wires: Way[], waits: Waits | null): Map<string, Wait> {
  const found = new Map<string, Wait>();
  if (!waits?.cycles) return found;
  wires.forEach(([source, sink], index) => {
    const own = waits.counts[index];
    const later = wires.map(([start], other) => (start === sink ? waits.counts[other] : 0));
    found.set(wireKey(source, sink), { share: own / waits.cycles, isFirst: own > 0 && 2 * Math.max(...later) < own });
  });
  return found;
}

/** The publishers to which messages lead from each block. */
export function publishersOf(wires: Way[]): Map<string, Set<string>> {
  const found = new Map(wires.flat().map((name) => [name, new Set<string>()]));
  const inner = wires.filter(([source, sink]) => source !== FROM_HOST && sink !== TO_HOST);
  for (const [source, sink] of wires) if (sink === TO_HOST) found.get(source)!.add(source);
  // A path has at most as many wires as there are.
  for (const _ of inner) for (const [source, sink] of inner) found.get(sink)!.forEach((name) => found.get(source)!.add(name));
  return found;
}

/** The sum of counts in their order; null without any. */
export function sumOf(parts: Waits[]): Waits | null {
  if (!parts.length) return null;
  const counts = parts[0].counts.map((_, index) => parts.reduce((sum, part) => sum + part.counts[index], 0));
  return { first: parts[0].first, end: parts.at(-1)!.end, cycles: parts.reduce((sum, part) => sum + part.cycles, 0), counts };
}

/** The waits since an earlier time; null if no cycles were counted since. */
export function since(now: Waits | null, before: Waits | null): Waits | null {
  if (!now || !before) return now;
  if (now.cycles <= before.cycles) return null;
  const counts = now.counts.map((count, index) => count - before.counts[index]);
  return { first: before.end, end: now.end, cycles: now.cycles - before.cycles, counts };
}

/** The words for a wait; none for a wire that hardly waits. */
export function waitWords({ share, isFirst }: Wait): string {
  const percent = Math.round(100 * share);
  return percent ? `waits ${percent} %${isFirst ? "\nbegins here" : ""}` : "";
}
