"""The publisher of a message of variable size alone: messages in, frames out.

    bench = PublisherBench(tmp_path)                        # analyses the library once
    publisher = bench.publisher(ROS2, "sensor_msgs/JointState", 64)
    result = publisher.run(tmp_path, [publisher.good(value)], SEED=7, STALL_PERCENT=30)

What the frames must be comes from rosbags. Here is decided what the message side shows for a value.
"""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity
from fusesoc_firm.converter.limits import LONGEST_TAIL
from fusesoc_firm.converter.message_ports import StreamPorts, message_ports, message_side
from fusesoc_firm.converter.program import Block, Count, Header, Scope, publisher_program
from fusesoc_firm.converter.variable_publisher import (
    VARIABLE_PUBLISHER_TEMPLATE,
    variable_publisher_configuration,
)
from fusesoc_firm.frame.model import Data, DataKind, Frame, FrameField, Loop, Node
from fusesoc_firm.frame.values import leaf_of, part_of, units_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import EMPTY, EXTREME, TYPICAL, Stimuli
from fusesoc_firm.text.render import render
from tests.frame.oracle import Oracle
from tests.frame.variable_samples import PACKAGE, VARIABLE
from tests.hdl.ghdl import Generic, Library, core_files
from tests.recall import RunResult

HERE = Path(__file__).parent
ID = 0xA5
# rosbags knows no wstring: the second one is the same on the wire.
WIDE, UNITS = f"{PACKAGE}/Wides", f"{PACKAGE}/Units"
BAD_LENGTH, SHORT, LONG = 1, 2, 3
KINDS = (TYPICAL, EXTREME, EMPTY, TYPICAL)


@dataclass(frozen=True)
class PublisherBench:
    """GHDL's libraries in one directory: `firm`, and one for the publishers of each ROS version and width."""

    directory: Path
    oracles: Mapping[Middleware, Oracle] = field(
        default_factory=lambda: {ros: Oracle(ros, VARIABLE[ros]) for ros in (ROS1, ROS2)}
    )
    publishers: dict[tuple[Middleware, str, int], Publisher] = field(default_factory=dict)

    def __post_init__(self) -> None:
        Library("firm", self.directory).analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
        Library("bench", self.directory).analyse([HERE / "message_source.vhd"])

    def publisher(self, ros: Middleware, name: str, width: int = 8) -> Publisher:
        """The publisher of a message with its bench, generated and analysed once."""
        key = ros, name, width
        if key not in self.publishers:
            self.publishers[key] = self.of_frame(ros, name, self.oracles[ros].frame(name), width)
        return self.publishers[key]

    def of_frame(self, ros: Middleware, name: str, frame: Frame, width: int, suffix: str = "") -> Publisher:
        """The publisher of a message with any selection of fields."""
        library = Library(f"ros{ros.number}_{width}{suffix}", self.directory)
        publisher = Publisher(library, self.oracles[ros], name, frame, width)
        publisher.analyse()
        return publisher


@dataclass(frozen=True)
class Beat:
    """Bytes of a stream, at most a beat."""

    data: bytes
    is_last: bool


@dataclass(frozen=True)
class Message:
    """The inputs of a publisher for one frame, with the expected output.

    `beats` and `elements` are, for each part by its number, the bytes of each stream and (last, bits) of each element.
    A frame with an `error` is aborted; it begins as that of `payload`.
    """

    bits: str
    payload: bytes
    streams: Mapping[int, Sequence[Sequence[Beat]]] = field(default_factory=dict)
    elements: Mapping[int, Sequence[tuple[bool, str]]] = field(default_factory=dict)
    error: int = 0
    lifetime: int = 0


@dataclass
class Cut:
    """The `chosen`-th array of `loop` that has elements has only the first `kept`."""

    loop: Loop
    chosen: int
    kept: int


@dataclass(frozen=True)
class Played:
    """The streams and elements of a message as they are collected."""

    streams: dict[int, list[Sequence[Beat]]]
    elements: dict[int, list[tuple[bool, str]]]
    cut: Cut | None

    def elements_of(self, loop: Loop, found: Sequence[Any]) -> Sequence[Any]:
        """The elements that are given."""
        if self.cut and found and loop.path == self.cut.loop.path:
            self.cut.chosen -= 1
            if self.cut.chosen == -1:
                return found[: self.cut.kept]
        return found


@dataclass(frozen=True)
class Group:
    """The ports that a source of values drives: those of the message, or of an element of `scope`."""

    scope: Scope
    fields: tuple[tuple[str, int | None, int, object], ...]
    segments: int


@dataclass(frozen=True)
class Publisher:
    """The publisher of one message, with its bench."""

    library: Library
    oracle: Oracle
    name: str
    frame: Frame
    width: int

    # --- the bench ----------------------------------------------------------------------------------------------

    @property
    def entity(self) -> str:
        return publisher_entity(self.frame)

    @property
    def text(self) -> str:
        """The publisher in VHDL."""
        configuration = variable_publisher_configuration(self.frame, self.width, self.entity)
        return render(VARIABLE_PUBLISHER_TEMPLATE, configuration)

    def analyse(self) -> None:
        """Generate and analyse publisher and bench."""
        folder = self.library.directory / self.library.name
        folder.mkdir(exist_ok=True)
        file = folder / f"{self.entity}.vhd"
        file.write_text(self.text, encoding="ascii")
        self.library.analyse([file])
        self.analyse_bench()

    def analyse_bench(self) -> None:
        """Analyse the bench alone, as is needed after the publisher was replaced."""
        file = self.library.directory / self.library.name / f"{self.entity}_tb.vhd"
        file.write_text(render("variable_publisher_tb.vhd", self._configuration(), HERE), encoding="ascii")
        self.library.analyse([file])

    @cached_property
    def groups(self) -> list[Group]:
        """The message itself, then every array of messages or strings in wire order."""
        scopes: dict[Scope, None] = {(): None}
        for scope in _scopes(self.frame.nodes, ()):
            scopes[scope] = None
        return [self._group(scope) for scope in scopes]

    def _group(self, scope: Scope) -> Group:
        side = message_side(self.frame)
        found: dict[str, tuple[str, int | None, int, object]] = {}
        for step in publisher_program(self.frame).steps:
            match step:
                case Header(segment=segment) if not scope:
                    assert segment is not None
                    found["payload_length"] = "payload_length", 32, segment.number, None
                case Block(fields=fields, segment=segment) if step.scope == scope:
                    for leaf in fields:
                        assert segment is not None
                        port = side.field(leaf)
                        found.setdefault(port.name, (port.name, port.width, segment.number, leaf))
                case Count(part=part, segment=segment) if step.scope == scope:
                    assert segment is not None
                    found[side.length(part)] = side.length(part), 32, segment.number, part
        segments = side.element(scope[-1]).segments if scope else side.segments
        return Group(scope, tuple(found.values()), segments or 1)

    @cached_property
    def streams(self) -> list[StreamPorts]:
        return [part for part in message_side(self.frame).parts if isinstance(part, StreamPorts)]

    def _configuration(self) -> dict[str, object]:
        ports = message_ports(self.frame, self.width)
        signals = {port.name: f"port_{number}" for number, port in enumerate(ports)}
        handshakes = []
        fields = []
        values = []
        for number, group in enumerate(self.groups):
            low = 0
            for name, width, segment, _ in group.fields:
                bits = width or 1
                slice_ = f"{low}" if width is None else f"{low + bits - 1} downto {low}"
                fields.append({"signal": signals[name], "number": number, "slice": slice_, "segment": segment})
                low += bits
            values.append(
                {
                    "number": number,
                    "bits": low,
                    "segments": group.segments,
                    "message": "message" if number else "0",
                    "following": "open" if number else "message",
                }
            )
            if number:
                element = message_side(self.frame).element(group.scope[-1])
                pairs = [(element.valid, "whole"), (element.last, "last"), (element.ready, "ready")]
                pairs += [(element.segment_valid, "valid")] if element.segments is not None else []
                handshakes += [{"port": port, "signal": f"{signal}_{number}"} for port, signal in pairs]
        taken = {handshake["port"] for handshake in handshakes}
        names = [{"port": port.name, "signal": signals[port.name], "type": port.vhdl_type} for port in ports]
        streams = [
            {
                "number": len(values) + number,
                "width": self.width,
                **{signal: signals[port.axis(signal)] for signal in ("tdata", "tkeep", "tvalid", "tlast", "tready")},
            }
            for number, port in enumerate(self.streams)
        ]
        return {
            "message": str(self.frame.message),
            "entity": f"{self.entity}_tb",
            "publisher": self.entity,
            "id": ID,
            "width": self.width,
            "data_high": self.width - 1,
            "keep_high": self.width // 8 - 1,
            "sources": len(values) + len(streams),
            "values": values,
            "streams": streams,
            "fields": fields,
            "handshakes": handshakes,
            "ports": [name for name in names if name["port"] not in taken],
        }

    # --- messages -----------------------------------------------------------------------------------------------

    def values(
        self, count: int, source: random.Random, kinds: Sequence[str] = KINDS, longest: int = 4
    ) -> list[dict[str, Any]]:
        """Values of these kinds by turns."""
        name = parse_name(self.name)
        stimuli = Stimuli(self.oracle.closure(self.name), self.oracle.ros, source, longest)
        return [stimuli.message(name, kinds[number % len(kinds)]) for number in range(count)]

    def good(self, value: Mapping[str, Any]) -> Message:
        """A message with nothing wrong."""
        payload = self._payload(value)
        played = self._played(value)
        return Message(self._bits(0, value, 0, len(payload)), payload, played.streams, played.elements)

    def _payload(self, value: Mapping[str, Any]) -> bytes:
        if self.name != WIDE:
            return self.oracle.serialise(self.name, value)
        texts = [{"units": _units(text)} for text in value["texts"]]
        return self.oracle.serialise(UNITS, {**value, "text": _units(value["text"]), "texts": texts})

    def announced(self, message: Message, length: int) -> Message:
        """The same with another `payload_length`."""
        payload = message.payload[:length] + bytes(max(0, length - len(message.payload)))
        slack = length - len(message.payload)
        most = LONGEST_TAIL if self.frame.trailing_bytes else 0
        error = 0 if 0 <= slack <= most else BAD_LENGTH
        return replace(message, bits=message.bits[:-32] + f"{length:032b}", payload=payload, error=error)

    def with_length(self, message: Message, name: str, length: int) -> Message:
        """The same with another number at the message's port `name`."""
        low = 0
        for port, width, _, _ in self.groups[0].fields:
            if port == name:
                high = len(message.bits) - low
                return replace(message, bits=f"{message.bits[: high - 32]}{length:032b}{message.bits[high:]}")
            low += width or 1
        raise KeyError(name)

    def faulty(self, value: Mapping[str, Any], source: random.Random) -> Message:
        """A message with one thing wrong, or with nothing."""
        message = self.good(value)
        streams = [(part, place) for part, found in message.streams.items() for place in range(len(found))]
        loops = [part for part, found in message.elements.items() if found]
        match source.randrange(8):
            case 0:
                length = source.choice((0, 1, 2, 3, 2**16)) if source.random() < 0.3 else len(message.payload)
                return self.announced(message, max(0, length + source.choice((-9, -2, -1, 1, 2, 3, 4, 5, 300))))
            case 1 if streams:
                return self.with_short_stream(message, *source.choice(streams), source)
            case 2 if streams:
                return self.with_long_stream(message, *source.choice(streams), source)
            case 3 if loops:
                return self.without_last(message, source.choice(loops), source)
            case 4 if loops:
                return self.with_early_last(value, message, source.choice(loops), source)
            case 5:
                return replace(message, lifetime=source.randint(1, 200), error=SHORT)
        return message

    def with_short_stream(self, message: Message, part: int, place: int, source: random.Random) -> Message:
        """A stream that ends early."""
        data = b"".join(beat.data for beat in message.streams[part][place])
        found = list(message.streams[part])
        # A part without bytes still has an end.
        found[place] = self.beats(data[: source.randrange(len(data))]) or [Beat(b"", True)]
        return replace(message, streams={**message.streams, part: found}, error=SHORT)

    def with_long_stream(self, message: Message, part: int, place: int, source: random.Random) -> Message:
        """A stream that continues after its length."""
        data = b"".join(beat.data for beat in message.streams[part][place])
        found = list(message.streams[part])
        found[place] = self.beats(data + source.randbytes(source.choice((1, 2, 9, 70, 200))))
        return replace(message, streams={**message.streams, part: found}, error=LONG)

    def without_last(self, message: Message, part: int, source: random.Random) -> Message:
        """The last element of an array lacks its `last`."""
        elements = list(message.elements[part])
        place = source.choice([place for place, (is_last, _) in enumerate(elements) if is_last])
        elements[place] = False, elements[place][1]
        return replace(message, elements={**message.elements, part: elements}, error=LONG)

    def with_early_last(self, value: Mapping[str, Any], message: Message, part: int, source: random.Random) -> Message:
        """An array ends before its length is reached."""
        loop = self.groups[part].scope[-1]
        total = len(message.elements[part])
        starts = [0, *(place + 1 for place, (is_last, _) in enumerate(message.elements[part]) if is_last)]
        chosen = source.randrange(len(starts) - 1)
        count = starts[chosen + 1] - starts[chosen]
        if count < 2:
            return message
        kept = source.randrange(1, count)
        played = self._played(value, Cut(loop, chosen, kept))
        assert len(played.elements[part]) == total - count + kept
        return replace(message, streams=played.streams, elements=played.elements, error=SHORT)

    def _played(self, value: Any, cut: Cut | None = None) -> Played:
        played = Played(
            {number: [] for number in range(len(self.streams))},
            {number: [] for number in range(1, len(self.groups))},
            cut,
        )
        self._play(self.frame.nodes, value, 0, (), played)
        return played

    def _play(self, nodes: Sequence[Node], value: Any, depth: int, scope: Scope, played: Played) -> None:
        for node in nodes:
            if isinstance(node, Data) and node.is_used:
                number = [port.part.path for port in self.streams].index(node.path)
                data = data_bytes(node, part_of(value, node, depth))
                if data:
                    played.streams[number].append(self.beats(data))
            elif isinstance(node, Loop) and node.is_used and node.body:
                inner = (*scope, node)
                number = [group.scope for group in self.groups].index(inner)
                found = played.elements_of(node, part_of(value, node, depth))
                for place, element in enumerate(found):
                    self._play(node.body, element, len(node.path), inner, played)
                    bits = self._bits(number, element, len(node.path), 0)
                    played.elements[number].append((place == len(found) - 1, bits))

    def beats(self, data: bytes) -> list[Beat]:
        """Full beats, except for the last one."""
        lanes = self.width // 8
        starts = range(0, len(data), lanes)
        return [Beat(data[start : start + lanes], start + lanes >= len(data)) for start in starts]

    def _bits(self, number: int, value: Any, depth: int, payload_length: int) -> str:
        """All ports of a group, the first one lowest, as digits."""
        digits = ""
        for _, width, _, what in self.groups[number].fields:
            digits = f"{self._port_bits(what, value, depth, payload_length):0{width or 1}b}" + digits
        return digits

    @staticmethod
    def _port_bits(what: object, value: Any, depth: int, payload_length: int) -> int:
        match what:
            case FrameField(type=type_):
                bits = 0
                for place, element in enumerate(leaf_of(value, what, depth)):
                    raw = int.from_bytes(struct.pack(f"<{type_.code}", element), "little")
                    bits |= raw << (place * type_.bits)
                return bits
            case Data():
                return len(data_bytes(what, part_of(value, what, depth))) // what.element.size
            case Loop():
                return len(part_of(value, what, depth))
        return payload_length

    # --- runs ---------------------------------------------------------------------------------------------------

    def run(self, directory: Path, messages: Sequence[Message], **generics: Generic) -> RunResult:
        """Give the messages; the run fails unless their frames and errors come, and nothing else."""
        self._write(directory, messages)
        # A frame that is cut goes on inside for as long as its message.
        quiet = 500 + 20 * max(map(self._most_beats, messages))
        result = self.library.run(f"{self.entity}_tb", {"QUIET": quiet, **generics}, directory=directory)
        output = result.output
        assert result.exit_code == 0, output[-3000:]
        assert output.splitlines()[-1] == "over", output[-3000:]
        assert "waiting" not in output, output[-3000:]
        frames = _frames(output)
        errors = [int(code) for code in re.findall(r"^error (\d+)$", output, re.MULTILINE)]
        taken = [int(number) for number in re.findall(r"^taken (\d+)", output, re.MULTILINE)]
        # One that is to be withdrawn may be taken before.
        messages = [
            replace(message, lifetime=0, error=0) if message.lifetime and number in taken else message
            for number, message in enumerate(messages)
        ]
        expected_errors = ""
        for number, message in enumerate(messages):
            if message.error:
                # A message that is withdrawn may have gone before its first byte was taken, and a frame that fits
                # a beat is not sent.
                is_sent = bool(frames) and frames[0].is_aborted and self._begins(frames[0], message)
                assert is_sent or message.lifetime or self.width > 8, f"no frame of message {number}"
                frames = frames[is_sent:]
                expected_errors += f"{message.error}{'' if is_sent or not message.lifetime else '?'}"
                continue
            assert frames, f"no frame of message {number}\n{output[-2000:]}"
            frame = frames.pop(0)
            assert not frame.is_aborted, number
            assert frame.data.hex() == (_header(message) + message.payload).hex(), number
        assert not frames
        assert re.fullmatch(expected_errors, "".join(map(str, errors))), (errors, expected_errors)
        left = {int(number) for number in re.findall(r"^left of message (\d+)$", output, re.MULTILINE)}
        assert left <= {number for number, message in enumerate(messages) if message.lifetime}
        assert taken == [number for number, message in enumerate(messages) if not message.lifetime]
        assert not re.search(r"^(?!.*@0ms).*warning", output, re.MULTILINE), output[-3000:]
        return result

    def _begins(self, frame: Sent, message: Message) -> bool:
        """Whether the frame is the beginning of the message's, apart from the beats in which it was aborted."""
        whole = _header(message) + message.payload
        certain = max(0, len(frame.data) - 2 * self.width // 8)
        return len(frame.data) <= len(whole) + self.width // 8 and whole.startswith(frame.data[:certain])

    def _most_beats(self, message: Message) -> int:
        """More than it is sent in: each group of fields and each stream begins with one of its own."""
        elements = [bits for found in message.elements.values() for _, bits in found]
        streams = sum(len(beats) + 1 for found in message.streams.values() for beats in found)
        return streams + sum(len(bits) // self.width + 2 for bits in (message.bits, *elements))

    def _write(self, directory: Path, messages: Sequence[Message]) -> None:
        lines: dict[str, list[str]] = {"values_0": []}
        lines |= {f"values_{number}": [] for number in range(1, len(self.groups))}
        lines |= {f"stream_{len(self.groups) + number}": [] for number in range(len(self.streams))}
        lanes = self.width // 8
        for number, message in enumerate(messages):
            lines["values_0"].append(f"{number} 1 {message.lifetime} {message.bits}")
            for place, elements in message.elements.items():
                lines[f"values_{place}"] += [f"{number} {int(last)} 0 {bits}" for last, bits in elements]
            for place, streams in message.streams.items():
                lines[f"stream_{len(self.groups) + place}"] += [
                    f"{number} {int(beat.is_last)} {(1 << len(beat.data)) - 1:0{lanes}b} "
                    f"{int.from_bytes(beat.data, 'little'):0{self.width}b}"
                    for beats in streams
                    for beat in beats
                ]
        for name, rows in lines.items():
            (directory / f"{name}.txt").write_text("".join(f"{row}\n" for row in rows), encoding="ascii")


def data_bytes(data: Data, value: Any) -> bytes:
    """The elements of a string or an array of numbers as they are sent."""
    if data.kind is DataKind.ARRAY:
        return struct.pack(f"<{len(value)}{data.element.code}", *value)
    return bytes(units_of(data, value))


def _units(text: str) -> list[int]:
    units = text.encode("utf-16-le")
    return list(struct.unpack(f"<{len(units) // 2}H", units))


def _scopes(nodes: Sequence[Node], scope: Scope) -> Iterator[Scope]:
    for node in nodes:
        if isinstance(node, Loop) and node.is_used and node.body:
            yield (*scope, node)
            yield from _scopes(node.body, (*scope, node))


@dataclass(frozen=True)
class Sent:
    """A frame on its way to the Manager."""

    data: bytes
    is_aborted: bool


def _frames(output: str) -> list[Sent]:
    """Those that the bench printed, most of them in parts, between which there are other lines."""
    frames, digits, is_aborted = [], "", False
    for line, kind, found in re.findall(r"^(aborted|(part|frame) (\w*))$", output, re.MULTILINE):
        digits += found
        is_aborted |= line == "aborted"
        if kind == "frame":
            frames.append(Sent(bytes.fromhex(digits), is_aborted))
            digits, is_aborted = "", False
    return frames


def _header(message: Message) -> bytes:
    return bytes([ID]) + len(message.payload).to_bytes(4, "little")
