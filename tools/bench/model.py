"""A converter as a program: GHDL's netlist of it, translated by Verilator, with a bench in C++ around it.

That is some twenty times as fast as GHDL's simulation. The netlist is what `ghdl --synth --out=verilog` makes, so
a fault of that translation would show here as well.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.text.render import render
from tests.compilers import CompilerError
from tests.hdl.ghdl import Generic, Library
from tests.hdl.verilator import compiled
from tools.bench.designs import Converter, Design, Port, generate, is_field

# More than the longest measured payload.
_LONGEST_PAYLOAD = 2**24
_HERE = Path(__file__).parent

# The id that publishers send.
PUBLISHER_ID = 3


class ModelError(Exception):
    """The model does not compile, or the converter broke a rule of its ports; the text says which."""


@dataclass(frozen=True)
class Message:
    """A message that was delivered: what each field's port and each stream showed, as bytes."""

    shown: dict[str, bytes]


@dataclass(frozen=True)
class FrameError:
    """A cycle of `frame_error`."""

    code: int


@dataclass(frozen=True)
class Timing:
    """Cycles by their numbers, one entry a frame or message; `streams` holds first, last and beats for each stream."""

    first: tuple[int, ...]
    last: tuple[int, ...]
    valid: tuple[int, ...]
    streams: tuple[tuple[int, int, int], ...]
    cycles: int


@dataclass(frozen=True)
class Subscriber:
    """A subscriber as a program. `fields` and `streams` are what its records hold, in order."""

    program: Path
    width: int
    fields: tuple[str, ...]
    streams: tuple[str, ...]

    @property
    def shown(self) -> tuple[str, ...]:
        """What a message shows, by name: each field, and each stream with `_axis` behind its name."""
        return (*self.fields, *(f"{stream}_axis" for stream in self.streams))

    def run(
        self, folder: Path, bodies: Iterable[bytes], seed: int = 1, stall_percent: int = 0
    ) -> tuple[list[Message | FrameError], Timing]:
        """Send frames, each as the bytes behind its id; raises `ModelError`. Files go to `folder`."""
        (folder / "frames").write_bytes(_sized(bodies))
        output = _execute([str(self.program), "frames", "records", str(seed), str(stall_percent)], folder)
        return [*self._records((folder / "records").read_bytes())], _timing(output)

    def _records(self, data: bytes) -> Iterator[Message | FrameError]:
        place = 0
        while place < len(data):
            if data[place : place + 1] == b"E":
                yield FrameError(data[place + 1])
                place += 2
                continue
            end = place + 5 + int.from_bytes(data[place + 1 : place + 5], "little")
            yield Message(dict(zip(self.shown, _strings(data[place + 5 : end]), strict=True)))
            place = end


@dataclass(frozen=True)
class Publisher:
    """A publisher as a program. `shown` are the fields, and each stream with `_axis` behind its name, in order."""

    program: Path
    shown: tuple[str, ...]

    def run(self, folder: Path, messages: Iterable[Mapping[str, bytes]]) -> tuple[list[bytes], Timing]:
        """Give messages, each as what its ports show, and return the frames; raises `ModelError`."""
        strings = [message[name] for message in messages for name in self.shown]
        (folder / "strings").write_bytes(_sized(strings))
        output = _execute([str(self.program), "strings", "frames"], folder)
        return [*_strings((folder / "frames").read_bytes())], _timing(output)


def subscriber_model(converter: Converter, folder: Path) -> Subscriber:
    """Generate, synthesise and compile a subscriber in `folder`; raises `NotConvertedError` and `ModelError`."""
    (design,) = generate(folder, converter)
    elements = [port.name.removesuffix("_ready") for port in design.ports if _is_element(port, design.ports)]
    fields = [port for port in design.ports if is_field(port)]
    streams = _streams(design)
    owner = {port.name: _owner(port.name, elements) for port in fields}
    configuration = {
        "entity": design.entity,
        "lanes": converter.width // 8,
        "void_lanes": int(converter.width > 8),
        "all_segments": _all_segments(design),
        "fields": [{"name": port.name} for port in fields],
        "message_fields": _shown(fields, owner, None),
        "elements": [{"name": element, "fields": _shown(fields, owner, element)} for element in elements],
        "streams": [{"name": stream} for stream in streams],
    }
    generics = {} if converter.frame().is_fixed_size else {"MAX_LENGTH": _LONGEST_PAYLOAD}
    program = _build(design, "subscriber.cpp", configuration, generics)
    return Subscriber(program, converter.width, tuple(port.name for port in fields), streams)


def publisher_model(converter: Converter, folder: Path) -> Publisher:
    """Generate, synthesise and compile a publisher in `folder`; raises `NotConvertedError` and `ModelError`.

    Its fields and streams are those of a message without arrays of messages.
    """
    (design,) = generate(folder, converter)
    fields = [port.name for port in design.ports if is_field(port)]
    streams = _streams(design)
    configuration = {
        "entity": design.entity,
        "lanes": converter.width // 8,
        "strings": max(1, len(fields) + len(streams)),
        "all_segments": _all_segments(design),
        "fields": [{"name": field, "index": index} for index, field in enumerate(fields)],
        "streams": [{"name": stream, "index": index} for index, stream in enumerate(streams, len(fields))],
        "has_errors": any(port.name == "frame_error" for port in design.ports),
    }
    program = _build(design, "publisher.cpp", configuration, {"ID": PUBLISHER_ID})
    return Publisher(program, (*fields, *(f"{stream}_axis" for stream in streams)))


def _build(design: Design, template: str, configuration: dict[str, Any], generics: Mapping[str, Generic]) -> Path:
    """The program of a design's netlist and the bench that `template` makes of `configuration`."""
    return verilate(design.library, design.entity, render(template, configuration, _HERE), generics)


def verilate(
    library: Library, entity: str, bench: str, generics: Mapping[str, Generic] | None = None, *, is_long: bool = True
) -> Path:
    """The program of an entity's netlist and a bench in C++, in the library's folder; raises `ModelError`."""
    netlist = library.synthesise(entity, generics, "verilog")
    try:
        return compiled(netlist, entity, bench, library.directory, is_long=is_long)
    except CompilerError as error:
        raise ModelError(str(error)) from error


def _execute(command: Sequence[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ModelError(done.stderr.strip() or f"ended with {done.returncode}")
    return done.stdout


def _sized(strings: Iterable[bytes]) -> bytes:
    """Each with its size in front."""
    return b"".join(len(string).to_bytes(4, "little") + string for string in strings)


def _strings(data: bytes) -> Iterator[bytes]:
    place = 0
    while place < len(data):
        size = int.from_bytes(data[place : place + 4], "little")
        yield data[place + 4 : place + 4 + size]
        place += 4 + size


def _all_segments(design: Design) -> int:
    """Every bit of `segment_valid`."""
    (bits,) = (port.bits for port in design.ports if port.name == "segment_valid")
    return (1 << bits) - 1


def _streams(design: Design) -> tuple[str, ...]:
    """The names of the message side's streams."""
    found = (re.fullmatch(r"(\w+)_axis_tvalid", port.name) for port in design.ports)
    return tuple(match[1] for match in found if match and match[1] not in ("s", "m"))


def _is_element(port: Port, ports: Sequence[Port]) -> bool:
    """Whether a port is the `ready` of an array's elements."""
    names = {other.name for other in ports}
    name = port.name.removesuffix("_ready")
    return port.name.endswith("_ready") and name != "msg" and {f"{name}_valid", f"{name}_last"} <= names


def _owner(field: str, elements: Sequence[str]) -> str | None:
    """The array whose element a port belongs to; an array's length belongs to what holds the array."""
    owners = [name for name in elements if field.startswith(f"{name}_") and field != f"{name}_length"]
    return max(owners, key=len, default=None)


def _shown(fields: Sequence[Port], owner: dict[str, str | None], element: str | None) -> list[dict[str, object]]:
    return [{"name": port.name, "bytes": -(-port.bits // 8)} for port in fields if owner[port.name] == element]


def _timing(output: str) -> Timing:
    cycles: dict[str, list[int]] = {"first": [], "last": [], "message": [], "cycles": []}
    streams = []
    for line in output.splitlines():
        word, *numbers = line.split()
        if word == "stream":
            start, end, beats = map(int, numbers)
            streams.append((start, end, beats))
        else:
            cycles[word].append(int(numbers[0]))
    first, last, valid = (tuple(cycles[word]) for word in ("first", "last", "message"))
    return Timing(first, last, valid, tuple(streams), cycles["cycles"][0])
