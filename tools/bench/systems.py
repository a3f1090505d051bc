"""Time that a large system takes: `firm check`, and FuseSoC's call of the generator `far`."""

from __future__ import annotations

import os
import random
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.scaffold.skeleton import missing_sources
from fusesoc_firm.system.system_core import load_system
from tests.hdl.ghdl import REPOSITORY
from tests.random_systems import random_system
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

TITLE = "A system of 60 blocks and 40 messages"
BLOCKS, MESSAGES = 60, 40
RUNS = 5

_COLUMNS = ("what", "wall, s", "processor, s", "bar, s", "result")
_NOTE = f"""
    Times are medians of {RUNS} runs, each in a new process, including the start of Python. The system is random
    (tests/random_systems.py); its messages are included in rosbags, and its accelerators are skeletons. 'cold' starts
    with an empty store; 'from the store' repeats the call. The bar applies to the processor time, which equals the
    wall-clock time of one thread on an idle machine.
    """


@dataclass(frozen=True)
class Job:
    """Something to run in a folder, and how long it may take."""

    name: str
    bar: float | None
    command: Callable[[Path], Sequence[str]]
    is_cold: bool = False


def _check(folder: Path) -> Sequence[str]:
    return ["-m", "fusesoc_firm.cli", "system", "check", str(folder / "spec.yaml")]


def _generate(folder: Path) -> Sequence[str]:
    return [str(REPOSITORY / "generators" / "far_generator.py"), str(folder / "call.yml")]


JOBS = (
    Job("firm check", 2.0, _check),
    Job("generation, cold", 5.0, _generate, is_cold=True),
    Job("generation, from the store", None, _generate),
)


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(job.name,) for job in JOBS]}


def measure(seed: int, tell: Tell) -> list[Table]:
    """Run all; `tell` hears of each."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_system(folder, seed)
        for job in JOBS:
            row = _row(job, folder, tell)
            tell(" ".join(row))
            rows.append(row)
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def write_system(folder: Path, seed: int) -> None:
    """The specification, its accelerators' sources and FuseSoC's call for it."""
    (folder / "spec.yaml").write_text(random_system(random.Random(seed), BLOCKS, MESSAGES).text, encoding="utf-8")
    libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
    system = load_system(folder / "spec.yaml", libraries, needs_sources=False).system
    for path, text in missing_sources(system, folder).items():
        path.write_text(text, encoding="utf-8")
    call = {"vlnv": "::bench-system:0", "files_root": str(folder), "parameters": {"spec": "spec.yaml"}}
    (folder / "call.yml").write_text(yaml.safe_dump(call), encoding="utf-8")


def _row(job: Job, folder: Path, tell: Tell) -> tuple[str, ...]:
    bar = "" if job.bar is None else f"{job.bar:g}"
    try:
        runs = [run(job, folder) for _ in range(RUNS)]
    except subprocess.CalledProcessError as error:
        tell(f"{job.name}: {error.stderr}")
        return (job.name, "", "", bar, FAILED)
    wall, processor = (statistics.median(times) for times in zip(*runs, strict=True))
    result = "" if job.bar is None else MET if processor <= job.bar else MISSED
    return (job.name, f"{wall:.2f}", f"{processor:.2f}", bar, result)


def run(job: Job, folder: Path) -> tuple[float, float]:
    """Seconds of the wall clock and of the processor; raises `CalledProcessError`."""
    with tempfile.TemporaryDirectory() as place:
        store = Path(place, "store") if job.is_cold else folder / "store"
        environment = {**os.environ, "FUSESOC_FIRM_CACHE": str(store), "PYTHONPATH": str(REPOSITORY)}
        before, start = processor_time(), time.monotonic()
        subprocess.run(
            [sys.executable, *job.command(folder)],
            cwd=place,
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
        return time.monotonic() - start, processor_time() - before


def processor_time() -> float:
    """Seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
