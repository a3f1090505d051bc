"""Find the end of a message in its payload, since senders of ROS 2 may append bytes.

`rclpy.serialization.serialize_message` returns its whole buffer, up to some 100 bytes more than the message. What a
node must know of a definition for this is a list of numbers, which generated nodes contain and
`node/cpp/firm/content.hpp` reads, too: the length of the prefix, the number of its checked bytes, these bytes, and
terms:

    n > 0                                       n bytes
    -a                                          padding to a multiple of `a`, counted from the end of the prefix
    0, count, terminator, stride, size, body    `size` numbers of terms, repeated

If a repetition's `count` is `COUNTED`, the four bytes before it are the count, which includes `terminator`. `stride` is
the size of each element after the first, or `VARYING` if the sizes differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from fusesoc_firm.frame.length import Align, Bytes, Repeat, Term, length_of
from fusesoc_firm.frame.model import COUNT_BYTES, Data, Frame

Content = tuple[int, ...]
REPEAT = 0
COUNTED = VARYING = -1


def trimmed(frame: Frame, payload: bytes) -> bytes:
    """Return the payload without the bytes after its message.

    A payload of another encoding, or one that ends within its message, is returned unchanged, so that its reader
    reports the fault.
    """
    return without_tail(content_of(frame), payload)


@lru_cache(maxsize=1024)
def content_of(frame: Frame) -> Content:
    """Return the numbers from which `without_tail` finds the end of a message; none if senders append no bytes."""
    if not frame.trailing_bytes:
        return ()
    checked = frame.prefix[: frame.checked_prefix]
    return (len(frame.prefix), len(checked), *checked, *_numbers(length_of(frame).terms))


def without_tail(content: Content, payload: bytes) -> bytes:
    """Return a payload without the bytes after the message that `content` describes, like `trimmed`."""
    if not content:
        return payload
    prefix, checked = content[:2]
    if payload[:checked] != bytes(content[2 : 2 + checked]):
        return payload
    walk = _Walk(content, prefix, payload)
    return payload[: prefix + walk.behind(2 + checked, len(content), 0)]


def _numbers(terms: Sequence[Term]) -> Iterator[int]:
    for term in terms:
        match term:
            case Bytes(count):
                yield count
            case Align(alignment):
                yield -alignment
            case Repeat(part, body, stride):
                fixed, terminator = (None, part.terminator) if isinstance(part, Data) else (part.count, 0)
                inner = tuple(_numbers(body))
                yield from (REPEAT, COUNTED if fixed is None else fixed, terminator)
                yield from (VARYING if stride is None else stride, len(inner), *inner)


class _Walk:
    """A walk over the terms of a content with the counts of a payload; positions count from the end of the prefix."""

    def __init__(self, content: Content, prefix: int, payload: bytes) -> None:
        self._content = content
        self._prefix = prefix
        self._payload = payload
        self._end = len(payload) - prefix

    def behind(self, place: int, last: int, position: int) -> int:
        """Return the position after the terms from `place` to before `last`."""
        while place < last:
            number = self._content[place]
            place += 1
            if number > 0:
                position += number
            elif number != REPEAT:
                position += -position % -number
            else:
                count, terminator, stride, size = self._content[place : place + 4]
                place += 4
                if count == COUNTED:
                    count = max(self._count_before(position) - terminator, 0)
                position = self._behind_elements(place, place + size, position, count, stride)
                place += size
        return position

    def _behind_elements(self, place: int, last: int, position: int, count: int, stride: int) -> int:
        if count and stride != VARYING:
            return self.behind(place, last, position) + (count - 1) * stride
        for _ in range(count):
            if position > self._end:
                break  # a count in a damaged payload can be billions
            position = self.behind(place, last, position)
        return position

    def _count_before(self, position: int) -> int:
        end = self._prefix + position
        return int.from_bytes(self._payload[end - COUNT_BYTES : end], "little")
