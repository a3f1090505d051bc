"""A subscriber whose message side is wired to the publisher of the same message: what comes back, and its cycles.

pair = WiredPair(Library("work", folder), frame, 64)
pair.analyse()
frames, cycles = pair.run(folder, payloads)
"""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.message_ports import message_ports, segment_count
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import (
    ArrayType,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)
from fusesoc_firm.text.render import render
from tests.converter.simulated.subscribers import LENGTH_BYTES, Subscriber
from tests.hdl.ghdl import Library

# Elements of an array of the message itself, and of one in an element; every string.
ELEMENTS, INNER_ELEMENTS, TEXT = 20, 4, "joint_07"
_ENTITY = "pair_tb"


@dataclass(frozen=True)
class WiredPair:
    """Both converters of a message of variable size in `library`; the library `firm` is in the same folder."""

    library: Library
    frame: Frame
    width: int

    def analyse(self) -> None:
        """Generate and analyse both converters and the bench."""
        sources = publisher_files([self.frame], self.width) | subscriber_files([self.frame], self.width)
        folder = self.library.directory / self.library.name
        folder.mkdir(exist_ok=True)
        files = []
        for name, file in sources.items():
            files.append(folder / name)
            files[-1].write_text(str(file.content), encoding="ascii")
        files.append(folder / f"{_ENTITY}.vhd")
        files[-1].write_text(render("pair_tb.vhd", self._configuration(), pathlib.Path(__file__).parent), "ascii")
        self.library.analyse(files)

    def run(self, directory: pathlib.Path, payloads: Sequence[bytes]) -> tuple[list[bytes], int]:
        """The payloads that come back, and the cycles from the first beat in to the last one out."""
        frames = [len(payload).to_bytes(LENGTH_BYTES, "little") + payload for payload in payloads]
        beats = [beat for frame in frames for beat in Subscriber(self.library, self.frame, self.width).beats(frame)]
        (directory / "beats.txt").write_text("".join(f"{beat.row(self.width)}\n" for beat in beats), "ascii")
        result = self.library.run(_ENTITY, {"BEATS": "beats.txt"}, directory=directory)
        assert result.exit_code == 0, result.output
        lines = [line.split() for line in result.output.splitlines() if ":@" not in line]
        found = [bytes.fromhex(words[1])[1:] for words in lines if words[0] == "frame"]
        return [frame[LENGTH_BYTES:] for frame in found], int(lines[-1][1])

    def beats_of(self, payload: bytes) -> int:
        """The beats of a frame with its id."""
        return -(-8 * (1 + LENGTH_BYTES + len(payload)) // self.width)

    def _configuration(self) -> dict[str, object]:
        ports = [(port.name, vhdl_type(port.width)) for port in message_ports(self.frame, self.width)]
        ports += [("payload_length", vhdl_type(32)), ("segment_valid", vhdl_type(segment_count(self.frame)))]
        ports += [("msg_valid", vhdl_type(None)), ("msg_ready", vhdl_type(None))]
        return {
            "entity": _ENTITY,
            "subscriber": subscriber_entity(self.frame),
            "publisher": publisher_entity(self.frame),
            "width": self.width,
            "lanes": self.width // 8,
            "ports": [{"name": name, "type": type_} for name, type_ in dict(ports).items()],
        }


def filled_message(name: MessageName, definitions: Definitions, count: int = ELEMENTS) -> dict[str, Any]:
    """A value whose arrays have `count` elements, and those in elements less."""
    return {field.name: _value(field.type, definitions, count) for field in definitions[name].fields}


def _value(type_: FieldType, definitions: Definitions, count: int) -> Any:
    match type_:
        case SequenceType(element, bound):
            elements = min(count, bound or count)
            if element in (PrimitiveType("uint8"), PrimitiveType("byte"), PrimitiveType("char")):
                return bytes(elements)
            return [_value(element, definitions, INNER_ELEMENTS) for _ in range(elements)]
        case ArrayType(element, length):
            return [_value(element, definitions, count) for _ in range(length)]
        case MessageType(name):
            return filled_message(name, definitions, count)
        case StringType(bound=bound):
            return TEXT[:bound]
        case PrimitiveType("bool"):
            return True
        case PrimitiveType(name):
            return 1.5 if name.startswith("float") else 1
    raise AssertionError(type_)
