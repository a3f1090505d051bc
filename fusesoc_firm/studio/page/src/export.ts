// The picture as a file: SVG, drawn from the blocks and wires themselves, or PNG.

import type { Edge } from "@xyflow/svelte";
import { wayOf, type BlockNode, type WireData } from "./graph";
import type { Live } from "./live.svelte";

// With room for a wire below the lowest block.
const MARGIN = 40;
const LINE = 17;
const SMALL_LINE = 14;
// Pixels of PNG for each unit of the picture.
const SCALE = 2;

const escaped = (text: string) =>
  text.replace(/[<>&"']/g, (found) => `&#${found.charCodeAt(0)};`).replace(/[^\t\n\r\u0020-\ud7ff\ue000-\ufffd]/g, "\ufffd");

type Colour = (name: string) => string;

/** The colours of the style in the present scheme. */
function colours(): Colour {
  const probe = document.body.appendChild(document.createElement("i"));
  const found = new Map<string, string>();
  for (const name of ["ink", "faint", "paper", "converter", "accelerator", "software", "service", "manager", "warn", "bad"]) {
    probe.style.color = `var(--${name})`;
    found.set(name, getComputedStyle(probe).color);
  }
  probe.remove();
  return (name) => found.get(name)!;
}

/** Return the picture in SVG, with what is known of a run at the wires. */
export function svgOf(nodes: BlockNode[], edges: Edge[], live: Live): string {
  const colour = colours();
  const right = Math.max(...nodes.map((node) => node.position.x + node.width!));
  const bottom = Math.max(...nodes.map((node) => node.position.y + node.height!));
  const left = Math.min(...nodes.map((node) => node.position.x));
  const top = Math.min(...nodes.map((node) => node.position.y));
  const box = [left - MARGIN, top - MARGIN, right - left + 2 * MARGIN, bottom - top + 2 * MARGIN];
  const places = new Map(nodes.map((node) => [node.id, node]));
  const wires = edges.flatMap((edge) => {
    const [source, target] = [places.get(edge.source), places.get(edge.target)];
    return source && target ? [wire(edge, source, target, colour, live)] : [];
  });
  const blocks = nodes.map((node) => block(node, colour, live));
  const size = `width="${box[2]}" height="${box[3]}"`;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${box.join(" ")}" ${size} font-family="sans-serif" font-size="12">
<rect x="${box[0]}" y="${box[1]}" ${size} fill="${colour("paper")}"/>
${[...wires, ...blocks].join("\n")}
</svg>
`;
}

function wire(edge: Edge, source: BlockNode, target: BlockNode, colour: Colour, live: Live): string {
  const from: [number, number] = [source.position.x + source.width!, source.position.y + source.height! / 2];
  const to: [number, number] = [target.position.x, target.position.y + target.height! / 2];
  const [path, x, y] = wayOf(edge.id, from, to);
  const { words, waiting } = live.shown(edge.data as WireData);
  const stroke = colour(waiting ? (waiting === "waits" ? "warn" : "bad") : "faint");
  const line = `<path d="${path}" fill="none" stroke="${stroke}" stroke-width="${edge.class === "stream" ? 3 : 1}"/>`;
  return line + linesAt([edge.label, words].filter(Boolean).join("\n"), x, y, colour);
}

/** Lines of text around a place. */
function linesAt(words: string, x: number, y: number, colour: Colour): string {
  const lines = words ? words.split("\n") : [];
  return lines
    .map((line, index) => `<text x="${x}" y="${y + SMALL_LINE * (index - (lines.length - 1) / 2) + 4}" text-anchor="middle" font-size="11" fill="${colour("ink")}">${escaped(line)}</text>`)
    .join("");
}

const fills: Record<string, string> = { subscriber: "converter", publisher: "converter" };

function block({ position: { x, y }, width, height, data }: BlockNode, colour: Colour, live: Live): string {
  const rim = colour(data.errors ? "bad" : "faint");
  const round = ["accelerator", "software", "service"].includes(data.kind) ? 10 : 3;
  const lines = [data.name, ...data.lines].map(
    (line, index) => `<text x="${x + 10}" y="${y + 17 + LINE * index}"${index ? "" : ' font-weight="bold"'} fill="${colour("ink")}">${escaped(line)}</text>`,
  );
  const waits = data.wire ? live.shown(data.wire).words : "";
  const below = linesAt(waits.replace("\n", ", "), x + width! / 2, y + height! + SMALL_LINE / 2, colour);
  return `<rect x="${x}" y="${y}" width="${width}" height="${height}" rx="${round}" fill="${colour(fills[data.kind] ?? data.kind)}" stroke="${rim}"/>${lines.join("")}${below}`;
}

/** Return an SVG as PNG. */
export async function pngOf(svg: string): Promise<Blob> {
  const image = new Image();
  image.src = `data:image/svg+xml,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width * SCALE, image.height * SCALE];
  canvas.getContext("2d")!.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((done, failed) =>
    canvas.toBlob((blob) => (blob ? done(blob) : failed(new Error("the picture is too large for PNG; export SVG"))), "image/png"),
  );
}

/** Let the browser save a file. */
export function save(name: string, content: Blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
