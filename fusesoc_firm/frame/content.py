"""Find the end of a message in its payload, since senders may append bytes.

`rclpy.serialization.serialize_message` returns its whole buffer, up to some 100 bytes more than the message.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from fusesoc_firm.frame.length import Align, Bytes, Length, Repeat, Term, length_of
from fusesoc_firm.frame.model import COUNT_BYTES, Data, Frame


def trimmed(frame: Frame, payload: bytes) -> bytes:
    """Return the payload without the bytes after its message.

    A payload of another encoding, or one that ends within its message, is returned unchanged, so that its reader
    reports the fault.
    """
    has_content = payload[: frame.checked_prefix] == frame.prefix[: frame.checked_prefix]
    if not (frame.trailing_bytes and has_content):
        return payload
    return payload[: content_bytes(frame, payload)]


def content_bytes(frame: Frame, payload: bytes) -> int:
    """Return the length of the message that begins the payload, from the counts in it.

    For a payload that ends within its message, the result is any number above the payload's length.
    """
    length = _length_of(frame)
    return length.prefix + _Walk(length.prefix, payload).behind(length.terms, 0)


@lru_cache(maxsize=1024)
def _length_of(frame: Frame) -> Length:
    return length_of(frame)


class _Walk:
    """An evaluation of terms with the counts of a payload; positions count from the end of the prefix."""

    def __init__(self, prefix: int, payload: bytes) -> None:
        self._prefix = prefix
        self._payload = payload
        self._end = len(payload) - prefix

    def behind(self, terms: Sequence[Term], position: int) -> int:
        """Return the position after `terms`."""
        for term in terms:
            match term:
                case Bytes(count):
                    position += count
                case Align(alignment):
                    position += -position % alignment
                case Repeat():
                    position = self._behind_part(term, position)
        return position

    def _behind_part(self, term: Repeat, position: int) -> int:
        count = self._count(term, position)
        if count and term.stride is not None:
            return self.behind(term.body, position) + (count - 1) * term.stride
        for _ in range(count):
            if position > self._end:
                break  # a count in a damaged payload can be billions
            position = self.behind(term.body, position)
        return position

    def _count(self, term: Repeat, position: int) -> int:
        """Return the number of elements; the count before them is the end of the term before."""
        part = term.part
        if not isinstance(part, Data) and part.count is not None:
            return part.count
        end = self._prefix + position
        count = int.from_bytes(self._payload[end - COUNT_BYTES : end], "little")
        return max(count - part.terminator, 0) if isinstance(part, Data) else count
