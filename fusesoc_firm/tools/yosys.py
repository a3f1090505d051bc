"""Verilog as Yosys reads it."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_SOURCE = re.compile(r"(?P<file>.+?):(?P<line>\d+)\.(?P<column>\d+)-")
_SYSTEM_VERILOG = (".sv", ".svh")
_INCLUDED = (".vh", ".svh")


def is_system_verilog(paths: Sequence[Path]) -> bool:
    """Return whether one of the files is in SystemVerilog, by its suffix."""
    return any(path.suffix.lower() in _SYSTEM_VERILOG for path in paths)


@dataclass(frozen=True)
class Yosys:
    """The program, with a folder for its output, and the macros that are defined for all files."""

    program: Path
    folder: Path
    defines: Mapping[str, str] = field(default_factory=dict)

    def run(self, script: str) -> subprocess.CompletedProcess[str]:
        """Return the finished process of a script."""
        return subprocess.run(
            [self.program, "-q", "-p", script],
            capture_output=True,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
            check=False,
        )

    def reading(self, paths: Sequence[Path], *options: str) -> str:
        """Return the command that reads the files; header files are only included by others."""
        folders = dict.fromkeys(f'-I"{path.parent}"' for path in paths if path.suffix.lower() in _INCLUDED)
        macros = [f"-D{name}={value}" if value else f"-D{name}" for name, value in self.defines.items()]
        standard = ["-sv"] if is_system_verilog(paths) else []
        files = [f'"{path}"' for path in paths if path.suffix.lower() not in _INCLUDED]
        return " ".join(["read_verilog", *standard, *folders, *macros, *options, *files])

    def modules(self, script: str) -> dict[str, dict[str, Any]]:
        """Return the modules after a script, as Yosys' JSON has them, by Yosys' names; none if it fails."""
        result = self.folder / "modules.json"
        done = self.run(f'{script}; write_json "{result}"')
        modules: dict[str, dict[str, Any]] = {}
        if done.returncode == 0:
            modules = json.loads(result.read_text(encoding="utf-8"))["modules"]
        return modules


def source_place(attributes: Mapping[str, Any]) -> tuple[Path, int, int] | None:
    """Return the file, line and column in the attributes of something that Yosys has read, or None."""
    match = _SOURCE.match(str(attributes.get("src", "")))
    return (Path(match["file"]), int(match["line"]), int(match["column"])) if match else None
