"""The ports that the converters of a message share, and how many segments it has.

Stands in for `converter.message_ports`, which has the same two functions for messages of variable size, too.
"""

from __future__ import annotations

from dataclasses import dataclass

from fusesoc_firm.converter.ports import field_ports, vhdl_type
from fusesoc_firm.frame.model import Frame


@dataclass(frozen=True)
class MessagePort:
    """A port of the message side; `is_reverse` marks what goes against the message: a `ready`."""

    name: str
    width: int | None
    is_reverse: bool = False

    @property
    def vhdl_type(self) -> str:
        """The port's type in VHDL."""
        return vhdl_type(self.width)


def message_ports(frame: Frame, width: int) -> tuple[MessagePort, ...]:
    """Every port of the message side but the handshake, in the order of declaration; streams are of `width` bits."""
    del width
    return tuple(MessagePort(port.name, port.width) for port in field_ports(frame))


def segment_count(frame: Frame) -> int:
    """The width of `segment_valid`."""
    del frame
    return 1
