"""How fast the clock may be: of converters, whole systems, and the Manager with schedulers, in a placed ECP5.

Each row can be measured alone. The others then keep the figures of docs/figures, or are marked as not measured.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.text.render import render
from tests.converter.simulated.pass_through import PassThrough
from tests.hdl.ghdl import GhdlError, Library, core_files
from tests.hdl.verilog import netlist
from tests.system.simulated.systems import HARDWARE, generate_system
from tools.bench import schedulers
from tools.bench.applications import NotBuiltError, netlist_of
from tools.bench.area import Subject
from tools.bench.designs import PUBLISHER, SUBSCRIBER, Converter, generate
from tools.bench.manager import TREE_PUBLISHERS, TREES, tree
from tools.bench.nextpnr import SEEDS, Nextpnr, Placement
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.yosys import SynthesisError

# Bar and stretch in MHz, by the number of channels.
LOOP_BARS = {32: (125.0, 150.0), 256: (100.0, 125.0)}
MANAGER_WIDTH = 8

_CONVERTERS_TITLE = "Converters of ROS 2 messages, MHz"
_SYSTEMS_TITLE = "Clock of whole systems, MHz"
_ARITHMETIC_TITLE = "Arithmetic of accelerators, MHz"
_LOOP_TITLE = f"Manager with its scheduler, {MANAGER_WIDTH} bits, MHz"
_COLUMNS = ("design", "bits", "MHz", "of each seed", "LUT4", "FF", "bar", "result", "stretch")
_NOTES = {
    _SYSTEMS_TITLE: """In the systems of a subscriber and a publisher for each message, messages are passed through, and
        `clock` in the specification is the bar. The others are the demo systems.""",
    _ARITHMETIC_TITLE: """The entities of [Arithmetic](../reference/arithmetic.md) for float64 and float32, with
        fixed-point numbers, half of their bits as fraction, and the division of integers. Multipliers
        (MULT18X18D) are not counted.""",
    _LOOP_TITLE: "The path from a grant through the Manager and back to the scheduler is included.",
}

JOINT_STATE, IMAGE, POSE = "sensor_msgs/JointState", "sensor_msgs/Image", "geometry_msgs/Pose"
_VARIABLE = (IMAGE, "nav_msgs/Odometry", "sensor_msgs/PointCloud2", "diagnostic_msgs/DiagnosticArray")
# Bar and stretch in MHz, by message and width: of the subscriber, then of the publisher.
_CONVERTERS: Mapping[tuple[str, int], tuple[tuple[float, float | None], tuple[float, float | None]]] = {
    (JOINT_STATE, 64): ((120, 160), (130, 160)),
    (JOINT_STATE, 128): ((110, 140), (110, 140)),
    (IMAGE, 128): ((115, 150), (125, 150)),
    **{(message, width): ((120, 160), (120, 160)) for message in _VARIABLE for width in (8, 64)},
    # The publisher is not to become slower than it was before others were pipelined.
    (POSE, 64): ((180, None), (281, None)),
}
# The messages that are passed through, width, bar and stretch.
_PASSED = (
    ((IMAGE, POSE), 64, 110.0, 150.0),
    ((IMAGE, POSE), 8, 130.0, 150.0),
    ((JOINT_STATE, IMAGE, POSE), 64, 105.0, 140.0),
)
_DEMOS = {
    "quat2euler": (125.0, 150.0),
    **dict.fromkeys(("mobile_robot", "sobel", "image_pipeline", "robotic_arm"), (100.0, 125.0)),
}
_LOOP_ENTITY = "manager_loop"
# In MHz.
_TREE_BAR = 100.0
# EXPONENT_BITS and MANTISSA_BITS by the bits of a number.
_FLOATS = {64: (11, 52), 32: (8, 23)}
_ARITHMETIC = (
    "firm_float_add",
    "firm_float_multiply",
    "firm_float_multiply_add",
    "firm_float_divide",
    "firm_float_square_root",
    "firm_float_compare",
    "firm_float_clamp",
    "firm_float_sincos",
    "firm_float_atan2",
    "firm_float_exp",
    "firm_float_log",
    "firm_float_low_pass",
    "firm_float_pid",
    "firm_fixed_to_float",
    "firm_float_to_fixed",
)
# Those with the generic IS_SHORT.
_SHORT = ("firm_float_add", "firm_float_multiply")


@dataclass(frozen=True)
class Design:
    """A netlist in Verilog, and its top level."""

    verilog: str
    top: str


@dataclass(frozen=True)
class Row:
    """A placed design; `make` makes it in an empty folder. `width` is in bits, `bar` and `stretch` are in MHz."""

    label: str
    width: int | None
    make: Callable[[Path], Design]
    bar: float | None = None
    stretch: float | None = None

    @property
    def key(self) -> tuple[str, ...]:
        """The cells that tell it from other rows of its table."""
        return (self.label, str(self.width or ""))

    @property
    def name(self) -> str:
        """How a user names it."""
        return ", ".join(filter(None, (self.label, f"{self.width} bits" if self.width else "")))


def rows() -> dict[str, list[Row]]:
    """All rows by the title of their table."""
    return {
        _CONVERTERS_TITLE: [*_converters()],
        _SYSTEMS_TITLE: [*_systems()],
        _LOOP_TITLE: [*_loops(), *_trees()],
        _ARITHMETIC_TITLE: [*_arithmetic()],
    }


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {title: [row.key for row in found] for title, found in rows().items()}


def measure(
    nextpnr: Nextpnr, tell: Tell, written: str = "", pattern: str = "", seeds: Sequence[int] = SEEDS
) -> list[Table]:
    """Place the rows whose names match the regular expression `pattern`; `tell` hears of each.

    The other rows are taken from the text `written` of docs/figures.
    """
    return measured_tables(rows(), _NOTES, nextpnr, tell, written, pattern, seeds)


def measured_tables(
    table_rows: Mapping[str, Sequence[Row]],
    notes: Mapping[str, str],
    nextpnr: Nextpnr,
    tell: Tell,
    written: str,
    pattern: str,
    seeds: Sequence[int],
) -> list[Table]:
    """Return the tables of all rows by title, with the `notes` of some; only rows that match `pattern` are placed."""
    wanted = [row for found in table_rows.values() for row in found if re.search(pattern, row.name)]

    def measured(row: Row) -> tuple[str, ...]:
        found = placed(row, nextpnr, seeds)
        tell(f"{row.name}: {found if isinstance(found, str) else summary(found)}")
        return _cells(row, found)

    nextpnr.prepare()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cells = dict(zip(map(id, wanted), pool.map(measured, wanted), strict=True))
    tables = []
    for title, of_table in table_rows.items():
        known = known_rows(written, title, _COLUMNS)
        lines = (cells.get(id(row)) or known.get(row.key) or _not_measured(row) for row in of_table)
        tables.append(Table(title, _COLUMNS, tuple(lines), notes.get(title, "")))
    return tables


def placed(row: Row, nextpnr: Nextpnr, seeds: Sequence[int]) -> Placement | str:
    """Return the placement, or the error."""
    with tempfile.TemporaryDirectory() as name:
        try:
            design = row.make(Path(name))
            return nextpnr.place(design.verilog, design.top, seeds)
        except (GhdlError, SynthesisError, NotBuiltError) as error:
            return f"{FAILED}: {error}"


def summary(found: Placement) -> str:
    """What is told of a placement."""
    return f"{found.median:.1f} MHz ({of_seeds(found)}), {found.cells}; slowest: {' > '.join(found.path)}"


def of_seeds(found: Placement) -> str:
    """The frequencies of the seeds."""
    return " ".join(f"{fmax:.0f}" for fmax in found.fmax.values())


def _cells(row: Row, found: Placement | str) -> tuple[str, ...]:
    bar, stretch = (f"{limit:.0f}" if limit else "" for limit in (row.bar, row.stretch))
    if isinstance(found, str):
        return (*row.key, "", "", "", "", bar, FAILED, stretch)
    verdict = "" if row.bar is None else MET if found.median >= row.bar else MISSED
    cells = (str(found.cells.lut), str(found.cells.ff))
    return (*row.key, f"{found.median:.1f}", of_seeds(found), *cells, bar, verdict, stretch)


def _not_measured(row: Row) -> tuple[str, ...]:
    *cells, _, stretch = _cells(row, FAILED)
    return (*cells, NOT_MEASURED, stretch)


def _converters() -> Iterator[Row]:
    for (message, width), limits in _CONVERTERS.items():
        for direction, (bar, stretch) in zip((SUBSCRIBER, PUBLISHER), limits, strict=True):
            converter = Converter(2, message, direction, width)
            yield Row(str(converter), width, _converter(converter), bar, stretch)


def _converter(converter: Converter) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        (design,) = generate(folder, converter)
        return _synthesised(Subject(design.library, design.entity))

    return make


def _systems() -> Iterator[Row]:
    for messages, width, bar, stretch in _PASSED:
        label = " + ".join(message.partition("/")[2] for message in messages)
        yield Row(f"pass-through {label}", width, _passed(messages, width, bar), bar, stretch)
    for name, (bar, stretch) in _DEMOS.items():
        yield Row(name, None, _demo(name), bar, stretch)


def _passed(messages: Sequence[str], width: int, bar: float) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        passed = PassThrough("humble", messages, count=0, seed=0, width=width, megahertz=bar)
        specification = passed.specification(folder)
        work = generate_system(specification, folder / "system")
        file = netlist(work[-1].stem, folder, work, core_files(*HARDWARE))
        return Design(file.read_text(encoding="utf-8"), work[-1].stem)

    return make


def _demo(name: str) -> Callable[[Path], Design]:
    def make(_: Path) -> Design:
        found = netlist_of(name)
        return Design(found.verilog, found.top)

    return make


def _loops() -> Iterator[Row]:
    for policy in POLICIES:
        for channels, (bar, stretch) in LOOP_BARS.items():
            yield Row(_label(f"Manager, {policy}", channels), None, _loop(policy, channels), bar, stretch)


def _loop(policy: str, channels: int) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        library, scheduler = schedulers.analysed(folder, policy, channels)
        Library("firm", folder).analyse(core_files("manager/manager"))
        file = folder / f"{_LOOP_ENTITY}.vhd"
        configuration = {
            "entity": _LOOP_ENTITY,
            "scheduler": scheduler,
            "is_preemptive": str(POLICIES[policy].is_preemptive).lower(),
        }
        file.write_text(render(file.name, configuration, Path(__file__).parent), encoding="ascii")
        library.analyse([file])
        return _synthesised(Subject(library, _LOOP_ENTITY, {"WIDTH": MANAGER_WIDTH, "CHANNELS": channels}))

    return make


def _trees() -> Iterator[Row]:
    for name, watchdog in TREES.items():
        yield Row(_label(f"Manager of Managers, {name}", TREE_PUBLISHERS), None, _tree(watchdog), _TREE_BAR)


def _tree(watchdog: int) -> Callable[[Path], Design]:
    return lambda folder: _synthesised(tree(watchdog)(folder))


def _arithmetic() -> Iterator[Row]:
    for width, (exponent, mantissa) in _FLOATS.items():
        for entity in _ARITHMETIC:
            generics = {"EXPONENT_BITS": exponent, "MANTISSA_BITS": mantissa}
            yield Row(entity, width, _operation(entity, generics))
        for entity in _SHORT:
            yield Row(f"{entity}, short", width, _operation(entity, {**generics, "IS_SHORT": True}))
    for width, other in (64, 32), (32, 64):
        generics = {
            f"{side}_{name}": bits
            for side, size in (("IN", width), ("OUT", other))
            for name, bits in zip(("EXPONENT_BITS", "MANTISSA_BITS"), _FLOATS[size], strict=True)
        }
        yield Row(f"firm_float_resize to {other} bits", width, _operation("firm_float_resize", generics))
    for entity in "firm_fixed_add", "firm_fixed_resize":
        yield Row(entity, 32, _operation(entity, {}))
    for entity in "firm_fixed_multiply", "firm_fixed_divide":
        for width in (16, 24, 32, 48):
            sizes = {"WIDTH": width, "FRACTION": width // 2}
            generics = {f"{port}_{name}": size for port in ("A", "B", "OUT") for name, size in sizes.items()}
            yield Row(entity, width, _operation(entity, generics))
    for width in (16, 32, 64):
        yield Row("firm_integer_divide", width, _operation("firm_integer_divide", {"WIDTH": width}))


def _operation(entity: str, generics: Mapping[str, int]) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        library = Library("firm", folder)
        library.analyse(core_files("acc/cordic/cordic", "acc/float/float", "acc/fixed/fixed", "acc/python/python"))
        return _synthesised(Subject(library, entity, generics))

    return make


def _label(design: str, channels: int) -> str:
    return f"{design}, N = {channels}"


def _synthesised(subject: Subject) -> Design:
    return Design(subject.library.synthesise(subject.entity, subject.generics, "verilog"), subject.entity)
