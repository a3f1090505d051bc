"""The queue of frames before a subscriber: the specification's `queue` and `overflow`."""

from __future__ import annotations

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived.model import Overflow, Queue
from fusesoc_firm.system.written.specification import BLOCK, Block
from fusesoc_firm.text.diagnostics import Diagnostics

_MOST_FRAMES = 256
_MOST_BYTES = 1 << 23
# Bytes of the longest payload of a message without bounds.
_UNBOUNDED = 65_536


def queue_of(block: Block, frame: Frame, faults: Diagnostics) -> Queue | None:
    """Return the queue of a subscriber, or None without one; note faults, and warn of a length that was assumed."""
    overflow = Overflow(str(block.overflow or BLOCK))
    if block.queue is None:
        if overflow is not Overflow.BLOCK:
            faults.error(
                f"'{block.name}' drops frames, but has no 'queue'",
                block.place("overflow"),
                "add 'queue: <number of frames>'",
            )
        return None
    least = 2 if overflow is Overflow.DROP_OLDEST else 1
    if not least <= block.queue <= _MOST_FRAMES:
        faults.error(
            f"'{block.name}' cannot have 'queue: {block.queue}'",
            block.place("queue"),
            f"legal here: {least} to {_MOST_FRAMES}" + ("; a frame that is leaving is not dropped" * (least > 1)),
        )
        return None
    maximum = length_of(frame).maximum
    queue = Queue(block.queue, _UNBOUNDED if maximum is None else maximum, overflow)
    _check_size(block, frame, queue, faults, is_assumed=maximum is None)
    return queue


def _check_size(block: Block, frame: Frame, queue: Queue, faults: Diagnostics, *, is_assumed: bool) -> None:
    size = queue.frames * queue.longest
    if size > _MOST_BYTES:
        faults.error(
            f"the queue of '{block.name}' needs {size:,} bytes of memory",
            block.place("queue"),
            f"legal here: up to {_MOST_BYTES:,}, for {queue.frames} payloads of {queue.longest:,} bytes",
        )
    elif is_assumed:
        faults.warn(
            f"the queue of '{block.name}' takes {size:,} bytes of memory",
            block.place("queue"),
            f"{frame.message} is unbounded; its payloads are assumed to have at most {queue.longest:,} bytes",
        )
