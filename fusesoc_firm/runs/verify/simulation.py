"""Simulate the loop of a message in GHDL: send frames, compare the responses, and return a verdict."""

from __future__ import annotations

import atexit
import re
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fusesoc_firm.core.core_reader import read_core
from fusesoc_firm.runs.simulation.host_files import hex_lines
from fusesoc_firm.runs.verify.loop import ENTITY
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools.library_path import library_root

STIMULUS_FILE, EXPECTED_FILE, OUTPUT_FILE = "stimulus.txt", "expected.txt", "output.txt"
STALL_PERCENT = 30
# In seconds. The host gives up on hanging hardware much earlier, so this limit only stops a simulation without
# progress.
TIMEOUT = 300

# The cores of the bench in the order of their dependencies.
_CORES = (
    "axis/package",
    "axis/axis",
    "sched/package",
    "sched/fixed_priority",
    "manager/manager",
    "sim/checker",
    "sim/host",
    "sim/parts",
)
_OPTIONS = ("--std=93",)
_CYCLES = re.compile(r"^\d+ frames in, \d+ frames out, (\d+) cycles", re.MULTILINE)
_REPORT = re.compile(r"^[^ ]*:@\d+[a-z]+:\(([a-z ]+)\): ")
_DETAIL_LINES = 3
# The threads of a Dask worker share the library.
_lock = threading.Lock()


@dataclass(frozen=True)
class Outcome:
    """The result of a simulation: `detail` describes the fault, and `output` is GHDL's whole output."""

    is_right: bool
    cycles: int
    detail: str
    output: str


def simulate(folder: Path, sources: Sequence[str], library: Path, seed: int, timeout: float = TIMEOUT) -> Outcome:
    """Compile the sources in `folder`, with the bench last and the cores in `library`; run the bench."""
    # One process compiles and runs everything in memory, which is twice as fast as separate steps.
    command = [ghdl(), "-c", *_OPTIONS, f"-P{library}", *sources, "-r", ENTITY]
    command += [f"-gSEED={seed}", f"-gSTALL_PERCENT={STALL_PERCENT}"]
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        output = error.output.decode(errors="replace") if isinstance(error.output, bytes) else error.output or ""
        return Outcome(False, 0, f"the simulation did not end within {timeout:g} s", output)
    cycles = _CYCLES.search(done.stdout)
    is_right = done.returncode == 0 and cycles is not None
    return Outcome(is_right, int(cycles[1]) if cycles else 0, "" if is_right else _detail(done.stdout), done.stdout)


def write_frames(folder: Path, stimuli: Sequence[bytes], answers: Sequence[bytes]) -> None:
    """Write the host's files (docs/reference/simulation-host.md): stimulus k causes only response k."""
    _write(folder / STIMULUS_FILE, ((f"> stimulus {number}", frame) for number, frame in enumerate(stimuli)))
    headed = ((f"< @{number} answer to stimulus {number}", frame) for number, frame in enumerate(answers))
    _write(folder / EXPECTED_FILE, headed)


def _write(path: Path, frames: Iterable[tuple[str, bytes]]) -> None:
    lines = [line for heading, frame in frames for line in (heading, *hex_lines(frame))]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


@cache
def ghdl() -> str:
    """Return the path of GHDL. Raise `InputError` if it is not installed."""
    path = shutil.which("ghdl")
    if path is None:
        fail("GHDL is not installed, but messages are verified in simulation", hint="apt-get install ghdl-mcode")
    return path


def ghdl_version() -> str:
    """Return the first line that `ghdl --version` prints."""
    return subprocess.run([ghdl(), "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]


def firm_library() -> Path:
    """Return a folder with the library `firm` of the bench's cores, analysed once per process and deleted at exit."""
    with _lock:
        return _analysed_library()


def core_files(root: Path | None = None) -> Iterator[Path]:
    """Yield the sources of the bench's cores."""
    for core in _CORES:
        description = (root or library_root()) / "cores" / f"{core}.core"
        for name in read_core(description).section("filesets")["rtl"]["files"]:
            yield description.parent / name


@cache
def _analysed_library() -> Path:
    folder = tempfile.mkdtemp(prefix="firm_verify_")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    files = [str(path) for path in core_files()]
    subprocess.run([ghdl(), "-a", *_OPTIONS, "--work=firm", f"--workdir={folder}", *files], check=True)
    return Path(folder)


def _detail(output: str) -> str:
    """Return the first lines that report a fault of the host, of an assertion or of the compiler."""
    lines = output.splitlines()
    faults = [line.partition(": ")[2] for line in lines if line.startswith("fault in cycle")]
    faults += [_REPORT.sub("", line) for line in lines if "(assertion failure)" in line and "FAIL" not in line]
    faults = (
        faults or [line for line in lines if "error" in line] or lines[:1] or ["GHDL ended without an error message"]
    )
    return "; ".join(faults[:_DETAIL_LINES])
