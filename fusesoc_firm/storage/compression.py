"""Decompress data whose size is known, and whole files; damaged data never expands beyond what is expected."""

from __future__ import annotations

import bz2
import shutil
import sys
from pathlib import Path
from typing import Any

import lz4.frame

from fusesoc_firm.storage.contents import DamageError

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

__all__ = ["MOST_BYTES", "ZSTD_MAGIC", "decompressed", "expand_file", "message", "zstd"]

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MOST_BYTES = 2**30
"""The maximum size in bytes of a chunk or message after decompression."""


def decompressed(data: bytes, form: str, size: int) -> bytes:
    """Return data with `size` bytes after decompression. Raise `DamageError` if they differ or the form is unknown."""
    if form in ("", "none"):
        found = data
    elif size > MOST_BYTES:
        raise DamageError(f"a compressed part states {size} bytes; at most {MOST_BYTES} are read")
    else:
        found = _expanded(data, form, size + 1)
    if len(found) != size:
        raise DamageError(f"a part has not the {size} bytes that it states")
    return found


def message(data: bytes) -> bytes:
    """Return a message that is compressed by itself. Raise `DamageError` if that is impossible."""
    found = _expanded(data, "zstd", MOST_BYTES + 1)
    if len(found) > MOST_BYTES:
        raise DamageError(f"a compressed message has more than {MOST_BYTES} bytes")
    return found


def expand_file(source: Path, target: Path) -> None:
    """Decompress a file of the form zstd. Raise `DamageError` if that is impossible."""
    try:
        with source.open("rb") as packed, zstd.open(packed, "rb") as content, target.open("wb") as file:
            shutil.copyfileobj(content, file)
    except (zstd.ZstdError, EOFError) as error:
        raise DamageError(f"the compressed file is damaged: {error}", "copy the bag again") from error


def _expanded(data: bytes, form: str, most: int) -> bytes:
    """Return at most the first `most` bytes."""
    makers: dict[str, Any] = {
        "zstd": zstd.ZstdDecompressor,
        "lz4": lz4.frame.LZ4FrameDecompressor,
        "bz2": bz2.BZ2Decompressor,
    }
    if form not in makers:
        raise DamageError(f"compression '{form}' is unknown; known: {', '.join(makers)}, none")
    decompressor = makers[form]()
    found = bytearray()
    try:
        while data and len(found) < most:
            found += decompressor.decompress(data, max_length=most - len(found))
            if not decompressor.eof:
                break
            # Further frames may follow.
            data, decompressor = decompressor.unused_data or b"", makers[form]()
    except (zstd.ZstdError, RuntimeError, OSError, EOFError, ValueError) as error:
        raise DamageError(f"a part that is compressed with {form} is damaged: {error}") from error
    return bytes(found)
