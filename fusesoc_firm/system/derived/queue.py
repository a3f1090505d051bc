"""The queue of frames before a subscriber, or its watchdog: the specification's `queue` and `overflow`."""

from __future__ import annotations

from fusesoc_firm.system.derived.model import Converter, Overflow, Queue
from fusesoc_firm.system.written.specification import BLOCK, Block, Project
from fusesoc_firm.text.diagnostics import Diagnostics

MOST_FRAMES = 256
_MOST_BYTES = 1 << 23


def queue_of(block: Block, subscriber: Converter, project: Project, faults: Diagnostics) -> Queue | None:
    """Return the queue of a subscriber with its longest payload, or its watchdog, or None; note faults.

    If the longest payload is a default, warn about the memory.
    """
    overflow = Overflow(str(block.overflow or BLOCK))
    if block.queue is None:
        return _watchdog_of(block, overflow, project, faults)
    least = 2 if overflow is Overflow.DROP_OLDEST else 1
    if not least <= block.queue <= MOST_FRAMES:
        faults.error(
            f"'{block.name}' cannot have 'queue: {block.queue}'",
            block.place("queue"),
            f"legal here: {least} to {MOST_FRAMES}" + ("; a frame that is leaving is not dropped" * (least > 1)),
        )
        return None
    longest = subscriber.max_length or subscriber.frame.payload_bytes
    queue = Queue(block.queue, longest, overflow)
    _check_size(block, subscriber, queue, faults)
    return queue


def _watchdog_of(block: Block, overflow: Overflow, project: Project, faults: Diagnostics) -> Queue | None:
    """Return the watchdog of a subscriber that drops frames without a queue, and so can drop only the newest frame."""
    if overflow is Overflow.DROP_NEWEST and project.watchdog:
        return Queue(0, 0, overflow, project.watchdog)
    if overflow is not Overflow.BLOCK:
        faults.error(
            f"'{block.name}' drops frames, but has no 'queue'" + " and no 'watchdog'" * (not project.watchdog),
            block.place("overflow"),
            "add 'queue: <number of frames>'",
        )
    return None


def _check_size(block: Block, subscriber: Converter, queue: Queue, faults: Diagnostics) -> None:
    size = queue.frames * queue.longest
    if size > _MOST_BYTES:
        faults.error(
            f"the queue of '{block.name}' needs {size:,} bytes of memory",
            block.place("queue"),
            f"legal here: up to {_MOST_BYTES:,}, for {queue.frames} payloads of {queue.longest:,} bytes",
        )
    elif subscriber.has_default_length:
        faults.warn(
            f"the queue of '{block.name}' takes {size:,} bytes of memory",
            block.place("queue"),
            f"{subscriber.frame.message} is unbounded; add 'maxLength: <bytes of the longest payload>'",
        )
