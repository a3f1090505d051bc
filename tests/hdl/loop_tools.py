"""Combinational loops that other programs find in a netlist in Verilog: Yosys and Verilator.

Yosys flattens the netlist, but keeps the cells of whole words. Each bit of such a cell's output depends on all bits of
its inputs, so Yosys may find more than there is, and misses nothing. Verilator does the same with signals.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.netlist.model import NetlistError
from tests.recall import digest_of_source, identity, ran, recalled

# What a memory shows depends on its address.
_READ_PORT = Path(__file__).with_name("read_port.v")
_CELLS = f"proc; flatten; techmap -map {_READ_PORT}; select -assert-none t:$memrd*"
_LOOPS = re.compile(r"ERROR: (Found \d+ SCCs) but expected 0")
_WAIVER = "// verilator lint_off UNOPTFLAT"
_UNOPTFLAT = re.compile(r"^%Warning-UNOPTFLAT: \S+ (.*)", re.MULTILINE)


def found_by_others(top: str, netlist: Path) -> list[str]:
    """The loops of the module `top`: a sentence for those of Yosys, and one for each of Verilator.

    Raises `NetlistError`.
    """
    return [*_in_yosys(top, netlist), *_in_verilator(top, netlist)]


def _in_yosys(top: str, netlist: Path) -> list[str]:
    script = f"read_verilog {netlist.name}; hierarchy -check -top {top}; {_CELLS}; scc -expect 0"
    status, said = _run(["yosys", "-q", "-p", script], netlist)
    found = _LOOPS.search(said)
    if status and not found:
        raise NetlistError(said)
    return [f"Yosys: {found[1]}"] if found else []


def _in_verilator(top: str, netlist: Path) -> list[str]:
    text = netlist.read_text(encoding="utf-8")
    assert _WAIVER in text, f"{netlist} does not waive the warning"
    unwaived = netlist.with_name(f"{netlist.stem}_unwaived.v")
    unwaived.write_text(text.replace(_WAIVER, ""), encoding="utf-8")
    options = ["--lint-only", "-Wno-lint", "-Wno-style", "-Wno-fatal", "-Wwarn-UNOPTFLAT", "--top-module", top]
    status, said = _run(["verilator", *options, unwaived.name], unwaived)
    if status:
        raise NetlistError(said)
    return [f"Verilator: {sentence}" for sentence in _UNOPTFLAT.findall(said)]


def _run(command: Sequence[str], source: Path) -> tuple[int, str]:
    """The exit code and the output of a program that reads `source`, in its folder."""
    parts = {
        "tool": identity(command[0]),
        "command": list(command),
        "sources": [*map(digest_of_source, (source, _READ_PORT))],
    }
    done = recalled(parts, [], lambda: ran(command, source.parent), [source.parent])
    return done.exit_code, done.output
