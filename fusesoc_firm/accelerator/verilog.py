"""Modules in Verilog as Yosys reads them."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.accelerator.rtlil import read_modules, source_faults
from fusesoc_firm.accelerator.unit import Unit, UnitPort, place
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

_ERROR = re.compile(r"(?P<file>.+?):(?P<line>\d+): ERROR: (?P<text>.+)")
_IMPLICIT = re.compile(r"(?P<file>.+?):(?P<line>\d+): Warning: Identifier `\\(?P<name>.+)' is implicitly declared")
_RANGE = re.compile(
    r"(?P<file>.+?):(?P<line>\d+): Warning: Range (?:(?P<range>\[.+?\]) )?select out of bounds"
    r" on signal `\\(?P<name>.+?)'"
)
_ASSIGNED = re.compile(
    r"Warning: (?P<kind>wire|reg) '\\(?P<name>.+)' is assigned in a (?P<place>block|continuous assignment)"
    r" at (?P<file>.+):(?P<line>\d+)\.(?P<column>\d+)-"
)
_SOURCE = re.compile(r"(?P<file>.+):(?P<line>\d+)\.(?P<column>\d+)-")
_SYSTEM_VERILOG = (".sv", ".svh")
_INCLUDED = (".vh", ".svh")
_DIRECTIONS = {"input": "in", "output": "out"}


@dataclass(frozen=True)
class VerilogReader:
    """Yosys, with a folder for its output."""

    yosys: Path
    folder: Path

    def read(self, paths: Sequence[Path], top: str, generics: Mapping[str, int], faults: Diagnostics) -> list[Unit]:
        """Return the modules of the files, the module `top` with the values of parameters; add all faults."""
        read = self._reading(paths)
        done = self._run(f"{read} {_quoted(_compiled(paths))}")
        if done.returncode:
            self._report(done.stderr, paths, faults)
            return []
        self._warn(done.stderr, faults)
        if not _is_system_verilog(paths):
            self._report_sources(read, paths, top, faults)
        interfaces = f"{read} -lib {_quoted(_compiled(paths))}"
        modules = self._modules(interfaces)
        parameters = modules.get(top, {}).get("parameter_default_values", {})
        given = " ".join(f"-chparam {name} {value}" for name, value in generics.items() if name in parameters)
        if given:
            modules[top] |= {"ports": self._modules(f"{interfaces}; hierarchy -top {top} {given}")[top]["ports"]}
        return [_unit(name, module, paths[0]) for name, module in modules.items()]

    def _reading(self, paths: Sequence[Path]) -> str:
        folders = dict.fromkeys(f'-I"{path.parent}"' for path in paths if path.suffix.lower() in _INCLUDED)
        return " ".join(["read_verilog", *(["-sv"] if _is_system_verilog(paths) else []), *folders])

    def _warn(self, output: str, faults: Diagnostics) -> None:
        for line in output.splitlines():
            if match := _IMPLICIT.match(line):
                hint = "an undeclared name is a wire of 1 bit; declare it, or correct its name"
                faults.warn(f"'{match['name']}' is not declared", _line(match), hint)
            elif match := _RANGE.match(line):
                bits = match["range"] or "selected here"
                hint = "select bits of the declared range"
                faults.warn(f"'{match['name']}' does not have the bits {bits}", _line(match), hint)

    def _report_sources(self, read: str, paths: Sequence[Path], top: str, faults: Diagnostics) -> None:
        """Add assignments of the wrong kind, and signals with several sources or without a source."""
        result = self.folder / "module.il"
        done = self._run(f'{read} {_quoted(_compiled(paths))}; hierarchy -top {top}; proc; write_rtlil "{result}"')
        found = list(filter(None, map(_ASSIGNED.match, done.stderr.splitlines())))
        for match in found:
            source = place(Path(match["file"]), int(match["line"]), int(match["column"]), len(match["name"]))
            other, way = ("reg", "'assign'") if match["kind"] == "wire" else ("wire", "an 'always' block")
            hint = f"declare it as '{other}', or use {way}"
            faults.error(f"'{match['name']}' is a {match['kind']}, and is assigned in a {match['place']}", source, hint)
        # Signals with the value z may have several sources.
        if done.returncode or found or "tri-state" in done.stderr:
            return
        modules = read_modules(result.read_text(encoding="utf-8"))
        for wire, message, hint in source_faults(modules, f"\\{top}"):
            source = _declared({"src": wire.place}, paths[0], len(wire.name) - 1)
            if hint:
                faults.error(message, source, hint)
            else:
                faults.warn(message, source, "assign it a value")

    def _report(self, output: str, paths: Sequence[Path], faults: Diagnostics) -> None:
        """Report Yosys' error, except in SystemVerilog, which simulators support better than Yosys."""
        match = next(filter(None, map(_ERROR.match, output.splitlines())), None)
        if match and Path(match["file"]).suffix.lower() not in _SYSTEM_VERILOG:
            faults.error(_readable(match["text"]), _line(match))

    def _modules(self, script: str) -> dict[str, dict[str, Any]]:
        result = self.folder / "modules.json"
        done = self._run(f'{script}; write_json "{result}"')
        modules = json.loads(result.read_text(encoding="utf-8"))["modules"] if done.returncode == 0 else {}
        return {str(item["attributes"].get("hdlname", name)).lstrip("\\"): item for name, item in modules.items()}

    def _run(self, script: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [self.yosys, "-q", "-p", script],
            capture_output=True,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
            check=False,
        )


def _is_system_verilog(paths: Sequence[Path]) -> bool:
    return any(path.suffix.lower() in _SYSTEM_VERILOG for path in paths)


def _compiled(paths: Sequence[Path]) -> list[Path]:
    return [path for path in paths if path.suffix.lower() not in _INCLUDED]


def _quoted(paths: Sequence[Path]) -> str:
    return " ".join(f'"{path}"' for path in paths)


def _unit(name: str, module: Mapping[str, Any], path: Path) -> Unit:
    nets = module.get("netnames", {})
    return Unit(
        name,
        _declared(module["attributes"], path, 0),
        tuple(
            UnitPort(
                port,
                _declared(nets.get(port, {}).get("attributes", {}), path, len(port)),
                _DIRECTIONS.get(item["direction"], item["direction"]),
                len(item["bits"]),
            )
            for port, item in module["ports"].items()
        ),
    )


def _declared(attributes: Mapping[str, Any], path: Path, width: int) -> SourceRef:
    """Return the place in the attributes of a module or a net, or the beginning of the file."""
    match = _SOURCE.match(str(attributes.get("src", "")))
    return place(Path(match["file"]), int(match["line"]), int(match["column"]), width) if match else place(path, 1, 1)


def _line(match: re.Match[str]) -> SourceRef:
    return place(Path(match["file"]), int(match["line"]), 0)


def _readable(text: str) -> str:
    """Return a message of Yosys' parser without the parser's internal names of tokens."""
    return re.sub(r"\bTOK_(\w+)", lambda match: f"'{match[1].lower()}'", text)
