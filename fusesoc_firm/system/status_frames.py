"""Frames that read and write the registers of a system's status (cores/status/README.md)."""

from __future__ import annotations

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.system.derived.status import STATUS_ID

# The bit of an address that makes an access a write.
WRITE = 1 << 31
_WORD_BYTES = 4


def read_request(address: int) -> bytes:
    """Return the frame that reads the register at an address."""
    return _frame(address, 0)


def write_request(address: int, word: int) -> bytes:
    """Return the frame that writes a word to the register at an address."""
    return _frame(address | WRITE, word)


def status_answer(address: int, word: int) -> bytes:
    """Return the answer to a request: its address, and the register's word before the access."""
    return _frame(address, word)


def _frame(address: int, word: int) -> bytes:
    return pack_frame(STATUS_ID, b"".join(item.to_bytes(_WORD_BYTES, "little") for item in (address, word)))


def answered(frame: bytes) -> tuple[int, int] | None:
    """Return the address and the word of an answer, or None for another frame."""
    start = pack_frame(STATUS_ID, bytes(2 * _WORD_BYTES))[: -2 * _WORD_BYTES]
    if len(frame) != len(start) + 2 * _WORD_BYTES or not frame.startswith(start):
        return None
    address, word = frame[len(start) : -_WORD_BYTES], frame[-_WORD_BYTES:]
    return int.from_bytes(address, "little"), int.from_bytes(word, "little")
