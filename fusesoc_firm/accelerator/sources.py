"""Signals of an accelerator with more than one source, without a source, or with an illegal one, in VHDL or Verilog.

GHDL and Yosys find them, but often know only the places where they are declared.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from enum import Enum
from pathlib import Path

from fusesoc_firm.accelerator.unit import lines_of, place
from fusesoc_firm.netlist.loops import waits
from fusesoc_firm.netlist.model import Modules
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

# A comment in VHDL or Verilog, in one line.
_COMMENT = re.compile(r"(?:--|//).*")
# A signal at the beginning of an assignment, and as a connection of an instance.
_PART = r"({})\s*(?:\[[^\]]*\]|\([^()]*\))?\s*"
_ASSIGNED = rf"(?:^|[;:)>]|\b(?:assign|begin|then|else)\b)\s*{_PART}(?:<=|=(?![=>]))"
_CONNECTED = rf"(?:=>\s*|\.\w+\s*\(\s*){_PART}(?:[,)]|$)"
_PLACED = re.compile(r"(?P<file>.+):(?P<line>\d+):(?P<column>\d+)")
# A port of a handshake: if it is open, no message passes, and the simulation waits.
_HANDSHAKE = re.compile(r".*_t?(?:valid|ready)", re.IGNORECASE)


class Fault(Enum):
    """What is wrong with the sources of a signal: a message that names the signal, and the cure."""

    INPUT = "'{}' is an input, and is assigned", "the value comes from outside; remove the assignment"
    SEVERAL = "'{}' has more than one source", "keep one source: an assignment, a process or an output of an instance"
    NONE = "output '{}' has no source", "assign it a value"
    PART = "a part of output '{}' has no source", "assign it a value"


def report_sources(name: str, declared: SourceRef, fault: Fault, faults: Diagnostics) -> None:
    """Add a fault at the last statement that assigns a signal, or else where the signal is declared.

    An open output is only a warning, unless it is a part of a handshake: the receiver may ignore its value.
    """
    message, cure = fault.value
    if fault in (Fault.NONE, Fault.PART):
        is_waiting = _HANDSHAKE.fullmatch(name)
        report = faults.error if is_waiting else faults.warn
        report(message.format(name), declared, f"{cure}: no message passes without it" if is_waiting else cure)
        return
    found = _assignments(name, Path(declared.file), 2 if fault is Fault.SEVERAL else 1)
    others = ", ".join(dict.fromkeys(str(item.line) for item in found[:-1] if item.line != found[-1].line))
    cure += f", and remove the others; see also line {others}" if others else ""
    faults.error(message.format(name), found[-1] if found else declared, cure)


def report_waits(modules: Modules, paths: Sequence[Path], faults: Diagnostics) -> None:
    """Add a warning for each `valid` of the top module that waits for a `ready`, where it reads the `ready`.

    The receiver's `ready` may wait for the `valid`, so both may wait forever.
    """
    for wait in waits(modules):
        match = _PLACED.fullmatch(wait.location)
        if match and (path := Path(match["file"])) in paths:
            source = place(path, int(match["line"]), int(match["column"]))
        elif found := [item for path in paths for item in _assignments(wait.output, path, 1)]:
            source = found[-1]
        else:
            source = place(paths[-1], 1, 0)
        hint = f"the receiver may wait for '{wait.output}' before '{wait.input}', so it must not depend on any 'ready'"
        faults.warn(f"'{wait.output}' waits for '{wait.input}', so no message may ever pass", source, hint)


def _assignments(name: str, path: Path, fewest: int) -> list[SourceRef]:
    """Return where a signal is assigned: statements or, if they are too few, also connections of instances.

    A connection may be an input, so fewer places than the `fewest` possible are unknown.
    """
    found = [*_matches(path, _ASSIGNED.format(re.escape(name)))]
    if len(found) < fewest:
        found = sorted([*found, *_matches(path, _CONNECTED.format(re.escape(name)))], key=lambda item: item.line)
    return found if len(found) >= fewest else []


def _matches(path: Path, pattern: str) -> Iterator[SourceRef]:
    """Yield the places of a pattern's first group in the lines of a source, without their comments."""
    lines = lines_of(path)
    for number, line in enumerate(lines, start=1):
        for match in re.finditer(pattern, _COMMENT.sub("", line), re.IGNORECASE):
            yield place(path, number, match.start(1) + 1, len(match[1]), lines)
