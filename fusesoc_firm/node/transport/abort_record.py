"""Records of aborted frames, in the streams of engines without `tuser` (cores/axis, `firm_axis_abort_record`)."""

from __future__ import annotations

from fusesoc_firm.node.transport.transport import Burst

# The reserved id, and a length that no frame has.
_BEGINNING = b"\xff" * 5
RECORD_BYTES = 7


def aborted_id(burst: bytes | bytearray) -> int | None:
    """Return the id of the aborted frame if the burst is a record, or None."""
    return burst[5] if len(burst) == RECORD_BYTES and burst[:5] == _BEGINNING else None


def burst_of(data: bytes) -> Burst:
    """Return a burst; a record becomes a burst that aborts the frame."""
    identifier = aborted_id(data)
    return Burst(data) if identifier is None else Burst(bytes([identifier]), is_aborted=True)
