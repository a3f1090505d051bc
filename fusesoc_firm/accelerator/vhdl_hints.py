"""What GHDL's messages mean for a beginner: the cure of a fault, and the messages that only follow from another one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from fusesoc_firm.text.diagnostics import closest

_NUMERIC = "write 'use ieee.numeric_std.all;' above the entity, and std_logic_vector(unsigned(a) + 1) for a sum"
_STANDARD = "write 'standard: 2008' for this accelerator in the specification"
# Beginnings of messages about the syntax, of which those after the first in a line follow from it.
_SYNTAX = re.compile(
    r".* expected\b|missing |[\"']end[\"'] must be followed by|unexpected |extra |misspelling"
    r"|end label for an unlabeled|(?:a|else) generate "
)
_GENERATE = re.compile(
    r"a generate statement must have a label|else generate not allowed|[\"']generate[\"'] is expected"
)
_AT_END = re.compile(r"unexpected end of file|.*instead of end of file")
_UNANALYSED = re.compile(r"entity [\"']\w+[\"'] was not analysed")
_UNDECLARED = re.compile(r"no declaration for [\"'](\w+)[\"']")
_NOT_A_VECTOR = re.compile(r"can't match [\"'](\w+)[\"'] with type array type")
# The declaration of a bit.
_A_BIT = r"\b{}\b[^:;]*:\s*(?:in|out|inout|buffer)?\s*std_u?logic\b"
_DECLARED = re.compile(
    r"\b(?:signal|variable|constant|type|subtype|function|procedure|entity|component)\s+(\w+)|(\w+)(?=\s*(?:,\s*\w+\s*)*:)",
    re.IGNORECASE,
)
_COMMENT = re.compile(r"--.*")
# Each name that a package declares, with the clause that makes it visible.
_PACKAGES = {
    **dict.fromkeys(
        ("std_logic", "std_ulogic", "std_logic_vector", "std_ulogic_vector", "rising_edge", "falling_edge"),
        "write 'library ieee;' and 'use ieee.std_logic_1164.all;' above the entity",
    ),
    **dict.fromkeys(
        (
            *("unsigned", "signed", "to_unsigned", "to_signed", "to_integer"),
            *("resize", "shift_left", "shift_right", "conv_std_logic_vector", "conv_integer"),
        ),
        _NUMERIC,
    ),
    "ieee": "write 'library ieee;' at the top of the file",
    "firm": "write 'library firm;' at the top of the file",
}
# A pattern of messages, and the hint about all of them, in which {0} is the pattern's first group.
_HINTS = tuple(
    (re.compile(pattern, re.IGNORECASE), hint)
    for pattern, hint in (
        (r"infinite loop", "list the signals that start the process: 'process (clk)'"),
        (
            r"[\"'](if|case|loop|process)[\"'] is expected instead of",
            "an 'end {0};' is missing above: each 'if', 'case', 'loop' and 'process' has its own",
        ),
        (
            r"[\"']end[\"'] must be followed by [\"'](\w+)",
            "an 'end {0};' is missing above: each 'if', 'case', 'loop' and 'process' has its own",
        ),
        (
            _GENERATE.pattern,
            "'if', 'case' and 'loop' are statements in a process; outside, write 'a <= b when condition else c;'",
        ),
        (r"identifier .* already used for a declaration", "rename one of them, or remove it"),
        (r"missing choice|no choices? for", "add the choice 'when others => ...' below the others"),
        (r"positional argument after named", "connect all by name: 'port => signal'"),
        (r"can't associate string literal with generic", "write a number, true or false without quotation marks"),
        (r"object class keyword such as", "is the 'begin' of the architecture missing above?"),
        (
            r"signal declaration not allowed in process",
            "declare a variable here, or the signal above the 'begin' of the architecture",
        ),
        (r"unexpected token ''' in a primary", "a vector has double quotes, such as \"0001\"; '1' is one bit"),
        (r"unexpected end of file", "an 'end' is missing: the architecture ends with 'end architecture;'"),
        (r"[\"'];[\"'] or [\"']\)[\"'] expected after interface", "is a ';' missing at the end of the line above?"),
        (r"extra [\"'];[\"'] at end of interface", "the last port or generic has no ';'"),
        (r"use of synopsys package", _NUMERIC),
        (r".*(?:VHDL[ -]?(?:20)?08\b|--std=08)", _STANDARD),
        (r"port [\"']\w+[\"'] cannot be read", f"assign a signal, and the port from it; or {_STANDARD}"),
        (
            r"no function declarations for operator [\"'](?:[-+*/]|[<>]=?|mod|rem)[\"']",
            f"a std_logic_vector is not a number: a float needs an operation such as firm_float_add; else, {_NUMERIC}",
        ),
        (
            r"no function declarations for operator",
            "both sides need the same type: '1' is a std_logic, \"01\" is a vector, and 1 is a number",
        ),
        (r"can't match .* with type boolean", "a condition is a comparison, such as valid = '1'"),
        (
            r"can't match character literal.* with type array",
            "a vector is a string of bits, such as \"0001\", or (others => '0')",
        ),
        (
            r"can't match integer literal.* with type array",
            "write std_logic_vector(to_unsigned(5, 8)), with ieee.numeric_std, or a string of bits",
        ),
        (
            r"can't match .* with type array type [\"'](\w+)",
            "convert it, as in {0}(value); a sum or a comparison needs ieee.numeric_std",
        ),
        (r"can't match .* with type integer", "convert it: to_integer(unsigned(value)), with ieee.numeric_std"),
        (r"(?:signal|port) .* is not a variable", "assign a signal or a port with '<='"),
        (r"[\"']:=[\"'] not allowed in concurrent", "assign a signal or a port with '<='"),
        (
            r"[\"']<=[\"'] or [\"']:=[\"'] expected",
            "assign a signal with '<=', a variable with ':='; 'else if' is 'elsif'",
        ),
        (r"port .* can't be assigned", "an input can only be read: assign an output or a signal"),
    )
)


def hint(text: str, lines: Sequence[str], formals: Sequence[str] = ()) -> str:
    """Return the cure of a fault that GHDL reports in a file with these lines, or an empty text.

    `formals` are the legal names if the fault is in the map of an instance.
    """
    if clause := missing_clause(text):
        return clause
    if found := _UNDECLARED.match(text):
        near = closest(found[1], formals or set(_declared(lines)))
        return f"did you mean '{near}'?" if near else f"legal here: {', '.join(formals)}" if formals else ""
    if (found := _NOT_A_VECTOR.match(text)) and re.search(_A_BIT.format(found[1]), "\n".join(lines), re.IGNORECASE):
        return f"'{found[1]}' is one bit: write target(0) <= {found[1]}, or (others => {found[1]}) for all bits"
    if is_unanalysed(text):
        names = re.findall(r"^\s*entity\s+(\w+)\s+is\b", "\n".join(lines), re.IGNORECASE | re.MULTILINE)
        return f"the entity in this file is '{names[-1]}'" if names else ""
    return next((known.format(*match.groups()) for pattern, known in _HINTS if (match := pattern.match(text))), "")


def missing_clause(text: str) -> str:
    """Return the cure of an undeclared name that belongs to a usual package, or an empty text."""
    found = _UNDECLARED.match(text)
    return _PACKAGES.get(found[1].lower(), "") if found else ""


def _declared(lines: Sequence[str]) -> Iterator[str]:
    """Yield the names that a file declares."""
    for found in _DECLARED.finditer("\n".join(_COMMENT.sub("", line) for line in lines)):
        yield found[1] or found[2]


def is_syntax(text: str) -> bool:
    """Return whether a message is about the syntax; the first one of a line causes the others."""
    return bool(_SYNTAX.match(text))


def is_generate(text: str) -> bool:
    """Return whether GHDL takes a statement outside a process for a 'generate'; further faults follow."""
    return bool(_GENERATE.match(text))


def is_unanalysed(text: str) -> bool:
    """Return whether a message is about an architecture of an unknown entity, which may only have faults."""
    return bool(_UNANALYSED.match(text))


def is_at_end(text: str) -> bool:
    """Return whether a message is about the end of a file, which follows from any other fault in the syntax."""
    return bool(_AT_END.match(text))
