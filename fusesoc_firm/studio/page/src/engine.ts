// The layout engine in its worker, which starts before the rest of the page has loaded.

import ELK, { type ElkNode } from "elkjs/lib/elk-api";
import worker from "elkjs/lib/elk-worker.min.js?url";

// Wires are drawn as curves, so the engine need not route them; more rounds for fewer crossings change little.
const OPTIONS = {
  "elk.algorithm": "layered",
  "elk.direction": "RIGHT",
  "elk.edgeRouting": "POLYLINE",
  "elk.separateConnectedComponents": "false",
  "elk.spacing.nodeNode": "40",
  "elk.layered.spacing.nodeNodeBetweenLayers": "100",
  "elk.layered.thoroughness": "1",
  "elk.layered.considerModelOrder.strategy": "NODES_AND_EDGES",
};
// A browser translates what has run several times to faster code.
const WARM_UPS = 5;
const engine = new ELK({ workerFactory: () => new Worker(worker), algorithms: ["layered"] });
let isAwaited = false;

/** Return a graph with the places of its children. */
export function layout(graph: Omit<ElkNode, "id">): Promise<ElkNode> {
  isAwaited = true;
  return arranged(graph);
}

const arranged = (graph: Omit<ElkNode, "id">) => engine.layout({ id: "root", layoutOptions: OPTIONS, ...graph });

async function warmUp() {
  const ids = ["a", "b", "c", "d", "e", "f"];
  const ways = ["ab", "ac", "bd", "cd", "de", "bf"];
  for (let turn = 0; turn < WARM_UPS && !isAwaited; turn++) {
    await arranged({
      children: ids.map((id) => ({ id, width: 100, height: 40 })),
      edges: ways.map((way) => ({ id: way, sources: [way[0]], targets: [way[1]] })),
    });
  }
}

warmUp();
