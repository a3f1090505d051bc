// Requests to the server, whose address is that of the page.

import type { Row } from "./live.svelte";
import type { Waits } from "./waits";

export type Path = (string | number)[];

export interface Fault {
  severity: "error" | "warning";
  message: string;
  hint?: string;
  file?: string;
  line?: number;
  column?: number;
  path?: Path | null;
}

export type Section = Record<string, any>;

/** What the server says of a specification; see fusesoc_firm/studio/scene.py. */
export interface Scene {
  file: string;
  text: string;
  version: string;
  canUndo: boolean;
  canRedo: boolean;
  specification: Section | null;
  /** The first and the last line of each block. */
  lines: [number, number][];
  faults: Fault[];
  derived: Section | null;
}

/** A key of the grammar. */
export interface Key {
  name: string;
  meaning: string;
  default: string;
  form: "text" | "integer" | "texts" | "section" | "sections";
  choices: (string | number)[];
  isRequired: boolean;
  onlyOf: string;
  section: string | null;
}

export type Grammar = Record<string, Key[]>;

async function answer<T>(response: Response): Promise<T> {
  if (response.ok) return response.json();
  const isJson = response.headers.get("Content-Type")?.startsWith("application/json");
  throw new Error(isJson ? (await response.json()).reason : await response.text());
}

export async function get<T>(name: string, query: Record<string, string> = {}): Promise<T> {
  return answer(await fetch(`api/${name}?${new URLSearchParams(query)}`));
}

/** The address of a connection that stays open. */
export function address(name: string, query: Record<string, string> = {}): URL {
  return new URL(`api/${name}?${new URLSearchParams(query)}`, location.href.replace(/^http/, "ws"));
}

async function post<T>(name: string, body: object): Promise<T> {
  const headers = { "Content-Type": "application/json" };
  return answer(await fetch(`api/${name}`, { method: "POST", headers, body: JSON.stringify(body) }));
}

export const files = () => get<{ files: string[] }>("files");
export const grammar = () => get<Grammar>("grammar");
/** The first specification as written, which the browser requests with the page; null without one. */
export const outline = async () => answer<Scene | null>(await fetch("api/outline"));
export const scene = (file: string) => get<Scene>("scene", { file });
export const sources = (file: string) => get<{ faults: Fault[] }>("sources", { file });
export const messages = (file: string, query: string) =>
  get<{ messages: string[]; count: number }>("messages", { file, query });
export const edit = (file: string, version: string, change: object) =>
  post<Scene>("edit", { file, version, change });
export const write = (file: string, version: string, text: string) => post<Scene>("write", { file, version, text });
export const step = (what: "undo" | "redo", file: string, version: string) => post<Scene>(what, { file, version });
export const check = (file: string, text: string) => post<Scene>("check", { file, text });

/** The dotted name of a field, its text and its unit. */
export type FieldText = [string, string, string];

/** A message with its fields as texts. */
export interface Message {
  row: Row;
  type: string;
  hasPicture: boolean;
  hasPose: boolean;
  fields: FieldText[];
  isShortened: boolean;
  fault: string;
  waits: Waits | null;
}

export interface Wishes {
  tool: string;
  rate: number;
  isEndless: boolean;
  isPaused: boolean;
  stallPercent: number;
}

export const run = (file: string, wishes: Wishes) => post<object>("run", { file, ...wishes });
export const control = (what: "pause" | "resume" | "step" | "stop") => post<object>("control", { do: what });
export const message = (number: number) => get<Message>("message", { number: String(number) });
export const record = (before: number) => get<{ messages: Row[] }>("record", { before: String(before) });

export interface Choices {
  languages: string[];
  widths: number[];
  ros: number[];
}

export const choices = () => get<Choices>("choices");
export const types = (ros: number, query: string) => get<{ messages: string[] }>("types", { ros: String(ros), query });
/** Write a new project. */
export const init = (project: object) => post<{ file: string }>("init", project);

/** A board that the system fits; see fusesoc_firm/studio/boards.py. */
export interface Offer {
  name: string;
  description: string;
  /** Whether the tools of the board's maker build for it: `command` sets up their project. */
  isProject: boolean;
  command: string;
  folder: string;
  /** How to install missing programs. */
  missing: string;
  loader: boolean;
}

/** A build for a board, or its loading: the last step, then the result; paths are relative to the folder. */
export interface Job {
  file: string;
  version: string;
  board: string;
  folder: string;
  state: "running" | "done" | "failed" | "cancelled";
  /** In seconds since 1970. */
  start: number;
  step?: string;
  number?: number;
  count?: number;
  line?: string;
  bitstream?: string;
  log?: string;
  next?: string;
  /** In MHz. */
  clocks?: { name: string; reached: number; needed: number }[];
  area?: { name: string; used: number; available: number }[];
  faults?: Fault[];
  output?: string[];
}

export type Jobs = Partial<Record<"bitstream" | "load", Job>>;

export const boards = (file: string) => get<{ boards: Offer[] }>("boards", { file });
export const bitstream = (file: string, board: string) => post<object>("bitstream", { file, board });
export const load = (file: string, board: string, flash: boolean) => post<object>("load", { file, board, flash });
export const cancel = () => post<object>("cancel", {});

/** Call a function whenever another program has changed a file; reconnects if the server was restarted. */
export function follow(changed: (file: string) => void): () => void {
  let socket: WebSocket | undefined;
  let isOver = false;
  const open = () => {
    socket = new WebSocket(address("changes"));
    socket.onmessage = (event) => changed(JSON.parse(event.data).changed);
    socket.onclose = () => isOver || setTimeout(open, 2000);
  };
  open();
  return () => {
    isOver = true;
    socket?.close();
  };
}
