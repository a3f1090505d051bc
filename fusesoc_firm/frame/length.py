"""How long a payload gets: an expression over the counts of its variable parts, which hardware can compute.

An expression is a list of terms that are worked off from the first byte on: add bytes, pad to an alignment, repeat.
So the padding of CDR, which depends on all that came before, needs no formula of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.frame.model import COUNT_BYTES, Data, DataKind, Fixed, Frame, Loop, Node, Pad
from fusesoc_firm.frame.values import MessageValue, part_of, units_of

# Growth by one and the same body depends on the position modulo this at most.
_PERIOD = 8


@dataclass(frozen=True)
class Bytes:
    """`count` bytes more."""

    count: int


@dataclass(frozen=True)
class Align:
    """Up to a multiple of `alignment`, counted from behind the prefix."""

    alignment: int


@dataclass(frozen=True)
class Repeat:
    """`body`, once for each element of `part`.

    `stride` is what each element but the first takes, wherever it lies: only the first one's padding depends on the
    position. It is None where the elements differ, since they hold counts of their own.
    """

    part: Data | Loop
    body: tuple[Term, ...]
    stride: int | None


Term = Bytes | Align | Repeat
# The elements of a part within a value, as many as there are; None if their number has no limit.
_Elements = Callable[[Data | Loop, Any], Sequence[Any] | None]


@dataclass(frozen=True)
class Length:
    """The length of a payload, without the bytes that may trail: `prefix` bytes and `terms`."""

    prefix: int
    terms: tuple[Term, ...]

    @property
    def is_computed(self) -> bool:
        """Whether the counts of the message's own parts suffice: no element of a loop has a count in it."""
        return all(term.stride is not None for term in self.terms if isinstance(term, Repeat))

    @property
    def minimum(self) -> int:
        """The bytes of a message whose variable parts are empty."""
        shortest = _Walk(_shortest).behind(self.terms, 0)
        assert shortest is not None
        return self.prefix + shortest

    @property
    def maximum(self) -> int | None:
        """The bytes of a message whose variable parts are at their bounds; None if one has none."""
        longest = _Walk(_longest).behind(self.terms, 0)
        return None if longest is None else self.prefix + longest

    def of(self, message: MessageValue) -> int:
        """The bytes of a message. Raises `CodecError` for a part without value and default."""
        size = _Walk(_elements_of).behind(self.terms, 0, _Scope(message, 0))
        assert size is not None
        return self.prefix + size


def length_of(frame: Frame) -> Length:
    """The expression of a frame's payload."""
    prefix = len(frame.prefix)
    return Length(prefix, _joined([Bytes(-prefix), *_terms(frame.nodes)]))


def sent_length_of(frame: Frame) -> Length:
    """The expression of what a publisher sends: of a part that is not used its default, or nothing."""
    prefix = len(frame.prefix)
    return Length(prefix, _joined([Bytes(-prefix), *_terms(frame.nodes, is_sent=True)]))


def _terms(nodes: Sequence[Node], *, is_sent: bool = False) -> tuple[Term, ...]:
    """The terms of nodes; with `is_sent`, parts that are not used are constants."""
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
    """What lies between the count and the elements, if there are any."""
    return Align(node.alignment) if node.padding is None else Bytes(node.padding)


def _constant_terms(node: Data | Loop, value: Any) -> Iterator[Term]:
    """The terms of a part that always has the same value; None is that of an element without one."""
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
    """The same with neighbouring bytes added up."""
    joined: list[Term] = []
    for term in terms:
        last = joined[-1] if joined else None
        if isinstance(term, Bytes) and isinstance(last, Bytes):
            joined[-1] = Bytes(last.count + term.count)
        else:
            joined.append(term)
    return tuple(term for term in joined if term != Bytes(0))


def _stride(body: tuple[Term, ...]) -> int | None:
    """What every element but the first takes.

    Behind its widest padding an element is in step with the largest alignment of them all, and so ends where the
    next one is padded as each one after it.
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
    """Works off terms. `_grown` is what a part without a value adds, by the place of its term and the residue."""

    elements_of: _Elements
    _grown: dict[tuple[int, int], int | None] = field(default_factory=dict)

    def behind(self, terms: Sequence[Term], position: int, value: Any = None) -> int | None:
        """The position behind `terms`; None if there is no limit to it."""
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
            # Parts lie within parts, so each would be walked many times for every walk of the one around it.
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
        """`count` elements without a value: growth comes again when a residue does, so not all are walked."""
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
    """A message, or an element of a loop, and how many names lead to it."""

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
