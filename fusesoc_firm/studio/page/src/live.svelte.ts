// What the page knows of the current run: counts and rates of each block, and the latest messages.

import { address, type Jobs } from "./api";
import type { End, WireData } from "./graph";
import { publishersOf, since, TO_HOST, waitsOf, waitWords, type Wait, type Waits, type Way } from "./waits";

/**
 * A message: number, block, seconds, bytes, and of a response: cause, cycles, ns of the wall clock; then its fields as
 * words, such as `x=1.5`.
 */
export type Row = [number, string, number, number, number | null, number | null, number | null, string[]];

export interface Run {
  number: number;
  file: string;
  title: string;
  state: "building" | "running" | "ended" | "failed";
  text: string;
  isPaused: boolean;
  isControlled: boolean;
  clock: number | null;
  wires: Way[];
}

interface Percentiles {
  median: number;
  most: number;
  maximum: number;
}

interface Count {
  messages: number;
  bytes: number;
  cycles: Percentiles | null;
  wall_ns: Percentiles | null;
}

interface Load {
  waiting: number;
  capacity: number;
  dropped: number;
  refused: number;
  lost: number;
}

interface Figures {
  seconds: number;
  counts: Record<string, Count>;
  loads: Record<string, Load>;
  waits: Waits | null;
}

/** What is new of a run; what is not new is left out. See fusesoc_firm/studio/reports.py. */
interface Report {
  run?: Run | null;
  first?: number;
  last?: number;
  skipped?: number;
  messages?: Row[];
  figures?: Figures;
  jobs?: Jobs;
}

/** What a drawn wire shows of a run; `waiting` is the class of its style. */
export interface Shown {
  words: string;
  waiting: "" | "waits" | "waits first" | "stuck" | "stuck first";
  isCrowded: boolean;
  isFlowing: boolean;
  /** Nothing passes and nothing waits. */
  isIdle: boolean;
}

const NOTHING: Shown = { words: "", waiting: "", isCrowded: false, isFlowing: false, isIdle: false };
// The part of the cycles in which a wire waits that is stuck: nothing passes, and something is offered in all of them.
const STUCK = 0.95;

// Each further row costs time in each picture; older ones are in the record.
const MOST_ROWS = 100;
// The server sends up to 20 reports that are not confirmed.
const CONFIRMED = 10;
// The seconds over which rates are averaged.
const WINDOW = 1;

const quantity = (value: number) => new Intl.NumberFormat("en", { maximumSignificantDigits: 3 }).format(value);

/** A time in a unit in which it is easily read. */
export function duration(ns: number): string {
  const [unit, size] = ns < 1e3 ? ["ns", 1] : ns < 1e6 ? ["µs", 1e3] : ns < 1e9 ? ["ms", 1e6] : ["s", 1e9];
  return `${quantity(ns / (size as number))} ${unit}`;
}

/** A latency: in simulated time if that is known, otherwise as measured on the host. */
export function latency(cycles: number | null, wall: number | null, clock: number | null): string {
  if (cycles !== null) return `${cycles} cycles${clock ? `, ${duration((cycles * 1e9) / clock)}` : ""}`;
  return wall === null ? "" : `${duration(wall)} on the host`;
}

export class Live {
  run = $state.raw<Run | null>(null);
  /** The numbers of the oldest message in the record and of the newest one. */
  first = $state(0);
  last = $state(-1);
  rows = $state.raw<Row[]>([]);
  skipped = $state(0);
  /** The words at the wire of each block. */
  words = $state.raw<Record<string, string>>({});
  /** The latest message of each block. */
  latest = $state.raw<Record<string, Row>>({});
  /** The blocks that messages have passed in the last second. */
  flowing = $state.raw<Set<string>>(new Set());
  /** The names of inputs whose queues are full. */
  crowded = $state.raw<Set<string>>(new Set());
  /** The longest of the latest latencies of each block, in cycles. */
  longest = $state.raw<Record<string, number>>({});
  isFollowing = $state(true);
  /** The latest builds for boards. */
  jobs = $state.raw<Jobs>({});
  /** The waits of an opened message, which the wires show instead of the present ones. */
  past = $state.raw<Waits | null>(null);
  #present = $state.raw<Waits | null>(null);
  #waits = $derived(waitsOf(this.run?.wires ?? [], this.past ?? this.#present));
  #publishers = $derived(publishersOf(this.run?.wires ?? []));
  #history: Figures[] = [];

  /** What is known of the waits on a wire. */
  waits(key: string): Wait | undefined {
    return this.#waits.get(key);
  }

  /** What a drawn wire shows: of several streams that wait, the longest wait, and whether waiting begins at any of them. */
  shown({ file, ends }: WireData): Shown {
    if (this.run?.file !== file) return NOTHING;
    const words = ends.flatMap(({ block, title }) => {
      const own = this.words[block ?? ""];
      return own && title ? [`${title}: ${own.replaceAll("\n", ", ")}`] : (own ?? []);
    });
    const waits = ends.flatMap(({ wire }) => this.waits(wire) ?? []).filter((wait) => waitWords(wait));
    const isFirst = waits.some((wait) => wait.isFirst);
    const share = Math.max(0, ...waits.map((wait) => wait.share));
    const waiting = waitWords({ share, isFirst });
    const isRunning = this.run.state === "running" && !this.run.isPaused && !this.past;
    // The host goes on to take messages for a subscriber that is stuck, so only what leaves the hardware counts.
    const isStuck = isRunning && share >= STUCK && this.#leaving(ends).every((name) => !this.flowing.has(name));
    const passed = ends.some(({ block, wire }) => [block ?? "", ...wire.split(">")].some((name) => this.flowing.has(name)));
    const isFlowing = passed && !isStuck;
    return {
      words: [...words, isStuck && "stuck", waiting].filter(Boolean).join("\n"),
      waiting: waiting && `${isStuck ? "stuck" : "waits"}${isFirst ? " first" : ""}` as const,
      isCrowded: ends.some(({ block }) => this.crowded.has(block ?? "")),
      isFlowing,
      isIdle: isRunning && !isFlowing && !waiting,
    };
  }

  /** The publishers to which messages lead from the sinks of wires. */
  #leaving(ends: End[]): string[] {
    const ways = ends.map(({ wire }) => wire.split(">"));
    return ways.flatMap(([source, sink]) => [...(this.#publishers.get(sink === TO_HOST ? source : sink) ?? [])]);
  }

  /** What a block of a file does: whether messages pass it, or wait because its queue is full. */
  stateOf(file: string, topics: string[]): "" | "flowing" | "crowded" {
    if (this.run?.file !== file) return "";
    if (topics.some((topic) => this.crowded.has(topic))) return "crowded";
    return topics.some((topic) => this.flowing.has(topic)) ? "flowing" : "";
  }

  /** The latest message of a block of a file. */
  latestOf(file: string, topics: string[]): Row | undefined {
    if (this.run?.file !== file) return undefined;
    const found = topics.flatMap((topic) => (this.latest[topic] ? [this.latest[topic]] : []));
    return found.sort(([one], [other]) => one - other).at(-1);
  }

  /** Follow the run until the returned function is called; connects again if the server was restarted. */
  follow(): () => void {
    let socket: WebSocket | undefined;
    let isOver = false;
    const open = () => {
      const made = (socket = new WebSocket(address("watch")));
      let waiting: Report[] = [];
      let unconfirmed = 0;
      // The server reports to each connection as if the page knew nothing.
      let isFirst = true;
      const showAll = () => {
        for (const report of waiting) {
          this.#take(report, isFirst);
          isFirst = false;
        }
        unconfirmed += waiting.length;
        waiting = [];
        if (unconfirmed < CONFIRMED || made.readyState !== WebSocket.OPEN) return;
        made.send(String(unconfirmed));
        unconfirmed = 0;
      };
      made.onmessage = (event) => {
        // All that came are shown by the next picture; a hidden page has none, and soon gets no more reports.
        if (waiting.push(JSON.parse(event.data)) === 1) requestAnimationFrame(showAll);
      };
      made.onclose = () => isOver || setTimeout(open, 2000);
    };
    open();
    return () => {
      isOver = true;
      socket?.close();
    };
  }

  #take({ run, first, last, skipped, messages, figures, jobs }: Report, isFirst: boolean) {
    if (jobs || isFirst) this.jobs = jobs ?? {};
    const isNew = isFirst || (run !== undefined && run?.number !== this.run?.number);
    if (isNew) {
      this.#history = [];
      [this.rows, this.skipped, this.isFollowing, this.first, this.last] = [[], 0, true, 0, -1];
      [this.past, this.#present] = [null, null];
      [this.latest, this.words, this.flowing, this.crowded] = [{}, {}, new Set(), new Set()];
    }
    if (run !== undefined) this.run = run;
    if (messages) {
      // What had passed before the page looked is not missing in the list.
      this.skipped += this.last < 0 ? 0 : skipped!;
      [this.first, this.last] = [first!, last!];
      this.latest = { ...this.latest, ...Object.fromEntries(messages.map((row) => [row[1], row])) };
      if (this.isFollowing) this.rows = [...this.rows, ...messages].slice(-MOST_ROWS);
    }
    if (figures && this.run) this.#show(figures, this.run);
  }

  #show(figures: Figures, run: Run) {
    const begin = this.#history.findIndex((item) => item.seconds >= figures.seconds - WINDOW);
    this.#history = [...this.#history.slice(Math.max(0, begin - 1)), figures];
    this.words = this.#wordsOf(figures, run);
    this.#present = since(figures.waits, this.#history[0].waits) ?? this.#present;
    const timed = Object.entries(figures.counts).filter(([, count]) => count.cycles);
    this.longest = Object.fromEntries(timed.map(([name, count]) => [name, count.cycles!.maximum]));
    const { loads } = figures;
    this.crowded = new Set(Object.keys(loads).filter((name) => loads[name].waiting >= loads[name].capacity));
  }

  #wordsOf({ seconds: now, counts, loads }: Figures, run: Run): Record<string, string> {
    const oldest = this.#history[0];
    const seconds = now - oldest.seconds;
    const found: Record<string, string> = {};
    const isRunning = run.state === "running" && !run.isPaused;
    const flowing = new Set<string>();
    for (const [name, count] of Object.entries(counts)) {
      const rate = seconds > 0 ? (count.messages - (oldest.counts[name]?.messages ?? 0)) / seconds : 0;
      if (isRunning && rate > 0) flowing.add(name);
      const words = [isRunning ? `${quantity(rate)}/s` : `${count.messages} messages`];
      const load = loads[name];
      if (load?.waiting) words.push(`${load.waiting} of ${load.capacity} wait`);
      for (const kind of ["dropped", "refused", "lost"] as const) if (load?.[kind]) words.push(`${load[kind]} ${kind}`);
      const times = count.cycles ?? count.wall_ns;
      if (times) {
        const inCycles = count.cycles !== null;
        const text = (value: number) =>
          inCycles ? (run.clock ? duration((value * 1e9) / run.clock) : `${value} cycles`) : duration(value);
        words.push(text(times.median));
        if (times.most !== times.median) words.push(`99 %: ${text(times.most)}`);
      }
      found[name] = words.join("\n");
    }
    this.flowing = flowing;
    return found;
  }
}

export const live = new Live();
