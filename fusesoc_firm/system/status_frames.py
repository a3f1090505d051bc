"""Frames that read and write the registers of a system's status (cores/status/README.md)."""

from __future__ import annotations

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.model import ID_BYTES
from fusesoc_firm.system.derived.ids import ONE_BYTE, TWO_BYTES
from fusesoc_firm.system.derived.status import status_id

# The bit of an address that makes an access a write.
WRITE = 1 << 31
_WORD_BYTES = 4


def read_request(address: int, id_bytes: int = ID_BYTES) -> bytes:
    """Return the frame that reads the register at an address."""
    return _frame(address, 0, id_bytes)


def write_request(address: int, word: int, id_bytes: int = ID_BYTES) -> bytes:
    """Return the frame that writes a word to the register at an address."""
    return _frame(address | WRITE, word, id_bytes)


def status_answer(address: int, word: int, id_bytes: int = ID_BYTES) -> bytes:
    """Return the answer to a request: its address, and the register's word before the access."""
    return _frame(address, word, id_bytes)


def _frame(address: int, word: int, id_bytes: int) -> bytes:
    payload = b"".join(item.to_bytes(_WORD_BYTES, "little") for item in (address, word))
    return pack_frame(status_id(id_bytes), payload, id_bytes)


def answered(frame: bytes) -> tuple[int, int] | None:
    """Return the address and the word of an answer, with an id of any size, or None for any other frame."""
    address, word = frame[-2 * _WORD_BYTES : -_WORD_BYTES], frame[-_WORD_BYTES:]
    found = int.from_bytes(address, "little"), int.from_bytes(word, "little")
    return found if frame in [_frame(*found, id_bytes) for id_bytes in (ONE_BYTE, TWO_BYTES)] else None
