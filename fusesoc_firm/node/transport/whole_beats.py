"""Frames in whole beats, for engines that do not tell the valid bytes of a beat (`tkeep`).

To the system, zeros follow the payload up to the end of a beat, and the length in the header includes them: a message
of ROS 2 may have up to three bytes after its end, which subscribers drop. From the system, the header tells the end of
the frame. The system needs no hardware for this; its `tkeep` is tied to ones.
"""

from __future__ import annotations

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.node.transport.abort_record import RECORD_BYTES, aborted_id
from fusesoc_firm.node.transport.transport import TransportError

_HEADER_BYTES = ID_BYTES + LENGTH_BYTES


def in_whole_beats(frame: bytes, beat_bytes: int) -> bytes:
    """Return a frame to the system, extended to whole beats."""
    return pack_frame(frame[0], frame[_HEADER_BYTES:] + bytes(-len(frame) % beat_bytes))


def frame_in(data: bytes) -> bytes:
    """Return the frame from the system, or the record, at the beginning of a buffer. May raise `TransportError`."""
    if aborted_id(data[:RECORD_BYTES]) is not None:
        return data[:RECORD_BYTES]
    size = _HEADER_BYTES + int.from_bytes(data[ID_BYTES:_HEADER_BYTES], "little")
    if size > len(data):
        raise TransportError(f"a frame announces {size} bytes; the buffer has {len(data)}")
    return data[:size]
