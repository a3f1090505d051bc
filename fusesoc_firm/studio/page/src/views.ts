// What the page asks of the server for the views below the picture.

import { get } from "./api";
import type { Waits } from "./waits";

/** Bytes with one meaning; see fusesoc_firm/studio/byte_map.py. */
export interface Part {
  name: string;
  type: string;
  offset: number | null;
  size: number | null;
  depth: number;
}

export interface Line {
  text: string;
  template: string;
  specification: number[];
  messages: string[];
}

export interface Bound {
  name: string;
  periodCycles: number;
  wcetCycles: number;
  deadlineCycles: number;
  responseCycles: number | null;
  latenessCycles: number | null;
  bufferBytes: number | null;
}

export interface Policy {
  name: string;
  schedulable: boolean;
  allFinish: boolean;
  worstLatenessCycles: number | null;
  bufferBytes: number | null;
  luts: number | null;
  publishers: Bound[];
}

export interface Schedulers {
  chosen: string;
  clock: number | null;
  scheduler: string;
  utilisation: number;
  reasons: string[];
  policies: Policy[];
}

/** The publishers of the chosen scheduler that miss their deadlines, and the verdict in words. */
export function verdictOf({ policies, chosen, utilisation }: Schedulers): { late: string[]; words: string } {
  const bounds = policies.find((policy) => policy.name === chosen)?.publishers ?? [];
  const late = bounds.filter(isLate).map((bound) => bound.name);
  const load = `the messages need ${Math.round(100 * utilisation)} % of the channel's time`;
  if (!late.length) return { late, words: `all messages meet their deadlines; ${load}` };
  return { late, words: `${utilisation > 1 ? "overloaded: " : ""}${load}; late: ${late.join(", ")}` };
}

/** Whether a publisher misses its deadline, or has no bound. */
export const isLate = ({ latenessCycles: late }: { latenessCycles: number | null }) => late === null || late > 0;

/** A burst: block, first and last cycle. */
export type Grant = [string, number, number];

/** The first beats of a frame, how many there are, and the cycles of the first and the last one. */
export interface Wave {
  beats: string[];
  count: number;
  cycles: [number, number] | null;
}

export interface Series {
  fields: string[];
  unit: string;
  points: [number, number | null][];
}

export const bytes = (file: string) => get<{ width: number; blocks: Record<string, Part[]> }>("bytes", { file });
export const generated = (file: string, name: string) =>
  get<{ names: string[]; name: string; lines: Line[] }>("generated", { file, name });
export const schedulers = (file: string) => get<Schedulers | { missing: string }>("schedulers", { file });
/** A way of the topics within the FPGA; see fusesoc_firm/exploration/fabrics.py. */
export interface Way {
  fabric: string;
  lut?: number;
  ff?: number;
  routers?: number;
  hops?: number;
  cycles?: number;
  interval?: number;
  fault?: string;
}

/** Routers at columns and rows with their blocks, and the links between them. */
export interface FabricMap {
  title: string;
  routers: { x: number; y: number; blocks: string[] }[];
  links: { from: number; to: number; beats: number }[];
}

export const fabrics = (file: string) =>
  get<{ fabric: string; ways: Way[]; map?: FabricMap; topics: string[] }>("fabrics", { file });
export const timeline = () => get<{ grants: Grant[]; waits: Waits[] }>("timeline");
export const status = () => get<{ access: string | null; counts: Record<string, number> }>("status");
export const series = (block: string, field: string) => get<Series>("series", { block, field });

/** A place and a unit quaternion: x, y, z, then x, y, z, w. */
export type Pose = number[];

export const poses = (number: number) => get<{ poses: Pose[] }>("poses", { number: String(number) });
export const wave = (number: number) => get<Wave>("wave", { number: String(number) });

/** Do something at once and then at intervals, one after the other, until the returned function is called. */
export function repeat(milliseconds: number, action: () => Promise<void>): () => void {
  let isOver = false;
  const turn = async () => {
    if (!document.hidden) await action().catch(() => undefined);
    if (!isOver) setTimeout(turn, milliseconds);
  };
  turn();
  return () => void (isOver = true);
}

/** Take the answer to a question, unless the returned function is called first, since a newer question counts. */
export function answered<T>(question: Promise<T>, take: (answer: T) => void, failed: (reason: string) => void): () => void {
  let isOver = false;
  question.then(
    (answer) => isOver || take(answer),
    (error) => isOver || failed(words(error)),
  );
  return () => void (isOver = true);
}

export const words = (error: unknown) => (error instanceof Error ? error.message : String(error));

/** Let the keyboard reach what scrolls. */
export const reachable = (element: HTMLElement) => void (element.tabIndex = 0);
