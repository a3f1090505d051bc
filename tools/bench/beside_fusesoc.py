"""Time of builds beside plain `fusesoc run`: the launcher on a small simulation, and libraries that are not ours."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import REPOSITORY
from tests.house.test_random_edits import FOREIGN, Library, open_logic, serv
from tests.processes import program
from tools.bench.systems import processor_time
from tools.bench.tables import FAILED, MET, MISSED, Tell

LAUNCHER_TITLE = "The launcher on a small simulation"
LAUNCHER_COLUMNS = ("what", "runs", "without, s", "launcher, s", "difference, s", "bar, s", "result")
LAUNCHER_KEY = ("GHDL, one entity", "5")
LAUNCHER_NOTE = """
    Processor time of `fusesoc run --clean` for a target with `robot:firm:firm_launcher`, and of the same target with an
    empty EDALIZE_LAUNCHER, in alternation; the fastest of the runs. GHDL was started before by the same user.
    """
_LAUNCHER_BAR = 0.1
_LAUNCHER_CORE = """\
CAPI=2:
name: bench:launcher:small:1.0
filesets:
  base: {files: [small.vhd: {file_type: vhdlSource-93}], depend: ["robot:firm:firm_launcher"]}
targets:
  sim: {filesets: [base], toplevel: small, flow: sim, flow_options: {tool: ghdl}}
"""
_SMALL = "entity small is\nend entity;\narchitecture a of small is\nbegin\nend architecture;\n"

FOREIGN_TITLE = "Libraries that are not ours"
FOREIGN_COLUMNS = ("what", "by", "builds", "steps run", "processor, s", "of FuseSoC", "bar", "result")
LIBRARIES: Mapping[str, Callable[[Path], Library]] = {
    "SERV: lint, test bench": serv,
    "open-logic: 13 entities": open_logic,
}
_FUSESOC, _FIRST, _UNCHANGED = "fusesoc run --build", "firm build --cached", "unchanged"
FOREIGN_NOTE = f"""
    The targets are set up and built in a new build root, by `fusesoc run` one after another. In the first run of
    `firm build --cached`, all steps are observed with `strace` and stored. An unchanged command must take at most 5 %
    of FuseSoC's time and run no step. {FOREIGN} names a folder with clones of the libraries, `serv` and `open-logic`;
    without it, the rows are those of the last measurement.
    """
_FOREIGN_BAR = 0.05


BENCH_TITLE = "A test bench that is not ours"
BENCH_COLUMNS = ("what", "by", "steps run", "processor, s", "of FuseSoC", "bar", "result")
BENCH_NOTE = """
    SERV's system with `hello_uart` in Verilator, 100 ms of simulated time: built and simulated by `fusesoc run`, and by
    `firm test` with an empty store and again. All must print the same lines. The first run should take as long as
    FuseSoC's, within 10 %, the unchanged one at most 5 % of it.
    """
_BENCH = "SERV: hello_uart"
_BENCH_CORE, _BENCH_TARGET = "award-winning:serv:servant", "verilator_tb"
_BENCH_OPTIONS = ("--uart_baudrate=57600", "--firmware=serv/sw/hello_uart.hex", "--timeout=100000000")
_BENCH_PRINTS = "Hi, I'm Servant!"
_TESTED = "firm test"
_FIRM_TEST = (program("firm"), "test")
_FIRST_BAR = 1.1


def bench_keys() -> list[tuple[str, str]]:
    """The first cells of the rows of the test bench."""
    return [(_BENCH, by) for by in ("fusesoc run", _TESTED, _UNCHANGED)]


def bench_rows(tell: Tell) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Return the rows of SERV's test bench by their keys; nothing, and a line, if no folder of clones is named."""
    if FOREIGN not in os.environ:
        tell(f"{BENCH_TITLE}: {FOREIGN} does not name a folder with clones of SERV and open-logic")
        return {}
    with tempfile.TemporaryDirectory() as place:
        folder = serv(Path(place)).folder
        arguments = ["run", "--build-root", "plain", f"--target={_BENCH_TARGET}", _BENCH_CORE, *_BENCH_OPTIONS]
        plain = min(run_fusesoc(folder, [*arguments[:1], "--clean", *arguments[1:]], "") for _ in range(2))
        first, ran = _tested(folder)
        unchanged, ran_again = _tested(folder)
        (log,) = (folder / "build").glob(f"*/{_BENCH_TARGET}.log")
        is_same = _BENCH_PRINTS in log.read_text(encoding="utf-8")
    results = [
        FAILED if not is_same else MET if is_met else MISSED
        for is_met in (first <= _FIRST_BAR * plain, unchanged <= _FOREIGN_BAR * plain and not ran_again)
    ]
    keys = bench_keys()
    rows = [
        (*keys[0], "", f"{plain:.1f}", "", "", ""),
        (*keys[1], str(ran), f"{first:.1f}", f"{first / plain:.2f}", f"{_FIRST_BAR:g}", results[0]),
        (*keys[2], str(ran_again), f"{unchanged:.1f}", f"{unchanged / plain:.3f}", f"{_FOREIGN_BAR:g}", results[1]),
    ]
    for row in rows:
        tell(" ".join(row))
    return {row[:2]: row for row in rows}


def _tested(folder: Path) -> tuple[float, int]:
    """Run the test bench with `firm test`; return the processor time in seconds and the number of steps that ran."""
    variables = {
        "PYTHONPATH": str(REPOSITORY),
        "FUSESOC_FIRM_CACHE": str(folder / "store"),
        "FUSESOC_FIRM_ACTIONS_TWICE": "0",
    }
    options = [f"--backend={option}" for option in _BENCH_OPTIONS]
    before = processor_time()
    subprocess.run(
        [*_FIRM_TEST, f"{_BENCH_CORE}@{_BENCH_TARGET}", "--events", "events", *options],
        cwd=folder,
        env={**os.environ, **variables},
        check=True,
        capture_output=True,
        text=True,
    )
    seconds = processor_time() - before
    lines = [json.loads(line) for line in (folder / "events").read_text(encoding="utf-8").splitlines()]
    steps = [step for line in lines if line["event"] == "end" for step in line["steps"]]
    return seconds, sum(step["state"] != "cached" for step in steps)


def foreign_keys() -> list[tuple[str, str]]:
    """The first cells of the rows of libraries."""
    return [(name, by) for name in LIBRARIES for by in (_FUSESOC, _FIRST, _UNCHANGED)]


def launcher_cells(tell: Tell) -> tuple[str, ...]:
    """Return the figures of the launcher after the cells of `LAUNCHER_KEY`."""
    times: dict[str | None, list[float]] = {"": [], None: []}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "fusesoc.conf").write_text(
            f"[library.firm]\nlocation = {library_root()}\n[library.own]\nlocation = .\n"
        )
        (folder / "small.core").write_text(_LAUNCHER_CORE)
        (folder / "small.vhd").write_text(_SMALL)
        command = ["run", "--clean", "--target=sim", "bench:launcher:small"]
        run_fusesoc(folder, command, None)
        for _ in range(int(LAUNCHER_KEY[1])):
            for launcher, seconds in times.items():
                seconds.append(run_fusesoc(folder, command, launcher))
    without, with_it = (min(seconds) for seconds in times.values())
    result = MET if with_it - without <= _LAUNCHER_BAR else MISSED
    figures = (f"{without:.2f}", f"{with_it:.2f}", f"{with_it - without:.2f}", f"{_LAUNCHER_BAR:g}", result)
    tell(" ".join((*LAUNCHER_KEY, *figures)))
    return figures


def foreign_rows(tell: Tell) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Return the rows of the libraries by their keys; nothing, and a line, if no folder of clones is named."""
    if FOREIGN not in os.environ:
        tell(f"{FOREIGN_TITLE}: {FOREIGN} does not name a folder with clones of SERV and open-logic")
        return {}
    rows: dict[tuple[str, ...], tuple[str, ...]] = {}
    for name, make in LIBRARIES.items():
        with tempfile.TemporaryDirectory() as place:
            for row in _library_rows(name, make(Path(place))):
                tell(" ".join(row))
                rows[row[:2]] = row
    return rows


def _library_rows(name: str, library: Library) -> list[tuple[str, ...]]:
    before = processor_time()
    states = library.run()
    first = processor_time() - before
    outputs = library.outputs()
    before = processor_time()
    again = library.run()
    unchanged = processor_time() - before
    plain = sum(
        run_fusesoc(library.folder, ["run", "--build-root", "plain", "--build", f"--target={target}", core], "")
        for core, target in (build.split(" ") for build in states)
    )
    count, ran = str(len(states)), [sum(step != "cached" for step in steps) for steps in states.values()]
    ran_again = sum(step != "cached" for steps in again.values() for step in steps)
    is_same = library.outputs() == outputs and library.outputs("plain").keys() == outputs.keys()
    is_met = unchanged <= _FOREIGN_BAR * plain and not ran_again
    result = FAILED if not is_same else MET if is_met else MISSED
    return [
        (name, _FUSESOC, count, "", f"{plain:.1f}", "", "", ""),
        (name, _FIRST, count, str(sum(ran)), f"{first:.1f}", f"{first / plain:.2f}", "", ""),
        (name, _UNCHANGED, count, str(ran_again), f"{unchanged:.1f}", f"{unchanged / plain:.3f}", "0.05", result),
    ]


def run_fusesoc(folder: Path, arguments: Sequence[str], launcher: str | None) -> float:
    """Run FuseSoC with a launcher (None: the core's own); return the processor time in seconds."""
    variables = {"PYTHONPATH": str(REPOSITORY), "FUSESOC_FIRM_CACHE": str(folder / "store")}
    kept = {name: value for name, value in os.environ.items() if name != "EDALIZE_LAUNCHER"}
    if launcher is not None:
        variables["EDALIZE_LAUNCHER"] = launcher
    before = processor_time()
    subprocess.run(
        [program("fusesoc"), *arguments],
        cwd=folder,
        env={**kept, **variables},
        check=True,
        capture_output=True,
        text=True,
    )
    return processor_time() - before
