"""Exchanges in simulation: each frame arrives once, whole, and in the order of its flow."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusesoc_firm.noc.hardware import exchange_configuration
from fusesoc_firm.noc.network import Flow, Network, Topology, chain, crossbar, mesh, ring, torus, tree
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.noc.exchanges import BENCH, ENTITY, all_to_all, analyse_bench, analysed, network, write_exchange
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
        simulated(library, SEED=seed, FRAMES=100 if width > 64 else 300, SHORTEST=1 if width > 8 else 2, **stalls)


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


@pytest.mark.parametrize("kind", ["crossbar", "mesh"])
def test_a_slow_reader_stalls_only_its_own_frames(kind: str, tmp_path: Path) -> None:
    """Endpoints 0 and 1 send to each other, and 2 to the slow endpoint 3, on ways without a common channel."""
    flows = (Flow(0, (1,)), Flow(1, (0,)), Flow(2, (3,)))
    library = analysed(network(crossbar(4) if kind == "crossbar" else mesh(2, 2), flows), 8, tmp_path)
    *_, cycles, first, second, third, slow = counts(
        simulated(library, SEED=SEED, FRAMES=100_000, CYCLES=4000, SLOW=3, TAKES=5)
    )
    mean = 9
    assert min(first, second) >= 0.99 * cycles / mean
    assert (third, slow > 0, slow <= 0.07 * cycles / mean) == (0, True, True)


def test_a_deaf_reader_stops_only_the_source_that_sends_to_it(tmp_path: Path) -> None:
    """In a crossbar, sources that do not send to it have frames as before."""
    flows = (Flow(0, (1,)), Flow(0, (3,)), Flow(1, (0, 2)), Flow(2, (0,)))
    library = analysed(network(crossbar(4), flows), 8, tmp_path)
    frames = counts(simulated(library, SEED=SEED, FRAMES=100_000, CYCLES=4000, SLOW=3, TAKES=0))[3:]
    # The outputs to endpoints 0 and 2 are shared by two sources, of which one sends a copy to both.
    assert frames[3] == 0
    assert frames[1] < 40
    assert frames[0] >= 0.9 * 4000 / 9
    assert frames[2] >= 0.4 * 4000 / 9


def test_each_reader_of_a_copy_takes_it_at_its_own_pace(tmp_path: Path) -> None:
    """A slow reader stalls the source, and the others receive all that it has sent."""
    library = analysed(network(crossbar(4), (Flow(0, (1, 2, 3)),)), 8, tmp_path)
    frames, *_, first, second, slow = counts(simulated(library, SEED=SEED, FRAMES=60, SLOW=3, TAKES=20))
    assert (frames, first, second, slow) == (180, 60, 60, 60)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("buffers", [2, 8])
@pytest.mark.parametrize("name", ["copies", "mesh", "tree"])
def test_the_netlist_does_the_same(name: str, buffers: int, tmp_path: Path) -> None:
    library = analysed(NETWORKS[name], 8, tmp_path, buffers=buffers)
    generics: dict[str, Generic] = {"SEED": SEED, "FRAMES": 200, "SOURCE_STALL": 10, "SINK_STALL": 20, "TRACE": "trace"}
    simulated(library, **generics)
    trace = (tmp_path / "trace").read_bytes()
    library.replace_by_netlist(ENTITY)
    analyse_bench(NETWORKS[name], 8, tmp_path)
    simulated(library, **generics)
    assert (tmp_path / "trace").read_bytes() == trace


@pytest.mark.one_in(3)
@pytest.mark.parametrize("buffers", [2, 8])
@pytest.mark.parametrize("name", NETWORKS)
def test_there_is_no_latch(name: str, buffers: int, tmp_path: Path) -> None:
    assert analysed(NETWORKS[name], 64, tmp_path, buffers=buffers).latches(ENTITY) == []


@pytest.mark.one_in(4)
@pytest.mark.parametrize("name", NETWORKS)
def test_there_is_no_loop(name: str, tmp_path: Path) -> None:
    files = [write_exchange(NETWORKS[name], 8, tmp_path)]
    assert loops(ENTITY, tmp_path, files, core_files("axis/package", "noc/noc")) == []


@pytest.mark.parametrize(
    ("width", "buffers", "flows", "words"),
    [
        (24, 2, all_to_all(4), "streams of 24 bits; legal: 8, 16, 32, 64, 128, 256, 512"),
        (8, 3, all_to_all(4), "buffers of 3 beats; legal: powers of two"),
        (8, 1, all_to_all(4), "buffers of 1 beats"),
        (8, 2, (), "an exchange without flows"),
    ],
)
def test_illegal_exchanges_are_refused(width: int, buffers: int, flows: tuple[Flow, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        exchange_configuration(ENTITY, network(mesh(2, 2), flows), width, buffers=buffers)


@pytest.mark.parametrize(
    ("entity", "generic", "value", "legal"),
    [
        ("firm_noc_router", "DEST_BITS", 17, "1 to 16"),
        ("firm_noc_buffer", "BITS", 0, "1 or more"),
        ("firm_noc_buffer", "CONTROL_BITS", 0, "1 or more"),
        ("firm_noc_buffer", "DEPTH", 6, "powers of two from 2 on"),
    ],
)
def test_an_illegal_generic_is_named(entity: str, generic: str, value: int, legal: str, tmp_path: Path) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "noc/noc"))
    result = library.run(entity, {generic: value})
    assert result.exit_code != 0
    assert f"{entity}: {generic} is {value}; legal: {legal}" in result.output


@pytest.mark.parametrize("depth", [2, 4])
@pytest.mark.parametrize("stall_percent", [0, 40])
def test_a_router_alone(depth: int, stall_percent: int, tmp_path: Path) -> None:
    print(f"seed {SEED}")
    library = Library("firm", tmp_path)
    library.analyse(core_files("axis/package", "noc/noc", "sim/checker", "sim/host"))
    library.analyse(core_files("noc/noc", fileset="tb"))
    generics: dict[str, Generic] = {"SEED": SEED, "DEPTH": depth, "STALL_PERCENT": stall_percent, "FRAMES": 300}
    result = library.run("firm_noc_router_tb", generics, options=["--ieee-asserts=disable-at-0"])
    assert result.exit_code == 0, result.output
    assert "PASS" in result.output
