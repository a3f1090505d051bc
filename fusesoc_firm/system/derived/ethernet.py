"""What a node of ROS 2 in fabric can do so far: the limits of a system with `interconnect: ethernet`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, NetworkKind, Phy, Quality
from fusesoc_firm.system.written.specification import Block, Project, Specification
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

MOST_SUBSCRIBERS = MOST_PUBLISHERS = 8
# Bytes of the longest payload: of a sample in one frame, of one in several, and of one that is sent by default.
LONGEST_IN_FRAME, LONGEST, LONGEST_SENT_BY_DEFAULT = 1344, 65280, 1024
# Bytes of the headers beside a payload in a packet of IPv4, with further submessages before it.
_HEADERS_BYTES = 256
# Bytes of payloads that wait; a longer payload is in the memory of a sample in several packets.
WAITING_BYTES = 4096
_LEAST_DISCOVERY, _MOST_DISCOVERY = 4096, 16384
# What the generics of the hardware may be at least.
LEAST_REASSEMBLED, _LEAST_ASSEMBLED = 2048, 1024
# Samples of a writer that others may ask for, and slots for the samples of all writers together.
MOST_DEPTH, MOST_SLOTS = 127, 256
# Bytes of all slots.
MOST_HISTORY_BYTES = 1 << 20
_SHORTEST_SLOT = 2
# The frequencies of clk in MHz that the line of each PHY needs, and the hint about them.
_CLOCKS = {
    Phy.GMII: ((125, 125), "125 MHz, which is also the clock of the line"),
    Phy.MII: ((25, None), "25 MHz, the clock of the line at 100 Mbit/s, and more"),
    Phy.RGMII: ((125, 125), "125 MHz, which is also the clock of the line"),
    Phy.RMII: ((50, 50), "50 MHz, which is also the clock of the line"),
}
_MEGAHERTZ = 10**6


def check_ethernet(written: Specification, system: DerivedSystem, faults: Diagnostics) -> None:
    """Note what the hardware of a node by Ethernet cannot do; other systems have no limits here."""
    if system.network is None or system.network.kind is not NetworkKind.ETHERNET:
        return
    project, blocks = written.project, {str(block.name): block for block in written.blocks}
    message = f"interconnect '{project.interconnect}' "
    _check_clock(project, system.network.phy, system.clock, faults)
    for items, most, name in (
        (system.subscribers, MOST_SUBSCRIBERS, "subscribers"),
        (system.publishers, MOST_PUBLISHERS, "publishers"),
    ):
        if len(items) > most:
            place = blocks[items[most].block].name.source
            faults.error(f"{message}allows {most} {name}, not {len(items)}", place)
    for item in system.subscribers:
        _check_size(item, blocks[item.block], "take", faults)
    before = len(faults.found)
    for item in system.publishers:
        _check_size(item, blocks[item.block], "send", faults)
    has_sizes = len(faults.found) == before
    slots = _check_slots(system.publishers, blocks, message, faults)
    if has_sizes and slots <= MOST_SLOTS:
        _check_history(system.publishers, slots, blocks, message, faults)


def slot_bytes(publishers: Iterable[Converter]) -> int:
    """Return the bytes of a slot, a power of two: the longest payload that a node sends fits in."""
    return max(_SHORTEST_SLOT, _power(max(map(_longest, publishers), default=1)))


def reassembled_bytes(system: DerivedSystem) -> int:
    """Return the bytes of the longest packet that is reassembled, a power of two; 0 if none needs to be."""
    longest, given = _longest_of_several(system), system.network.reassembly if system.network else 0
    needed = max(given, longest + _HEADERS_BYTES if longest else 0)
    return max(LEAST_REASSEMBLED, _power(needed)) if needed else 0


def assembled_bytes(system: DerivedSystem) -> int:
    """Return the bytes of the longest sample that is put together, a power of two; 0 if none is taken."""
    longest = _longest_of_several(system)
    return max(_LEAST_ASSEMBLED, _power(longest)) if longest else 0


def discovery_bytes(system: DerivedSystem) -> int:
    """Return the bytes of discovery that wait, a power of two.

    Peers announce all their endpoints in one packet, with whose payloads the fields of its submessages wait. One that
    finds no room is counted, and the node asks for these endpoints again, two at a time.
    """
    return min(_MOST_DISCOVERY, max(_LEAST_DISCOVERY, reassembled_bytes(system)))


def slot_count(used: int) -> int:
    """Return the slots of a history of which so many are used, a power of two."""
    return max(2, _power(used))


def kept_of(quality: Quality) -> int:
    """Return the number of a writer's samples that others may ask for."""
    return quality.depth if quality.is_reliable or quality.is_transient_local else 1


def ring_slots(quality: Quality) -> int:
    """Return the number of a writer's slots, a power of two: one of them is for the sample that comes."""
    return 1 << kept_of(quality).bit_length()


def _longest_of_several(system: DerivedSystem) -> int:
    """Return the bytes of the longest payload that a node takes, if it comes in several frames; otherwise 0."""
    longest = max(map(_longest, system.subscribers), default=0)
    return longest if longest > LONGEST_IN_FRAME else 0


def _power(size: int) -> int:
    """Return the next power of two from a size on."""
    return 1 << (size - 1).bit_length()


def _longest(item: Converter) -> int:
    if item.frame.is_fixed_size:
        return item.frame.payload_bytes
    return item.buffer or item.max_length or 0


def _check_clock(project: Project, phy: Phy, clock: Fraction | None, faults: Diagnostics) -> None:
    """Note a missing clock, and one that the PHY's line cannot have.

    A clock that a generator call gives has no place in the specification: it is that of a simulated line.
    """
    (least, most), hint = _CLOCKS[phy]
    if project.clock is None:
        message = f"interconnect '{project.interconnect}' needs the clock's frequency"
        faults.error(message, project.interconnect.source, f"add 'clock' to 'project', with '{phy.value}': {hint}")
    elif clock is not None and project.clock.source is not None:
        megahertz = clock / _MEGAHERTZ
        if megahertz < least or (most is not None and megahertz > most):
            message = f"'{phy.value}' as 'phy' of 'network' is not possible with a clock of {project.clock}"
            faults.error(message, project.clock.source, f"legal here: {hint}")


def _check_slots(
    publishers: Iterable[Converter], blocks: Mapping[str, Block], message: str, faults: Diagnostics
) -> int:
    """Return the number of slots; note a publisher with too many kept messages, or else the first one without slots."""
    used = 0
    for item in publishers:
        block, kept = blocks[item.block], kept_of(item.quality)
        if kept > MOST_DEPTH:
            text = f"{message}keeps up to {MOST_DEPTH} messages of a topic, not {kept} of '{item.block}'"
            faults.error(text, _place_of_depth(block), f"add 'depth: {MOST_DEPTH}' or less to the block's 'qos'")
            continue
        before, used = used, used + ring_slots(item.quality)
        if before <= MOST_SLOTS < used:
            text = f"{message}has {MOST_SLOTS} slots for the last messages; with '{item.block}', it needs {used}"
            hint = "give publishers a smaller 'depth' in 'qos': each needs a power of two of slots, more than its depth"
            faults.error(text, _place_of_depth(block), hint)
    return slot_count(used)


def _check_history(
    publishers: Sequence[Converter], slots: int, blocks: Mapping[str, Block], message: str, faults: Diagnostics
) -> None:
    """Note too many bytes of all slots."""
    size = slots * slot_bytes(publishers)
    if size > MOST_HISTORY_BYTES:
        block = blocks[max(publishers, key=_longest).block]
        need = f"{slots} slots, each for the longest message, that of '{block.name}', need {size}"
        hint = "give publishers a smaller 'depth' in 'qos', or the longest messages a smaller 'maxLength'"
        faults.error(f"{message}has {MOST_HISTORY_BYTES} bytes for the last messages; {need}", block.name.source, hint)


def _place_of_depth(block: Block) -> SourceRef | None:
    """Return where a block says how many messages are kept."""
    if block.qos is None:
        return block.name.source
    return block.qos.place("profile" if block.qos.profile and block.qos.depth is None else "depth")


def _check_size(item: Converter, block: Block, direction: str, faults: Diagnostics) -> None:
    """Note a converter whose payloads, or those that its block asks for, are too long or longer than the default."""
    reason = f"but the node can {direction} {LONGEST}"
    key = next((name for name in ("max_length", "buffer") if (getattr(block, name) or 0) > LONGEST), None)
    if key:
        message = f"payloads of '{item.block}' have up to {getattr(block, key)} bytes, {reason}"
        faults.error(message, block.place(key))
        return
    least = item.frame.payload_bytes if item.frame.is_fixed_size else length_of(item.frame).minimum
    if max(least, _longest(item)) > LONGEST:
        is_short = least <= LONGEST
        hint = f"add 'maxLength: {LONGEST}' to the block" if is_short else "use a smaller message"
        size = _longest(item) if is_short else least
        faults.error(f"'{item.block}' has payloads of {size} bytes, {reason}", block.name.source, hint)
    elif least > _longest(item):
        text = f"'{item.block}' has payloads of {least} bytes and more, but without 'maxLength', {_longest(item)} fit"
        faults.error(text, block.name.source, f"add 'maxLength' to the block; legal here: {least} to {LONGEST}")
