"""The ports and handshakes of a block's message side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.converter.message_ports import (
    ElementPorts,
    StreamPorts,
    message_ports,
    message_side,
    segment_count,
)
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource

PAYLOAD_LENGTH = "payload_length"


@dataclass(frozen=True)
class SidePort:
    """A port of a message side, without the side's prefix."""

    name: str
    width: int | None
    is_output: bool
    comment: str = ""


@dataclass(frozen=True)
class Handshake:
    """A pair of `valid` and `ready`; `part` is the part to which the pair belongs, empty for the message itself.

    If `segment_valid` is present, it has `segments` bits, which go low together with `ready`.
    """

    part: str
    valid: str
    ready: str
    segment_valid: str | None = None
    segments: int = 1


def side_ports(frame: Frame, width: int, *, gives: bool, has_valid: bool) -> list[SidePort]:
    """Return the ports of a message side; `gives` means that the side's block is the source of the message.

    With `has_valid`, the side of a message of fixed size includes `msg_valid`, which signals a complete message. The
    side of a message of variable size always includes `msg_valid`.
    """
    ports = [
        SidePort(port.name, port.width, gives is not port.is_reverse, port.comment)
        for port in message_ports(frame, width)
    ]
    ports.append(SidePort("segment_valid", segment_count(frame), gives))
    if has_valid or not frame.is_fixed_size:
        ports.append(SidePort("msg_valid", None, gives))
    ports.append(SidePort("msg_ready", None, not gives))
    return ports


def accelerator_ports(accelerator: AcceleratorType) -> list[tuple[str, SidePort]]:
    """Return all ports of an accelerator's message sides, with prefixes, in the order of the interface.

    An output's length is a port only if the accelerator provides it.
    """
    taken = [
        (side.prefix, port)
        for side in accelerator.inputs
        for port in side_ports(side.frame, accelerator.width, gives=False, has_valid=True)
    ]
    given = [
        (side.prefix, port)
        for side in accelerator.outputs
        for port in side_ports(side.frame, accelerator.width, gives=True, has_valid=False)
        if port.name != PAYLOAD_LENGTH or side.length is None or side.length.source is LengthSource.GIVEN
    ]
    return taken + given


def handshakes(frame: Frame) -> Iterator[Handshake]:
    """Yield all handshakes of a message of variable size."""
    side = message_side(frame)
    yield Handshake("", "msg_valid", "msg_ready", "segment_valid", side.segments)
    for part in side.parts:
        match part:
            case StreamPorts():
                yield Handshake(f"{part.name}_axis", part.axis("tvalid"), part.axis("tready"))
            case ElementPorts(segments=None):
                yield Handshake(part.name, part.valid, part.ready)
            case ElementPorts(segments=int() as segments):
                yield Handshake(part.name, part.valid, part.ready, part.segment_valid, segments)
