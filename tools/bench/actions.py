"""Time of `firm test` and `firm build --cached` if nothing has changed, on one machine and on a second one.

Also the cost of a sandbox for steps that run, and times beside plain `fusesoc run`.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.tree import tree_of
from fusesoc_firm.builds.store.server import Server
from fusesoc_firm.builds.store.store import Store
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.tools.library_path import demos_root, library_root
from fusesoc_firm.tools.manifest import FILE as MANIFEST
from tests.hdl.ghdl import REPOSITORY
from tests.processes import program
from tools.bench import beside_fusesoc as beside
from tools.bench import robustness
from tools.bench.store import APPLICATIONS
from tools.bench.systems import processor_time
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

TITLE = "Unchanged steps of builds"
CONVERTERS = 30

_COLUMNS = ("what", "state", "builds", "steps run", "wall, s", "processor, s", "bar, s", "result")
_NOTE = f"""
    The lint of {CONVERTERS} cores, each with one converter, is `firm build --cached`: GHDL's netlist and Verilator's
    lint. The simulations of the seven applications with GHDL, Icarus Verilog and Verilator are `firm test`. A second
    machine has an empty store and no builds, and reads the remote store to which the first run wrote, over HTTP on
    the same machine. 'steps run' counts the steps that were not cached. Times include the start of Python. The bar
    applies to the processor time of all processes, which is at least the wall-clock time on an idle machine.
    """
SANDBOX_TITLE = "Steps in a sandbox"
SANDBOXED = "lint of 4 converters"
SANDBOX_BAR = 1.3
_SANDBOX_COLUMNS = (
    *("what", "runs", "plain, s", "sandboxed, s", "ratio", "files", "other than FuseSoC's", "bar", "result"),
)
_SANDBOX_RUNS = 3
_SANDBOX_KEY = (SANDBOXED, str(_SANDBOX_RUNS))
_SANDBOX_NOTE = """
    The steps of `firm build --rerun` with `--cached` and with `--sandbox`; both are observed with `strace`. Times are
    those of the fastest of the runs, which alternate, since other load can only increase them. The outputs of all runs
    are compared with each other, and with those of `fusesoc run --build` in the same folder, byte for byte, apart from
    time stamps and from manifest.json, which plain FuseSoC does not write.
    """
_TOKEN = "bench"
_FIRST, _UNCHANGED, _REMOVED, _SECOND = "first run", "unchanged", "builds removed", "second machine"


@dataclass(frozen=True)
class Job:
    """A command, and the seconds that it may take in each state after the first run."""

    name: str
    command: tuple[str, ...]
    bars: Mapping[str, float]

    @property
    def states(self) -> tuple[str, ...]:
        """The states in which the command runs, one after the other."""
        return (_FIRST, *self.bars)


JOBS = (
    Job(
        f"lint of {CONVERTERS} converters",
        ("build", "bench:lint:*@lint", "--cached", "--build-only"),
        {_UNCHANGED: 2.5},
    ),
    Job(
        "simulations of the applications",
        ("test", *(f"robot:sys:{name}" for name in APPLICATIONS)),
        {_UNCHANGED: 5, _REMOVED: 10, _SECOND: 60},
    ),
)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {
        TITLE: [(job.name, state) for job in JOBS for state in job.states],
        SANDBOX_TITLE: [_SANDBOX_KEY],
        beside.LAUNCHER_TITLE: [beside.LAUNCHER_KEY],
        beside.FOREIGN_TITLE: [*beside.foreign_keys()],
        beside.BENCH_TITLE: [*beside.bench_keys()],
        robustness.TITLE: [*robustness.row_keys()],
    }


def measure(tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Run the jobs whose names match; the rows of the others are those of the written page."""
    known = known_rows(written, TITLE, _COLUMNS)
    rows: list[tuple[str, ...]] = []
    for job in JOBS:
        if not re.search(pattern, job.name):
            missing = ("", "", "", "", "", NOT_MEASURED)
            rows += [known.get((job.name, state), (job.name, state, *missing)) for state in job.states]
            continue
        with tempfile.TemporaryDirectory() as place:
            for row in _rows(job, Path(place), tell):
                tell(" ".join(row))
                rows.append(row)
    tables = [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]
    sandbox = known_rows(written, SANDBOX_TITLE, _SANDBOX_COLUMNS)
    if re.search(pattern, SANDBOX_TITLE):
        with tempfile.TemporaryDirectory() as place:
            sandbox[_SANDBOX_KEY] = (*_SANDBOX_KEY, *_sandbox_cells(Path(place), tell))
    row = sandbox.get(_SANDBOX_KEY, (*_SANDBOX_KEY, *[""] * 6, NOT_MEASURED))
    tables.append(Table(SANDBOX_TITLE, _SANDBOX_COLUMNS, (row,), _SANDBOX_NOTE))
    return [
        *tables,
        _launcher_table(tell, written, pattern),
        _foreign_table(tell, written, pattern),
        _bench_table(tell, written, pattern),
        _robustness_table(tell, written, pattern),
    ]


def _launcher_table(tell: Tell, written: str, pattern: str) -> Table:
    title, columns, key = beside.LAUNCHER_TITLE, beside.LAUNCHER_COLUMNS, beside.LAUNCHER_KEY
    known = known_rows(written, title, columns)
    if re.search(pattern, title):
        known[key] = (*key, *beside.launcher_cells(tell))
    return Table(title, columns, (known.get(key, (*key, *[""] * 4, NOT_MEASURED)),), beside.LAUNCHER_NOTE)


def _foreign_table(tell: Tell, written: str, pattern: str) -> Table:
    empty = ("", "", "", "", "")
    parts = (beside.FOREIGN_TITLE, beside.FOREIGN_COLUMNS, beside.FOREIGN_NOTE)
    return _optional_table(parts, beside.foreign_keys(), empty, beside.foreign_rows, tell, written, pattern)


def _bench_table(tell: Tell, written: str, pattern: str) -> Table:
    empty = ("", "", "", "")
    parts = (beside.BENCH_TITLE, beside.BENCH_COLUMNS, beside.BENCH_NOTE)
    return _optional_table(parts, beside.bench_keys(), empty, beside.bench_rows, tell, written, pattern)


def _optional_table(
    parts: tuple[str, tuple[str, ...], str],
    keys: Sequence[tuple[str, str]],
    empty: tuple[str, ...],
    measured: Callable[[Tell], dict[tuple[str, ...], tuple[str, ...]]],
    tell: Tell,
    written: str,
    pattern: str,
) -> Table:
    """Return a table whose rows are measured if its title matches; the others are those of the written page."""
    title, columns, note = parts
    known = known_rows(written, title, columns)
    if re.search(pattern, title):
        known |= measured(tell)
    return Table(title, columns, tuple(known.get(key, (*key, *empty, NOT_MEASURED)) for key in keys), note)


def _robustness_table(tell: Tell, written: str, pattern: str) -> Table:
    title, columns = robustness.TITLE, robustness.COLUMNS
    known = known_rows(written, title, columns) | robustness.rows(tell, pattern)
    rows = tuple(known.get(key, (*key, "", "", NOT_MEASURED)) for key in robustness.row_keys())
    return Table(title, columns, rows, robustness.NOTE)


def _sandbox_cells(folder: Path, tell: Tell) -> tuple[str, ...]:
    """Return the figures of the sandbox: its cost for steps that run, and whether outputs differ."""
    _write_project(folder)
    command = ("build", "bench:lint:c[0-3]@lint", "--build-only", "--rerun")
    times: dict[str, list[float]] = {"--cached": [], "--sandbox": []}
    outputs = []
    for _ in range(_SANDBOX_RUNS):
        for option, seconds in times.items():
            try:
                seconds.append(run((*command, option), folder, "first", "", "").wall)
            except subprocess.CalledProcessError as error:
                tell(f"{SANDBOXED}, {option}: {error.stdout}{error.stderr}")
                return ("", "", "", "", "", f"{SANDBOX_BAR:g}", FAILED)
            outputs.append(_outputs(folder))
    plain, sandboxed = map(min, times.values())
    of_fusesoc = _outputs_of_fusesoc(folder, ["c0", "c1", "c2", "c3"])
    differing = sum(of_fusesoc.get(path) != key for path, key in outputs[0].items())
    is_met = sandboxed <= SANDBOX_BAR * plain
    is_same = all(found == outputs[0] for found in outputs) and of_fusesoc == outputs[0]
    result = FAILED if not is_same else MET if is_met else MISSED
    figures = (f"{plain:.1f}", f"{sandboxed:.1f}", f"{sandboxed / plain:.2f}", str(len(outputs[0])), str(differing))
    tell(" ".join((SANDBOXED, *figures, result)))
    return (*figures, f"{SANDBOX_BAR:g}", result)


def _outputs(folder: Path) -> dict[str, list[str]]:
    """Return the files of all builds' folders, by identities that leave out times."""
    return {
        f"{place.relative_to(folder)}/{path}": item.key
        for place in sorted((folder / "build").glob("*/*/"))
        for path, item in tree_of(place, Contents()).items()
        if path != MANIFEST
    }


def _outputs_of_fusesoc(folder: Path, cores: Sequence[str]) -> dict[str, list[str]]:
    """Build cores with plain FuseSoC in the same folder, and return its files."""
    shutil.rmtree(folder / "build")
    options = ("--build-root", "build", "--build", "--target=lint")
    for core in cores:
        beside.run_fusesoc(folder, ["run", *options, f"bench:lint:{core}"], "")
    return _outputs(folder)


def _rows(job: Job, folder: Path, tell: Tell) -> Iterator[tuple[str, ...]]:
    _write_project(folder)
    with _served(folder / "served") as url:
        for state in job.states:
            if state in (_REMOVED, _SECOND):
                shutil.rmtree(folder / "build")
            machine = "second" if state == _SECOND else "first"
            token = _TOKEN if state == _FIRST else ""
            bar = job.bars.get(state)
            try:
                found = run(job.command, folder, machine, url, token)
            except subprocess.CalledProcessError as error:
                tell(f"{job.name}, {state}: {error.stdout}{error.stderr}")
                yield (job.name, state, "", "", "", "", f"{bar or ''}", FAILED)
                return
            is_met = not bar or (found.processor <= bar and not found.steps)
            yield (
                *(job.name, state, str(found.builds), str(found.steps), f"{found.wall:.1f}", f"{found.processor:.1f}"),
                *(("", "") if bar is None else (f"{bar:g}", MET if is_met else MISSED)),
            )


@dataclass(frozen=True)
class Run:
    """The numbers of builds and of steps that ran, and the seconds of the wall clock and of the processors."""

    builds: int
    steps: int
    wall: float
    processor: float


def run(command: Sequence[str], folder: Path, machine: str, url: str, token: str) -> Run:
    """Run a command of `firm` in a project, with the store of a machine. Raises `CalledProcessError`."""
    variables = {
        "PYTHONPATH": str(REPOSITORY),
        "FUSESOC_FIRM_CACHE": str(folder / "stores" / machine),
        "FUSESOC_FIRM_ACTIONS_TWICE": "0",
        "FUSESOC_FIRM_REMOTE": url,
        "FUSESOC_FIRM_REMOTE_TOKEN": token,
    }
    events = folder / "events"
    before, start = processor_time(), time.monotonic()
    subprocess.run(
        [program("firm"), *command, "--events", str(events)],
        cwd=folder,
        env={**os.environ, **variables},
        check=True,
        capture_output=True,
        text=True,
    )
    wall, processor = time.monotonic() - start, processor_time() - before
    ends = [line for text in events.read_text().splitlines() if (line := json.loads(text))["event"] == "end"]
    steps = sum(step["state"] != "cached" for line in ends for step in line["steps"])
    return Run(len(ends), steps, wall, processor)


def _write_project(folder: Path) -> None:
    """Write a project with our libraries and a core for each of the first converters."""
    libraries = {"firm": library_root(), "demos": demos_root(), "bench": "library"}
    places = "".join(f"[library.{name}]\nlocation = {place}\n" for name, place in libraries.items())
    (folder / "fusesoc.conf").write_text(f"[main]\nignored_dirs = build\n{places}")
    (folder / "library").mkdir()
    for number, name in enumerate([*MessageLibrary(ROS2).names()][:CONVERTERS]):
        top = f"axis_to_{str(name).replace('/', '_').lower()}"
        parameters = f"{{message: {name}, ros: 2, direction: subscriber, width: 32, name: c{number}}}"
        lines = (
            "CAPI=2:",
            f"name: bench:lint:c{number}:1.0",
            'filesets: {base: {depend: ["robot:firm:generators"]}}',
            f"generate: {{one: {{generator: firm, parameters: {parameters}}}}}",
            "targets:",
            f"  lint: {{filesets: [base], generate: [one], toplevel: c{number}_{top}, flow: lint, flow_options:",
            "    {tool: verilator, frontends: [ghdlsynth], ghdlsynth_refuse_loops: true}}",
            "",
        )
        (folder / "library" / f"c{number}.core").write_text("\n".join(lines))


@contextmanager
def _served(folder: Path) -> Iterator[str]:
    """Serve a remote store within this context, and yield its URL."""
    with Server(Store(folder, 2**33), "127.0.0.1", 0, _TOKEN) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.url
        finally:
            server.shutdown()
            thread.join()
