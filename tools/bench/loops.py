"""Combinational loops: of every message that is passed through, with each `pipeline`, and of random systems.

None is allowed. Our own search, Yosys and Verilator look for them.
"""

from __future__ import annotations

import os
import random
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.netlist.model import NetlistError
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from tests.converter.simulated.pass_through import PassThrough, systems_of_all
from tests.hdl.ghdl import core_files
from tests.hdl.loop_tools import found_by_others
from tests.hdl.verilog import loops, netlist
from tests.random_systems import random_system
from tests.system.simulated.systems import HARDWARE, generate_system
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

TITLE = "Combinational loops"
DISTRIBUTIONS, WIDTHS = ("noetic", "humble"), (8, 64)
RANDOM_SYSTEMS = 500
# How many random systems a row has at most.
_SYSTEMS_A_ROW = 100
BAR = 0

_COLUMNS = ("design", "bits", "number", "loops", "bar", "result")
_NOTE = """
    Each design is searched three times, and 'loops' counts what any of them found: by our own search, by Yosys' `scc`
    and by Verilator's UNOPTFLAT. Each message of a distribution has a subscriber that is connected to a publisher, with
    each [`pipeline`](../reference/variable-converters.md#register-stages). Random systems have widths and pipelines of
    their own, and first versions of accelerators, in which an input's ready depends on the outputs'.
    """
# A random system has so many blocks at least and at most.
_FEWEST, _MOST = 3, 12
_FIRST_SYSTEMS = range(0, RANDOM_SYSTEMS, _SYSTEMS_A_ROW)

# Searches a system's files in an empty folder; returns a sentence for each loop.
Search = Callable[[Sequence[Path], Path], list[str]]


@dataclass(frozen=True)
class Row:
    """Designs that are searched: each part returns a sentence for each of its loops, and works in an empty folder."""

    label: str
    width: str
    number: int
    parts: Sequence[Callable[[Path], list[str]]]

    @property
    def key(self) -> tuple[str, ...]:
        """The cells that tell it from other rows."""
        return (self.label, self.width)

    @property
    def name(self) -> str:
        """How a user names it."""
        return ", ".join(filter(None, (self.label, self.width and f"{self.width} bits")))


def rows(seed: int, random_systems: int = RANDOM_SYSTEMS) -> Iterator[Row]:
    """All rows; random systems are drawn by `seed`."""
    for distribution in DISTRIBUTIONS:
        systems = systems_of_all(distribution, 0, seed)
        number = sum(len(system.names) for system in systems)
        for pipeline, width in product(PIPELINES, WIDTHS):
            parts = [_passed(distribution, system.names, width, pipeline) for system in systems]
            yield Row(_label(distribution, pipeline), str(width), number, parts)
    for first in range(0, random_systems, _SYSTEMS_A_ROW):
        number = min(_SYSTEMS_A_ROW, random_systems - first)
        yield Row(_random_label(first), "", number, [_random(seed + first + place) for place in range(number)])


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    messages = product(DISTRIBUTIONS, PIPELINES, WIDTHS)
    rows_of_messages = [(_label(distribution, pipeline), str(width)) for distribution, pipeline, width in messages]
    return {TITLE: [*rows_of_messages, *((_random_label(first), "") for first in _FIRST_SYSTEMS)]}


def _label(distribution: str, pipeline: str) -> str:
    return f"messages of {distribution}, pipeline {pipeline}"


def _random_label(first: int) -> str:
    return f"random systems from number {first + 1}"


def measure(seed: int, tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Search the designs of rows whose names match the regular expression `pattern`; `tell` hears of each loop.

    The other rows are taken from the text `written` of docs/figures.
    """
    known = known_rows(written, TITLE, _COLUMNS)
    lines = []
    for row in rows(seed):
        if re.search(pattern, row.name):
            lines.append(_cells(row, tell))
        else:
            lines.append(known.get(row.key) or (*row.key, str(row.number), "", str(BAR), NOT_MEASURED))
    return [Table(TITLE, _COLUMNS, tuple(lines), _NOTE)]


def _cells(row: Row, tell: Tell) -> tuple[str, ...]:
    try:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = [sentence for part in pool.map(_searched, row.parts) for sentence in part]
    except NetlistError as error:
        tell(f"{row.name}: {error}")
        return (row.label, row.width, str(row.number), "", str(BAR), FAILED)
    for sentence in found:
        tell(f"{row.name}: {sentence}")
    tell(f"{row.name}: {len(found)} loops")
    return (row.label, row.width, str(row.number), str(len(found)), str(BAR), MET if len(found) <= BAR else MISSED)


def _searched(part: Callable[[Path], list[str]]) -> list[str]:
    with tempfile.TemporaryDirectory() as name:
        return part(Path(name))


def _passed(distribution: str, names: Sequence[str], width: int, pipeline: str) -> Callable[[Path], list[str]]:
    system = PassThrough(distribution, names, count=0, seed=0, width=width, pipeline=pipeline)
    return lambda folder: loops_of_messages(system, folder, _found_by_all)


def _random(seed: int) -> Callable[[Path], list[str]]:
    return lambda folder: loops_of_random_system(seed, folder, _found_by_all)


def found_by_us(work: Sequence[Path], folder: Path) -> list[str]:
    """The loops that our own search finds in a system; its top level is the last file."""
    found = loops(work[-1].stem, folder, work, core_files(*HARDWARE))
    return [sentence.replace(f"{folder}/", "") for sentence in found]


def _found_by_all(work: Sequence[Path], folder: Path) -> list[str]:
    top = work[-1].stem
    return [
        *found_by_us(work, folder),
        *found_by_others(top, netlist(top, folder, work, core_files(*HARDWARE))),
    ]


def loops_of_messages(system: PassThrough, folder: Path, search: Search = found_by_us) -> list[str]:
    """The loops of messages that are passed through."""
    return search(generate_system(system.specification(folder), folder / "system"), folder)


def loops_of_random_system(seed: int, folder: Path, search: Search = found_by_us) -> list[str]:
    """The loops of a random system, whose accelerators are first versions."""
    chance = random.Random(seed)
    blocks = chance.randint(_FEWEST, _MOST)
    specification = folder / "spec.yaml"
    specification.write_text(random_system(chance, blocks, max(2, blocks // 2)).text, encoding="utf-8")
    libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
    system = load_system(specification, libraries, needs_sources=False).system
    for path, text in missing_sources(system, folder).items():
        path.write_text(text, encoding="utf-8")
    return [f"seed {seed}: {sentence}" for sentence in search(generate_system(specification, folder / "core"), folder)]
