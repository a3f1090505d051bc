"""Compute the length of a payload as an expression over the counts of the variable parts, suitable for hardware.

An expression is a list of terms: add bytes, pad to an alignment, repeat. Evaluation goes from the first byte to the
last, since CDR's padding depends on all previous bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.frame.model import COUNT_BYTES, Data, DataKind, Fixed, Frame, Loop, Node, Pad
from fusesoc_firm.frame.values import MessageValue, part_of, units_of

# The default of the longest payload in bytes for messages without bounds, and the hardware's limit.
DEFAULT_LONGEST = 65_536
MOST_BYTES = 2**30 - 1

# The growth by a body of fixed size depends on the position modulo at most this number.
_PERIOD = 8


@dataclass(frozen=True)
class Bytes:
    """The term that advances by `count` bytes."""

    count: int


@dataclass(frozen=True)
class Align:
    """The term that pads to a multiple of `alignment`, counted from the end of the prefix."""

    alignment: int


@dataclass(frozen=True)
class Repeat:
    """The term that repeats `body` for each element of `part`.

    `stride` is the size of each element after the first, which does not depend on the position: only the padding of the
    first element does. If the elements contain counts and therefore differ in size, `stride` is None.
    """

    part: Data | Loop
    body: tuple[Term, ...]
    stride: int | None


Term = Bytes | Align | Repeat
# A function that returns the elements of a part within a value, or None if their number is unlimited.
_Elements = Callable[[Data | Loop, Any], Sequence[Any] | None]


@dataclass(frozen=True)
class Length:
    """The length of a payload without trailing bytes, as `prefix` bytes followed by `terms`."""

    prefix: int
    terms: tuple[Term, ...]

    @property
    def is_computed(self) -> bool:
        """Whether the counts of top-level parts determine the length, since no loop's element contains a count."""
        return all(term.stride is not None for term in self.terms if isinstance(term, Repeat))

    @property
    def minimum(self) -> int:
        """The number of bytes in a message with empty variable parts."""
        shortest = _Walk(_shortest).behind(self.terms, 0)
        assert shortest is not None
        return self.prefix + shortest

    @property
    def maximum(self) -> int | None:
        """The number of bytes in a message with all variable parts at their bounds; None if a part is unbounded."""
        longest = _Walk(_longest).behind(self.terms, 0)
        return None if longest is None else self.prefix + longest

    def of(self, message: MessageValue) -> int:
        """Return the number of bytes in a message's payload.

        Raise `CodecError` for a part without a value or default.
        """
        size = _Walk(_elements_of).behind(self.terms, 0, _Scope(message, 0))
        assert size is not None
        return self.prefix + size


def length_of(frame: Frame) -> Length:
    """Return the expression for the length of a frame's payload."""
    prefix = len(frame.prefix)
    return Length(prefix, _joined([Bytes(-prefix), *_terms(frame.nodes)]))


def bounded_payload(frame: Frame) -> int | None:
    """Return the longest payload in bytes, including trailing bytes; None if the message has no bounds."""
    longest = length_of(frame).maximum
    return None if longest is None else min(longest + frame.trailing_bytes, MOST_BYTES)


def longest_payload(frame: Frame) -> int:
    """Return the longest payload in bytes that a subscriber accepts by default."""
    bounded = bounded_payload(frame)
    return DEFAULT_LONGEST if bounded is None else bounded


def sent_length_of(frame: Frame) -> Length:
    """Return the length of the payload that a publisher sends: unused parts have their defaults or are empty."""
    prefix = len(frame.prefix)
    return Length(prefix, _joined([Bytes(-prefix), *_terms(frame.nodes, is_sent=True)]))


def _terms(nodes: Sequence[Node], *, is_sent: bool = False) -> tuple[Term, ...]:
    """Return the terms for nodes; with `is_sent`, unused parts are constants."""
    terms: list[Term] = []
    for node in nodes:
        match node:
            case Fixed(size):
                terms.append(Bytes(size))
            case Pad(alignment):
                terms.append(Align(alignment))
            case Data() | Loop() if is_sent and not node.is_used:
                terms += _constant_terms(node, node.default)
            case Data():
                body = _joined([_gap(node), Bytes(node.element.size)])
                terms += [Bytes(COUNT_BYTES), Repeat(node, body, node.element.size), Bytes(node.terminator)]
            case Loop():
                body = _terms(node.body, is_sent=is_sent)
                terms += [Bytes(COUNT_BYTES if node.count is None else 0), Repeat(node, body, _stride(body))]
    return _joined(terms)


def _gap(node: Data) -> Term:
    """Return the term for the gap between the count and the elements, if there are elements."""
    return Align(node.alignment) if node.padding is None else Bytes(node.padding)


def _constant_terms(node: Data | Loop, value: Any) -> Iterator[Term]:
    """Yield the terms for a part with a constant value; a value of None means an element without a value."""
    if isinstance(node, Data):
        size = node.element.size
        count = len(value or ()) if node.kind is DataKind.ARRAY else len(units_of(node, value or "")) // size
        yield Bytes(COUNT_BYTES)
        if count:
            yield from (_gap(node), Bytes(count * size))
        yield Bytes(node.terminator)
        return
    if node.count is None:
        yield Bytes(COUNT_BYTES)
    for element in value or [None] * (node.count or 0):
        for inner in node.body:
            if isinstance(inner, Data | Loop):
                yield from _constant_terms(inner, inner.default if element is None else element)
            else:
                yield from _terms([inner])


def _joined(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return the terms with adjacent `Bytes` terms merged."""
    joined: list[Term] = []
    for term in terms:
        last = joined[-1] if joined else None
        if isinstance(term, Bytes) and isinstance(last, Bytes):
            joined[-1] = Bytes(last.count + term.count)
        else:
            joined.append(term)
    return tuple(term for term in joined if term != Bytes(0))


def _stride(body: tuple[Term, ...]) -> int | None:
    """Return the size in bytes of every element after the first, or None if the sizes differ.

    After its widest padding, an element is aligned to its largest alignment. The element therefore ends at a position
    after which all following elements have the same padding.
    """
    if any(isinstance(term, Repeat) for term in body):
        return None
    walk = _Walk(_longest)
    first = walk.behind(body, 0)
    assert first is not None
    second = walk.behind(body, first)
    assert second is not None
    return second - first


@dataclass
class _Walk:
    """An evaluation of terms; `_grown` caches the growth of a part without a value, by term and residue."""

    elements_of: _Elements
    _grown: dict[tuple[int, int], int | None] = field(default_factory=dict)

    def behind(self, terms: Sequence[Term], position: int, value: Any = None) -> int | None:
        """Return the position after `terms`, or None if the length is unlimited."""
        for term in terms:
            match term:
                case Bytes(count):
                    position += count
                case Align(alignment):
                    position += -position % alignment
                case Repeat():
                    end = self._behind_part(term, position, value)
                    if end is None:
                        return None
                    position = end
        return position

    def _behind_part(self, term: Repeat, position: int, value: Any) -> int | None:
        elements = self.elements_of(term.part, value)
        if elements is None:
            return None
        if not elements:
            return position
        if term.stride is not None:
            first = self.behind(term.body, position)
            return None if first is None else first + (len(elements) - 1) * term.stride
        if isinstance(elements, range):
            # Parts are nested: without this cache, every walk of a part would walk each nested part many times.
            key = id(term), position % _PERIOD
            if key not in self._grown:
                self._grown[key] = self._growth_alike(term, key[1], len(elements))
            growth = self._grown[key]
            return None if growth is None else position + growth
        for element in elements:
            end = self.behind(term.body, position, _Scope(element, len(term.part.path)))
            assert end is not None
            position = end
        return position

    def _growth_alike(self, term: Repeat, start: int, count: int) -> int | None:
        """Return the position after `count` elements without a value.

        Growth repeats with the residue, so few steps suffice.
        """
        passed: dict[int, tuple[int, int]] = {}
        position, done = start, 0
        while done < count:
            before = passed.setdefault(position % _PERIOD, (done, position))
            if before[0] < done:
                periods = (count - done) // (done - before[0])
                position += periods * (position - before[1])
                done += periods * (done - before[0])
                passed = {}
                if done == count:
                    break
            end = self.behind(term.body, position)
            if end is None:
                return None
            position, done = end, done + 1
        return position - start


@dataclass(frozen=True)
class _Scope:
    """A message or a loop's element, with the number of names above the value."""

    value: Any
    depth: int


def _elements_of(part: Data | Loop, scope: _Scope) -> Sequence[Any]:
    value = part_of(scope.value, part, scope.depth)
    if isinstance(part, Data) and part.kind is not DataKind.ARRAY:
        return range(len(units_of(part, value)) // part.element.size)
    elements: Sequence[Any] = value
    return elements


def _shortest(part: Data | Loop, _: Any) -> Sequence[Any]:
    return range(part.count or 0 if isinstance(part, Loop) else 0)


def _longest(part: Data | Loop, _: Any) -> Sequence[Any] | None:
    count = part.count if isinstance(part, Loop) else None
    most = part.bound if count is None else count
    return None if most is None else range(most)
