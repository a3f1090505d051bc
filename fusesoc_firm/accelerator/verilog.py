"""Modules in Verilog as Yosys reads them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusesoc_firm.accelerator.instances import Instances
from fusesoc_firm.accelerator.rtlil import read_modules, source_faults
from fusesoc_firm.accelerator.sources import report_sources, report_waits
from fusesoc_firm.accelerator.unit import Unit, UnitPort, lines_of, place
from fusesoc_firm.netlist.elaborated import elaborate
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, closest
from fusesoc_firm.tools.yosys import Yosys, is_system_verilog, source_place

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
# In Yosys' text of a design: a cell below its place in the source.
_LATCH = re.compile(
    r'^  attribute \\src "(?P<file>.+):(?P<line>\d+)\.(?P<column>\d+)-.*"\n(?:  attribute .*\n)*  cell \$a?dlatch .*\n'
    r"(?:    .*\n)*?    connect \\Q \\?(?P<name>\S+)",
    re.MULTILINE,
)
# What Yosys' parser did not expect, and what it did expect.
_UNEXPECTED = re.compile(
    r"syntax error, unexpected (?P<token>'[^']+'|a name|end of file)(?:, expecting (?P<expected>.+))?"
)
# Beginnings of other errors, each with its cure.
_CURES = {
    "Mix of positional": "connect all by name: '.port(net)'",
    "Digit larger than": "the letter names the base: 8'b1010 is binary, 8'd10 decimal, 8'hA hexadecimal",
}
_SYSTEM_WORD = re.compile(r"\b(logic|always_ff|always_comb|always_latch|int|bit|byte|typedef|enum|struct|import)\b")
_COMMENT = re.compile(r"//.*")
_DIRECTIONS = {"input": "in", "output": "out"}


@dataclass(frozen=True)
class VerilogReader:
    """Reads modules with Yosys."""

    yosys: Yosys
    instances: Instances

    def read(self, paths: Sequence[Path], top: str, generics: Mapping[str, int], faults: Diagnostics) -> list[Unit]:
        """Return the modules of the files, the module `top` with the values of parameters; add all faults."""
        done = self.yosys.run(self.yosys.reading(paths))
        if done.returncode:
            self._report(done.stderr, paths, faults)
            return []
        self._warn(done.stderr, faults)
        if not is_system_verilog(paths):
            self._report_sources(paths, top, faults)
        if module := elaborate(self.yosys, self.yosys.reading(paths), top):
            report_waits({top: module}, paths, faults)
        interfaces = self.yosys.reading(paths, "-lib")
        modules = {_name(name, module): module for name, module in self.yosys.modules(interfaces).items()}
        parameters = modules.get(top, {}).get("parameter_default_values", {})
        given = " ".join(f"-chparam {name} {value}" for name, value in generics.items() if name in parameters)
        elaborated = f"{self.yosys.reading(paths, '-nosynthesis', '-defer')}; hierarchy -top {top} {given}; proc"
        self.instances.compare(self.yosys.modules(elaborated), paths, faults)
        if given:
            sized = self.yosys.modules(f"{interfaces}; hierarchy -top {top} {given}")
            modules[top] |= {"ports": next(item["ports"] for name, item in sized.items() if _name(name, item) == top)}
        return [_unit(name, module, paths[0]) for name, module in modules.items()]

    def _warn(self, output: str, faults: Diagnostics) -> None:
        for line in output.splitlines():
            if match := _IMPLICIT.match(line):
                _report_undeclared(match["name"], _line(match), faults)
            elif match := _RANGE.match(line):
                bits = match["range"] or "selected here"
                hint = "select bits of the declared range"
                faults.warn(f"'{match['name']}' does not have the bits {bits}", _line(match), hint)

    def _report_sources(self, paths: Sequence[Path], top: str, faults: Diagnostics) -> None:
        """Add assignments of the wrong kind, latches, and signals with several sources or without a source."""
        result = self.yosys.folder / "module.il"
        done = self.yosys.run(f'{self.yosys.reading(paths)}; hierarchy -top {top}; proc; write_rtlil "{result}"')
        found = list(filter(None, map(_ASSIGNED.match, done.stderr.splitlines())))
        for match in found:
            source = place(Path(match["file"]), int(match["line"]), int(match["column"]), len(match["name"]))
            other, way = ("reg", "'assign'") if match["kind"] == "wire" else ("wire", "an 'always' block")
            hint = f"declare it as '{other}', or use {way}"
            faults.error(f"'{match['name']}' is a {match['kind']}, and is assigned in a {match['place']}", source, hint)
        # Signals with the value z may have several sources.
        if done.returncode or found or "tri-state" in done.stderr:
            return
        text = result.read_text(encoding="utf-8")
        for match in _LATCH.finditer(text):
            source = place(Path(match["file"]), int(match["line"]), int(match["column"]))
            hint = "assign it in every branch of its block, or only at a clock edge"
            faults.warn(f"latch inferred for '{match['name']}': some branch does not assign it", source, hint)
        modules = read_modules(text)
        for wire, fault in source_faults(modules, f"\\{top}"):
            name = wire.name.removeprefix("\\")
            report_sources(name, _declared({"src": wire.place}, paths[0], len(name)), fault, faults)

    def _report(self, output: str, paths: Sequence[Path], faults: Diagnostics) -> None:
        """Report Yosys' error, except in SystemVerilog, which simulators support better than Yosys."""
        match = next(filter(None, map(_ERROR.match, output.splitlines())), None)
        if match and not is_system_verilog([path := Path(match["file"])]):
            faults.error(*_syntax_fault(_readable(match["text"]), path, int(match["line"])))


def _name(name: str, module: Mapping[str, Any]) -> str:
    """Return the name of a module in its source; Yosys' name contains the values of parameters."""
    return str(module["attributes"].get("hdlname", name)).lstrip("\\")


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
    found = source_place(attributes)
    return place(*found, width) if found else place(path, 1, 1)


def _line(match: re.Match[str]) -> SourceRef:
    return place(Path(match["file"]), int(match["line"]), 0)


def _report_undeclared(name: str, source: SourceRef, faults: Diagnostics) -> None:
    """Add an undeclared name, which Verilog takes for a wire of 1 bit.

    If the name only connects instances, this is legal, and a warning.
    """
    code = [_COMMENT.sub("", line) for line in lines_of(Path(source.file))]
    uses = re.findall(rf"(\(\s*)?\b{re.escape(name)}\b(\s*\))?", "\n".join(code))
    near = closest(name, {word for line in code for word in re.findall(r"\b[A-Za-z_]\w*", line)} - {name})
    hint = f"did you mean '{near}'?" if near else "declare it: an undeclared name is a wire of 1 bit"
    report = faults.warn if all(map(all, uses)) else faults.error
    if found := re.search(rf"\b{re.escape(name)}\b", source.text):
        source = replace(source, column=found.start() + 1, width=len(name))
    report(f"'{name}' is not declared", source, hint)


def _syntax_fault(text: str, path: Path, line: int) -> tuple[str, SourceRef, str]:
    """Return a message of Yosys' parser with its place and its probable cure."""
    lines = lines_of(path)
    found = _UNEXPECTED.match(text)
    if found and found["token"] == "end of file":
        last = max((number for number, item in enumerate(lines, start=1) if item.strip()), default=1)
        return text, place(path, last, 0, lines=lines), "an 'endmodule' or a 'begin' without 'end' is missing above"
    source = place(path, line, 0, lines=lines)
    if not found:
        return text, source, next((cure for begin, cure in _CURES.items() if text.startswith(begin)), "")
    code = _COMMENT.sub("", source.text)
    token = found["token"].strip("'")
    if word := re.search(rf"\b{token}\b", code) if token.isalpha() else None:
        source = place(path, line, word.start() + 1, len(token), lines)
    if system := _SYSTEM_WORD.search(code):
        return text, source, f"'{system[1]}' is SystemVerilog, whose files end in .sv: rename {path.name}"
    if (found["expected"] or "").startswith("','"):
        return text, source, "is a ',' missing at the end of the line above?"
    if found["expected"] == "';'" or token == "endmodule":
        return text, source, "is a ';' or an 'end' missing above?"
    if token == "<=" and "assign" in code:
        return text, source, "write '=': an 'assign' has no '<=', which is for 'always' blocks"
    if token in ("=", "<=") and "if" not in code:
        return text, source, "write 'assign' before it, or put it into an 'always' block"
    return text, source, "is a ';' or an 'end' missing above?" if word else ""


def _readable(text: str) -> str:
    """Return a message of Yosys' parser without the parser's internal names of tokens."""
    text = text.replace("TOK_ID", "a name").replace("OP_LE", "'<='")
    return re.sub(r"\bTOK_(\w+)", lambda match: f"'{match[1].lower()}'", text)
