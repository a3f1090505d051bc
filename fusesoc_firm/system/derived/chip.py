"""The limits of a system that is a ROS 1 node and uses the sockets of a W5500 or W5200."""

from __future__ import annotations

from collections.abc import Sequence

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.derived.services import ros_name_of
from fusesoc_firm.system.derived.timing import seconds_of
from fusesoc_firm.system.written.specification import SERVER, Block, Specification
from fusesoc_firm.text.diagnostics import Diagnostics

# The chip's sockets for connections: of eight sockets, one calls the master, and two accept calls of other nodes.
CONNECTIONS = 5
# The longest payload in bytes: a buffer of the chip holds the length and the whole message.
LONGEST = 2044
# The node's program counts registrations in a byte, and types in 6 bits.
MOST_TOPICS, MOST_TYPES = 127, 62
# The longest time limit of a call in seconds: 255 alarms of 8 s.
LONGEST_LIMIT = 2000


def check_chip(
    written: Specification, subscribers: Sequence[Converter], publishers: Sequence[Converter], faults: Diagnostics
) -> None:
    """Note unsupported features, and warn if not all topics can be connected at the same time."""
    project, blocks = written.project, {str(block.name): block for block in written.blocks}
    message, source = f"interconnect '{project.interconnect}' ", project.interconnect.source
    if project.clock is None:
        faults.error(
            f"{message}needs the clock's frequency", source, "add 'clock' to 'project', such as 'clock: 12 MHz'"
        )
    services = [*dict.fromkeys(block.service_block for block in written.blocks if block.service_block)]
    _check_services(services, message, faults)
    topics = [[item for item in side if not item.service] for side in (subscribers, publishers)]
    for item in subscribers:
        _check_size(item, blocks[item.block], LONGEST, faults)
    for item in publishers:
        # A byte before a response reports success or failure of the call.
        _check_size(item, blocks[item.block], LONGEST - 1 if item.service else LONGEST, faults)
        _check_durability(item, blocks[item.block], message, faults)
    _check_counts(topics, services, blocks, message, faults)


def _check_services(services: Sequence[Block], message: str, faults: Diagnostics) -> None:
    """Note actions and clients, services with the same name, and time limits that the node cannot measure."""
    owners: dict[str, str] = {}
    for block in services:
        place = block.mode.source if block.mode else block.name.source
        if block.action is not None or block.mode != SERVER:
            kind = "actions" if block.action is not None else "clients of services"
            hint = f"legal here: topics, and services with 'mode: {SERVER}'"
            faults.error(f"{message}has no {kind}, such as '{block.name}'", place, hint)
            continue
        name = ros_name_of(block)
        if (owner := owners.setdefault(name, str(block.name))) != block.name:
            faults.error(f"'{block.name}' and '{owner}' have the same name {name}", block.name.source, "use others")
        if block.time_limit and (seconds_of(block.time_limit) or 0) > LONGEST_LIMIT:
            hint = f"legal here: up to {LONGEST_LIMIT} s"
            faults.error(f"'timeLimit' cannot be '{block.time_limit}'", block.time_limit.source, hint)


def _check_size(item: Converter, block: Block, most: int, faults: Diagnostics) -> None:
    """Note a converter if its actual or requested payload size exceeds the chip's buffer."""
    key = next((name for name in ("max_length", "buffer") if (getattr(block, name) or 0) > most), None)
    least = item.frame.payload_bytes if item.frame.is_fixed_size else length_of(item.frame).minimum
    if key:
        faults.error(
            f"payloads of '{item.block}' cannot have {getattr(block, key)} bytes",
            block.place(key),
            f"a buffer of the chip holds {most}",
        )
    elif least > most:
        _note_long(item, block, (least, most), "use a smaller message", faults)
    elif not item.frame.is_fixed_size and (item.max_length or 0) > most:
        _note_long(item, block, (item.max_length or 0, most), f"add 'maxLength: {most}' to the block", faults)


def _note_long(item: Converter, block: Block, sizes: tuple[int, int], hint: str, faults: Diagnostics) -> None:
    size, most = sizes
    message = f"'{item.block}' has payloads of {size} bytes, but a buffer of the chip holds {most}"
    faults.error(message, block.name.source, hint)


def _check_durability(item: Converter, block: Block, message: str, faults: Diagnostics) -> None:
    if item.quality.is_transient_local and block.qos is not None:
        key = "durability" if block.qos.durability else "profile"
        faults.error(f"{message}cannot latch the topic of '{item.block}'", block.qos.place(key), "legal here: volatile")


def _check_counts(
    topics: Sequence[Sequence[Converter]],
    services: Sequence[Block],
    blocks: dict[str, Block],
    message: str,
    faults: Diagnostics,
) -> None:
    """Note too many subscribers, topics or types, and warn if there are more topics and services than connections.

    `topics` are the subscribers and the publishers.
    """
    subscribers, publishers = topics
    items = (*subscribers, *publishers)
    places = [block.name.source for block in (*(blocks[item.block] for item in items), *services)]
    uses = f"{len(items)} topics" + (f" and {len(services)} services" if services else "")
    if len(subscribers) > CONNECTIONS:
        hint = "of eight sockets, one calls the master and two are kept for calls of others"
        faults.error(f"{message}allows {CONNECTIONS} subscribers, not {len(subscribers)}", places[CONNECTIONS], hint)
    elif len(places) > CONNECTIONS:
        hint = "other nodes wait until a connection ends"
        faults.warn(f"{message}has {CONNECTIONS} connections for {uses}", places[CONNECTIONS], hint)
    types = len(dict.fromkeys(item.frame.message for item in items)) + len(services)
    if len(places) > MOST_TOPICS or types > MOST_TYPES:
        place = places[min(len(places) - 1, MOST_TOPICS)]
        hint = f"legal here: up to {MOST_TOPICS} topics of up to {MOST_TYPES} types; each service counts as one of both"
        faults.error(f"{message}cannot have {uses} of {types} types", place, hint)
