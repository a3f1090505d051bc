"""How fast simulators are: cycles a second of quat2euler's whole system, the same frames in all of them.

Time is the processor's, of a long run less that of a short one: what it takes to begin does not count. Unlike all other
figures these are of the machine; their relation to one another is not.
"""

from __future__ import annotations

import re
import resource
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.core.request import Request
from fusesoc_firm.tools.simulators import SIMULATORS
from tests.applications.applications import SPECS
from tests.hdl.verilog import compile_verilog, translated
from tests.system.simulated import systems
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

TITLE = "Cycles a second, quat2euler at 8 bits"
# Each with how often the specification's hundred messages are sent in the long run.
REPEATS = {"GHDL": 20, "Icarus Verilog": 20, "Verilator": 400}
LEAST_FACTOR = 20

_CORES = ("acc/cordic/cordic", "acc/float64/float64")
_COLUMNS = ("simulator", "cycles", "seconds", "cycles a second", "to GHDL", "bar", "result")
_NOTE = f"""
    Streams stall in 25 % of the cycles. Seconds are processor time minus the processor time of a run with a hundred
    messages. To pass, Verilator must be at least {LEAST_FACTOR} times as fast as GHDL.
    """
_CYCLES = re.compile(r"^(\d+) frames in, .* (\d+) cycles from the first beat in", re.MULTILINE)


@dataclass(frozen=True)
class Speed:
    """Cycles, and the seconds that a simulator took for them."""

    cycles: int
    seconds: float

    @property
    def rate(self) -> float:
        """Cycles a second."""
        return self.cycles / self.seconds


class SimulationError(Exception):
    """A simulation failed, or its frames were not the model's."""


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cell of every row, by table."""
    return {TITLE: [(simulator,) for simulator in REPEATS]}


def versions() -> list[str]:
    """The version of Icarus, which it writes on the standard error."""
    output = subprocess.run(["vvp", "-V"], capture_output=True, text=True, check=False)
    found = re.search(r"version (\S+)", output.stdout + output.stderr)
    return [f"Icarus Verilog {found[1]}"] if found else []


def measure(tell: Tell) -> list[Table]:
    """Run all simulators; `tell` hears of each."""
    builders: dict[str, Callable[[Path], list[str]]] = {
        "GHDL": _ghdl,
        "Icarus Verilog": _icarus,
        "Verilator": _verilator,
    }
    speeds: dict[str, Speed] = {}
    rows = []
    for simulator, repeats in REPEATS.items():
        try:
            with tempfile.TemporaryDirectory() as folder:
                speeds[simulator] = _speed(builders[simulator], Path(folder), repeats)
        except (SimulationError, subprocess.CalledProcessError) as error:
            tell(f"{simulator}: {error}")
            rows.append((simulator, *[""] * (len(_COLUMNS) - 2), FAILED))
            continue
        rows.append(_row(simulator, speeds))
        tell(f"{simulator}: {speeds[simulator].rate:,.0f} cycles a second")
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _row(simulator: str, speeds: dict[str, Speed]) -> tuple[str, ...]:
    speed = speeds[simulator]
    factor = speed.rate / speeds["GHDL"].rate if "GHDL" in speeds else 0
    bar = result = ""
    if simulator == "Verilator":
        bar, result = f">= {LEAST_FACTOR}", MET if factor >= LEAST_FACTOR else MISSED
    return (
        simulator,
        f"{speed.cycles:,}",
        f"{speed.seconds:.2f}",
        # Digits that another run repeats.
        f"{float(f'{speed.rate:.2g}'):,.0f}",
        f"{factor:.3g}",
        bar,
        result,
    )


def _speed(builder: Callable[[Path], list[str]], folder: Path, repeats: int) -> Speed:
    command = builder(folder)
    short = _run(command, folder, 1)
    long = _run(command, folder, repeats)
    return Speed(long.cycles - short.cycles, long.seconds - short.seconds)


def _run(command: list[str], folder: Path, repeats: int) -> Speed:
    """One run with the frames of the specification, so often one after the other."""
    place = folder / f"run_{repeats}"
    place.mkdir()
    for name in ("stimulus.txt", "expected.txt"):
        (place / name).write_text((folder / name).read_text() * repeats)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = _CYCLES.search(done.stdout)
    if done.returncode or not found or int(found[1]) != 100 * repeats:
        raise SimulationError(done.stdout + done.stderr)
    return Speed(int(found[2]), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def _ghdl(folder: Path) -> list[str]:
    built = systems.build(_request(), folder, *_CORES)
    built.work.make()
    options = ["--std=93", "--work=work", f"--workdir={folder}", f"-P{folder}"]
    return ["ghdl", "-r", *options, f"{built.entity}_tb", "-gSHOWN=0", "-gRECEIVED_FILE=/dev/null"]


def _icarus(folder: Path) -> list[str]:
    top, files = translated(_request(), folder, *_CORES)
    return ["vvp", "-n", str(compile_verilog(top, files, folder).make()), "+SHOWN=0", "+RECEIVED_FILE=/dev/null"]


def _verilator(folder: Path) -> list[str]:
    """Built with the options of the target sim_verilator."""
    options = SIMULATORS["verilator"].options
    top, files = translated(_request(), folder, *_CORES)
    words = [word for option in options["verilator_options"] for word in option.split()]
    command = ["verilator", "--cc", "--exe", *words, "--Mdir", str(folder), "--top-module", top, *map(str, files)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    make = ["make", "-s", "-C", str(folder), "-f", f"V{top}.mk", *options["make_options"]]
    subprocess.run(make, check=True, capture_output=True, text=True)
    return [str(folder / f"V{top}"), "+SHOWN=0", "+RECEIVED_FILE=/dev/null"]


def _request() -> Request:
    application = SPECS / "quat2euler"
    return systems.call(*(application / name for name in ("quat2euler.yaml", "stimuli.yaml", "model.py")))
