"""Determine the longest payload that each subscriber accepts, and each publisher sends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from fusesoc_firm.frame.length import DEFAULT_LONGEST, MOST_BYTES, bounded_payload, length_of
from fusesoc_firm.system.derived.ethernet import LONGEST_IN_FRAME, LONGEST_SENT_BY_DEFAULT
from fusesoc_firm.system.derived.model import Converter
from fusesoc_firm.system.written.specification import AXI_STREAM, CHIPS, ETHERNET, Block, Project
from fusesoc_firm.text.diagnostics import Diagnostics

LINK_DEFAULT = 2000
"""The default with a link, which stores whole frames.

With its header and the adapter's late bytes, such a frame fills a memory of 2,048 bytes.
"""


def with_longest_payloads(
    subscribers: tuple[Converter, ...], project: Project, blocks: Mapping[str, Block], faults: Diagnostics
) -> tuple[Converter, ...]:
    """Return the subscribers, with the longest payload of each that has variable size; note faults in `maxLength`."""
    _check_keys(blocks, subscribers, faults)
    return tuple(
        item if item.frame.is_fixed_size else _limited(item, blocks[item.block], _default(item, project), faults)
        for item in subscribers
    )


def with_longest_sent(
    publishers: tuple[Converter, ...],
    subscribers: Iterable[Converter],
    project: Project,
    blocks: Mapping[str, Block],
    faults: Diagnostics,
) -> tuple[Converter, ...]:
    """Return the publishers, with the longest payload of each that may pause; note faults in `maxLength`.

    By default, a publisher sends at most as much as the system's subscribers accept from the host, since a response
    often has the size of its cause. A node with a TCP/IP chip has the default of a link. An Ethernet node has a default
    that fits in a small memory.
    """
    _check_keys(blocks, publishers, faults)
    least = LINK_DEFAULT if project.interconnect in CHIPS else DEFAULT_LONGEST
    default = max([least, *(item.max_length or 0 for item in subscribers if item.software is None)])
    if project.interconnect == ETHERNET:
        default = LONGEST_SENT_BY_DEFAULT
    return tuple(
        _limited(item, blocks[item.block], default if item.software is None else MOST_BYTES, faults)
        if item.may_pause
        else item
        for item in publishers
    )


def _check_keys(blocks: Mapping[str, Block], converters: Iterable[Converter], faults: Diagnostics) -> None:
    """Note a fault for each `maxLength` that limits nothing."""
    for item in converters:
        block = blocks[item.block]
        if block.max_length is None:
            continue
        if item.frame.is_fixed_size:
            message = f"'{item.block}' has a 'maxLength', but {item.frame.message} has a fixed size"
            faults.error(message, block.place("max_length"), "remove the key: only messages of variable size need it")
        elif item.buffer:
            message = f"'{item.block}' has a 'maxLength' and a 'buffer'"
            faults.error(message, block.place("max_length"), "remove the key: the buffer limits the payloads")


def _limited(converter: Converter, block: Block, default: int, faults: Diagnostics) -> Converter:
    """Return the converter with its longest payload: the message's bounds, the block's `maxLength`, or a default."""
    bounded, given = bounded_payload(converter.frame), block.max_length
    if given is None:
        return replace(converter, max_length=bounded or default, has_default_length=bounded is None)
    least, most = length_of(converter.frame).minimum, bounded or MOST_BYTES
    if not least <= given <= most:
        message = f"'maxLength' of '{converter.block}' cannot be {given} bytes for {converter.frame.message}"
        faults.error(message, block.place("max_length"), f"legal here: {least} to {most}")
    return replace(converter, max_length=given)


def _default(subscriber: Converter, project: Project) -> int:
    """Return the longest payload of a message without bounds; software of the system itself keeps its lengths."""
    if project.interconnect == ETHERNET:
        return LONGEST_IN_FRAME
    if project.interconnect != AXI_STREAM:
        return LINK_DEFAULT
    return DEFAULT_LONGEST if subscriber.software is None else MOST_BYTES
