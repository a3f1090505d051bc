"""Cells, clock, cycles and compile time of accelerators in Python: those of specs/, and the functions of `kernels/`.

Each is placed alone, with the operators that its specification selects: one of each kind, unless it has limits.
"""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.exploration.report import Report
from fusesoc_firm.system.hardware.compiled import entity_of, schedule_of
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import REPOSITORY, GhdlError, Library, core_files
from tools.bench import holoso
from tools.bench.nextpnr import SEEDS, Nextpnr, Placement
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.yosys import SynthesisError

TITLE = "Accelerators in Python"

_SPECS = REPOSITORY / "specs"
_OWN = Path(__file__).parent / "kernels" / "kernels.yaml"
_CORES = ("axis/package", "axis/axis", "acc/cordic/cordic", "acc/float/float", "acc/python/python")
_COLUMNS = (
    *("kernel", "numbers", "lines", "cycles", "each element", "LUT4", "FF", "DSP", "MHz", "of each seed"),
    *("compiled in s", "bars", "result"),
)
_NOTE = """'lines' are those of the source that are not blank. 'cycles' are those from the complete message to the
    answer, with operands that are not subnormal, and without those of each element of the arrays over which the
    function loops. 'compiled in s' is the time from the source to the VHDL. 'bars' are the most lines, the most cycles
    (of each element, if a function has no other bar), the most LUT4 and the least MHz; '-' is no bar."""


@dataclass(frozen=True)
class Bars:
    """The limits of a kernel; 0 is no limit."""

    lines: int = 0
    cycles: int = 0
    element: int = 0
    lut: int = 0
    megahertz: int = 0

    def __str__(self) -> str:
        numbers = (self.lines, self.element or self.cycles, self.lut, self.megahertz)
        return " / ".join(str(number or "-") for number in numbers) if any(numbers) else ""


@dataclass(frozen=True)
class Kernel:
    """An accelerator of a specification, with all floats of the type `numbers`."""

    name: str
    spec: Path
    numbers: str
    bars: Bars = Bars()

    @property
    def key(self) -> tuple[str, str]:
        """The cells that tell it from other rows."""
        return (self.name, self.numbers)


@dataclass(frozen=True)
class Compiled:
    """A compiled kernel: its cycles and those of each element, its lines, its VHDL and the time to write it."""

    lines: int
    cycles: int
    interval: int
    element: int
    entity: str
    vhdl: str
    seconds: float


KERNELS = (
    Kernel("pid", _OWN, "float64", Bars(30, 70, 0, 3800, 130)),
    Kernel("pid32", _OWN, "float32", Bars(30, 66, 0, 1900, 140)),
    Kernel("complementary_filter", _SPECS / "complementary_filter/complementary_filter.yaml", "float64",
           Bars(25, 190, 0, 7500, 110)),
    Kernel("inverse_kinematics", _SPECS / "inverse_kinematics/inverse_kinematics.yaml", "float64",
           Bars(25, 400, 0, 9500, 110)),
    Kernel("quat2euler_python", _SPECS / "quat2euler/quat2euler_python.yaml", "float64", Bars(20, 200, 0, 8500, 110)),
    Kernel("nearest", _OWN, "float32", Bars(12, 0, 1, 1500, 140)),
    Kernel("state_kalman", _SPECS / "state_kalman/state_kalman.yaml", "float64", Bars(40, 0, 0, 0, 110)),
    Kernel("joint_pid", _SPECS / "joint_pid/joint_pid.yaml", "float64"),
    Kernel("scan_sectors", _SPECS / "scan_sectors/scan_sectors.yaml", "float32", Bars(0, 0, 1, 0, 0)),
    Kernel("cloud_occupancy", _SPECS / "cloud_occupancy/cloud_occupancy.yaml", "float32"),
)  # fmt: skip


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row."""
    return {TITLE: [kernel.key for kernel in KERNELS], **holoso.keys()}


def measure(
    nextpnr: Nextpnr, tell: Tell, written: str = "", pattern: str = "", seeds: Sequence[int] = SEEDS
) -> list[Table]:
    """Place the kernels whose names match the regular expression `pattern`; `tell` hears of each.

    The other rows are taken from the text `written` of docs/figures.
    """
    nextpnr.prepare()
    known = known_rows(written, TITLE, _COLUMNS)
    rows, ours = [], {}
    for kernel in KERNELS:
        if not re.search(pattern, " ".join(kernel.key)):
            rows.append(known.get(kernel.key) or _without_figures(kernel, NOT_MEASURED))
            continue
        made = compiled(kernel)
        placement = _placed(made, nextpnr, tell, seeds)
        rows.append(
            (*kernel.key, *cells(kernel.bars, made, placement)) if placement else _without_figures(kernel, FAILED)
        )
        if placement and kernel.name in holoso.KERNELS and kernel.numbers == "float64":
            ours[kernel.name] = holoso.Figures(made.interval, placement)
    return [
        Table(TITLE, _COLUMNS, tuple(rows), _NOTE),
        holoso.measured(ours, nextpnr, tell, written, pattern, seeds),
    ]


def _without_figures(kernel: Kernel, result: str) -> tuple[str, ...]:
    return (*kernel.key, *[""] * (len(_COLUMNS) - 4), str(kernel.bars), result)


def _placed(made: Compiled, nextpnr: Nextpnr, tell: Tell, seeds: Sequence[int]) -> Placement | None:
    try:
        found = nextpnr.place(_netlist(made), made.entity, seeds)
    except (GhdlError, SynthesisError) as error:
        tell(f"{made.entity}: {FAILED}: {error}")
        return None
    tell(f"{made.entity}: {made.cycles} cycles, {found.cells}, {found.median:.1f} MHz ({' > '.join(found.path)})")
    return found


def cells(bars: Bars, made: Compiled, placement: Placement) -> tuple[str, ...]:
    """Return the cells after the key."""
    lut = placement.cells.lut + placement.cells.memory
    at_most = (
        (made.lines, bars.lines),
        (made.cycles, bars.cycles),
        (made.element, bars.element),
        (lut, bars.lut),
    )
    is_met = all(found <= most for found, most in at_most if most) and placement.median >= bars.megahertz
    return (
        str(made.lines),
        str(made.cycles),
        str(made.element or ""),
        *map(str, (lut, placement.cells.ff, placement.cells.dsp)),
        f"{placement.median:.1f}",
        " ".join(f"{fmax:.0f}" for fmax in placement.fmax.values()),
        f"{made.seconds:.2f}",
        str(bars),
        (MET if is_met else MISSED) if str(bars) else "",
    )


def compiled(kernel: Kernel) -> Compiled:
    """Compile a kernel."""
    messages = kernel.spec.parent / "msg"
    loaded = load_beside(kernel.spec, [messages] if messages.is_dir() else [])
    (type_,) = (item.own for item in loaded.system.accelerator_types if str(item.accelerator.name) == kernel.name)
    begin = time.perf_counter()
    schedule = schedule_of(type_, loaded.folder, kernel.numbers)
    made = entity_of(type_, schedule)
    vhdl = render(made.template, made.context)
    seconds = time.perf_counter() - begin
    text = (loaded.folder / type_.accelerator.sources[0]).read_text(encoding="utf-8")
    lines = sum(bool(line.strip()) for line in text.splitlines())
    element = sum(Report(schedule).elements.values())
    return Compiled(lines, schedule.latency, schedule.interval, element, type_.entity, vhdl, seconds)


def _netlist(made: Compiled) -> str:
    """Return the entity with its operators in Verilog. May raise `GhdlError`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        Library("firm", folder).analyse(core_files(*_CORES))
        (folder / "kernel.vhd").write_text(made.vhdl, encoding="utf-8")
        work = Library("work", folder)
        work.analyse([folder / "kernel.vhd"])
        return work.synthesise(made.entity, None, "verilog")
