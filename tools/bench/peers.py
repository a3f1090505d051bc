"""Area and clock of parts of streams, beside those of verilog-axis and Open Logic that do the same work.

    VERILOG_AXIS=~/verilog-axis OPEN_LOGIC=~/open-logic python -m tools.bench peers

The folders hold the two libraries, of which nothing is kept here but the modules around their parts (`peers/*.v`).
Without them, the written table stays.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.netlist.translation import Translation, translate
from tests.hdl.ghdl import core_files
from tools.bench.nextpnr import Nextpnr, Placement
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell
from tools.bench.yosys import ECP5, SynthesisError

TITLE = "Parts of streams beside those of other libraries"
BAR = 1.0
OURS, VERILOG_AXIS, OPEN_LOGIC = "ours", "verilog-axis", "Open Logic"
_VARIABLES = {VERILOG_AXIS: "VERILOG_AXIS", OPEN_LOGIC: "OPEN_LOGIC"}
WITHOUT_FOLDERS = (
    f"peers: not measured; {' and '.join(f'{name}=DIR' for name in _VARIABLES.values())} name folders with "
    f"{' and '.join(_VARIABLES)}"
)

_WRAPPERS = Path(__file__).with_name("peers")
_CORES = ("axis/package", "axis/axis", "sched/package", "sched/round_robin", "cdc/sync", "cdc/cdc")
_MODULES = ("register", "adapter", "fifo", "async_fifo", "arb_mux", "demux")
_PARTS_OF_MODULES = ("arbiter", "priority_encoder")
_NAMED = "named"
_COLUMNS = ("function", "library", "LUT", "FF", "block RAM", "MHz", "LUT to best", "FF to best", "bar", "result")
_NOTE = f"""LUT includes those of carries and of RAM. 'to best' is the quotient of ours and the lower figure of the
    others; the bar is {BAR:g}. The crossing has two clocks, so it has no single frequency; ours also waits until the
    end of a message has been read. Open Logic has neither a multiplexer of several streams nor a demultiplexer.
    'named' is a known exception: the flags of our FIFO are registers, which the next state of both indices sets, while
    those of verilog-axis are comparisons of two pointers at its outputs."""


@dataclass(frozen=True)
class Function:
    """A function: the module of its name in `peers/*.v`, and its name in the table.

    `is_larger` marks an exception to the bar.
    """

    module: str
    label: str
    libraries: tuple[str, ...] = (OURS, VERILOG_AXIS, OPEN_LOGIC)
    has_two_clocks: bool = False
    is_larger: bool = False


FUNCTIONS = (
    Function("register_slice", "register slice, 64 bits"),
    Function("widening", "8 bits to 64"),
    Function("narrowing", "64 bits to 8"),
    Function("fifo", "FIFO, 512 beats of 64 bits", is_larger=True),
    Function("crossing", "two clocks, 16 beats of 64 bits", has_two_clocks=True),
    Function("merging", "round robin of 4, 64 bits", (OURS, VERILOG_AXIS)),
    Function("demultiplexer", "one of 4 sinks, 64 bits", (OURS, VERILOG_AXIS)),
)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(function.label, library) for function in FUNCTIONS for library in function.libraries]}


def folders(environment: Mapping[str, str] = os.environ) -> dict[str, Path]:
    """Return the named folders, by library; none unless all are named."""
    named = {library: environment.get(variable, "") for library, variable in _VARIABLES.items()}
    return {library: Path(name) for library, name in named.items()} if all(named.values()) else {}


def versions() -> list[str]:
    """Return the libraries with their commits."""
    return [f"{library} {_commit(folder)}" for library, folder in folders().items()]


def measure(nextpnr: Nextpnr, tell: Tell, seeds: Sequence[int]) -> list[Table]:
    """Map and place all parts of all libraries; `tell` hears of each."""
    nextpnr.prepare()
    sources = folders()

    def measured(function: Function, library: str) -> Placement | str:
        found = _measured(function, library, sources, nextpnr, seeds)
        tell(f"{function.label}, {library}: {found if isinstance(found, str) else found.cells}")
        return found

    return [Table(TITLE, _COLUMNS, tuple(line for function in FUNCTIONS for line in lines(function, measured)), _NOTE)]


def lines(function: Function, measured: Callable[[Function, str], Placement | str]) -> list[tuple[str, ...]]:
    """Return the rows of a function, a row for each library, from what is measured of it, or the error."""
    found = {library: measured(function, library) for library in function.libraries}
    areas = {library: _area(placement) for library, placement in found.items() if isinstance(placement, Placement)}
    return [
        (function.label, library, *_figures(placement), *_comparison(function, library, areas))
        for library, placement in found.items()
    ]


def _measured(
    function: Function, library: str, sources: Mapping[str, Path], nextpnr: Nextpnr, seeds: Sequence[int]
) -> Placement | str:
    """Return the cells, with frequencies if there is one clock, or the error."""
    with tempfile.TemporaryDirectory() as name:
        try:
            verilog = _VERILOG[library](function.module, sources.get(library, Path()), Path(name))
            if function.has_two_clocks:
                return Placement(nextpnr.yosys.cells(verilog, function.module, ECP5))
            return nextpnr.place(verilog, function.module, seeds)
        except (NetlistError, SynthesisError) as error:
            return f"{FAILED}: {error}"


def _area(placement: Placement) -> tuple[int, int]:
    return placement.cells.lut + placement.cells.memory, placement.cells.ff


def _figures(placement: Placement | str) -> tuple[str, ...]:
    if isinstance(placement, str):
        return ("", "", "", "")
    numbers = (*_area(placement), placement.cells.block or "")
    return (*map(str, numbers), f"{placement.median:.0f}" if placement.fmax else "")


def _comparison(function: Function, library: str, areas: Mapping[str, tuple[int, int]]) -> tuple[str, ...]:
    """Return the last cells of a row: only ours is compared."""
    if library not in areas:
        return ("", "", "", FAILED)
    others = [area for other, area in areas.items() if other != OURS]
    if library != OURS or not others:
        return ("", "", "", "")
    quotients = [own / min(figures) for own, figures in zip(areas[OURS], zip(*others, strict=True), strict=True)]
    verdict = MET if max(quotients) <= BAR else _NAMED if function.is_larger else MISSED
    return (*(f"{quotient:.2f}" for quotient in quotients), f"{BAR:g}", verdict)


def _ours(module: str, _: Path, folder: Path) -> str:
    files = [str(file) for file in core_files(*_CORES) if file.suffix == ".vhd"]
    return _translated(module, _wrappers("ours"), folder, {"firm": files}, "93")


def _open_logic(module: str, source: Path, folder: Path) -> str:
    files = sorted(map(str, (source / "src" / "base" / "vhdl").glob("*.vhd")))
    # Its RAM is a shared variable without a protected type.
    return _translated(module, _wrappers("open_logic"), folder, {"olo": files}, "08", ["-frelaxed"])


def _verilog_axis(_: str, source: Path, __: Path) -> str:
    names = (*(f"axis_{module}" for module in _MODULES), *_PARTS_OF_MODULES)
    try:
        files = [(source / "rtl" / f"{name}.v").read_text(encoding="utf-8") for name in names]
    except OSError as error:
        raise SynthesisError(str(error)) from None
    return "\n".join([_wrappers("verilog_axis"), *files])


def _wrappers(library: str) -> str:
    return "\n".join((_WRAPPERS / name).read_text(encoding="utf-8") for name in ("streams.vh", f"{library}.v"))


def _translated(
    module: str,
    wrappers: str,
    folder: Path,
    libraries: Mapping[str, Sequence[str]],
    standard: str,
    options: Sequence[str] = (),
) -> str:
    """Return the wrappers, and a netlist of the entities that one of their modules instantiates."""
    source, output = folder / "wrappers.v", folder / "netlist.v"
    source.write_text(wrappers, encoding="utf-8")
    translate(
        Translation(module, str(output), libraries, {}, [str(source)], std=standard, options=options), folder / "ghdl"
    )
    return f"{wrappers}\n{output.read_text(encoding='utf-8')}"


def _commit(folder: Path) -> str:
    done = subprocess.run(["git", "-C", folder, "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else "of an unknown commit"


_VERILOG: Mapping[str, Callable[[str, Path, Path], str]] = {
    OURS: _ours,
    VERILOG_AXIS: _verilog_axis,
    OPEN_LOGIC: _open_logic,
}
