"""What a node of ROS 2 in fabric can do so far: the limits of a system with `interconnect: ethernet`."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, NetworkKind, Phy
from fusesoc_firm.system.written.specification import BEST_EFFORT, RELIABLE, VOLATILE, Block, Project, Specification
from fusesoc_firm.text.diagnostics import Diagnostics

MOST_SUBSCRIBERS, PUBLISHERS = 8, 1
# Bytes of the longest payload: of a sample in one packet, and of the node's memory for a sample to send.
LONGEST_TAKEN, LONGEST_SENT = 1344, 128
# The frequencies of clk in MHz that the line of each PHY needs, and the hint about them.
_CLOCKS = {
    Phy.GMII: ((125, 125), "125 MHz, which is also the clock of the line"),
    Phy.MII: ((25, None), "25 MHz, the clock of the line at 100 Mbit/s, and more"),
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
        (system.publishers, PUBLISHERS, "published topic"),
    ):
        if len(items) > most:
            place = blocks[items[most].block].name.source
            faults.error(f"{message}allows {most} {name} so far, not {len(items)}", place)
    for item in (*system.subscribers, *system.publishers):
        _check_reliability(item, blocks[item.block], message, faults)
    for item in system.subscribers:
        _check_size(item, blocks[item.block], LONGEST_TAKEN, faults)
    for item in system.publishers:
        _check_durability(item, blocks[item.block], message, faults)
        _check_size(item, blocks[item.block], LONGEST_SENT, faults)


def longest_sent(publishers: Iterable[Converter]) -> int:
    """Return the bytes of the longest payload that a node sends."""
    return max(map(_longest, publishers))


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
            message = f"'{phy.value}' is not possible with a clock of {project.clock}"
            faults.error(message, project.clock.source, f"legal here: {hint}")


def _check_reliability(item: Converter, block: Block, message: str, faults: Diagnostics) -> None:
    if item.quality.is_reliable:
        given = block.qos and (block.qos.reliability or block.qos.profile)
        place = given.source if given else block.name.source
        hint = f"add 'qos: {{reliability: {BEST_EFFORT}}}' to the block"
        faults.error(f"{message}cannot make '{item.block}' {RELIABLE} yet", place, hint)


def _check_durability(item: Converter, block: Block, message: str, faults: Diagnostics) -> None:
    if item.quality.is_transient_local and block.qos is not None:
        key = "durability" if block.qos.durability else "profile"
        hint = f"legal here: {VOLATILE}"
        faults.error(f"{message}cannot latch the topic of '{item.block}' yet", block.qos.place(key), hint)


def _check_size(item: Converter, block: Block, longest: int, faults: Diagnostics) -> None:
    """Note a converter whose payloads, or the payloads that its block asks for, are longer than `longest` bytes."""
    direction = "send" if longest == LONGEST_SENT else "take"
    reason = f"but the node can {direction} {longest} so far"
    key = next((name for name in ("max_length", "buffer") if (getattr(block, name) or 0) > longest), None)
    if key:
        message = f"payloads of '{item.block}' have up to {getattr(block, key)} bytes, {reason}"
        faults.error(message, block.place(key))
        return
    least = item.frame.payload_bytes if item.frame.is_fixed_size else length_of(item.frame).minimum
    if max(least, _longest(item)) > longest:
        is_short = least <= longest
        hint = f"add 'maxLength: {longest}' to the block" if is_short else "use a smaller message"
        size = _longest(item) if is_short else least
        faults.error(f"'{item.block}' has payloads of {size} bytes, {reason}", block.name.source, hint)
