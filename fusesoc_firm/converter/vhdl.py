"""Literals, operands and conditions in VHDL, for values that templates print; the templates contain the statements."""

from __future__ import annotations

from collections.abc import Iterable

# The approximate length of a line in a condition.
LINE = 80


def vhdl_type(width: int | None) -> str:
    """Return `std_logic` if `width` is None, otherwise a vector type with `width` bits."""
    return "std_logic" if width is None else f"std_logic_vector({width - 1} downto 0)"


def index_bits(values: int) -> int:
    """Return the width of an index of `values` values, like `index_bits` of firm_axis_pkg."""
    return max(1, (values - 1).bit_length())


def bit(vector: str, number: int) -> str:
    """Return the expression for a bit of a vector."""
    return f"{vector}({number})"


def bits(vector: str, high: int, low: int) -> str:
    """Return the expression for a range of bits in a vector."""
    return f"{vector}({high} downto {low})"


def binary(value: int, width: int) -> str:
    """Return a `width`-bit number as a literal."""
    return f'"{value:0{width}b}"'


def hexadecimal(data: bytes) -> str:
    """Return bytes as a literal, with the first byte lowest."""
    return f'x"{data[::-1].hex()}"'


def bits_of_bool(port: str) -> str:
    """Return the expression for the wire byte of a bool's bit."""
    return f'"0000000" & {port}'


def between(number: str, first: int, last: int | None) -> str:
    """Return the condition that a natural number is in the range `first` to `last`; None means no limit."""
    if first == last:
        return f"{number} = {first}"
    lower, upper = f"{number} >= {first}", f"{number} <= {last}"
    if last is None:
        return lower
    return f"{lower} and {upper}" if first > 0 else upper


def within(number: str, first: int, last: int | None) -> str:
    """Return the condition that a number is in the range `first` to `last`, as an operand of other conditions."""
    condition = between(number, first, last)
    return f"({condition})" if " and " in condition else condition


def wrapped(operands: Iterable[str], operator: str, length: int) -> list[str]:
    """Return lines of about `length` characters with operands joined by an operator, which is omitted at line ends."""
    lines: list[str] = []
    for operand in operands:
        if lines and len(lines[-1]) + len(operand) < length:
            lines[-1] += f" {operator} {operand}"
        else:
            lines.append(operand)
    return lines


def all_of(conditions: Iterable[str]) -> str:
    """Return the bit that is '1' if all conditions are '1'."""
    return " and ".join(conditions)


def any_of(conditions: Iterable[str]) -> str:
    """Return the condition that at least one of the conditions is true, or an empty string without conditions."""
    return " or\n        ".join(wrapped(conditions, "or", LINE))
