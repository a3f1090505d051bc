"""Time to generate 200 converters: `fusesoc run` for one core after another, and `firm build` on one and two cores."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY
from tests.processes import program
from tools.bench.systems import processor_time
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

TITLE = "200 converters, generated with an empty store"
CONVERTERS = 200
WIDTHS = (8, 32)
RUNS = 2
SPEED_UP = 1.7

_COLUMNS = ("converters", "by", "processors", "wall, s", "processor, s", "speed-up", "bar", "result")
_KEYS = 3
_NOTE = f"""
    The cores contain a subscriber and a publisher for each of {CONVERTERS // len(WIDTHS)} ROS 2 messages at
    {len(WIDTHS)} widths. The cores are set up for a tool in a new build root; times include the start of Python. The
    time of `firm build` is the time of the fastest of {RUNS} runs, since other load can only increase it. Runs on one
    and two processors alternate. `fusesoc run` is started for one core after another. All runs produce the same bytes.
    FuseSoC itself processes the generated cores of one core sequentially, so a single core gains less from a second
    processor.
    """


@dataclass(frozen=True)
class Layout:
    """How the converters are spread: so many cores, each with as many; the bar on two processors in seconds."""

    cores: int
    seconds: float
    has_speed_up: bool

    @property
    def name(self) -> str:
        each = CONVERTERS // self.cores
        return f"{self.cores} cores of {each}" if self.cores > 1 else f"a core of {each}"


LAYOUTS = (Layout(20, 5.0, has_speed_up=True), Layout(1, 10.0, has_speed_up=False))
_FLOW = "toplevel: x, flow: generic, flow_options: {tool: ghdl}"
_PLAIN, _FIRM = "fusesoc run", "firm build"


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [key for layout in LAYOUTS for key in _keys(layout)]}


def _keys(layout: Layout) -> list[tuple[str, ...]]:
    plain = [(layout.name, _PLAIN, "2")] if layout.has_speed_up else []
    return [*plain, *((layout.name, _FIRM, count) for count in ("1", "2"))]


def measure(tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Run the rows whose first two cells match; the others are those of the written page. `tell` hears of each."""
    found = known_rows(written, TITLE, _COLUMNS, _KEYS)
    for layout in LAYOUTS:
        with tempfile.TemporaryDirectory() as place:
            write_library(Path(place), layout.cores)
            for row in _rows(layout, Path(place), pattern):
                tell(" ".join(row))
                found[row[:_KEYS]] = row
    missing = [""] * (len(_COLUMNS) - _KEYS - 1)
    rows = (found.get(key, (*key, *missing, NOT_MEASURED)) for key in keys()[TITLE])
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def write_library(folder: Path, cores: int) -> None:
    """A library of so many cores, which have all the converters generated."""
    names = [str(name) for name in MessageLibrary(ROS2).names()][: CONVERTERS // len(WIDTHS)]
    wanted = [(name, width) for width in WIDTHS for name in names]
    (folder / "fusesoc.conf").write_text(
        f"[library.firm]\nlocation = {library_root()}\n[library.bench]\nlocation = library\n"
    )
    for core in range(cores):
        instances = {f"i{number}": item for number, item in enumerate(wanted[core::cores])}
        lines = [
            "CAPI=2:",
            f"name: bench:lib:c{core}:1.0",
            'filesets: {base: {depend: ["robot:firm:generators"]}}',
            "generate:",
            *(
                f"  {name}: {{generator: firm, parameters: {{name: {name}, ros: 2, message: {type_}, width: {bits}}}}}"
                for name, (type_, bits) in instances.items()
            ),
            "targets:",
            f"  default: {{filesets: [base], generate: [{', '.join(instances)}], {_FLOW}}}",
            "",
        ]
        path = folder / "library" / f"c{core}" / f"c{core}.core"
        path.parent.mkdir(parents=True)
        path.write_text("\n".join(lines))


def _rows(layout: Layout, folder: Path, pattern: str) -> list[tuple[str, ...]]:
    cores = [f"bench:lib:c{core}" for core in range(layout.cores)]
    fusesoc = [program("fusesoc"), "run", "--setup", "--target=default"]
    firm = [program("firm"), "build", "--setup", "--target", "default"]
    has_plain = layout.has_speed_up and re.search(pattern, f"{layout.name} {_PLAIN}")
    plain = run(fusesoc, [[core] for core in cores], folder, 2) if has_plain else None
    first: list[tuple[str, ...]] = [(layout.name, _PLAIN, "2", *plain.cells(), "", "", "")] if plain else []
    if not re.search(pattern, f"{layout.name} {_FIRM}"):
        return first
    turns = [(run(firm, [cores], folder, 1), run(firm, [cores], folder, 2)) for _ in range(RUNS)]
    one, two = (min(runs, key=lambda item: item.wall) for runs in zip(*turns, strict=True))
    speed_up = one.wall / two.wall
    bar = f"{layout.seconds:g} s, {SPEED_UP}" if layout.has_speed_up else f"{layout.seconds:g} s"
    is_met = two.wall <= layout.seconds and (speed_up >= SPEED_UP or not layout.has_speed_up)
    result = MET if is_met else MISSED
    expected = plain or one
    if any(item.files != expected.files for turn in turns for item in turn):
        result = FAILED
    return [
        *first,
        (layout.name, _FIRM, "1", *one.cells(), "", "", ""),
        (layout.name, _FIRM, "2", *two.cells(), f"{speed_up:.2f}", bar, result),
    ]


@dataclass(frozen=True)
class Run:
    """Seconds of the wall clock and of the processors, and the files that tools are given, by path."""

    wall: float
    processor: float
    files: dict[str, bytes]

    def cells(self) -> tuple[str, str]:
        """The figures in a row."""
        return f"{self.wall:.1f}", f"{self.processor:.1f}"


def run(command: list[str], starts: list[list[str]], folder: Path, processors: int) -> Run:
    """Start a command with these cores, then with those, with so many processors in all, and an empty store.

    Raises `CalledProcessError`.
    """
    available = sorted(os.sched_getaffinity(0))
    assert len(available) >= processors, f"this needs {processors} processors"
    with tempfile.TemporaryDirectory(dir=folder) as place:
        variables = {"PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(Path(place, "store"))}
        before, start = processor_time(), time.monotonic()
        for cores in starts:
            subprocess.run(
                [*command, "--build-root", str(Path(place, "build")), *cores],
                cwd=folder,
                env={**os.environ, **variables},
                check=True,
                capture_output=True,
                text=True,
                preexec_fn=lambda: os.sched_setaffinity(0, available[:processors]),
            )
        return Run(time.monotonic() - start, processor_time() - before, generated(Path(place)))


def generated(place: Path) -> dict[str, bytes]:
    """Return the inputs of tools, by path in the build root."""
    files = (place / "build").glob("*/default/src/bench_lib_*/*")
    return {str(path.relative_to(place)): path.read_bytes() for path in files}
