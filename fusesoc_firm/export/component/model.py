"""A component as plain data: ports, bus interfaces, files and generics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import PurePosixPath

from fusesoc_firm.system.hardware.registers import Register


class Direction(Enum):
    """The direction of a port, in the words of IP-XACT."""

    IN = "in"
    OUT = "out"
    INOUT = "inout"


@dataclass(frozen=True)
class Port:
    """A port: a vector with the bounds `left` and `right`, or a scalar if `bounds` is None.

    `default` is the value of an unconnected input as an unsigned number, or None if it must be connected.
    """

    name: str
    direction: Direction
    bounds: tuple[int, int] | None = None
    default: int | None = None

    @property
    def width(self) -> int:
        """The number of bits."""
        return abs(self.bounds[0] - self.bounds[1]) + 1 if self.bounds else 1


@dataclass(frozen=True)
class Generic:
    """A generic of the top, with its type in VHDL and its value.

    If it is not `is_free`, a port's width depends on it, so that only this value fits the described ports.
    """

    name: str
    type: str
    value: float | str
    is_free: bool = True


class Bus(Enum):
    """A type of bus interface: the library and the name that Vivado knows it by."""

    AXI_STREAM = ("interface", "axis")
    AXI = ("interface", "aximm")
    CLOCK = ("signal", "clock")
    RESET = ("signal", "reset")
    INTERRUPT = ("signal", "interrupt")


@dataclass(frozen=True)
class AddressBlock:
    """The addresses of a memory-mapped interface: their number in bytes, the bits of a word, and the registers."""

    size: int
    width: int
    registers: Sequence[Register] = ()


@dataclass(frozen=True)
class BusInterface:
    """A bus interface: its ports by their logical names, its parameters, and its addresses if it has any."""

    name: str
    bus: Bus
    is_initiator: bool
    ports: Mapping[str, str]
    parameters: Mapping[str, str | int] = field(default_factory=dict)
    addresses: AddressBlock | None = None


@dataclass(frozen=True)
class SourceFile:
    """A file of the component: its path below the component's folder, its type in FuseSoC, and its VHDL library."""

    path: PurePosixPath
    type: str
    library: str = ""
    is_include_file: bool = False


@dataclass(frozen=True)
class Component:
    """A component; `name` is that of its top unit, and `language` that of the top unit's source."""

    vendor: str
    library: str
    name: str
    version: str
    description: str
    language: str
    ports: Sequence[Port]
    interfaces: Sequence[BusInterface]
    files: Sequence[SourceFile]
    generics: Sequence[Generic] = ()
