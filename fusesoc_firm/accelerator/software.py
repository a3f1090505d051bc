"""The place of accelerators in software in a system: topics of other programs, and routes to publishers."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem, End, MessageSide, Topic


def sent_elsewhere(system: DerivedSystem) -> dict[Topic, End]:
    """Return the outputs of software in other programs, as topics with their ends."""
    return _elsewhere(system, lambda type_: type_.outputs)


def taken_elsewhere(system: DerivedSystem) -> dict[Topic, End]:
    """Return the topics that software in other programs receives, each with its end."""
    return _elsewhere(system, lambda type_: type_.inputs)


def _elsewhere(system: DerivedSystem, sides: Callable[[AcceleratorType], Iterable[MessageSide]]) -> dict[Topic, End]:
    return {
        Topic(system.names[end], side.frame): end
        for block in system.software.blocks
        if not block.type.accelerator.sources
        for side in sides(block.type)
        for end in (End(block.block, side.prefix),)
    }


def way_to(publisher: str, system: DerivedSystem) -> set[str]:
    """Return the blocks in hardware on the routes to a publisher."""
    found: set[str] = set()
    new = {publisher}
    while new:
        new = {item.source.block for item in system.connections for end in item.sinks if end.block in new} - found
        found |= new
    return found
