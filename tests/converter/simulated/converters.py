"""The two converters of a message back to back behind the Manager, and what must come of the frames sent to them.

    bench = ConverterBench(tmp_path)                    # analyses the library once
    pair = bench.pair(ROS2, "geometry_msgs/Point")
    result = pair.run(tmp_path, [pair.frame_of(payload)], SEED=7, STALL_PERCENT=30)

Payloads come from rosbags; which frames are good, and why not, is decided here by docs/reference/converters.md
and not by the templates' configuration.
"""

from __future__ import annotations

import json
import random
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.frame.codec import used_bytes
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.text.render import render
from tests.frame.oracle import Oracle
from tests.frame.samples import AWKWARD
from tests.hdl.frames import write_expected, write_stimulus
from tests.hdl.ghdl import Generic, Library, core_files
from tests.recall import RunResult

SUBSCRIBER = 1
PUBLISHER = 2
LENGTH_BYTES = 4

BAD_LENGTH, SHORT_FRAME, LONG_FRAME, BAD_ENCODING = 1, 2, 3, 4
_ENCODING = {ROS1: b"", ROS2: b"\x00\x01"}
_LONGEST_TAIL = {ROS1: 0, ROS2: 3}


@dataclass(frozen=True)
class Selection:
    """The fields of both converters, and the values that a publisher must send for others; as JSON, for a key."""

    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    defaults: str = ""


EVERYTHING = Selection()


@dataclass(frozen=True)
class ConverterBench:
    """GHDL's libraries in one directory: `firm`, and one for the converters of each ROS version and width."""

    directory: Path
    oracles: Mapping[Middleware, Oracle] = field(
        default_factory=lambda: {ros: Oracle(ros, AWKWARD[ros]) for ros in (ROS1, ROS2)}
    )
    pairs: dict[tuple[Middleware, str, int, Selection], Pair] = field(default_factory=dict)

    def __post_init__(self) -> None:
        Library("firm", self.directory).analyse(
            core_files(
                "axis/package",
                "axis/axis",
                "sched/package",
                "sched/fixed_priority",
                "manager/manager",
                "sim/checker",
                "sim/host",
            )
        )

    def pair(self, ros: Middleware, name: str, width: int = 8, selection: Selection = EVERYTHING) -> Pair:
        """The converters of a message with their bench, generated and analysed once."""
        key = ros, name, width, selection
        if key not in self.pairs:
            # Entities of other fields have the same names.
            number = sum(other[3] != EVERYTHING for other in self.pairs)
            library = f"ros{ros.number}_{width}" if selection == EVERYTHING else f"selection_{number}"
            pair = Pair(Library(library, self.directory), self.oracles[ros], name, width, selection)
            pair.analyse()
            self.pairs[key] = pair
        return self.pairs[key]


@dataclass(frozen=True)
class Sent:
    """A frame as the host sends it, all bytes behind the id."""

    body: bytes

    def to_bytes(self) -> bytes:
        return bytes([SUBSCRIBER]) + self.body


@dataclass(frozen=True)
class Pair:
    """Subscriber and publisher of one message."""

    library: Library
    oracle: Oracle
    name: str
    width: int = 8
    selection: Selection = EVERYTHING

    @cached_property
    def frame(self) -> Frame:
        chosen = self.selection
        return select(self.oracle.frame(self.name), dict.fromkeys(chosen.include), dict.fromkeys(chosen.exclude))

    @property
    def entities(self) -> tuple[str, str]:
        return subscriber_entity(self.frame), publisher_entity(self.frame)

    @property
    def _bench(self) -> str:
        return f"{publisher_entity(self.frame)}_tb"

    def analyse(self) -> None:
        """Generate and analyse converters and bench."""
        files = subscriber_files([self.frame], self.width) | publisher_files([self.frame], self.width)
        folder = self.library.directory / self.library.name
        folder.mkdir(exist_ok=True)
        for name, file in files.items():
            assert isinstance(file.content, str)
            (folder / name).write_text(file.content, encoding="ascii")
        self.library.analyse(folder / name for name in files)
        self.analyse_bench()

    def analyse_bench(self) -> None:
        """Analyse the bench alone, as is needed after a converter was replaced."""
        file = self.library.directory / self.library.name / f"{self._bench}.vhd"
        file.write_text(render("converter_tb.vhd", self._configuration(), Path(__file__).parent), encoding="ascii")
        self.library.analyse([file])

    def run(self, directory: Path, frames: Sequence[Sent], **generics: Generic) -> RunResult:
        """Send the frames; the run fails unless just the good ones come back and every other is reported."""
        answers = [(cause, self._answer(sent)) for cause, sent in enumerate(frames) if self.is_good(sent)]
        write_stimulus(directory / "stimulus.txt", (sent.to_bytes() for sent in frames))
        write_expected(directory / "expected.txt", answers, sum(not self._reaches_converter(sent) for sent in frames))
        with (directory / "expected.txt").open("a", encoding="ascii") as file:
            file.write(f"! frame_error {len(self.error_codes(frames))}\n")
        result = self.library.run(self._bench, generics, directory=directory)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == f"PASS {len(answers)}/{len(answers)}"
        assert printed(result, "frame_error") == [str(code) for code in self.error_codes(frames)]
        # At the very beginning the wires of a netlist are undefined; later, a warning means that a fault was hidden.
        assert not re.search(r"^(?!.*@0ms).*warning", result.output, re.MULTILINE), result.output
        return result

    def beats(self, sent: Sent) -> int:
        """Beats that the host sends for a frame."""
        return -(-len(sent.to_bytes()) // (self.width // 8))

    def payload(self, source: random.Random) -> bytes:
        """A random message as rosbags serialises it."""
        return self.oracle.serialise(self.name, self.oracle.random_value(self.name, source))

    def sent(self, payload: bytes) -> Sent:
        """A right frame."""
        return Sent(len(payload).to_bytes(LENGTH_BYTES, "little") + payload)

    def error_codes(self, frames: Sequence[Sent]) -> list[int]:
        """The codes that the frames must give, in their order."""
        return [code for sent in frames if self._reaches_converter(sent) and (code := self._verdict(sent.body))]

    def is_good(self, sent: Sent) -> bool:
        """Whether a message must come of the frame."""
        return self._verdict(sent.body) == 0

    def field_bits(self, value: Mapping[str, Any]) -> int:
        """What all ports of the message side together must show for a message: the first field lowest."""
        bits, low = 0, 0
        for port in field_ports(self.frame):
            for element in _elements(value, port.field.names):
                bits |= _element_bits(element, port) << low
                low += port.field.type.bits
        return bits

    def _reaches_converter(self, sent: Sent) -> bool:
        """An id alone is a beat of its own at 8 bits, which the Manager keeps and reports; wider, it is passed on."""
        return bool(sent.body) or self.width > 8

    def _verdict(self, body: bytes) -> int:
        """0, or the code of the first fault in the order of the bytes."""
        ros, size = self.oracle.ros, self._size
        lengths = [(size + tail).to_bytes(LENGTH_BYTES, "little") for tail in range(_LONGEST_TAIL[ros] + 1)]
        head, payload = body[:LENGTH_BYTES], body[LENGTH_BYTES:]
        if not any(length.startswith(head) for length in lengths):
            return BAD_LENGTH
        if len(head) < LENGTH_BYTES:
            return SHORT_FRAME
        if not _ENCODING[ros].startswith(payload[: len(_ENCODING[ros])]):
            return BAD_ENCODING
        missing = int.from_bytes(head, "little") - len(payload)
        return SHORT_FRAME if missing > 0 else LONG_FRAME if missing < 0 else 0

    @cached_property
    def _size(self) -> int:
        return len(self.payload(random.Random(0)))

    def _answer(self, sent: Sent) -> bytes:
        """The publisher's frame: without the bytes behind the last field, zeros where the layout leaves a gap."""
        sent_payload = sent.body[LENGTH_BYTES:]
        used = used_bytes(self.frame, sent_payload)
        payload = bytes(byte if is_used else 0 for byte, is_used in zip(sent_payload, used, strict=True))
        payload = payload[: self._size]
        payload = self._with_defaults(self._with_bools_of_one(payload))
        assert len(payload) == self._size
        return bytes([PUBLISHER]) + self._size.to_bytes(LENGTH_BYTES, "little") + self._with_whole_prefix(payload)

    def _with_whole_prefix(self, payload: bytes) -> bytes:
        """The options in the header of CDR are the sender's own: a publisher of ours has none."""
        return payload[:2] + bytes(2) + payload[4:] if self.oracle.ros is ROS2 else payload

    def _with_bools_of_one(self, payload: bytes) -> bytes:
        """Random bytes may be any bool; a publisher sends 0 or 1."""
        flags = {offset for leaf in self.frame.fields if leaf.type.bits == 1 for offset in leaf.offsets}
        return bytes(min(byte, 1) if offset in flags else byte for offset, byte in enumerate(payload))

    def _with_defaults(self, payload: bytes) -> bytes:
        """What no port drives is as rosbags serialises the defaults that the test gives; zeros where it gives none."""
        chosen = self.selection.defaults
        undriven = self.oracle.serialise(self.name, json.loads(chosen)) if chosen else bytes(len(payload))
        mixed = bytearray(payload)
        for leaf in self.frame.fields:
            for offset in leaf.offsets if not leaf.is_used else ():
                mixed[offset : offset + leaf.type.size] = undriven[offset : offset + leaf.type.size]
        return bytes(mixed)

    def _configuration(self) -> dict[str, object]:
        fields, low = [], 0
        for port in field_ports(self.frame):
            width = 1 if port.width is None else port.width
            bits = f"{low}" if port.width is None else f"{low + width - 1} downto {low}"
            fields.append({"port": port.name, "bits": bits})
            low += width
        subscriber, publisher = self.entities
        return {
            "message": str(self.frame.message),
            "entity": self._bench,
            "subscriber_entity": subscriber,
            "publisher_entity": publisher,
            "subscriber": SUBSCRIBER,
            "publisher": PUBLISHER,
            "width": self.width,
            "data_high": self.width - 1,
            "keep_high": self.width // 8 - 1,
            "select_high": PUBLISHER.bit_length() - 1,
            "bits_high": max(1, low) - 1,
            "fields": fields,
        }


def troubled_frames(pair: Pair, count: int, source: random.Random) -> list[Sent]:
    """Good and broken frames at random; `Pair.is_good` distinguishes them."""
    return [_troubled_frame(pair, source) for _ in range(count)]


def _troubled_frame(pair: Pair, source: random.Random) -> Sent:
    payload = pair.payload(source)
    body = bytearray(pair.sent(payload).body)
    match source.randrange(12):
        case 0:  # ends early
            return Sent(bytes(body[: source.randrange(len(body))]))
        case 1:  # continues after its length
            return Sent(bytes(body) + source.randbytes(source.choice((1, 2, 3, 4, 5, 300))))
        case 2:  # a wrong length, close to the right one or not
            lie = max(0, len(payload) + source.choice((-256, -4, -3, -2, -1, 1, 2, 3, 4, 256, 2**24)))
            return Sent(lie.to_bytes(LENGTH_BYTES, "little") + payload)
        case 3:  # a flipped bit of the length
            body[source.randrange(LENGTH_BYTES)] ^= 1 << source.randrange(8)
            return Sent(bytes(body))
        case 4:  # a true length, but not this message's
            return pair.sent(source.randbytes(source.randrange(2 * len(payload) + 8)))
        case 5:  # bytes behind the last field, which only ROS 2 allows, and only three
            return pair.sent(payload + source.randbytes(source.randrange(6)))
        case 6:  # nothing
            return source.choice((pair.sent(b""), Sent(b"")))
        case 7:  # another length than the announced one, both legal in ROS 2
            announced = len(payload) + source.randrange(4)
            return Sent(announced.to_bytes(LENGTH_BYTES, "little") + payload + source.randbytes(source.randrange(4)))
        case 8 if pair.oracle.ros is ROS2:  # another encoding
            body[LENGTH_BYTES + source.randrange(2)] ^= 1 << source.randrange(8)
            return Sent(bytes(body))
    return Sent(bytes(body))


def printed(result: RunResult, word: str) -> list[str]:
    """What a bench printed behind `word` at the beginning of its lines."""
    return re.findall(rf"^{word} (.*)$", result.output, re.MULTILINE)


def _elements(value: Any, names: Sequence[str]) -> list[Any]:
    """The numbers that a path of names leads to, in wire order."""
    found = [value]
    for name in names:
        found = [element for part in found for element in _as_list(part[name])]
    return found


def _as_list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _element_bits(element: Any, port: FieldPort) -> int:
    if isinstance(element, bool):
        return int(element)
    return int.from_bytes(struct.pack(f"<{port.field.type.code}", element), "little")
