"""A subscriber alone, and what must come out of it.

    bench = SubscriberBench(tmp_path)
    subscriber = bench.subscriber(frame, 8)
    events = subscriber.run(tmp_path, [payload], SEED=7, STALL_PERCENT=30)
    assert events == subscriber.events(value, payload)

An event is a line: a stream with its bytes, an element of an array with its fields, the message with its own.
"""

from __future__ import annotations

import pathlib
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.converter.configuration import subscriber_entity
from fusesoc_firm.converter.message_ports import message_ports, message_side, segment_count
from fusesoc_firm.converter.pipeline import NONE, pipeline_of
from fusesoc_firm.converter.program import has_bytes
from fusesoc_firm.converter.sources import subscriber_source
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, FrameField, Loop, Node, Path, Step
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Generic, Library, core_files

LENGTH_BYTES = 4
_ZERO = {True: "(others => '0')", False: "'0'"}


@dataclass(frozen=True)
class Beat:
    """A beat of a stream; bit k of `keep` is that of lane k."""

    data: bytes
    keep: int
    is_last: bool
    is_aborted: bool = False

    def row(self, width: int) -> str:
        """The beat as the bench reads it."""
        data = int.from_bytes(self.data, "little")
        return f"{data:0{width}b} {self.keep:0{width // 8}b} {int(self.is_last)} {int(self.is_aborted)}"


@dataclass(frozen=True)
class SubscriberBench:
    """GHDL's libraries in one directory."""

    directory: pathlib.Path
    pipeline: str | None = None
    made: dict[tuple[Frame, int], Subscriber] = field(default_factory=dict)

    def __post_init__(self) -> None:
        Library("firm", self.directory).analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))

    def subscriber(self, frame: Frame, width: int) -> Subscriber:
        """The subscriber with its bench, analysed once."""
        if (frame, width) not in self.made:
            library = Library(f"ros{frame.ros.number}_{width}", self.directory)
            made = Subscriber(library, frame, width, pipeline_of(frame, self.pipeline))
            made.analyse()
            self.made[frame, width] = made
        return self.made[frame, width]


@dataclass(frozen=True)
class Subscriber:
    """The subscriber of one message."""

    library: Library
    frame: Frame
    width: int
    pipeline: str = NONE

    @property
    def entity(self) -> str:
        return subscriber_entity(self.frame)

    def analyse(self) -> None:
        folder = self.library.directory / self.library.name
        folder.mkdir(exist_ok=True)
        file = folder / f"{self.entity}.vhd"
        source = subscriber_source(self.frame, self.width, self.entity, self.pipeline)
        file.write_text(source.text, encoding="ascii")
        self.library.analyse([file])
        self.analyse_bench()

    def analyse_bench(self) -> None:
        file = self.library.directory / self.library.name / f"{self.entity}_tb.vhd"
        file.write_text(
            render("subscriber_tb.vhd", self._configuration(), pathlib.Path(__file__).parent), encoding="ascii"
        )
        self.library.analyse([file])

    def run(self, directory: pathlib.Path, frames: Sequence[bytes], **generics: Generic) -> list[str]:
        """What comes of the frames, given as all bytes behind their ids."""
        return self.run_beats(directory, [beat for frame in frames for beat in self.beats(frame)], **generics)

    def run_beats(self, directory: pathlib.Path, beats: Sequence[Beat], **generics: Generic) -> list[str]:
        """What comes of beats."""
        (directory / "beats.txt").write_text("".join(f"{beat.row(self.width)}\n" for beat in beats), encoding="ascii")
        result = self.library.run(f"{self.entity}_tb", generics, directory=directory)
        assert result.exit_code == 0, result.output
        lines = result.output.splitlines()
        assert not [line for line in lines if "warning" in line and "@0ms" not in line], result.output
        assert lines[-1].startswith("cycles ")
        (directory / "cycles.txt").write_text(lines[-1], encoding="ascii")
        return [line.rstrip() for line in lines[:-1] if ":@" not in line]

    def events(self, value: Any, payload_length: int) -> list[str]:
        """What must come of a message."""
        numbers = [struct.pack(">I", payload_length).hex()]
        streams = list(self._events(self.frame.nodes, value, 0, numbers))
        return [*streams, " ".join(["message", *numbers])]

    def _events(self, nodes: Sequence[Node], value: Any, depth: int, numbers: list[str]) -> Iterator[str]:
        """The events of a message or an element; its own fields and lengths are added to `numbers`."""
        side = message_side(self.frame)
        shown: set[Path] = set()
        for node in nodes:
            match node:
                case Fixed():
                    numbers += _fixed_digits(node, value, depth, shown)
                case Data() if node.is_used:
                    data, count = _data(node, _member(value, node.path[depth:]))
                    numbers.append(struct.pack(">I", count).hex())
                    if data:
                        yield f"{side.stream(node).name} {data.hex()}"
                case Loop() if node.is_used:
                    elements = list(_member(value, node.path[depth:]))
                    if node.count is None:
                        numbers.append(struct.pack(">I", len(elements)).hex())
                    if not has_bytes(node):
                        continue
                    ports = side.element(node)
                    for number, element in enumerate(elements):
                        inner: list[str] = []
                        yield from self._events(node.body, element, len(node.path), inner)
                        last = "01" if number == len(elements) - 1 else "00"
                        yield " ".join([ports.name, *inner, "last", last])

    def beats(self, frame: bytes) -> list[Beat]:
        """The beats of a frame, given as all bytes behind its id."""
        lanes = self.width // 8
        data = frame if lanes == 1 else b"\xee" + frame
        parts = [data[start : start + lanes] for start in range(0, len(data), lanes)]
        return [
            Beat(part, (1 << len(part)) - 1, is_last=number == len(parts)) for number, part in enumerate(parts, start=1)
        ]

    def _configuration(self) -> dict[str, object]:
        side = message_side(self.frame)
        # In front of each port's name, so that no signal has the name of something else here.
        ports = message_ports(self.frame, self.width)
        top, inner = _scoped_ports(self.frame, side)
        fields = [port.name for port in ports] if self.frame.is_fixed_size else ["payload_length", *top]
        return {
            "message": str(self.frame.message),
            "entity": f"{self.entity}_tb",
            "subscriber_entity": self.entity,
            "lanes": self.width // 8,
            "segment_high": segment_count(self.frame) - 1,
            "ports": [
                {
                    "port": port.name,
                    "signal": _signal(port.name),
                    "type": vhdl_type(port.width),
                    "initial": f" := {_ZERO[port.width is not None]}" if port.is_reverse else "",
                }
                for port in ports
            ],
            "streams": [
                {"name": found.name, "signal": f"{_signal(found.name)}_axis"}
                for found in side.parts
                if hasattr(found, "axis")
            ],
            "elements": [
                {
                    "name": name,
                    "signal": _signal(name),
                    "fields": [{"signal": _signal(port)} for port in fields],
                    "segments": "",
                }
                for name, fields in inner
            ],
            "fields": [{"signal": _signal(port)} for port in fields],
        }


def _signal(name: str) -> str:
    return f"p_{name}"


def _scoped_ports(frame: Frame, side: Any) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """The ports of fields and lengths of the message itself, and of each array's element."""
    inner: list[tuple[str, list[str]]] = []

    def own(nodes: Sequence[Node]) -> list[str]:
        found: list[str] = []
        for node in nodes:
            match node:
                case Fixed(fields=fields):
                    names = [side.field(leaf).name for leaf in fields if leaf.count and leaf.is_used]
                    found += [name for name in names if name not in found]
                case Data() if node.is_used:
                    found.append(side.stream(node).length)
                case Loop() if node.is_used:
                    if node.count is None:
                        found.append(side.element(node).length)
                    fields_of_element = own(node.body)
                    if has_bytes(node):
                        inner.append((side.element(node).name, fields_of_element))
        return found

    return own(frame.nodes), inner


def _member(value: Any, path: Sequence[Step]) -> Any:
    for step in path:
        value = value[step.name]
    return value


def _elements(value: Any, path: Sequence[Step]) -> list[Any]:
    found = [value]
    for step in path:
        found = [part[step.name] for part in found]
        if step.count is not None:
            found = [element for part in found for element in part]
    return found


def _fixed_digits(node: Fixed, value: Any, depth: int, shown: set[Path]) -> Iterator[str]:
    """The digits of each leaf that is not shown yet."""
    for leaf in node.fields:
        if leaf.count and leaf.is_used and leaf.path not in shown:
            shown.add(leaf.path)
            yield _leaf_digits(leaf, _elements(value, leaf.path[depth:]))


def _leaf_digits(leaf: FrameField, elements: Sequence[Any]) -> str:
    bits = 0
    for number, element in enumerate(elements):
        value = int(element) if leaf.type.bits == 1 else _bits(leaf.type.code, element)
        bits |= value << (number * leaf.type.bits)
    return f"{bits:0{2 * -(-leaf.count * leaf.type.bits // 8)}x}"


def _bits(code: str, element: Any) -> int:
    return int.from_bytes(struct.pack(f"<{code}", element), "little")


def _data(node: Data, value: Any) -> tuple[bytes, int]:
    if node.kind is DataKind.STRING:
        data = str(value).encode()
        return data, len(data)
    if node.kind is DataKind.WSTRING:
        units = str(value).encode("utf-16-le")
        numbers = struct.unpack(f"<{len(units) // 2}H", units)
        return struct.pack(f"<{len(numbers)}I", *numbers), len(numbers)
    values = list(value)
    return struct.pack(f"<{len(values)}{node.element.code}", *values), len(values)
