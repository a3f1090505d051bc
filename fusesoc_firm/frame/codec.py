"""Encode and decode frames in Python: nested dictionaries and lists to payload bytes, and back.

The codec uses the same Frame as the hardware generator, and serves stimuli and reports. It is never used to verify the
converters; independent serialisers verify them.
"""

from fusesoc_firm.frame.content import trimmed
from fusesoc_firm.frame.decoder import decode, decode_arrays, field_at, field_ranges, used_bytes
from fusesoc_firm.frame.encoder import encode
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.frame.values import CodecError, MessageValue

__all__ = [
    "CodecError",
    "MessageValue",
    "decode",
    "decode_arrays",
    "encode",
    "field_at",
    "field_ranges",
    "pack_frame",
    "trimmed",
    "used_bytes",
]


def pack_frame(identifier: int, payload: bytes, id_bytes: int = ID_BYTES) -> bytes:
    """Return the whole frame: the id, the payload's length and the payload."""
    return identifier.to_bytes(id_bytes, "little") + len(payload).to_bytes(LENGTH_BYTES, "little") + payload
