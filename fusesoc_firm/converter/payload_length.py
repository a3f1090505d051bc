"""Frame -> configuration of `<pkg>_<type>_length`, which computes a payload's length from the lengths of its parts.

This is the dissertation's listing 6.5 as hardware, with ROS's sizes: a nested message has no header, and CDR adds
padding. The size of an element does not depend on its position, so the sizes of all elements are simply added. Padding
depends only on positions modulo the largest alignment, so a chain of two or three bits beside the sum suffices.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from fusesoc_firm.converter.message_ports import LENGTH_BITS, message_side
from fusesoc_firm.converter.ports import ros_path
from fusesoc_firm.converter.vhdl import bits
from fusesoc_firm.frame.length import Align, Bytes, Repeat, Term, sent_length_of
from fusesoc_firm.frame.model import Data, Frame, Loop, Path
from fusesoc_firm.text.naming import entity_name
from fusesoc_firm.text.render import Context

LENGTH_TEMPLATE = "vhdl/payload_length.vhd"

_SIGNAL = re.compile(r"[a-z]+_\d+")


@dataclass(frozen=True)
class Statement:
    """An assignment of a sum to an unsigned signal for values below `modulus`; a word and a number name the signal.

    The sum consists of `operands` and `constant`. If `counted` is set, the sum is zero while that operand is zero.
    """

    word: str
    modulus: int
    operands: tuple[str, ...]
    constant: int = 0
    counted: str = ""
    comment: str = ""
    number: int = 0

    @property
    def signal(self) -> str:
        """The signal's name."""
        return f"{self.word}_{self.number}"

    @property
    def bits(self) -> int:
        """The width of the signal."""
        return self.modulus.bit_length() - 1


def length_entity(frame: Frame, suffix: str = "") -> str:
    """`<pkg>_<type>_length`, with a suffix that identifies the selection of parts."""
    return f"{entity_name(frame.message.package, frame.message.name)}_length{suffix}"


def length_ports(frame: Frame) -> tuple[str, ...]:
    """The message side's ports that determine the payload's length, for a frame with a computed length."""
    side = message_side(frame)
    return tuple(side.length(part) for part in _counted_parts(sent_length_of(frame).terms))


def payload_length_configuration(frame: Frame, suffix: str = "") -> Context:
    """The configuration of `<pkg>_<type>_length`, for a frame with a computed length."""
    length = sent_length_of(frame)
    assert length.is_computed, f"the lengths at the ports of {frame.message} do not determine the payload's length"
    parts = _counted_parts(length.terms)
    names = dict(zip((part.path for part in parts), length_ports(frame), strict=True))
    # Positions count from the end of the prefix.
    total = _Sum(_modulus(length.terms), {path: _unsigned(name) for path, name in names.items()}, [])
    total.add(length.terms)
    total.add_bytes(length.prefix)
    return {
        "entity": length_entity(frame, suffix),
        "message": str(frame.message),
        "middleware": frame.ros.title,
        "summand_count": len(total.elements),
        "has_paddings": total.modulus > 1,
        "chain_length": _chain_length(total.statements),
        "place_bits": total.modulus.bit_length() - 1,
        "ports": [{"name": names[part.path], "comment": f"{ros_path(part.path)}: {part.ros_type}"} for part in parts],
        "statements": [
            {
                "signal": item.signal,
                "bits": item.bits,
                "operands": [*item.operands],
                "more": item.constant if item.constant > 0 else None,
                "less": -item.constant if item.constant < 0 else None,
                "counted": item.counted,
                "comment": item.comment,
            }
            for item in total.statements
        ],
        "elements": [*total.elements],
        "constant": total.constant,
        "paddings": [*total.paddings],
        "rest_bits": total.rest_bits,
    }


def _chain_length(statements: Sequence[Statement]) -> int:
    """The largest number of paddings that depend on each other in a chain."""
    lengths: dict[str, int] = {}
    for item in statements:
        before = [lengths[name] for name in _SIGNAL.findall(" ".join(item.operands)) if name in lengths]
        lengths[item.signal] = max(before, default=0) + (item.word == "padding")
    return max(lengths.values(), default=0)


def _modulus(terms: Sequence[Term]) -> int:
    """The largest alignment, at least 1."""
    inner = [_modulus(term.body) for term in terms if isinstance(term, Repeat)]
    return max([1, *inner, *(term.alignment for term in terms if isinstance(term, Align))])


def _counted_parts(terms: Sequence[Term]) -> list[Data | Loop]:
    """The parts with a variable number of elements of nonzero size."""
    return [
        term.part
        for term in terms
        if isinstance(term, Repeat) and term.body and not (isinstance(term.part, Loop) and term.part.count is not None)
    ]


@dataclass
class _Sum:
    """A running sum of terms, with the statements that compute it.

    The sum consists of the signals `elements` and `paddings` and of `constant`. The position after the terms, modulo
    `modulus`, is the sum of `offset` and the signals in `origin`, which are listed with their widths. `counts` holds
    the number of elements by path.
    """

    modulus: int
    counts: Mapping[Path, str]
    statements: list[Statement]
    origin: list[str] = field(default_factory=list)
    offset: int = 0
    elements: list[str] = field(default_factory=list)
    paddings: list[str] = field(default_factory=list)
    constant: int = 0

    @property
    def rest_bits(self) -> int:
        """The width in bits of the sum without the elements."""
        return max(1, (self.constant + len(self.paddings) * self.modulus).bit_length())

    def add(self, terms: Sequence[Term]) -> None:
        """Add terms that are always present."""
        for term in terms:
            match term:
                case Bytes(count):
                    self.add_bytes(count)
                case Align(alignment) if self.origin:
                    self._add_padding(alignment)
                case Align(alignment):
                    self.add_bytes(-self.offset % alignment)
                case Repeat(part=Loop(count=int() as count), stride=int() as stride):
                    if count:
                        self.add(term.body)
                        self.add_bytes((count - 1) * stride)
                case Repeat() if term.body:
                    self._add_elements(term)

    def add_bytes(self, count: int) -> None:
        """Add a known number of bytes."""
        self.constant += count
        self.offset += count

    def _add_padding(self, alignment: int) -> None:
        offset = self.offset % self.modulus
        comment = f"up to a multiple of {alignment}"
        place = self._state(Statement("place", self.modulus, (*self.origin,), offset, comment=comment))
        position = place if alignment == self.modulus else _low(place, alignment)
        padding = self._state(Statement("padding", alignment, (_minus(position),)))
        self.paddings.append(padding)
        self.origin = [] if alignment == self.modulus else [place, padding]
        self.offset = 0

    def _add_elements(self, term: Repeat) -> None:
        """Add any number of elements; the first one may differ in size from the others."""
        assert term.stride is not None
        count = self.counts[term.part.path]
        first = replace(self, origin=[*self.origin], paddings=[], constant=-term.stride)
        first.add(term.body)
        is_uniform = not first.paddings and not first.constant
        operands = (_times(count, term.stride), *first.paddings)
        comment = f"{ros_path(term.part.path)}: {term.part.ros_type}"
        elements = self._state(
            Statement("bytes", 2**LENGTH_BITS, operands, first.constant, "" if is_uniform else count, comment)
        )
        self.elements.append(elements)
        if term.stride % self.modulus or not is_uniform:
            self.origin.append(_low(elements, self.modulus))

    def _state(self, statement: Statement) -> str:
        """Add a statement with a new number, and return the signal that it assigns."""
        number = sum(other.word == statement.word for other in self.statements)
        self.statements.append(replace(statement, number=number))
        return self.statements[-1].signal


def _low(signal: str, modulus: int) -> str:
    """A signal modulo a power of two."""
    return bits(signal, modulus.bit_length() - 2, 0)


def _minus(number: str) -> str:
    return f"0 - {number}"


def _unsigned(port: str) -> str:
    return f"unsigned({port})"


def _times(count: str, stride: int) -> str:
    """The size of `count` elements of `stride` bytes each."""
    if stride == 1:
        return count
    if stride.bit_count() == 1:
        return f"shift_left({count}, {stride.bit_length() - 1})"
    return f"resize({count} * {stride}, {LENGTH_BITS})"
