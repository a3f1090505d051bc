"""VHDL and Verilog stand in templates: what Python puts together of them is short, and listed here with its reason."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "fusesoc_firm"
ROOMS = (
    "converter",
    "noc",
    "system/hardware",
    "system/boards",
    "system/scaffold",
    "runs/verify",
    "runs/simulation",
    "netlist",
)
MOST_LINES = 10

# Signs and words of both languages that no message to a user holds.
_HDL = re.compile(
    r"""<=|=>|'[01]'|x"|'[bd][01z]|\bdownto\b|std_logic|\b(un)?signed\(|\bothers\b.*=>| [?] """
    r"""|^ *assign |\balways @|\bposedge\b|\bend(module|function|case)$|^begin$|\bcase \(|^(reg|wire)$"""
    r"""|^  (reg|wire|initial|function) """
    # A bare conjunction joins words of messages, too.
    r"""|^ (and|or)\s.|^ & |^"0+" & """
)

_LITERAL, _OPERAND, _CONDITION = "a literal", "one operand", "a condition of one list of operands"
_STATEMENT = "a statement for a gate: the netlist has no order that a template could show"
REASONS = {
    "converter/vhdl.py": {
        "vhdl_type": "the type of a port",
        "bits": _OPERAND,
        "hexadecimal": _LITERAL,
        "bits_of_bool": _OPERAND,
        "between": _CONDITION,
        "any_of": _CONDITION,
    },
    "converter/configuration.py": {"_literal": _LITERAL},
    "converter/constants.py": {"_value": _LITERAL, "_bytes": _LITERAL},
    "converter/payload_length.py": {"_unsigned": _OPERAND},
    "converter/storing.py": {"is_beat": _CONDITION, "_is_used": _CONDITION},
    "converter/variable_publisher.py": {"_count": _OPERAND, "_is_empty": _CONDITION},
    "runs/verify/loop.py": dict.fromkeys(("_element_gates", "_message_gate", "_segment_gate", "_gate_of"), _CONDITION),
    "netlist/instantiated.py": {"_range": "the range of a port"},
    "netlist/padding.py": {"text": "a statement on one line, whose length is taken off the columns of messages"},
    "netlist/probed_source.py": {"bit_functions": _OPERAND},
    "netlist/verilog.py": {
        **dict.fromkeys(("_either", "_modulus"), "an expression"),
        **dict.fromkeys(
            (
                "_assignment",
                "_function",
                "_insertion",
                "_choice",
                "text",
                "_declarations",
                "_part",
                "_bidirectional",
                "_assertion",
                "_register",
                "_with_reset",
                "_clocked",
                "_action",
                "_contents",
            ),
            _STATEMENT,
        ),
    },
}


def found() -> Iterator[tuple[str, str, int]]:
    """Module, name and lines, its docstring aside, of each function that holds text of VHDL or Verilog."""
    for path in sorted(path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                body = node.body[1:] if ast.get_docstring(node) else node.body
                texts = [item for part in body for item in ast.walk(part) if isinstance(item, ast.Constant)]
                if any(isinstance(item.value, str) and _HDL.search(item.value) for item in texts):
                    lines = (body[-1].end_lineno or 0) - body[0].lineno + 1
                    yield path.relative_to(PACKAGE).as_posix(), node.name, lines


def test_functions_with_text_of_hardware_are_listed_and_short() -> None:
    functions = list(found())
    assert [item for item in functions if item[2] > MOST_LINES] == []
    listed = {(module, name) for module, names in REASONS.items() for name in names}
    assert {(module, name) for module, name, _ in functions} == listed
