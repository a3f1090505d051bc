"""What a node of ROS 1 in the sockets of a W5500 or W5200 can do: the limits of a system with this interconnect."""

from __future__ import annotations

from collections.abc import Sequence

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.written.specification import Block, Specification
from fusesoc_firm.text.diagnostics import Diagnostics

# Sockets of the chip for connections: of eight, one calls the master, and two remain for calls of others.
CONNECTIONS = 5
# Payload bytes of the longest message: it is written to a buffer of the chip as a whole, after its length.
LONGEST = 2044
# The numbers of registrations, and of types, which the node's program counts in a byte and in 6 bits.
MOST_TOPICS, MOST_TYPES = 127, 62


def check_chip(
    written: Specification, subscribers: Sequence[Converter], publishers: Sequence[Converter], faults: Diagnostics
) -> None:
    """Note what the node cannot do, and warn where all of its topics cannot be connected at the same time."""
    project, blocks = written.project, {str(block.name): block for block in written.blocks}
    message, source = f"interconnect '{project.interconnect}' ", project.interconnect.source
    if project.clock is None:
        faults.error(
            f"{message}needs the clock's frequency", source, "add 'clock' to 'project', such as 'clock: 12 MHz'"
        )
    for item in (*subscribers, *publishers):
        _check_size(item, blocks[item.block], faults)
    for item in publishers:
        _check_durability(item, blocks[item.block], message, faults)
    _check_counts(subscribers, publishers, blocks, message, faults)


def _check_size(item: Converter, block: Block, faults: Diagnostics) -> None:
    """Note a converter whose payloads, or the payloads that its block asks for, do not fit in the chip's buffer."""
    key = next((name for name in ("max_length", "buffer") if (getattr(block, name) or 0) > LONGEST), None)
    if key:
        faults.error(
            f"payloads of '{item.block}' cannot have {getattr(block, key)} bytes",
            block.place(key),
            f"a buffer of the chip holds {LONGEST}",
        )
    elif item.frame.is_fixed_size and item.frame.payload_bytes > LONGEST:
        _note_long(item, block, item.frame.payload_bytes, "use a smaller message", faults)
    elif not item.frame.is_fixed_size and (least := length_of(item.frame).minimum) > LONGEST:
        _note_long(item, block, least, "use a smaller message", faults)
    elif (item.max_length or 0) > LONGEST:
        _note_long(item, block, item.max_length or 0, f"add 'maxLength: {LONGEST}' to the block", faults)


def _note_long(item: Converter, block: Block, size: int, hint: str, faults: Diagnostics) -> None:
    message = f"'{item.block}' has payloads of {size} bytes, but a buffer of the chip holds {LONGEST}"
    faults.error(message, block.name.source, hint)


def _check_durability(item: Converter, block: Block, message: str, faults: Diagnostics) -> None:
    if item.quality.is_transient_local and block.qos is not None:
        key = "durability" if block.qos.durability else "profile"
        faults.error(f"{message}cannot latch the topic of '{item.block}'", block.qos.place(key), "legal here: volatile")


def _check_counts(
    subscribers: Sequence[Converter],
    publishers: Sequence[Converter],
    blocks: dict[str, Block],
    message: str,
    faults: Diagnostics,
) -> None:
    """Note more topics than connections or numbers, and warn where each topic once is more than all connections."""
    items = (*subscribers, *publishers)
    if len(subscribers) > CONNECTIONS:
        first = blocks[subscribers[CONNECTIONS].block]
        hint = "of eight sockets, one calls the master and two are kept for calls of others"
        faults.error(f"{message}allows {CONNECTIONS} subscribers, not {len(subscribers)}", first.name.source, hint)
    elif len(items) > CONNECTIONS:
        place = blocks[items[CONNECTIONS].block].name.source
        hint = "other nodes wait until a connection ends"
        faults.warn(f"{message}has {CONNECTIONS} connections for {len(items)} topics", place, hint)
    types = dict.fromkeys(item.frame.message for item in items)
    if len(items) > MOST_TOPICS or len(types) > MOST_TYPES:
        place = blocks[items[min(len(items) - 1, MOST_TOPICS)].block].name.source
        hint = f"legal here: up to {MOST_TOPICS} topics of up to {MOST_TYPES} types"
        faults.error(f"{message}cannot have {len(items)} topics of {len(types)} types", place, hint)
