"""The measured converters: generates and analyses them, and reads their ports from the generated text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.text.diagnostics import InputError
from tests.hdl.ghdl import REPOSITORY, Library, core_files

SUBSCRIBER, PUBLISHER = "subscriber", "publisher"
CORES = ("axis/package", "axis/axis", "sched/package", "sched/fixed_priority", "manager/manager")
# Definitions of ROS 1 that no distribution holds.
_FURTHER = REPOSITORY / "specs" / "robotic_arm" / "franka_msgs"

_PORT = re.compile(r"^ +(\w+) *: (in|out) +std_logic(?:_vector\((\d+) downto 0\))?", re.MULTILINE)
_PORTS = re.compile(r"^  port \((.*?)^  \);", re.MULTILINE | re.DOTALL)


class NotConvertedError(Exception):
    """A message that no converter is made of; the text says why."""


@dataclass(frozen=True)
class Port:
    """A port of an entity; `is_bit` tells a std_logic from a vector of one bit."""

    name: str
    is_input: bool
    bits: int
    is_bit: bool

    @property
    def vhdl_type(self) -> str:
        return "std_logic" if self.is_bit else f"std_logic_vector({self.bits - 1} downto 0)"


@dataclass(frozen=True)
class Converter:
    """A converter of `message` (`pkg/Type`) for streams of `width` bits; `include` names the fields used, none all."""

    ros: int
    message: str
    direction: str
    width: int
    include: tuple[str, ...] = ()

    def __str__(self) -> str:
        used = f" ({', '.join(self.include)})" if self.include else ""
        return f"{self.message}{used}, {self.direction}"

    def frame(self) -> Frame:
        """The message's frame."""
        ros, name = middleware_of(self.ros), parse_name(self.message)
        library = MessageLibrary(ros, [_FURTHER] if ros is ROS1 else [])
        frame = frame_of(name, library.closure(name))
        return select(frame, dict.fromkeys(self.include)) if self.include else frame


@dataclass(frozen=True)
class Design:
    """A converter in VHDL, in a library of its own; `lines` are those of its own file."""

    library: Library
    entity: str
    ports: tuple[Port, ...]
    lines: int

    @property
    def field_bits(self) -> int:
        """Bits of the message side's fields and lengths."""
        return sum(port.bits for port in self.ports if is_field(port))


def is_field(port: Port) -> bool:
    """Whether a port carries a field or a length, and no stream or handshake."""
    return not re.search(r"^(clk|rst_n|frame_error|frame_error_code)$|_axis_t|(^|_)(valid|ready|last)$", port.name)


def generate(directory: Path, *converters: Converter) -> list[Design]:
    """Converters of any messages, in the library `work` of `directory`; raises `NotConvertedError`."""
    directory.mkdir(parents=True, exist_ok=True)
    Library("firm", directory).analyse(core_files(*CORES))
    return [_generate(directory, converter) for converter in converters]


def _generate(directory: Path, converter: Converter) -> Design:
    work = Library("work", directory)
    work.analyse(write_converter(converter, directory))
    name = subscriber_entity if converter.direction == SUBSCRIBER else publisher_entity
    entity = name(converter.frame())
    text = (directory / f"{entity}.vhd").read_text(encoding="ascii")
    return Design(work, entity, ports_of(text), text.count("\n"))


def write_converter(converter: Converter, directory: Path) -> list[Path]:
    """Write the files of a converter, in the order of their analysis; raises `NotConvertedError`."""
    make = subscriber_files if converter.direction == SUBSCRIBER else publisher_files
    try:
        files = make([converter.frame()], converter.width)
    except InputError as error:
        raise NotConvertedError(str(error)) from error
    for file, generated in files.items():
        (directory / file).write_text(str(generated.content), encoding="ascii")
    return [directory / file for file in files]


def ports_of(vhdl: str) -> tuple[Port, ...]:
    """The ports of the first entity in a generated file."""
    found = _PORTS.search(vhdl)
    assert found, "no entity with ports"
    return tuple(
        Port(name, direction == "in", int(high or 0) + 1, not high) for name, direction, high in _PORT.findall(found[1])
    )
