// What the page knows of the current run: counts and rates of each block, and the latest messages.

import { address } from "./api";

/** A message without its content: number, block, seconds, bytes, and of a response: cause, cycles, ns of the wall clock. */
export type Row = [number, string, number, number, number | null, number | null, number | null];

export interface Run {
  number: number;
  file: string;
  title: string;
  state: "building" | "running" | "ended" | "failed";
  text: string;
  isPaused: boolean;
  isControlled: boolean;
  clock: number | null;
  first: number;
  last: number;
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

/** What the server sends when it is asked; see fusesoc_firm/studio/live.py. */
interface News {
  run: Run | null;
  seconds: number;
  counts: Record<string, Count>;
  loads: Record<string, Load>;
  messages: Row[];
  skipped: number;
}

const MOST_ROWS = 200;
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
  rows = $state.raw<Row[]>([]);
  skipped = $state(0);
  /** The words at the wire of each block. */
  words = $state.raw<Record<string, string>>({});
  /** The names of inputs whose queues are full. */
  crowded = $state.raw<Set<string>>(new Set());
  /** The longest of the latest latencies of each block, in cycles. */
  longest = $state.raw<Record<string, number>>({});
  isFollowing = $state(true);
  #history: { seconds: number; counts: Record<string, Count> }[] = [];

  /** Follow the run until the returned function is called; connects again if the server was restarted. */
  follow(): () => void {
    let socket: WebSocket | undefined;
    let isOver = false;
    const open = () => {
      const made = (socket = new WebSocket(address("watch")));
      let last = -1;
      made.onopen = () => made.send(String(last));
      made.onmessage = (event) => {
        const news: News = JSON.parse(event.data);
        this.#take(news);
        last = news.run?.last ?? -1;
        // The next news is asked for when this one is shown; a hidden page asks for none.
        requestAnimationFrame(() => made.readyState === WebSocket.OPEN && made.send(String(last)));
      };
      made.onclose = () => isOver || setTimeout(open, 2000);
    };
    open();
    return () => {
      isOver = true;
      socket?.close();
    };
  }

  #take(news: News) {
    const isNew = news.run?.number !== this.run?.number;
    if (isNew) {
      this.#history = [];
      [this.rows, this.skipped, this.isFollowing] = [[], 0, true];
    }
    this.run = news.run;
    if (!news.run) return;
    this.skipped += isNew ? 0 : news.skipped;
    if (this.isFollowing && news.messages.length) this.rows = [...this.rows, ...news.messages].slice(-MOST_ROWS);
    const first = this.#history.findIndex((item) => item.seconds >= news.seconds - WINDOW);
    this.#history = [...this.#history.slice(Math.max(0, first - 1)), { seconds: news.seconds, counts: news.counts }];
    this.words = this.#wordsOf(news, news.run);
    const timed = Object.entries(news.counts).filter(([, count]) => count.cycles);
    this.longest = Object.fromEntries(timed.map(([name, count]) => [name, count.cycles!.maximum]));
    this.crowded = new Set(Object.keys(news.loads).filter((name) => news.loads[name].waiting >= news.loads[name].capacity));
  }

  #wordsOf(news: News, run: Run): Record<string, string> {
    const oldest = this.#history[0];
    const seconds = news.seconds - oldest.seconds;
    const found: Record<string, string> = {};
    for (const [name, count] of Object.entries(news.counts)) {
      const rate = seconds > 0 ? (count.messages - (oldest.counts[name]?.messages ?? 0)) / seconds : 0;
      const words = [run.state === "running" && !run.isPaused ? `${quantity(rate)}/s` : `${count.messages} messages`];
      const load = news.loads[name];
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
    return found;
  }
}

export const live = new Live();
