"""The programs of a build, and the packages of Debian that bring them: said before one of them is missed."""

from __future__ import annotations

import shutil
from collections.abc import Iterable

# Those of each of Edalize's tools; every one is in the package of its name.
_PROGRAMS: dict[str, tuple[str, ...]] = {
    "icarus": ("iverilog",),
    "verilator": ("verilator", "g++", "make"),
    "yosys": ("yosys",),
}


def needed_programs(tool: str) -> list[str]:
    """The programs that Edalize's tool needs beside GHDL, and it too."""
    return ["ghdl", *_PROGRAMS.get(tool, ())]


def missing_programs(programs: Iterable[str]) -> list[str]:
    """Those that are not installed."""
    return [name for name in programs if shutil.which(name) is None]


def explanation(programs: Iterable[str]) -> str:
    """What brings missing programs."""
    names = " ".join(programs)
    return f"error: not installed: {names}\n      = on Debian: apt-get install --no-install-recommends {names}"
