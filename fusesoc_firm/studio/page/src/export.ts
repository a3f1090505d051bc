// The picture as a file: SVG, drawn from the blocks and wires themselves, or PNG.

import { getBezierPath, Position, type Edge } from "@xyflow/svelte";
import type { BlockNode } from "./graph";

const MARGIN = 20;
const LINE = 17;
// Pixels of PNG for each unit of the picture.
const SCALE = 2;

const escaped = (text: string) =>
  text.replace(/[<>&"']/g, (found) => `&#${found.charCodeAt(0)};`).replace(/[^\t\n\r\u0020-\ud7ff\ue000-\ufffd]/g, "\ufffd");

/** The colours of the style in the present scheme. */
function colours(): (name: string) => string {
  const probe = document.body.appendChild(document.createElement("i"));
  const found = new Map<string, string>();
  for (const name of ["ink", "faint", "paper", "converter", "accelerator", "software", "service", "manager", "bad"]) {
    probe.style.color = `var(--${name})`;
    found.set(name, getComputedStyle(probe).color);
  }
  probe.remove();
  return (name) => found.get(name)!;
}

/** Return the picture in SVG. */
export function svgOf(nodes: BlockNode[], edges: Edge[]): string {
  const colour = colours();
  const right = Math.max(...nodes.map((node) => node.position.x + node.width!));
  const bottom = Math.max(...nodes.map((node) => node.position.y + node.height!));
  const left = Math.min(...nodes.map((node) => node.position.x));
  const top = Math.min(...nodes.map((node) => node.position.y));
  const box = [left - MARGIN, top - MARGIN, right - left + 2 * MARGIN, bottom - top + 2 * MARGIN];
  const places = new Map(nodes.map((node) => [node.id, node]));
  const wires = edges.flatMap((edge) => {
    const [source, target] = [places.get(edge.source), places.get(edge.target)];
    return source && target ? [wire(edge, source, target, colour)] : [];
  });
  const blocks = nodes.map((node) => block(node, colour));
  const size = `width="${box[2]}" height="${box[3]}"`;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${box.join(" ")}" ${size} font-family="sans-serif" font-size="12">
<rect x="${box[0]}" y="${box[1]}" ${size} fill="${colour("paper")}"/>
${[...wires, ...blocks].join("\n")}
</svg>
`;
}

function wire(edge: Edge, source: BlockNode, target: BlockNode, colour: (name: string) => string): string {
  const [path, x, y] = getBezierPath({
    sourceX: source.position.x + source.width!,
    sourceY: source.position.y + source.height! / 2,
    sourcePosition: Position.Right,
    targetX: target.position.x,
    targetY: target.position.y + target.height! / 2,
    targetPosition: Position.Left,
  });
  const line = `<path d="${path}" fill="none" stroke="${colour("faint")}" stroke-width="${edge.class === "stream" ? 3 : 1}"/>`;
  return edge.label ? `${line}<text x="${x}" y="${y}" text-anchor="middle" fill="${colour("ink")}">${escaped(edge.label)}</text>` : line;
}

const fills: Record<string, string> = { subscriber: "converter", publisher: "converter" };

function block({ position: { x, y }, width, height, data }: BlockNode, colour: (name: string) => string): string {
  const rim = colour(data.errors ? "bad" : "faint");
  const round = ["accelerator", "software", "service"].includes(data.kind) ? 10 : 3;
  const lines = [data.name, ...data.lines].map(
    (line, index) => `<text x="${x + 10}" y="${y + 17 + LINE * index}"${index ? "" : ' font-weight="bold"'} fill="${colour("ink")}">${escaped(line)}</text>`,
  );
  return `<rect x="${x}" y="${y}" width="${width}" height="${height}" rx="${round}" fill="${colour(fills[data.kind] ?? data.kind)}" stroke="${rim}"/>${lines.join("")}`;
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
