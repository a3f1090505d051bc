"""Determine the longest payload that each subscriber accepts."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

from fusesoc_firm.frame.length import DEFAULT_LONGEST, MOST_BYTES, bounded_payload, length_of
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.written.specification import AXI_STREAM, PUBLISHER, Block, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# The default with a link, which stores whole frames. With the header and the bytes that an adapter sends late, such a
# frame fills a memory of 2,048 bytes.
_LINK_DEFAULT = 2000


def with_longest_payloads(
    subscribers: tuple[Converter, ...], project: Project, blocks: Mapping[str, Block], faults: Diagnostics
) -> tuple[Converter, ...]:
    """Return the subscribers, those of variable size with their longest payloads; note faults in `maxLength`."""
    has_link = project.interconnect != AXI_STREAM
    _check_keys(blocks, {item.block for item in subscribers if item.frame.is_fixed_size}, faults)
    return tuple(
        item if item.frame.is_fixed_size else _with_longest_payload(item, blocks[item.block], has_link, faults)
        for item in subscribers
    )


def _check_keys(blocks: Mapping[str, Block], fixed: Set[str], faults: Diagnostics) -> None:
    """Note a fault for each `maxLength` that limits nothing."""
    for name, block in blocks.items():
        if block.max_length is None:
            continue
        if name in fixed:
            message = f"'{name}' has a 'maxLength', but {block.message} has a fixed size"
            faults.error(message, block.place("max_length"), "remove the key: only messages of variable size need it")
        elif block.mode == PUBLISHER:
            message = f"'{name}' has a 'maxLength', which is legal only for subscribers"
            faults.error(message, block.place("max_length"), "the key 'buffer' limits the payloads of a publisher")


def _with_longest_payload(subscriber: Converter, block: Block, has_link: bool, faults: Diagnostics) -> Converter:
    bounded, given = bounded_payload(subscriber.frame), block.max_length
    if given is None:
        default = _default(is_software=subscriber.software is not None, has_link=has_link)
        return replace(subscriber, max_length=bounded or default, has_default_length=bounded is None)
    least, most = length_of(subscriber.frame).minimum, bounded or MOST_BYTES
    if not least <= given <= most:
        message = f"'maxLength' of '{subscriber.block}' cannot be {given} bytes for {subscriber.frame.message}"
        faults.error(message, block.place("max_length"), f"legal here: {least} to {most}")
    return replace(subscriber, max_length=given)


def _default(*, is_software: bool, has_link: bool) -> int:
    """Return the longest payload of a message without bounds; software of the system itself keeps its lengths."""
    if has_link:
        return _LINK_DEFAULT
    return MOST_BYTES if is_software else DEFAULT_LONGEST
