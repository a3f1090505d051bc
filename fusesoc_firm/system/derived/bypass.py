"""Accelerators for a part of a message; the other fields bypass them (`others: pass`).

The accelerator has ports only for its fields, which have a fixed size, and the handshakes of a message of fixed size. A
generated entity around it receives and sends the whole message: it passes strings, arrays and all other fields on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fusesoc_firm.converter.message_ports import message_side
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.frame.model import Data, Fixed, Frame, FrameField, Loop, Path, all_nodes
from fusesoc_firm.frame.select import select
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource, MessageSide, PayloadLength
from fusesoc_firm.system.written.specification import OutputType
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef


def with_bypass(type_: AcceleratorType, faults: Diagnostics) -> AcceleratorType:
    """Return the accelerator with its whole messages, and the user's accelerator inside; note faults."""
    found = [item for item in type_.accelerator.interface.output if item.others]
    if not found:
        return type_
    (item, *_) = found
    if not _may_pass(type_, item, faults):
        return type_
    (source,), (sink,) = type_.inputs, type_.outputs
    inner = replace(type_, inputs=(_part(source),), outputs=(_part(sink),))
    whole = select(sink.frame)
    length = None if whole.is_fixed_size else PayloadLength(LengthSource.GIVEN, "the message has the input's length")
    return replace(
        type_,
        inputs=(replace(source, frame=select(source.frame)),),
        outputs=(replace(sink, frame=whole, length=length),),
        has_width=False,
        inner=inner,
    )


def _may_pass(type_: AcceleratorType, item: OutputType, faults: Diagnostics) -> bool:
    """Whether the other fields can pass; note the reason if they cannot."""
    assert item.others
    source = item.others.source
    if type_.accelerator.is_software:
        message, hint = "no fields can pass by an accelerator in software", "remove the key"
    elif len(type_.inputs) != 1 or len(type_.outputs) != 1 or type_.inputs[0].kind != type_.outputs[0].kind:
        message = f"no fields of {item.message} can pass: it is not the only input and the only output"
        hint = "legal here: one input and one output of the same message"
    elif item.length is not None:
        message, hint = f"'length' is set for {item.message}, which has the input's length", "remove the key"
    elif found := next(_variable_parts(type_), None):
        part, source = found
        message = f"'{dotted(part.names)}' of type '{part.ros_type}' has no fixed size"
        hint = "with 'others: pass', 'include' must select numbers, times, or fixed arrays and messages of them"
    elif max(_own_segments(type_.inputs)) > min(_own_segments(type_.outputs)):
        message = f"'{type_.accelerator.name}' sends a field before it receives all of its fields"
        hint = "a string or an array between them passes without storage"
    else:
        return True
    faults.error(message, source, hint)
    return False


def _own_segments(sides: Sequence[MessageSide]) -> list[int]:
    (side,) = sides
    return part_segments(side.frame, side.frame)


def _variable_parts(type_: AcceleratorType) -> Iterator[tuple[Data | Loop, SourceRef | None]]:
    """Yield the strings and arrays of variable size for which the user's accelerator would have ports.

    Each has the place that selects it: an item of `include` or, without one, the message.
    """
    interface = type_.accelerator.interface
    for side, written in zip((*type_.inputs, *type_.outputs), (*interface.input, *interface.output), strict=True):
        for node in all_nodes(side.frame.nodes):
            if isinstance(node, Data | Loop) and node.is_used:
                name = dotted(node.names)
                chosen = (path for path in written.include if f"{name}.".startswith(f"{path}."))
                yield node, next(chosen, written.message).source


def passing_hint(type_: str) -> str:
    """Return a hint that describes how an accelerator passes on the fields that it does not have."""
    return f"the fields that '{type_}' should pass need the key 'others' in its output"


def part_segments(whole: Frame, part: Frame) -> list[int]:
    """Return the segments of the whole message that contain the used fields of a part of it."""
    if whole.is_fixed_size:
        return [0]
    segments = segments_of(select(whole)).fields
    return [segments[leaf.path] for leaf in _leaves(part) if leaf.is_used]


def whole_ports(side: MessageSide) -> dict[Path, str]:
    """Return the port of each field of a side with the whole message."""
    if side.frame.is_fixed_size:
        return {port.field.path: port.name for port in field_ports(side.frame)}
    ports = message_side(side.frame)
    return {leaf.path: ports.field(leaf).name for leaf in _leaves(side.frame)}


def _part(side: MessageSide) -> MessageSide:
    """Return the side of the user's accelerator: the used fields as a message of fixed size."""
    fields = tuple(_leaves(side.frame))
    frame = side.frame if side.frame.is_fixed_size else replace(side.frame, nodes=(Fixed(0, fields),))
    return replace(side, frame=frame, length=None)


def _leaves(frame: Frame) -> list[FrameField]:
    """Return the fields outside of arrays of variable size, each once, even if padding separates its elements."""
    fixed = (node for node in frame.nodes if isinstance(node, Fixed))
    return [leaf for node in fixed for leaf in node.fields if leaf.first == 0 and leaf.count]
