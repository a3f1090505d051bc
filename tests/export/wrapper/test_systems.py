"""`quat2euler` in a SoC of LiteX and in a design of Amaranth, as Verilog of these frameworks, in Verilator."""

from __future__ import annotations

import random
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from fusesoc_firm.export.component.package import NETLIST, package
from fusesoc_firm.export.wrapper.framework import FRAMEWORKS
from fusesoc_firm.export.wrapper.wrapper import write_wrapper
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import identity
from tests.export.component.designs import alone, designed, write_system
from tests.hdl.frames import Frame
from tests.hdl.ghdl import REPOSITORY
from tests.hdl.verilator import compiled
from tests.seeds import seeded

HERE = Path(__file__).parent
SEED = seeded(20261201)
MESSAGES, STALL_PERCENT = 1000, 30
UNIT = "quat2euler_system"
# Where the registers are on the bus.
ORIGINS = {"litex": 0x4000_0000, "amaranth": 0}
ENABLE, DIGEST = 0x10, (0x30, 0x34, 0x38, 0x3C)
FRAMES = (0x8000 + 0x34, 0x8040 + 0x34)
pytestmark = pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator")


@dataclass(frozen=True)
class Exported:
    """A design as Verilog: the part that the framework writes, and the netlist."""

    framework: str
    specification: Path
    design: str
    netlist: str


Export = Callable[[str, bool], Exported]


# Without keep, all beats of a frame must be full: with ids of two bytes, frames have 38 bytes instead of 37.
PROJECTS: dict[bool, dict[str, int | str]] = {
    True: {"width": 32, "status": "axi_lite"},
    False: {"width": 16, "idBytes": 2},
}


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Export]:
    """The design of a framework around the system; a design without keep does not drive it."""
    with pytest.MonkeyPatch.context() as patch:
        place = tmp_path_factory.mktemp("wrapped")
        alone(place, patch)

        @cache
        def wrapped(with_keep: bool) -> Path:
            keys = "".join(f"  {key}: {value}\n" for key, value in PROJECTS[with_keep].items())
            spec = write_system(place / str(with_keep), "quat2euler", {"  fpgaPart: xc7z020clg400-1\n": keys})
            made = package(designed(str(spec)), NETLIST)
            for framework in FRAMEWORKS:
                write_wrapper(made, framework, spec.parent / framework)
            return spec

        @cache
        def exported(framework: str, with_keep: bool) -> Exported:
            spec = wrapped(with_keep)
            folder = spec.parent / framework
            netlist = (folder / "src" / f"{UNIT}_netlist.v").read_text(encoding="utf-8")
            options = [] if with_keep else ["--without-keep"]
            design = _EXPORTS[framework](folder, options)
            return Exported(framework, spec, design, netlist)

        yield exported


def _litex(folder: Path, options: list[str]) -> str:
    _run("litex_soc", folder / f"{UNIT}.py", folder / "soc", *options)
    gateware = folder / "soc" / "gateware"
    assert f"read_verilog {{{folder}/src/{UNIT}_netlist.v}}" in (gateware / "soc.tcl").read_text(encoding="utf-8")
    # A comment has the time.
    return re.sub("//.*", "", (gateware / "soc.v").read_text(encoding="utf-8"))


def _amaranth(folder: Path, options: list[str]) -> str:
    return _run("amaranth_design", folder / f"{UNIT}.py", *options)


_EXPORTS = {"litex": _litex, "amaranth": _amaranth}


def _run(program: str, *words: object) -> str:
    """What a program of this folder prints."""
    command = [sys.executable, "-m", f"tests.export.wrapper.{program}", *map(str, words)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return done.stdout


@cache
def _model() -> ModuleType:
    spec = spec_from_file_location("model", REPOSITORY / "specs" / "quat2euler" / "model.py")
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_every_port_is_connected_with_its_width(export: Export, framework: str, tmp_path: Path) -> None:
    """Verilator refuses unknown ports, and warns of ports that are missing or have other widths."""
    made = export(framework, True)
    (tmp_path / "soc.v").write_text(made.design, encoding="utf-8")
    (tmp_path / "netlist.v").write_text(made.netlist, encoding="utf-8")
    options = ["-Wno-lint", "-Wno-style", "-Wwarn-PINMISSING", "-Wwarn-WIDTH", "-Wno-fatal"]
    command = ["verilator", "--lint-only", *options, "--top-module", "soc", "soc.v", "netlist.v"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    found = [
        line for line in done.stderr.splitlines() if re.search(r"%Warning.*soc\.v.*(pin|port)", line, re.IGNORECASE)
    ]
    assert not found


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_messages_pass_as_in_the_model(export: Export, framework: str, tmp_path: Path) -> None:
    """The registers have counted them, and can be written."""
    made = export(framework, True)
    origin = ORIGINS[framework]
    words = check_messages(made, 1, [0, *FRAMES, *DIGEST, ENABLE, (ENABLE, 10), ENABLE], origin, tmp_path)
    assert words[0] == 0x4D524946
    assert words[1:3] == [MESSAGES, MESSAGES]
    # The lowest word of the digest is the first, unlike in a CSR of LiteX.
    assert (
        "".join(f"{word:08x}" for word in words[6:2:-1]) == identity(load_beside(made.specification, [], None)).digest
    )
    assert words[7:] == [0, 10]


@pytest.mark.check
@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_messages_of_a_source_without_keep(export: Export, framework: str, tmp_path: Path) -> None:
    check_messages(export(framework, False), 2, [], 0, tmp_path)


def check_messages(
    made: Exported, id_bytes: int, accesses: Sequence[int | tuple[int, int]], origin: int, folder: Path
) -> list[int]:
    """Compare the responses to random messages with the model; return what registers then hold."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    sent = [[chance.gauss(0, 1) * 2.0 ** chance.randrange(-8, 8) for _ in range(4)] for _ in range(MESSAGES)]
    frames = [Frame(0, struct.pack("<4d", *values)).to_bytes(id_bytes) for values in sent]
    answers = (struct.pack("<3d", *_model().quaternion_to_euler(*values)) for values in sent)
    (folder / "frames").write_bytes(b"".join(struct.pack("<I", len(frame)) + frame for frame in frames))
    bench = f"#define HAS_REGISTERS {int(bool(accesses))}\n" + (HERE / "bench.cpp").read_text(encoding="ascii")
    program = compiled(f"{made.netlist}\n{made.design}", "soc", bench, folder, is_long=False)
    words = [
        f"{origin + item[0]:x}={item[1]:x}" if isinstance(item, tuple) else f"{origin + item:x}" for item in accesses
    ]
    command = [str(program), str(folder / "frames"), str(SEED), str(STALL_PERCENT), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert not done.returncode, done.stderr
    received = done.stdout.split()
    assert received[:MESSAGES] == [Frame(0, answer).to_bytes(id_bytes).hex() for answer in answers]
    return [int(word, 16) for word in received[MESSAGES:]]
