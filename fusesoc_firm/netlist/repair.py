"""Puts right what GHDL 2.0 writes wrongly in a Verilog netlist, without a word about it.

* A `case` loses its `when others`, so that it keeps its old value: a latch. The netlist in VHDL, of the same nets with
  the same names, has it.
* Signed division, remainder and modulus are written as those of unsigned numbers.
* An arithmetic shift to the right is written as a logical one.
* A signal with a first value that something else drives for ever keeps the first value: no event starts its block.
* First values are assigned as if in a clocked block, which linters dislike.
* `abs` is copied over as VHDL, and constants of more than 64 bits as strings.

What is unknown to this module is not let through: `check` names what is left of VHDL.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

_MODULE = re.compile(r"^module\s+(\S+)(.*?)^endmodule\b", re.MULTILINE | re.DOTALL)
_ARCHITECTURE = re.compile(r"^architecture\s+\S+\s+of\s+(\S+)\s+is\b(.*?)^end\s+\S+;", re.MULTILINE | re.DOTALL)
_CASE = re.compile(r"\bcase \((?P<select>\S+)\)\n(?P<choices>.*?)(?P<indent>[ ]*)endcase", re.DOTALL)
_CHOICE = re.compile(r"^\s*(\d+)'b[01]+\s*:\s*(\S+)\s*<?=", re.MULTILINE)
_SELECT = re.compile(r"\bwith\s+\S+\s+select\s+(\S+)\s*<=(.*?)\bwhen\s+others\s*;", re.DOTALL)

_DIVISION = re.compile(r"^(\s*assign \S+ = )(\S+) ([/%]) (\S+);( // (?:sdiv|srem|smod))$", re.MULTILINE)
_SHIFT = re.compile(r"^(\s*assign \S+ = \$signed\(\S+\)) >> (?=\S+;)", re.MULTILINE)
_ABSOLUTE = re.compile(r"^(\s*)(\S+) <= std_logic_vector\(abs \$signed\((\S+)\)\);", re.MULTILINE)
_INITIAL = re.compile(r"^(\s*initial\n\s*\S+) <= ", re.MULTILINE)
_CONSTANT_SIGNAL = re.compile(
    r"^ *always @\*\n +(?P<signal>\S+) = (?P<value>\d+'b\w+); // \(isignal\)\n *initial\n +(?P=signal) = \S+;",
    re.MULTILINE,
)
_STRING = re.compile(r'"([01XZUWLH-]+)"')
_LEVELS = str.maketrans("UWLH-XZ", "xx01xxz")

_VHDL = re.compile(r'^.*(?:\bstd_logic\w*|"|\babs\b|\bwhen\b).*$', re.MULTILINE)
# An assertion of the VHDL, which may well stand in what is simulated.
_ASSERTION = re.compile(r'\$fatal\(1, "[^"]*"\)')
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)


class NetlistError(Exception):
    """A netlist that is not what the VHDL says; the text is what to tell the user."""


def repair(verilog: str, vhdl: str, top: str) -> str:
    """The Verilog netlist of `top` as it should be; `vhdl` is the netlist of the same design in VHDL.

    Raises `NetlistError` for what cannot be put right.
    """
    architectures = {name.lower(): text for name, text in _ARCHITECTURE.findall(vhdl)}
    # In VHDL, the top level has a net beside each of its ports.
    architectures[top.lower()] = re.sub(r"\bwrap_(?=\w)", "", architectures.get(top.lower(), ""))
    verilog = _DIVISION.sub(_division, verilog)
    verilog = _SHIFT.sub(r"\1 >>> ", verilog)
    verilog = _ABSOLUTE.sub(r"\1assign \2 = $signed(\3) < 0 ? -\3 : \3;", verilog)
    verilog = _INITIAL.sub(r"\1 = ", verilog)
    verilog = _STRING.sub(lambda found: _constant(found[1]), verilog)
    verilog = _CONSTANT_SIGNAL.sub(r"  initial\n    \g<signal> = \g<value>;", verilog)
    verilog = _MODULE.sub(lambda found: _with_defaults(found, architectures), verilog)
    check(verilog)
    return verilog


def check(verilog: str) -> None:
    """Raise `NetlistError` if there is a latch in a netlist, or something that is no Verilog."""
    text = _ASSERTION.sub("$fatal", _COMMENT.sub("", verilog))
    for case in _CASE.finditer(text):
        if not _is_complete(case):
            target = _target(case)
            raise NetlistError(f"'{target}' is a latch: GHDL lost what it is when no choice of its case holds")
    if "$dlatch" in text:
        raise NetlistError("the netlist has a latch")
    if found := _VHDL.search(text):
        raise NetlistError(f"GHDL wrote something that is no Verilog: {found[0].strip()}")


def _division(found: re.Match[str]) -> str:
    """Division of signed numbers; what VHDL calls `mod` has the sign of its divisor."""
    begin, left, operator, right, comment = found.groups()
    result = f"$signed({left}) {operator} $signed({right})"
    if comment.endswith("smod"):
        is_other_sign = f"($signed({left}) < 0) != ($signed({right}) < 0)"
        result = f"{result} != 0 && {is_other_sign} ? {result} + $signed({right}) : {result}"
    return f"{begin}{result};{comment}"


def _constant(digits: str) -> str:
    return f"{len(digits)}'b{digits.translate(_LEVELS)}"


def _with_defaults(module: re.Match[str], architectures: dict[str, str]) -> str:
    """A module whose every `case` says what holds otherwise."""
    name, text = module.groups()
    if not _CASE.search(text):
        return module[0]
    defaults = dict(_defaults(architectures.get(name.lower(), "")))

    def complete(case: re.Match[str]) -> str:
        choices = case["choices"]
        default = defaults.get(_target(case))
        if not _is_complete(case) and default is not None:
            choices += f"{case['indent']}  default: {_target(case)} <= {default};\n"
        # It stands in no clocked block, so nothing is to be delayed.
        return f"case ({case['select']})\n{choices.replace(' <= ', ' = ')}{case['indent']}endcase"

    return f"module {name}{_CASE.sub(complete, text)}endmodule"


def _defaults(architecture: str) -> Iterator[tuple[str, str]]:
    """Each net that is selected by choices, and what it is otherwise, in Verilog."""
    for target, choices in _SELECT.findall(architecture):
        yield target, _expression(choices.rpartition(",")[2].strip())


def _expression(text: str) -> str:
    if found := re.fullmatch(r"""["']([01XZUWLH-]+)["']""", text):
        return _constant(found[1])
    if found := re.fullmatch(r"\((\d+) downto 0 => '(.)'\)", text):
        return _constant(found[2] * (int(found[1]) + 1))
    return text


def _target(case: re.Match[str]) -> str:
    choice = _CHOICE.search(case["choices"])
    return choice[2] if choice else ""


def _is_complete(case: re.Match[str]) -> bool:
    choices = _CHOICE.findall(case["choices"])
    return "default" in case["choices"] or (bool(choices) and len(choices) == 2 ** int(choices[0][0]))
