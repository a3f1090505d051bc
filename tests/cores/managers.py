"""The Manager with its test benches, analysed."""

from __future__ import annotations

from pathlib import Path

from tests.hdl.ghdl import Library, core_files


def manager_library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(
        core_files(
            "axis/package",
            "axis/axis",
            "sched/package",
            "sched/fixed_priority",
            "manager/manager",
            "sim/checker",
            "sim/host",
            "sim/parts",
            "sim/echo",
        )
    )
    library.analyse(core_files("manager/manager", fileset="tb"))
    return library
