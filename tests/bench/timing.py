"""How fast the clock may be: of schedulers and of the Manager with one, placed and routed on an ECP5."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.text.render import render
from tests.bench import schedulers
from tests.bench.area import Subject
from tests.bench.nextpnr import Nextpnr
from tests.bench.tables import FAILED, MET, MISSED, Table, Tell
from tests.bench.yosys import SynthesisError
from tests.hdl.ghdl import GhdlError, Library, core_files

CHANNELS = (8, 32, 256)
# MHz, by the number of channels.
BARS = {32: 100.0, 256: 80.0}
MANAGER_WIDTH = 8

_SCHEDULERS_TITLE = "Schedulers, MHz"
_MANAGER_TITLE = f"Manager without scheduler, {MANAGER_WIDTH} bits, MHz"
_LOOP_TITLE = f"Manager with its scheduler, {MANAGER_WIDTH} bits, MHz"
_COLUMNS = ("design", *(f"N = {channels}" for channels in CHANNELS), "bar", "result")
_BAR = ", ".join(f"{bar:.0f} at {channels}" for channels, bar in BARS.items())

# The simplest one has no more than the loop itself.
_POLICIES_IN_LOOP = ("fixed_priority",)
_LOOP_ENTITY = "manager_loop"

Make = Callable[[Path, int], Subject]


@dataclass(frozen=True)
class Row:
    """A placed subject; `make` analyses it in an empty folder, for a number of channels."""

    label: str
    make: Make


def rows() -> dict[str, list[Row]]:
    """All rows by the title of their table."""
    return {
        _SCHEDULERS_TITLE: [*_schedulers()],
        _MANAGER_TITLE: [Row("firm_manager", _manager)],
        _LOOP_TITLE: [Row(policy, _loop(policy)) for policy in _POLICIES_IN_LOOP],
    }


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {title: [(row.label,) for row in found] for title, found in rows().items()}


def measure(nextpnr: Nextpnr, tell: Tell) -> list[Table]:
    """Place everything; `tell` hears of each design."""
    table_rows = rows()
    wanted = [(row, channels) for found in table_rows.values() for row in found for channels in CHANNELS]

    def outcome(one: tuple[Row, int]) -> float | str:
        row, channels = one
        found = _outcome(row, channels, nextpnr)
        tell(f"{row.label}, N = {channels}: {found if isinstance(found, str) else f'{found:.1f} MHz'}")
        return found

    nextpnr.prepare()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        outcomes = list(pool.map(outcome, wanted))
    found = {(id(row), channels): fmax for (row, channels), fmax in zip(wanted, outcomes, strict=True)}
    return [
        Table(title, _COLUMNS, tuple(_cells(row, [found[id(row), each] for each in CHANNELS]) for row in of_table))
        for title, of_table in table_rows.items()
    ]


def _outcome(row: Row, channels: int, nextpnr: Nextpnr) -> float | str:
    """Return MHz, or the error."""
    with tempfile.TemporaryDirectory() as name:
        try:
            subject = row.make(Path(name), channels)
            netlist = subject.library.synthesise(subject.entity, subject.generics, "verilog")
            return nextpnr.fmax(netlist, subject.entity)
        except (GhdlError, SynthesisError) as error:
            return f"{FAILED}: {error}"


def _cells(row: Row, found: list[float | str]) -> tuple[str, ...]:
    figures = [FAILED if isinstance(fmax, str) else f"{fmax:.0f}" for fmax in found]
    if FAILED in figures:
        return (row.label, *figures, _BAR, FAILED)
    fmax_of = dict(zip(CHANNELS, found, strict=True))
    is_met = all(float(fmax_of[channels]) >= bar for channels, bar in BARS.items())
    return (row.label, *figures, _BAR, MET if is_met else MISSED)


def _schedulers() -> Iterator[Row]:
    for policy in POLICIES:
        yield Row(policy, _scheduler(policy))


def _scheduler(policy: str) -> Make:
    return lambda folder, channels: Subject(*schedulers.analysed(folder, policy, channels))


def _manager(folder: Path, channels: int) -> Subject:
    library = Library("firm", folder)
    library.analyse(core_files("axis/package", "axis/axis", "manager/manager"))
    generics = {"WIDTH": MANAGER_WIDTH, "SUBSCRIBERS": channels, "PUBLISHERS": channels}
    return Subject(library, "firm_manager", generics)


def _loop(policy: str) -> Make:
    def make(folder: Path, channels: int) -> Subject:
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
        return Subject(library, _LOOP_ENTITY, {"WIDTH": MANAGER_WIDTH, "CHANNELS": channels})

    return make
