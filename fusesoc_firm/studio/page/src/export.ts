// The picture as a file: SVG, drawn from the blocks and wires themselves, or PNG.

import type { Edge } from "@xyflow/svelte";
import { HEAD, LINE, PAD, shortened, SIDES, TEXT, TITLE, wayOf, type BlockNode, type WireData } from "./graph";
import type { Live } from "./live.svelte";

const MARGIN = 40;
const SMALL_LINE = 16;
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
  // A PNG has whole pixels.
  const box = [left - MARGIN, top - MARGIN, Math.ceil(right - left) + 2 * MARGIN, Math.ceil(bottom - top) + 2 * MARGIN];
  const places = new Map(nodes.map((node) => [node.id, node]));
  const wires = edges.flatMap((edge) => {
    const [source, target] = [places.get(edge.source), places.get(edge.target)];
    return source && target ? [wire(edge, source, target, colour, live)] : [];
  });
  const blocks = nodes.map((node) => block(node, colour, live));
  const size = `width="${box[2]}" height="${box[3]}"`;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${box.join(" ")}" ${size} font-family="sans-serif" font-size="${TEXT}">
<rect x="${box[0]}" y="${box[1]}" ${size} fill="${colour("paper")}"/>
${[...wires, ...blocks].join("\n")}
</svg>
`;
}

function wire(edge: Edge, source: BlockNode, target: BlockNode, colour: Colour, live: Live): string {
  const from: [number, number] = [source.position.x + source.width!, source.position.y + source.height! / 2];
  const to: [number, number] = [target.position.x, target.position.y + target.height! / 2];
  const data = edge.data as WireData;
  const [path, x, y] = wayOf(edge.id, from, to, data.way!);
  const { words, waiting } = live.shown(data);
  const stroke = colour(data.isFaulty || waiting.startsWith("stuck") ? "bad" : waiting ? "warn" : "faint");
  const line = `<path d="${path}" fill="none" stroke="${stroke}" stroke-width="${edge.class === "stream" ? 3 : 1}"/>`;
  return line + linesAt([edge.label, words].filter(Boolean).join("\n"), x, y, colour);
}

/** Lines of text around a place. */
function linesAt(words: string, x: number, y: number, colour: Colour): string {
  const lines = words ? words.split("\n") : [];
  return lines
    .map((line, index) => `<text x="${x}" y="${y + SMALL_LINE * (index - (lines.length - 1) / 2) + 4}" text-anchor="middle" fill="${colour("ink")}">${escaped(line)}</text>`)
    .join("");
}

const fills: Record<string, string> = { subscriber: "converter", publisher: "converter" };

function block(node: BlockNode, colour: Colour, live: Live): string {
  const { position, width, height, data } = node;
  const { x, y } = position;
  const rim = colour(data.errors ? "bad" : "faint");
  const box = `<rect x="${x}" y="${y}" width="${width}" height="${height}" rx="8" fill="${colour(fills[data.kind] ?? data.kind)}" stroke="${rim}"/>`;
  if (data.wire) return box + side(node, live.shown(data.wire).words, colour);
  const value = data.topics ? (live.latestOf(data.file, data.topics)?.[7] ?? []).join(" ") : "";
  const lines = [data.name, ...data.lines, ...(value ? [value] : [])].map((line, index) => {
    const place = `x="${x + PAD}" y="${y + (index ? HEAD + LINE * index - 4 : 22)}"`;
    return `<text ${place}${index ? "" : ` font-size="${TITLE}" font-weight="bold"`} fill="${colour("ink")}">${escaped(shortened(line, width! - SIDES))}</text>`;
  });
  return box + lines.join("");
}

/** The words of a side of the Manager, from above to below. */
function side({ position: { x, y }, width, height, data }: BlockNode, waits: string, colour: Colour): string {
  const lines = [data.name, ...data.lines, ...(waits ? [waits.replace("\n", ", ")] : [])];
  const middle = y + height! / 2;
  return lines
    .map((line, index) => {
      const place = x + width! / 2 + LINE * ((lines.length - 1) / 2 - index) - 4;
      return `<text transform="translate(${place} ${middle}) rotate(90)" text-anchor="middle"${index ? "" : ' font-weight="bold"'} fill="${colour("ink")}">${escaped(line)}</text>`;
    })
    .join("");
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
