"""The limits of a system that is a ROS 2 node in fabric, with `interconnect: ethernet`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, NetworkKind, Phy, Quality
from fusesoc_firm.system.written.specification import Block, Project, Specification
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef

MOST_SUBSCRIBERS = MOST_PUBLISHERS = 8
# The longest payload in bytes: in one frame, in several frames, and by default for a publisher.
LONGEST_IN_FRAME, LONGEST, LONGEST_SENT_BY_DEFAULT = 1344, 65280, 1024
# The headers in bytes of an IPv4 packet with a payload, including submessages before the payload.
_HEADERS_BYTES = 256
# The buffer for received payloads in bytes; a longer payload is in the memory for samples in several packets.
WAITING_BYTES = 4096
_LEAST_DISCOVERY, _MOST_DISCOVERY = 4096, 16384
# The minimum values of the hardware's generics.
LEAST_REASSEMBLED, _LEAST_ASSEMBLED = 2048, 1024
# The maximum number of samples that a writer keeps, and of slots for the samples of all writers.
MOST_DEPTH, MOST_SLOTS = 127, 256
# The maximum size of all slots in bytes.
MOST_HISTORY_BYTES = 1 << 20
_SHORTEST_SLOT = 2
# For each PHY, the lowest and highest frequency of clk in MHz, and a hint.
_CLOCKS = {
    Phy.GMII: ((125, 125), "125 MHz, which is also the clock of the line"),
    Phy.MII: ((25, None), "25 MHz, the clock of the line at 100 Mbit/s, and more"),
    Phy.RGMII: ((125, 125), "125 MHz, which is also the clock of the line"),
    Phy.RMII: ((50, 50), "50 MHz, which is also the clock of the line"),
}
_MEGAHERTZ = 10**6


def check_ethernet(written: Specification, system: DerivedSystem, faults: Diagnostics) -> None:
    """Note the faults of an Ethernet node; other systems are not checked here."""
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
    """Return the size of a slot in bytes, a power of two that holds the longest payload sent."""
    return max(_SHORTEST_SLOT, _power(max(map(_longest, publishers), default=1)))


def reassembled_bytes(system: DerivedSystem) -> int:
    """Return the size in bytes of the longest reassembled packet, a power of two; 0 without reassembly."""
    longest, given = _longest_of_several(system), system.network.reassembly if system.network else 0
    needed = max(given, longest + _HEADERS_BYTES if longest else 0)
    return max(LEAST_REASSEMBLED, _power(needed)) if needed else 0


def assembled_bytes(system: DerivedSystem) -> int:
    """Return the size in bytes of the longest assembled sample, a power of two; 0 without assembly."""
    longest = _longest_of_several(system)
    return max(_LEAST_ASSEMBLED, _power(longest)) if longest else 0


def discovery_bytes(system: DerivedSystem) -> int:
    """Return the size of the discovery buffer in bytes, a power of two.

    Peers announce all their endpoints in one packet. The buffer holds its payloads and the fields of its submessages.
    If the buffer is full, the loss is counted, and the node requests these endpoints again, two at a time.
    """
    return min(_MOST_DISCOVERY, max(_LEAST_DISCOVERY, reassembled_bytes(system)))


def slot_count(used: int) -> int:
    """Return the number of slots of a history with `used` slots, a power of two."""
    return max(2, _power(used))


def kept_of(quality: Quality) -> int:
    """Return the number of samples that a writer keeps for requests of its readers."""
    return quality.depth if quality.is_reliable or quality.is_transient_local else 1


def ring_slots(quality: Quality) -> int:
    """Return the number of a writer's slots, a power of two; one slot is for the next sample."""
    return 1 << kept_of(quality).bit_length()


def _longest_of_several(system: DerivedSystem) -> int:
    """Return the size in bytes of the longest received payload if it takes several frames, otherwise 0."""
    longest = max(map(_longest, system.subscribers), default=0)
    return longest if longest > LONGEST_IN_FRAME else 0


def _power(size: int) -> int:
    """Return the least power of two that is not less than a size."""
    return 1 << (size - 1).bit_length()


def _longest(item: Converter) -> int:
    if item.frame.is_fixed_size:
        return item.frame.payload_bytes
    return item.buffer or item.max_length or 0


def _check_clock(project: Project, phy: Phy, clock: Fraction | None, faults: Diagnostics) -> None:
    """Note a missing clock, and a frequency that the PHY does not support.

    A clock from a generator call has no place in the specification and is not checked: it belongs to a simulated line.
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
    """Return the number of slots; note each publisher with too many kept messages, and the first one without slots."""
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
    """Note a fault if all slots together are too large."""
    size = slots * slot_bytes(publishers)
    if size > MOST_HISTORY_BYTES:
        block = blocks[max(publishers, key=_longest).block]
        need = f"{slots} slots, each for the longest message, that of '{block.name}', need {size}"
        hint = "give publishers a smaller 'depth' in 'qos', or the longest messages a smaller 'maxLength'"
        faults.error(f"{message}has {MOST_HISTORY_BYTES} bytes for the last messages; {need}", block.name.source, hint)


def _place_of_depth(block: Block) -> SourceRef | None:
    """Return the place that sets the number of kept messages of a block."""
    if block.qos is None:
        return block.name.source
    return block.qos.place("profile" if block.qos.profile and block.qos.depth is None else "depth")


def _check_size(item: Converter, block: Block, direction: str, faults: Diagnostics) -> None:
    """Note a converter whose payloads exceed the hardware's limit, or whose smallest payload exceeds the default."""
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
