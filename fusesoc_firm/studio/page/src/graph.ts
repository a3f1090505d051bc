// From a specification to nodes and edges in their places.

import { getBezierPath, getSmoothStepPath, Position, type Edge, type Node } from "@xyflow/svelte";
import { layout } from "./engine";
import type { Fault, Path, Scene, Section } from "./api";
import { FROM_HOST, HOST, TO_HOST, wireKey } from "./waits";

export type Kind = "subscriber" | "publisher" | "service" | "accelerator" | "software" | "manager";

/** What a block shows; the sides of the Manager also show the waits on their wire to the host. */
export type BlockWords = { kind: Kind; name: string; lines: string[]; path: Path; wire?: WireData };
export type BlockData = BlockWords & { errors: number; warnings: number };

/** A stream or a connection of hardware: its wire, and on a stream the converter, with the name of its end if it has one. */
export type End = { wire: string; block?: string; title?: string };

/** What is drawn as one wire, which shows those of a `file`'s run. */
export type WireData = { file: string; ends: End[] };

export type BlockNode = Node<BlockData, "block">;

const LINE = 17;
// The space between the Manager and the blocks beside it.
const GAP = 140;
// From the middle of the block at which a wire that leads back ends to the wire below it.
const BELOW = 52;
// The width that the derived facts of a converter need, so that the picture stays when they arrive.
const FACTS_WIDTH = 260;
const FACTS = "...";
// The converters of a service and of an action by their ends: what a server takes from the Manager, and what it gives.
const ENDS = { service: [["request"], ["response"]], action: [["goal", "cancel"], ["feedback", "result"]] } as const;

const list = (value: unknown): any[] => (Array.isArray(value) ? value : []);
const isAt = (path: Path | null | undefined, place: Path) =>
  !!path && place.every((part, index) => path[index] === part);

export const faultsAt = (faults: Fault[], place: Path) => faults.filter((fault) => isAt(fault.path, place));

/** The accelerator of a block, and its index among the accelerators. */
export function typeOf(specification: Section, block: Section): [Section, number] | null {
  const index = list(specification.accelerators).findIndex((item) => item?.name === block.type);
  return index < 0 ? null : [specification.accelerators[index], index];
}

export function kindOf(specification: Section, block: Section): Kind {
  if (block.mode === "subscriber" || block.mode === "publisher") return block.mode;
  if (block.mode === "server" || block.mode === "client") return "service";
  return typeOf(specification, block)?.[0].type === "ROS-SW" ? "software" : "accelerator";
}

/** The facts of a block's converters: one, or those of all ends of a service or an action. */
function factsOf(block: Section, derived: Section | null): string {
  const converters = Object.values(derived?.Converters ?? {}).flat() as Section[];
  const { taken, given } = convertersOf(block);
  const own = [...taken, ...given].flatMap(({ name }) => converters.filter((item) => item.block === name));
  if (!own.length) return FACTS;
  return isCalled(block) ? `ids ${own.map((item) => item.id).join(", ")}` : `id ${own[0].id}, payload ${own[0].payloadBytes} bytes`;
}

/** Whether a block is the server or the client of a service or an action. */
const isCalled = (block: Section) => block.mode === "server" || block.mode === "client";
const interfaceOf = (block: Section) => (block.action ? "action" : "service");

function linesOf(block: Section, specification: Section, derived: Section | null): string[] {
  const found: string[] = [];
  if (isCalled(block)) {
    const called = interfaceOf(block);
    found.push(`${block.mode} of ${block[called] ?? ""}`, `${called} ${block.topic ?? block.name}`, factsOf(block, derived));
  } else if (block.mode) {
    found.push(String(block.message ?? ""), `topic ${block.topic ?? block.name}`);
    if (block.period) found.push(`period ${block.period}`);
    if (block.queue) found.push(`queue of ${block.queue}`);
    found.push(factsOf(block, derived));
  } else {
    const type = typeOf(specification, block)?.[0];
    found.push(type ? `${block.type} (${type.type})` : String(block.type ?? "no type"));
    if (block.clock) found.push(`clock ${block.clock}`);
    const pins = list(type?.pins).map((pin) => pin?.name);
    if (pins.length) found.push(`pins ${pins.join(", ")}`);
  }
  return found;
}

function nodeOf(id: string, data: BlockWords, faults: Fault[]): BlockNode {
  const errors = faults.filter((fault) => fault.severity === "error").length;
  const words = [data.name, ...data.lines];
  const least = ["subscriber", "publisher", "service"].includes(data.kind) ? FACTS_WIDTH : 120;
  const width = Math.min(320, Math.max(least, ...words.map((line) => 7.2 * line.length + 28)));
  const height = 30 + LINE * data.lines.length;
  const label = `${data.kind} ${data.name}${faults.length ? `, ${faults.length} faults` : ""}`;
  return {
    id,
    type: "block",
    position: { x: 0, y: 0 },
    width,
    height,
    ariaLabel: label,
    deletable: data.kind !== "manager",
    data: { ...data, errors, warnings: faults.length - errors },
  };
}

/**
 * The blocks and the two sides of the Manager as nodes, and the connections as edges.
 *
 * `derived` are the facts of the last text without faults, so that a fault does not rearrange the picture.
 */
export function graphOf(scene: Scene, derived: Section | null): { nodes: BlockNode[]; edges: Edge[] } {
  const specification = scene.specification ?? {};
  const project = specification.project ?? {};
  const blocks = list(specification.blocks);
  const nodes = blocks.map((block, index) => {
    const path = ["blocks", index];
    const data = { kind: kindOf(specification, block ?? {}), name: String(block?.name ?? `block ${index + 1}`) };
    return nodeOf(`block:${index}`, { ...data, lines: linesOf(block ?? {}, specification, derived), path }, faultsAt(scene.faults, path));
  });
  const manager = (id: string, name: string, wire: string, lines: string[], faults: Fault[]) =>
    nodeOf(id, { kind: "manager", name, lines, path: ["project"], wire: { file: scene.file, ends: [{ wire }] } }, faults);
  const faults = faultsAt(scene.faults, ["project"]);
  const link = `${project.interconnect ?? "axi_stream"}, ${project.width ?? 8} bits`;
  nodes.unshift(manager("manager:in", FROM_HOST, wireKey(HOST, FROM_HOST), [link], []));
  nodes.push(manager("manager:out", TO_HOST, wireKey(TO_HOST, HOST), [`scheduler ${project.scheduler ?? "fixed_priority"}`], faults));
  const edges: Edge[] = [];
  blocks.forEach((block, index) => {
    const { taken, given } = convertersOf(block ?? {});
    const streams = (converters: Converter[], wire: (name: string) => string) => {
      const titled = converters.length > 1;
      const ends = converters.map(({ name, end }) => ({ wire: wire(name), block: name, title: titled ? end : undefined }));
      return { file: scene.file, ends };
    };
    if (taken.length) edges.push(fixed(`in:${index}`, "manager:in", `block:${index}`, streams(taken, (name) => wireKey(FROM_HOST, name))));
    if (given.length) edges.push(fixed(`out:${index}`, `block:${index}`, "manager:out", streams(given, (name) => wireKey(name, TO_HOST))));
    list(block?.outgoing).forEach((way, number) => {
      const sink = blocks.findIndex((other) => other?.name === way?.name);
      if (sink < 0) return;
      const fields = [...list(way.include), ...list(way.exclude).map((field) => `without ${field}`)];
      const sinks = endsOr(convertersOf(blocks[sink]).given, way.name);
      edges.push({
        type: "wire",
        id: `way:${index}:${number}`,
        source: `block:${index}`,
        target: `block:${sink}`,
        label: fields.join(", "),
        ariaLabel: `connection from ${block.name} to ${way.name}`,
        data: {
          path: ["blocks", index, "outgoing", number],
          file: scene.file,
          ends: endsOr(taken, block.name).flatMap((source) => sinks.map((name) => ({ wire: wireKey(source, name) }))),
        },
      });
    });
  });
  return { nodes, edges };
}

/** A converter; of a service or an action, with the word for its end. */
type Converter = { name: string; end?: string };

/** The converters of a block that take from the Manager, and those that give to it. */
function convertersOf(block: Section): { taken: Converter[]; given: Converter[] } {
  if (!isCalled(block)) {
    const own = (mode: string) => (block.mode === mode ? [{ name: block.name }] : []);
    return { taken: own("subscriber"), given: own("publisher") };
  }
  const [taken, given] = ENDS[interfaceOf(block)].map((ends) => ends.map((end) => ({ name: `${block.name}_${end}`, end })));
  return block.mode === "server" ? { taken, given } : { taken: given, given: taken };
}

/** A block's converters on one side, or the block itself if it has none there. */
const endsOr = (converters: Converter[], name: string) => (converters.length ? converters.map((item) => item.name) : [name]);

/** The streams between the Manager and a block's converters, whose wire shows their live words. */
function fixed(id: string, source: string, target: string, data: WireData): Edge {
  const type = "wire";
  const still = { selectable: false, deletable: false, focusable: false };
  return { id, source, target, type, ...still, class: "stream", data };
}

type Place = [number, number];

/**
 * The path of a wire, and the place of its words: its middle, or beside its block, as all streams come together at the
 * Manager. A wire that leads back goes below the block at its end, so that both wires of a loop are seen.
 */
export function wayOf(id: string, source: Place, target: Place): [string, ...Place] {
  const [[sourceX, sourceY], [targetX, targetY]] = [source, target];
  const ends = { sourceX, sourceY, sourcePosition: Position.Right, targetX, targetY, targetPosition: Position.Left };
  const [path, ...middle] =
    sourceX <= targetX ? getBezierPath(ends) : getSmoothStepPath({ ...ends, centerY: targetY + BELOW, borderRadius: 12 });
  if (id.startsWith("in:")) return [path, targetX - GAP / 2, targetY];
  if (id.startsWith("out:")) return [path, sourceX + GAP / 2, sourceY];
  return [path, middle[0], middle[1]];
}

/**
 * Place the nodes, from left to right along the data.
 *
 * The Manager's two sides stand beside all other blocks. The engine does not see them: their many long wires would take
 * it most of its time.
 */
export async function placed(nodes: BlockNode[], edges: Edge[]): Promise<BlockNode[]> {
  const [first, inner, last] = [nodes[0], nodes.slice(1, -1), nodes.at(-1)!];
  const isInner = (id: string) => id !== first.id && id !== last.id;
  // In a column, the two blocks of a loop leave the way free for the wires to the Manager.
  const ways = new Set(edges.map(({ source, target }) => `${source} ${target}`));
  const graph = await layout({
    children: inner.map(({ id, width, height }) => ({ id, width, height })),
    edges: edges
      .filter(({ source, target }) => isInner(source) && isInner(target) && !ways.has(`${target} ${source}`))
      .map(({ id, source, target }) => ({ id, sources: [source], targets: [target] })),
  });
  const places = new Map(graph.children!.map((item) => [item.id, { x: item.x!, y: item.y! }]));
  const middle = (node: BlockNode) => (graph.height! - node.height!) / 2;
  places.set(first.id, { x: -GAP - first.width!, y: middle(first) });
  places.set(last.id, { x: graph.width! + GAP, y: middle(last) });
  return nodes.map((node) => ({ ...node, position: places.get(node.id)! }));
}
