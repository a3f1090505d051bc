// From a specification to nodes and edges in their places.

import { getBezierPath, getSmoothStepPath, Position, type Edge, type Node } from "@xyflow/svelte";
import { layout } from "./engine";
import type { Fault, Path, Scene, Section } from "./api";
import { FROM_HOST, HOST, TO_HOST, wireKey } from "./waits";

export type Kind = "subscriber" | "publisher" | "service" | "accelerator" | "software" | "manager";

/**
 * What a block shows: a converter the values of its `topics`, a side of the Manager the waits on its wire to the host.
 * Messages of a converter that is `isWithin` stay within the FPGA.
 */
export type BlockWords = { kind: Kind; name: string; lines: string[]; path: Path; file: string; topics?: string[]; wire?: WireData; isWithin?: boolean };
export type BlockData = BlockWords & { errors: number; warnings: number };

/** A stream or a connection of hardware: its wire, and on a stream the converter, with the name of its end if it has one. */
export type End = { wire: string; block?: string; title?: string };

/** What is drawn as one wire, which shows those of a `file`'s run, and whether a fault is at the connection. */
export type WireData = { file: string; ends: End[]; isFaulty?: boolean; way?: Way };

/**
 * What the way of a wire depends on beside its ends: the height at which it passes the blocks that are before it, if there
 * are any, and the distance of a stream's words from its block.
 */
export type Way = { around?: number; beside: number };

export type BlockNode = Node<BlockData, "block">;

// The least size of a text on the screen, and the zoom of the first view at which the smallest text has it, in pixels.
const SMALLEST = 12;
export const [TITLE, TEXT] = [14, 13];
export const FLOOR = SMALLEST / TEXT;
// The zoom above which a small system only looks coarse.
const MOST_ZOOM = 1.15;
// The heights of a block's name and of each further line, and its borders.
export const [HEAD, LINE, PAD] = [34, 19, 12];
// The width of the Manager's sides, the space for the words beside them, and less of it in a narrow picture.
const [RAIL, GAP, NARROW_GAP] = [48, 98, 42];
// The width of a picture below which the words beside the Manager are left out.
const NARROW = 640;
// The spaces between columns, which leave room for words, and between rows, which leave room for wires that lead back.
const [COLUMNS, ROWS] = [100, 40];
const MARGIN = 16;
// The width that the derived facts and values of a converter need, so that the picture stays when they arrive.
const [FACTS_WIDTH, LEAST_WIDTH, MOST_WIDTH] = [176, 150, 360];
// The characters of an accelerator's ports that are in one line.
const LONGEST_PORTS = 28;
const FACTS = "...";
const WITHIN = "within the FPGA";
// The border and the space beside the texts of a block.
export const SIDES = 34;
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
  if (!own.length) return withinOf(derived).has(block.name) ? WITHIN : FACTS;
  return isCalled(block) ? `ids ${own.map((item) => item.id).join(", ")}` : `id ${own[0].id}, ${own[0].payloadBytes} bytes`;
}

/** The topics between blocks of the system. */
const innerOf = (derived: Section | null): Section[] => list(derived?.Topics).filter((topic) => topic.readers);

/** The converters whose messages all stay within the FPGA. */
const withinOf = (derived: Section | null) =>
  new Set<string>(
    innerOf(derived).flatMap(({ publishers, readers, toHost, fromHost }) => [
      ...list(publishers).filter((name) => !list(toHost).includes(name)),
      ...list(readers).filter((name) => !list(fromHost).includes(name)),
    ]),
  );

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
    const times = [block.period && `period ${block.period}`, block.queue && `queue of ${block.queue}`].filter(Boolean);
    if (times.length) found.push(times.join(", "));
    found.push(factsOf(block, derived));
  } else {
    const type = typeOf(specification, block)?.[0];
    found.push(type ? `${block.type} (${type.type})` : String(block.type ?? "no type"));
    const ports = (side: string) => list(type?.interface?.[side]).map((port) => String(port?.message ?? "").split("/").at(-1));
    const [taken, given] = [ports("input"), ports("output")];
    const [inputs, outputs] = [taken.join(", "), given.join(", ")];
    if (inputs.length + outputs.length > LONGEST_PORTS) found.push(`in: ${inputs}`, `out: ${outputs}`);
    else if (inputs || outputs) found.push(`${inputs} → ${outputs}`);
    if (block.clock) found.push(`clock ${block.clock}`);
    const pins = list(type?.pins).map((pin) => pin?.name);
    if (pins.length) found.push(`pins ${pins.join(", ")}`);
  }
  return found;
}

const canvas = document.createElement("canvas").getContext("2d")!;

/** The width of a text in the picture, in pixels. */
export function widthOf(text: string, isTitle = false): number {
  canvas.font = isTitle ? `600 ${TITLE}px system-ui, sans-serif` : `${TEXT}px system-ui, sans-serif`;
  return canvas.measureText(text).width;
}

/** The beginning of a text that a width in the picture has room for. */
export function shortened(text: string, room: number): string {
  let [found, count] = [text, text.length];
  while (count > 1 && widthOf(found) > room) found = `${text.slice(0, --count)}…`;
  return found;
}

function nodeOf(id: string, data: BlockWords, faults: Fault[]): BlockNode {
  const errors = faults.filter((fault) => fault.severity === "error").length;
  const isRail = data.kind === "manager";
  // Beside the name are an icon and the word for the kind, or in its place the numbers of faults: these move no block.
  const head = widthOf(data.name, true) + widthOf(data.kind) + 48;
  const least = data.topics ? FACTS_WIDTH : LEAST_WIDTH;
  const width = Math.ceil(Math.min(MOST_WIDTH, Math.max(least, head, ...data.lines.map((line) => widthOf(line) + 1)) + SIDES));
  const label = `${data.kind} ${data.name}${faults.length ? `, ${faults.length} faults` : ""}`;
  return {
    id,
    type: "block",
    position: { x: 0, y: 0 },
    width: isRail ? RAIL : width,
    height: isRail ? Math.ceil(Math.max(widthOf(data.name, true), ...data.lines.map((line) => widthOf(line)))) + 3 * PAD : HEAD + PAD + LINE * (data.lines.length + (data.topics ? 1 : 0)),
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
  const within = withinOf(derived);
  const nodes = blocks.map((block, index) => {
    const path = ["blocks", index];
    const data = { kind: kindOf(specification, block ?? {}), name: String(block?.name ?? `block ${index + 1}`), isWithin: within.has(block?.name) };
    const { taken, given } = convertersOf(block ?? {});
    const topics = block?.mode && !data.isWithin ? [...taken, ...given].map((item) => item.name) : undefined;
    return nodeOf(`block:${index}`, { ...data, lines: linesOf(block ?? {}, specification, derived), path, file: scene.file, topics }, faultsAt(scene.faults, path));
  });
  const manager = (id: string, name: string, wire: string, lines: string[], faults: Fault[]) =>
    nodeOf(id, { kind: "manager", name, lines, path: ["project"], file: scene.file, wire: { file: scene.file, ends: [{ wire }] } }, faults);
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
    const passesHost = !within.has(block?.name);
    if (taken.length && passesHost) edges.push(fixed(`in:${index}`, "manager:in", `block:${index}`, streams(taken, (name) => wireKey(FROM_HOST, name))));
    if (given.length && passesHost) edges.push(fixed(`out:${index}`, `block:${index}`, "manager:out", streams(given, (name) => wireKey(name, TO_HOST))));
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
          isFaulty: faultsAt(scene.faults, ["blocks", index, "outgoing", number]).some((fault) => fault.severity === "error"),
          file: scene.file,
          ends: endsOr(taken, block.name).flatMap((source) => sinks.map((name) => ({ wire: wireKey(source, name) }))),
        },
      });
    });
  });
  return { nodes, edges: [...edges, ...topicsOf(scene.file, blocks, derived)] };
}

/** The topics within the FPGA as wires from each publisher to each reader, which show what the blocks beside them say. */
function topicsOf(file: string, blocks: any[], derived: Section | null): Edge[] {
  const feeding = (name: string) => blocks.filter((block) => list(block?.outgoing).some((way) => way?.name === name));
  const indexOf = (name: string) => blocks.findIndex((block) => block?.name === name);
  return innerOf(derived).flatMap(({ topic, publishers, readers }) =>
    list(publishers).flatMap((publisher) =>
      list(readers).flatMap((reader): Edge[] => {
        const [source, target] = [indexOf(publisher), indexOf(reader)];
        if (source < 0 || target < 0) return [];
        const ends = feeding(publisher).flatMap((block) => list(blocks[target]?.outgoing).map((way) => ({ wire: wireKey(block.name, way?.name) })));
        const wire = fixed(`topic:${source}:${target}`, `block:${source}`, `block:${target}`, { file, ends });
        return [{ ...wire, class: "topic", label: topic, ariaLabel: `topic ${topic} from ${publisher} to ${reader}` }];
      }),
    ),
  );
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
 * The path of a wire, and the place of its words: its middle, or beside its block for a stream. A stream leaves the
 * Manager's side at the height of its block.
 */
export function wayOf(id: string, source: Place, target: Place, { around, beside }: Way): [string, ...Place] {
  const [[sourceX, sourceY], [targetX, targetY]] = [source, target];
  if (id.startsWith("in:")) {
    const start = around === undefined ? `M${sourceX} ${targetY}` : `M${sourceX} ${around}H${targetX - PAD}V${targetY}`;
    return [`${start}H${targetX}`, targetX - beside, targetY];
  }
  if (id.startsWith("out:")) {
    const end = around === undefined ? "" : `H${sourceX + PAD}V${around}`;
    return [`M${sourceX} ${sourceY}${end}H${targetX}`, sourceX + beside, sourceY];
  }
  const ends = { sourceX, sourceY, sourcePosition: Position.Right, targetX, targetY, targetPosition: Position.Left };
  const [path, ...middle] =
    sourceX <= targetX ? getBezierPath(ends) : getSmoothStepPath({ ...ends, centerY: around, borderRadius: 12, offset: 16 });
  return [path, middle[0], middle[1]];
}

const isInner = (node: BlockNode) => node.data.kind !== "manager";
const sizeOf = (nodes: BlockNode[]) => ({
  width: Math.max(0, ...nodes.map((node) => node.position.x + node.width!)),
  height: Math.max(0, ...nodes.map((node) => node.position.y + node.height!)),
});
const at = (node: BlockNode, x: number, y: number): BlockNode => ({ ...node, position: { x, y } });
/** The blocks that have a wire. */
const wired = (nodes: BlockNode[], edges: Edge[]) => {
  const ends = new Set(edges.flatMap(({ source, target }) => [source, target]));
  return nodes.filter((node) => isInner(node) && ends.has(node.id));
};

/**
 * Place the blocks that have wires, from left to right along the data.
 *
 * The engine does not see the Manager's two sides: their many long wires would take it most of its time.
 */
export async function laidOut(nodes: BlockNode[], edges: Edge[]): Promise<BlockNode[]> {
  const own = new Map(wired(nodes, edges).map((node) => [node.id, node]));
  // In a column, the two blocks of a loop leave the way free for the wires to the Manager.
  const ways = new Set(edges.map(({ source, target }) => `${source} ${target}`));
  const graph = await layout({
    children: [...own.values()].map(({ id, width, height, data }) => {
      const layer = data.isWithin ? "NONE" : ({ subscriber: "FIRST", publisher: "LAST" }[data.kind as string] ?? "NONE");
      return { id, width, height, layoutOptions: { "elk.layered.layering.layerConstraint": layer } };
    }),
    edges: edges
      .filter(({ source, target }) => own.has(source) && own.has(target) && !ways.has(`${target} ${source}`))
      .map(({ id, source, target }) => ({ id, sources: [source], targets: [target] })),
  });
  const places = new Map(graph.children!.map((item) => [item.id, { x: item.x!, y: item.y! }]));
  return nodes.map((node) => ({ ...node, position: places.get(node.id) ?? node.position }));
}

/**
 * The picture for a width in pixels at zoom 1: nodes that were laid out, and their edges with their ways.
 *
 * If the flow is too wide, its parts follow one another, in rows. Blocks without wires fill the rows below. The Manager's
 * two sides are as high as the picture.
 */
export function inRows(nodes: BlockNode[], edges: Edge[], width: number): { nodes: BlockNode[]; edges: Edge[] } {
  const gap = width < NARROW ? NARROW_GAP : GAP;
  const room = width - 2 * (RAIL + gap);
  const laid = columnsOf(wired(nodes, edges)).flatMap(even);
  const flow = sizeOf(laid).width <= room ? laid : stacked(partsOf(laid, edges).map((part) => wrapped(columnsOf(part), room)));
  const known = new Set(laid.map((node) => node.id));
  const alone = nodes.filter((node) => isInner(node) && !known.has(node.id));
  const inner = stacked([flow, wrapped(alone.map((node) => [node]), Math.max(room, sizeOf(flow).width))]);
  const size = sizeOf(inner);
  const [first, last] = [nodes[0], nodes.at(-1)!];
  const height = Math.max(size.height, first.height!, last.height!);
  const top = (size.height - height) / 2;
  const placed = new Map(inner.map((node) => [node.id, node]));
  placed.set(first.id, { ...at(first, -gap - RAIL, top), height });
  placed.set(last.id, { ...at(last, (inner.length ? size.width : room) + gap, top), height });
  const ways = edges.map((edge) => ({ ...edge, data: { ...edge.data, way: wayBetween(edge, placed, inner, gap) } }));
  return { nodes: nodes.map((node) => placed.get(node.id)!), edges: ways };
}

/** The blocks that wires connect, without the Manager, from above. */
function partsOf(nodes: BlockNode[], edges: Edge[]): BlockNode[][] {
  const parts = new Map(nodes.map((node) => [node.id, [node]]));
  for (const { source, target } of edges) {
    const [one, other] = [parts.get(source), parts.get(target)];
    if (!one || !other || one === other) continue;
    one.push(...other);
    for (const node of other) parts.set(node.id, one);
  }
  const top = (part: BlockNode[]) => Math.min(...part.map((node) => node.position.y));
  return [...new Set(parts.values())].sort((one, other) => top(one) - top(other));
}

/** The columns of blocks that were laid out, each from above. */
function columnsOf(nodes: BlockNode[]): BlockNode[][] {
  const found: BlockNode[][] = [];
  let end = -Infinity;
  for (const node of [...nodes].sort((one, other) => one.position.x - other.position.x)) {
    if (node.position.x >= end) found.push([]);
    found.at(-1)!.push(node);
    end = Math.max(end, node.position.x + node.width!);
  }
  return found.map((column) => column.sort((one, other) => one.position.y - other.position.y));
}

/** A column whose blocks have the same width, so that a wire beside one of them is not below another. */
function even(column: BlockNode[]): BlockNode[] {
  const left = Math.min(...column.map((node) => node.position.x));
  const width = Math.max(...column.map((node) => node.width!));
  return column.map((node) => ({ ...at(node, left, node.position.y), width }));
}

/** Columns in rows that are at most as wide as the room. */
function wrapped(columns: BlockNode[][], room: number): BlockNode[] {
  const rows: BlockNode[][] = [];
  let end = Infinity;
  for (const column of columns) {
    const own = Math.max(...column.map((node) => node.width!));
    if (end + own > room) [end] = [0, rows.push([])];
    let y = 0;
    for (const node of column) {
      rows.at(-1)!.push(at(node, end + (own - node.width!) / 2, y));
      y += node.height! + ROWS;
    }
    end += own + COLUMNS;
  }
  return stacked(rows.map(centred));
}

/** A row whose columns have the same middle. */
function centred(row: BlockNode[]): BlockNode[] {
  const { height } = sizeOf(row);
  return columnsOf(row).flatMap((column) => column.map((node) => at(node, node.position.x, node.position.y + (height - sizeOf(column).height) / 2)));
}

/** Groups of blocks below one another. */
function stacked(groups: BlockNode[][]): BlockNode[] {
  let y = 0;
  return groups.filter((group) => group.length).flatMap((group) => {
    const moved = group.map((node) => at(node, node.position.x, node.position.y + y));
    y = sizeOf(moved).height + ROWS;
    return moved;
  });
}

function wayBetween({ id, source, target }: Edge, nodes: Map<string, BlockNode>, inner: BlockNode[], gap: number): Way {
  const [from, to] = [nodes.get(source)!, nodes.get(target)!];
  const beside = gap / 2;
  const own = id.startsWith("in:") ? to : id.startsWith("out:") ? from : null;
  if (!own) return { beside, around: heightBack(from, to, inner) };
  const y = own.position.y + own.height! / 2;
  const isBefore = (node: BlockNode) => (own === to ? node.position.x < own.position.x : node.position.x > own.position.x);
  const before = inner.filter((node) => isBefore(node) && node.position.y <= y && y <= bottomOf(node));
  return before.length ? { beside, around: Math.min(...[own, ...before].map((node) => node.position.y)) - ROWS / 2 } : { beside };
}

const bottomOf = (node: BlockNode) => node.position.y + node.height!;

/**
 * The height at which a wire leads back: the first one that no block between its ends covers. Above its end, both wires of
 * a loop are seen.
 */
function heightBack(from: BlockNode, to: BlockNode, inner: BlockNode[]): number {
  const [left, right] = [to.position.x, from.position.x + from.width!];
  const between = inner.filter((node) => node.position.x <= right && node.position.x + node.width! >= left);
  const isFree = (y: number) => between.every((node) => y < node.position.y || y > bottomOf(node));
  const top = Math.min(...inner.map((node) => node.position.y)) - ROWS / 2;
  const heights = [to.position.y - ROWS / 2, from.position.y - ROWS / 2, bottomOf(from) + ROWS / 2];
  return heights.find(isFree) ?? top;
}

/** The view in which a picture begins: all of it, or its beginning if its texts would be too small. */
export function viewOf(nodes: BlockNode[], width: number, height: number): { x: number; y: number; zoom: number } {
  const left = Math.min(...nodes.map((node) => node.position.x));
  const top = Math.min(...nodes.map((node) => node.position.y));
  const size = sizeOf(nodes);
  const own = { width: size.width - left, height: size.height - top };
  const whole = Math.min((width - 2 * MARGIN) / own.width, (height - 2 * MARGIN) / own.height);
  const zoom = Math.min(MOST_ZOOM, Math.max(FLOOR, whole));
  const start = (room: number, length: number) => Math.max(MARGIN, (room - length * zoom) / 2);
  return { x: start(width, own.width) - left * zoom, y: start(height, own.height) - top * zoom, zoom };
}

/** The width at zoom 1 that a picture of a width on the screen may have. */
export const roomOf = (width: number) => (width - 2 * MARGIN) / FLOOR;
