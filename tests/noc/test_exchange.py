"""Exchanges in simulation: each frame arrives once, whole, and in the order of its flow."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.noc.network import Flow, Network, Topology, chain, crossbar, mesh, ring, torus, tree
from tests.hdl.ghdl import Generic, Library
from tests.noc.exchanges import BENCH, all_to_all, analysed, network
from tests.recall import RunResult
from tests.seeds import seeded

SEED = seeded(20261130)
# Rings and tori deadlock if flows use all links of a circle one after the other.
_ONE_WAY = tuple(Flow(source, (sink,)) for source in range(5) for sink in range(source + 1, 6))
_UP = tuple(
    Flow(source, (sink,))
    for source in range(9)
    for sink in range(9)
    if source != sink and sink % 3 >= source % 3 and sink // 3 >= source // 3
)
_COPIES = (
    Flow(0, (1, 2, 3)),
    Flow(1, (0, 2)),
    Flow(2, (0, 1, 3)),
    Flow(3, (2, 0)),
    Flow(0, (1,)),
    Flow(1, (3,)),
    Flow(4, (0, 3)),
)
NETWORKS = {
    "crossbar": network(crossbar(4), all_to_all(4)),
    "copies": network(crossbar(5), _COPIES),
    "mesh": network(mesh(3, 3), all_to_all(9)),
    "concentrated mesh": network(mesh(2, 2, each=3), all_to_all(11), 11),
    "chain": network(chain(5), all_to_all(5)),
    "tree": network(tree(18), all_to_all(18)),
    "ring": network(ring(6), _ONE_WAY),
    "torus": network(torus(3, 3), _UP),
    "one flow": network(chain(2), (Flow(1, (0,)),)),
}


def simulated(library: Library, **generics: Generic) -> RunResult:
    result = library.run(BENCH, generics, options=["--ieee-asserts=disable-at-0"])
    assert result.exit_code == 0, result.output
    assert "PASS" in result.output
    return result


def counts(result: RunResult) -> list[int]:
    """The frames, beats and cycles of a simulation, and the frames of each sink."""
    found = re.search(r"PASS (\d+) frames, (\d+) beats in (\d+) cycles, by sinks ([\d ]+)", result.output)
    assert found, result.output
    return [int(word) for word in (*found.groups()[:3], *found[4].split())]


@pytest.mark.one_in(6)
@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("width", [8, 64, 256])
@pytest.mark.parametrize("buffers", [2, 8])
def test_random_frames(name: str, width: int, buffers: int, tmp_path: Path) -> None:
    library = analysed(NETWORKS[name], width, tmp_path, buffers=buffers)
    for seed, source_stall, sink_stall in (SEED, 0, 0), (SEED + 1, 30, 10), (SEED + 2, 10, 60):
        print(f"seed {seed}")
        stalls = {"SOURCE_STALL": source_stall, "SINK_STALL": sink_stall}
        simulated(library, SEED=seed, FRAMES=300, SHORTEST=1 if width > 8 else 2, **stalls)


@pytest.mark.parametrize(
    ("topology", "flow"), [(crossbar(4), Flow(1, (3,))), (mesh(3, 3), Flow(0, (8,))), (crossbar(4), Flow(1, (0, 3)))]
)
def test_a_lone_stream_loses_no_cycle(topology: Topology, flow: Flow, tmp_path: Path) -> None:
    """Other flows share its channels, but send nothing."""
    others = all_to_all(len(topology.slots))
    flows = (flow, *(item for item in others if item.sinks != flow.sinks or item.source != flow.source))
    made = Network(topology, topology.slots, flows)
    library = analysed(made, 8, tmp_path)
    first = made.flows_of(flow.source).index(flow) + sum(len(made.flows_of(source)) for source in range(flow.source))
    frames, beats, cycles, *_ = counts(simulated(library, SEED=SEED, FRAMES=60, ONLY=first))
    # A cycle for each router, one for each of them that changes the source at first, and three of the bench.
    routers = len(made.ways[flow.source, flow.sinks[0]])
    copied = len(flow.sinks) - 1
    assert beats / len(flow.sinks) <= cycles <= beats / len(flow.sinks) + 2 * routers + 3 + copied * frames
