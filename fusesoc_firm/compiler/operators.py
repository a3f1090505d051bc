"""The operators of `robot:acc:firm_float`, `firm_fixed` and `firm_python`, as their `operators.yaml` describe them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.compiler.fixed import MOST_BITS
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.kinds import Kind
from fusesoc_firm.tools.library_path import library_root

# The operations of the graph that are operators, each with the operator's name.
_NAMES = {
    "add": "add",
    "multiply": "multiply",
    "divide": "divide",
    "square_root": "square_root",
    "to_float": "from_fixed",
    "to_integer": "to_fixed",
    "resize": "resize",
    **{name: name for name in ("multiply_add", "atan2", "exp", "log", "sincos", "divmod")},
}
# Those with two results.
_PAIRS = ("sincos", "divmod")
# The sizes of fixed-point operators that are measured.
_FIXED_BITS = (16, 24, 32, MOST_BITS)
# The widths of integers that are converted; one operator converts all that are not wider.
_WIDTHS = (32, 64, 65)
SHORT = "short"
"""The form of operators with few registers."""


@dataclass(frozen=True)
class Cost:
    """The cells of an operator in an ECP5-8 and its clock in MHz; `longest` is the latency with the worst operands."""

    lut: int
    ff: int
    dsp: int
    megahertz: float
    longest: int


@dataclass(frozen=True)
class Operator:
    """An entity that computes one operation: the generics, and the ports of the operands and of the result.

    The ports of the result have the same width, and the first one is in the lowest bits. The result is there `latency`
    cycles after its operands. With `has_wait`, one result is computed at a time, and it may be later. `width` is the
    bits of the result, and `operand` those of the operands.
    """

    operation: str
    entity: str
    generics: tuple[tuple[str, str], ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    latency: int
    has_wait: bool
    width: int
    operand: int
    cost: Cost


def table_files() -> list[Path]:
    """Return the paths of the descriptions of all operators."""
    return [library_root() / "cores" / "acc" / core / "operators.yaml" for core in ("float", "fixed", "python")]


@cache
def _table() -> Mapping[str, Any]:
    found: dict[str, Any] = {}
    for file in table_files():
        found |= yaml.safe_load(file.read_text(encoding="utf-8"))["operators"]
    return found


def is_operator(node: Node) -> bool:
    """Whether an operator computes the node, which other nodes may share."""
    if node.operation in ("add", "multiply", "divide"):
        return node.kind.is_real
    return node.operation in _NAMES


def operator_of(node: Node, form: str = SHORT) -> Operator:
    """Return the operator that computes a node; `form` is preferred, if the operator has it."""
    of_operand = node.operation in ("to_integer", "resize", "sincos")
    size = node.operands[0].kind if of_operand else node.kind
    description = _table()[_NAMES[node.operation] if size.is_float or not size.format else f"fixed_{node.operation}"]
    forms = description["forms"]
    width, generics = _width(node)
    facts = forms.get(form, forms["default"])[f"int{width}" if node.operation == "divmod" else _size(size)]
    latency = facts["latency"]
    if not isinstance(latency, int):
        latency = next(cycles for most, cycles in latency.items() if width <= most)
    latency += facts.get("digit", 0) * (size.bits + size.fraction)
    ports = tuple(name for name, type_ in description["inputs"].items() if type_ != "bit")
    results = tuple(description["outputs"]) if node.operation in _PAIRS else (next(iter(description["outputs"])),)
    return Operator(
        node.operation,
        description["entity"],
        (*((name, str(value).lower()) for name, value in facts["generics"].items()), *generics),
        ports,
        results,
        latency,
        facts["interval"] != 1,
        width if node.operation == "to_integer" else node.kind.bits,
        width if node.operation in ("to_float", "divmod") else size.bits,
        Cost(facts["lut"], facts["ff"], facts["dsp"], facts["megahertz"], facts.get("longest", latency)),
    )


def _size(kind: Kind) -> str:
    if kind.format:
        return next(f"fixed{bits}" for bits in _FIXED_BITS if kind.bits <= bits)
    return "float32" if kind.bits == 32 else "float64"


def _width(node: Node) -> tuple[int, tuple[tuple[str, str], ...]]:
    """Return the width of an operation's integers, and the generics that set it."""
    if node.operation == "divmod":
        return node.kind.bits // 2, ()
    if node.operation == "to_float":
        value = node.operands[0]
        needed = value.bits + (not value.is_signed)
        width = next(item for item in _WIDTHS if needed <= item)
        return width, (("WIDTH", str(width)), ("FRACTION", str(value.kind.fraction)))
    if node.operation == "to_integer":
        truncates = "true" if node.payload == "truncate" else "false"
        fraction = str(node.kind.fraction)
        return node.bits, (("WIDTH", str(node.bits)), ("FRACTION", fraction), ("TRUNCATES", truncates))
    if node.kind.format:
        generics = {"WIDTH": node.kind.bits, "FRACTION": node.kind.fraction}
        return node.kind.bits, tuple(
            (f"{port}_{name}", str(value)) for port in ("A", "B", "OUT") for name, value in generics.items()
        )
    return node.kind.bits, ()
