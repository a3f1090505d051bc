"""Networks on chip: area and clock of routers and exchanges, and their throughput and latency beside the Manager's."""

from __future__ import annotations

import random
import re
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median

from fusesoc_firm.noc.hardware import TEMPLATE, exchange_configuration
from fusesoc_firm.noc.mapping import mapped
from fusesoc_firm.noc.model import Frame, latency, next_place, random_frames, throughput
from fusesoc_firm.noc.network import Flow, Network, Topology, crossbar, mesh, tree
from fusesoc_firm.text.render import render
from tests.exploration.topic_systems import FABRICS, random_system, ratios
from tests.hdl.ghdl import GhdlError, Library, core_files
from tools.bench import floonoc
from tools.bench.nextpnr import SEEDS, Nextpnr
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.yosys import SynthesisError

AREA_TITLE = "Area and clock of routers and exchanges"
MESH_TITLE = "Saturation of a 4 x 4 mesh"
TRAFFIC_TITLE = "Exchanges beside the Manager"
WORST_TITLE = "Worst case"

_FOLDER = Path(__file__).parent
_AREA_COLUMNS = ("design", "bits", "LUT4", "FF", "MHz", "of each seed", "bar LUT4", "bar MHz", "result")
_MESH_COLUMNS = ("beats of a buffer", "beats of a frame", "beats per cycle and endpoint", "bar", "result")
_TRAFFIC_COLUMNS = (
    "traffic",
    "endpoints",
    "figure",
    "Manager",
    "wires",
    "crossbar",
    "mesh",
    "tree",
    "quotient",
    "bar",
    "result",
)
_WORST_COLUMNS = ("exchange", "messages", "median", "of ten, nine are below", "greatest", "bar of the median", "result")
_NOTES = {
    WORST_TITLE: """The quotient of the bound on a message's time from its publisher to its reader, and of the slowest
        message that 100 runs of the cycle model find, of 2,000 cycles each: sources that always have messages, or
        pause, and readers that are slow up to their bounds. The systems are 200 random ones of up to eight
        accelerators, with messages of 1 to 48 beats. No bound is below the slowest message.""",
    AREA_TITLE: """Routers are those of a 4 x 4 mesh with XY routing and flows from each endpoint to each other one.
        The flows of the crossbar are pipelines of four endpoints from endpoint 0 and back to it. Buffers have two
        beats.""",
    MESH_TITLE: """Each endpoint always has a frame for a random other one. The [cycle
        model](../../fusesoc_firm/noc/model.py) has the handshakes of the hardware in every cycle.""",
    TRAFFIC_TITLE: """'saturation' is the number of beats that all endpoints receive in a cycle if each source always
        has a frame of 8 beats. 'latency' is the mean number of cycles from the cycle in which such a frame is due to
        the one in which its last beat arrives, if all sources together send 0.2 beats in a cycle. Frames between
        accelerators pass the Manager and an ideal host, which returns each frame without delay. In 'host', endpoint 0
        sends to all others and receives from them; 'uniform' is from each endpoint to each other one; 'neighbours' are
        pairs; 'pipelines' consist of four endpoints, from endpoint 0 and back to it; in 'four hosts', each of the
        endpoints 0 to 3 has its own accelerators. Wires carry a whole message in a cycle, which counts as
        8 beats, and have a merge at each endpoint. The crossbar has only the turns that the flows need. The endpoints
        of the mesh are placed by annealing. The quotient is that of the crossbar and the Manager.""",
}
# LUT4 at most and MHz at least.
_AREA_BARS = {
    ("router of five ports", 8): (430, 210),
    ("router of five ports", 64): (1300, 210),
    ("router at a corner", 8): (117, 290),
    ("router at a corner", 64): (430, 290),
    ("crossbar, 16 endpoints, 19 flows", 8): (420, 230),
    ("crossbar, 16 endpoints, 19 flows", 64): (1600, 210),
    ("mesh 4 x 4, all to all", 8): (4100, 200),
}
_MESH_BARS = {(2, 8): 0.45, (16, 8): 0.58}
_SIZES = (4, 16, 64)
# The least quotient of the saturations of the crossbar and the Manager.
_WORST_BAR, _WORST_SYSTEMS, _WORST_RUNS, _WORST_CYCLES = 1.3, 200, 100, 2000
_QUOTIENTS = {("pipelines", 16): 9.5, ("pipelines", 64): 60.0}
_SATURATION, _LATENCY = "saturation", "latency"
_BEATS, _LOAD, _CYCLES = 8, 0.2, 3000


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {
        AREA_TITLE: [(design, str(width)) for design, width in _AREA_BARS],
        floonoc.TITLE: floonoc.keys(),
        MESH_TITLE: [(str(buffers), str(beats)) for buffers, beats in _mesh_sizes()],
        TRAFFIC_TITLE: [(name, str(count), figure) for name, count, figure in _traffic_rows()],
        WORST_TITLE: [(fabric,) for fabric in ("all", *FABRICS)],
    }


def measure(nextpnr: Nextpnr, tell: Tell, known: str, pattern: str, seeds: Sequence[int] = SEEDS) -> list[Table]:
    """Measure the rows whose names match; the others keep their figures in the text `known`."""
    areas = _areas(nextpnr, tell, known, pattern, seeds)
    ours = partial(verilog_of, "router of five ports")
    beside = floonoc.measure(nextpnr, tell, known, pattern, seeds, ours)
    return [areas, beside, _meshes(tell, known, pattern), _traffic(tell, known, pattern), _worst(tell, known, pattern)]


# --- worst case ------------------------------------------------------------------------------------------------------


def _worst(tell: Tell, known: str, pattern: str) -> Table:
    before = known_rows(known, WORST_TITLE, _WORST_COLUMNS, 1)
    names = ("all", *FABRICS)
    rows = [before.get((name,), (name, *[""] * 5, NOT_MEASURED)) for name in names]
    if any(re.search(pattern, f"worst case of {name}") for name in names):
        found = _worst_ratios()
        rows = [(name, *_spread(found[name], is_barred=name == "all")) for name in names]
        for row in rows:
            tell(" ".join(row))
    return Table(WORST_TITLE, _WORST_COLUMNS, tuple(rows), _NOTES[WORST_TITLE])


def _worst_ratios() -> dict[str, list[float]]:
    """Return the quotients of all messages, by the kind of exchange and of all."""
    found: dict[str, list[float]] = {name: [] for name in ("all", *FABRICS)}
    for number in range(_WORST_SYSTEMS):
        with tempfile.TemporaryDirectory() as name:
            loaded = random_system(random.Random(f"worst case {number}"), Path(name))
            quotients = ratios(loaded, number, _WORST_RUNS, _WORST_CYCLES)
        for kind in ("all", str(loaded.specification.project.fabric)):
            found[kind] += quotients
    return found


def _spread(quotients: Sequence[float], *, is_barred: bool) -> tuple[str, ...]:
    ordered = sorted(quotients)
    middle = median(ordered)
    figures = (middle, ordered[len(ordered) * 9 // 10], ordered[-1])
    limits = (f"<= {_WORST_BAR}", MET if middle <= _WORST_BAR else MISSED) if is_barred else ("", "")
    return (str(len(ordered)), *(f"{figure:.2f}" for figure in figures), *limits)


# --- area and clock --------------------------------------------------------------------------------------------------


def all_to_all(endpoints: int) -> tuple[Flow, ...]:
    """Return a flow from each endpoint to each other one.

    For a power of two, the numbers of destinations are those of endpoints, inverted and XORed with that of the source.
    """
    numbers = range(endpoints)
    if endpoints & (endpoints - 1):
        return tuple(Flow(source, (sink,)) for source in numbers for sink in numbers if source != sink)
    last = endpoints - 1
    return tuple(Flow(source, (source ^ last ^ number,)) for source in numbers for number in range(last))


def pipelines(endpoints: int) -> tuple[Flow, ...]:
    """Return pipelines of four endpoints from endpoint 0 and back to it, the first one of three."""
    ends: set[tuple[int, int]] = set()
    for first in range(0, endpoints, 4):
        stages = [0, *(number for number in range(first, min(first + 4, endpoints)) if number), 0]
        ends |= {*pairwise(stages)}
    return tuple(Flow(source, (sink,)) for source, sink in sorted(ends) if source != sink)


def _network(topology: Topology, flows: tuple[Flow, ...]) -> Network:
    return Network(topology, topology.slots, flows)


def verilog_of(design: str, width: int) -> tuple[str, str]:
    """Return the netlist of a row of the table of areas, and its top level."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        Library("firm", folder).analyse(core_files("axis/package", "noc/noc"))
        work = Library("work", folder)
        is_router = design.startswith("router")
        top = "router" if is_router else "exchange"
        made = _network(crossbar(16), pipelines(16)) if "crossbar" in design else _network(mesh(4, 4), all_to_all(16))
        data = exchange_configuration(top, made, width)
        text = render(TEMPLATE, data)
        if is_router:
            router = data["routers"][5 if "five" in design else 0]
            sizes = {"bits": 1 + width // 8 + width, "links": router["count"] - 1, "locals": 1}
            context = {**router, **sizes, "dest_bits": data["dest_bits"], "depth": data["depth"]}
            text = render("router.vhd", context, _FOLDER)
        (folder / f"{top}.vhd").write_text(text, encoding="ascii")
        work.analyse([folder / f"{top}.vhd"])
        return work.synthesise(top, None, "verilog"), top


def _areas(nextpnr: Nextpnr, tell: Tell, known: str, pattern: str, seeds: Sequence[int]) -> Table:
    before = known_rows(known, AREA_TITLE, _AREA_COLUMNS)
    rows = []
    for (design, width), bars in _AREA_BARS.items():
        key, limits = (design, str(width)), tuple(map(str, bars))
        row = before.get(key, (*key, "", "", "", "", *limits, NOT_MEASURED))
        if re.search(pattern, f"{design} {width} bits"):
            row = (*key, *_placed(nextpnr, design, width, bars, seeds))
            tell(" ".join(row))
        rows.append(row)
    return Table(AREA_TITLE, _AREA_COLUMNS, tuple(rows), _NOTES[AREA_TITLE])


def _placed(nextpnr: Nextpnr, design: str, width: int, bars: tuple[int, int], seeds: Sequence[int]) -> tuple[str, ...]:
    limits = tuple(map(str, bars))
    try:
        found = nextpnr.place(*verilog_of(design, width), seeds)
    except (GhdlError, SynthesisError):
        return ("", "", "", "", *limits, FAILED)
    result = MET if found.cells.lut <= bars[0] and found.median >= bars[1] else MISSED
    each = " ".join(f"{fmax:.0f}" for fmax in found.fmax.values())
    return (str(found.cells.lut), str(found.cells.ff), f"{found.median:.0f}", each, *limits, result)


# --- throughput and latency ------------------------------------------------------------------------------------------


def _mesh_sizes() -> Iterator[tuple[int, int]]:
    yield from ((buffers, beats) for buffers in (2, 4, 16) for beats in (2, 8, 16))


def _meshes(tell: Tell, known: str, pattern: str) -> Table:
    before = known_rows(known, MESH_TITLE, _MESH_COLUMNS)
    made = _network(mesh(4, 4), all_to_all(16))
    rows = []
    for buffers, beats in _mesh_sizes():
        bar = _MESH_BARS.get((buffers, beats))
        key, limit = (str(buffers), str(beats)), f">= {bar:g}" if bar else ""
        row = before.get(key, (*key, "", limit, NOT_MEASURED))
        if re.search(pattern, f"mesh of {buffers} and {beats}"):
            runs = [throughput(made, buffers=buffers, beats=beats, seed=seed) / 16 for seed in SEEDS]
            rate = sum(runs) / len(runs)
            row = (*key, f"{rate:.3f}", limit, "" if not bar else MET if rate >= bar else MISSED)
            tell(" ".join(row))
        rows.append(row)
    return Table(MESH_TITLE, _MESH_COLUMNS, tuple(rows), _NOTES[MESH_TITLE])


def _host(endpoints: int) -> Iterator[tuple[int, int]]:
    yield from ((0, sink) for sink in range(1, endpoints))
    yield from ((source, 0) for source in range(1, endpoints))


def _neighbours(endpoints: int) -> Iterator[tuple[int, int]]:
    yield from ((source, source ^ 1) for source in range(endpoints))


def _four_hosts(endpoints: int) -> Iterator[tuple[int, int]]:
    for number in range(4, endpoints):
        yield from ((number % 4, number), (number, number % 4))


def _pairs(made: Callable[[int], Iterator[tuple[int, int]]]) -> Callable[[int], tuple[Flow, ...]]:
    return lambda endpoints: tuple(Flow(source, (sink,)) for source, sink in made(endpoints))


TRAFFIC: Mapping[str, Callable[[int], tuple[Flow, ...]]] = {
    "host": _pairs(_host),
    "uniform": all_to_all,
    "neighbours": _pairs(_neighbours),
    "pipelines": pipelines,
    "four hosts": _pairs(_four_hosts),
}


def _traffic_rows() -> Iterator[tuple[str, int, str]]:
    for name in TRAFFIC:
        for endpoints in _SIZES:
            if name != "four hosts" or endpoints > 4:
                yield from ((name, endpoints, figure) for figure in (_SATURATION, _LATENCY))


def _traffic(tell: Tell, known: str, pattern: str) -> Table:
    before = known_rows(known, TRAFFIC_TITLE, _TRAFFIC_COLUMNS, 3)
    rows = []
    for name, endpoints, figure in _traffic_rows():
        key = (name, str(endpoints), figure)
        row = before.get(key, (*key, *[""] * 7, NOT_MEASURED))
        if re.search(pattern, f"{name} of {endpoints} {figure}"):
            row = (*key, *_compared(name, endpoints, figure))
            tell(" ".join(row))
        rows.append(row)
    return Table(TRAFFIC_TITLE, _TRAFFIC_COLUMNS, tuple(rows), _NOTES[TRAFFIC_TITLE])


def _compared(name: str, endpoints: int, figure: str) -> tuple[str, ...]:
    """Return the figures of the Manager and the exchanges, and the result."""
    flows = TRAFFIC[name](endpoints)
    side = round(endpoints**0.5)
    networks = [_network(crossbar(endpoints), flows), _mapped(mesh(side, side), flows), _mapped(tree(endpoints), flows)]
    if figure == _LATENCY:
        found = [
            Relays(networks[0]).latency(),
            Wires(networks[0]).latency(),
            *(latency(made, _LOAD, cycles=_CYCLES) for made in networks),
        ]
        return (*(f"{cycles:.1f}" for cycles in found), f"{found[2] / found[0]:.2f}", "", "")
    ways = (Relays(networks[0]), Wires(networks[0]))
    rates = [*(way.throughput() for way in ways), *(throughput(made, cycles=_CYCLES) for made in networks)]
    quotient = rates[2] / rates[0]
    bar = _QUOTIENTS.get((name, endpoints))
    limits = (f">= {bar:g}", MET if quotient >= bar else MISSED) if bar else ("", "")
    return (*(f"{rate:.2f}" for rate in rates), f"{quotient:.1f}", *limits)


def _mapped(topology: Topology, flows: tuple[Flow, ...]) -> Network:
    return Network(topology, mapped(topology, len(topology.slots), flows), flows)


@dataclass(frozen=True)
class Wires:
    """Wires for each flow, and a merge at each sink; a message passes in a cycle."""

    network: Network

    def throughput(self) -> float:
        """Return the beats that all endpoints receive in a cycle if each source always has a message."""
        choice, first = random.Random(1), _CYCLES // 5
        frames: list[Frame] = []
        for source in range(self.network.endpoints):
            flows = [place for place, flow in enumerate(self.network.flows) if flow.source == source]
            frames += [Frame(0, choice.choice(flows), _BEATS) for _ in range(_CYCLES) if flows]
        return sum(cycle >= first for cycle, _ in self._arrivals(frames)) * _BEATS / (_CYCLES - first)

    def latency(self) -> float:
        """Return the mean cycles from the cycle in which a message is due to the one in which it arrives."""
        frames = random_frames(self.network, _LOAD, _BEATS, _CYCLES)
        waits = [cycle + 1 - frame.cycle for cycle, frame in self._arrivals(frames) if frame.cycle < _CYCLES * 4 // 5]
        return sum(waits) / len(waits)

    def _arrivals(self, frames: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
        """Yield the cycle of each arrival, and the frame; each merge turns as `firm_message_merge` does."""
        left: dict[int, deque[Frame]] = {}
        for frame in frames:
            left.setdefault(self.network.flows[frame.flow].source, deque()).append(frame)
        turns: dict[int, int] = {}
        for cycle in range(_CYCLES):
            waiting: dict[int, list[int]] = {}
            for source, messages in left.items():
                if messages and messages[0].cycle <= cycle:
                    (sink,) = self.network.flows[messages[0].flow].sinks
                    waiting.setdefault(sink, []).append(source)
            for sink, sources in waiting.items():
                # A sink of one source needs no merge.
                turn = turns.get(sink, self._first_source(sink))
                if turn in sources:
                    yield cycle, left[turn].popleft()
                turns[sink] = next_place(sources, turn)

    def _first_source(self, sink: int) -> int:
        return min(flow.source for flow in self.network.flows if sink in flow.sinks)


@dataclass(frozen=True)
class Relays:
    """The Manager, whose channels carry a beat in each cycle, and a host, endpoint 0, that returns frames at once.

    Frames to the host pass the channel to it, with round robin; its own ones pass the channel from it; the others pass
    both. The network has only their flows.
    """

    network: Network

    def throughput(self) -> float:
        """Return the beats that all endpoints receive in a cycle if each source always has a frame."""
        choice = random.Random(1)
        # Long before the end, all sources wait.
        frames = []
        for source in range(self.network.endpoints):
            flows = [place for place, flow in enumerate(self.network.flows) if flow.source == source]
            frames += [Frame(0, choice.choice(flows), _BEATS) for _ in range(_CYCLES // _BEATS) if flows]
        first = _CYCLES // 5
        arrived = [cycle for cycle, _ in self._arrivals(frames) if first <= cycle < _CYCLES]
        return len(arrived) * _BEATS / (_CYCLES - first)

    def latency(self) -> float:
        """Return the mean cycles from the cycle in which a frame is due to the arrival of its last beat."""
        frames = random_frames(self.network, _LOAD, _BEATS, _CYCLES)
        waits = [cycle + 1 - frame.cycle for cycle, frame in self._arrivals(frames) if frame.cycle < _CYCLES * 4 // 5]
        return sum(waits) / len(waits)

    def _arrivals(self, frames: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
        """Yield the cycle of each arrival until all frames have arrived, and the frame.

        A beat needs a cycle in a channel's register.
        """
        returned: list[tuple[int, Frame]] = []
        for cycle, frame in self._to_host(frames):
            if self.network.flows[frame.flow].sinks == (0,):
                yield cycle, frame
            else:
                returned.append((cycle, frame))
        down = [(frame.cycle, frame) for frame in frames if self.network.flows[frame.flow].source == 0] + returned
        free = 0
        for due, frame in sorted(down, key=lambda item: item[0]):
            free = max(free, due) + frame.beats
            yield free, frame

    def _to_host(self, frames: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
        """Yield the frames of accelerators as they end at the host."""
        waiting: dict[int, deque[Frame]] = {}
        for frame in frames:
            waiting.setdefault(self.network.flows[frame.flow].source, deque()).append(frame)
        waiting.pop(0, None)
        turn, cycle = 0, 0
        while any(waiting.values()):
            due = [source for source, queue in waiting.items() if queue and queue[0].cycle <= cycle]
            if not due:
                cycle = min(queue[0].cycle for queue in waiting.values() if queue)
                continue
            turn = min((source for source in due if source > turn), default=min(due))
            frame = waiting[turn].popleft()
            cycle += frame.beats
            yield cycle, frame
