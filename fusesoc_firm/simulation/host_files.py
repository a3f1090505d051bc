"""Write the simulated host's two text files: stimuli and expected frames (docs/reference/simulation-host.md)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, takewhile
from typing import Any

from fusesoc_firm.frame.codec import field_at, pack_frame, used_bytes
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.simulation.reference import Response
from fusesoc_firm.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter, Topic

_BYTES_A_LINE = 32
_LABEL_WIDTH = 160
_ZEROS = ("0", "0.0", "False", '""', "[]")
_WRONG_BYTE = re.compile(r"fault in cycle \d+: '(?P<label>.*)': byte (?P<byte>\d+)")


def stimulus_text(stimuli: Iterable[Stimulus], subscribers: Iterable[Converter], id_bytes: int = ID_BYTES) -> str:
    """Return the text of the stimulus file."""
    ids = {item.block: item.id for item in subscribers}
    lines: list[str] = []
    for stimulus in stimuli:
        lines.append(f"> {_label(stimulus.subscriber, stimulus.message)}")
        lines += _hex_lines(pack_frame(ids[stimulus.subscriber.block], stimulus.payload, id_bytes), None)
    return "\n".join(lines) + "\n"


def expected_text(responses: Iterable[Response], publishers: Iterable[Converter], id_bytes: int = ID_BYTES) -> str:
    """Return the text of the file of expected frames, in which padding matches any byte."""
    ids = {item.block: item.id for item in publishers}
    lines: list[str] = []
    for response in responses:
        publisher = response.publisher
        cause = "" if response.cause is None else f"@{response.cause} "
        lines.append(f"< {cause}{_label(publisher, response.message)}")
        used = b"\1" * (id_bytes + LENGTH_BYTES) + used_bytes(publisher.frame, response.payload)
        lines += _hex_lines(pack_frame(ids[publisher.block], response.payload, id_bytes), used)
    return "\n".join(lines) + "\n"


def with_field(fault: str, expected: str, publishers: Iterable[Converter], id_bytes: int = ID_BYTES) -> str:
    """Return a fault of the host with the name of the wrong byte's field, if it is known: `byte 32 (vector.y): ...`.

    `expected` is the text of the file of expected frames.
    """
    match = _WRONG_BYTE.match(fault)
    frame = _frame_of(match["label"], expected) if match else b""
    offset = int(match["byte"]) - id_bytes - LENGTH_BYTES if match else -1
    if match is None or not frame or offset < 0:
        return fault
    (topic,) = (item for item in publishers if item.block == match["label"].partition(" ")[0])
    name = field_at(topic.frame, frame[id_bytes + LENGTH_BYTES :], offset)
    return f"{fault[: match.end()]} ({name}){fault[match.end() :]}" if name else fault


def _frame_of(label: str, expected: str) -> bytes:
    """Return the first expected frame with a label, with zeros for padding; no bytes if there is none."""
    lines = iter(expected.splitlines())
    if not any(re.fullmatch(rf"< (@\d+ )?{re.escape(label)}", line) for line in lines):
        return b""
    return bytes.fromhex("".join(takewhile(lambda line: line.startswith("  "), lines)).replace("..", "00"))


def _hex_lines(frame: bytes, used: bytes | None) -> Iterator[str]:
    """Yield the frame's bytes in hex; an unused byte is written as `..`."""
    digits = [f"{byte:02x}" if used is None or used[index] else ".." for index, byte in enumerate(frame)]
    for first in range(0, len(digits), _BYTES_A_LINE):
        yield "  " + " ".join(digits[first : first + _BYTES_A_LINE])


def _label(topic: Topic, message: dict[str, Any]) -> str:
    """Return the block, type and values on one line of plain ASCII.

    A long line has no zeros and nothing empty; if it is still long, it is truncated.
    """
    values = [(name, value_text(value)) for name, value in leaves(message)]
    label = _line(topic, values)
    if len(label) > _LABEL_WIDTH:
        label = _line(topic, [item for item in values if item[1] not in _ZEROS])
    return label if len(label) <= _LABEL_WIDTH else label[: _LABEL_WIDTH - 3] + "..."


def _line(topic: Topic, values: Iterable[tuple[str, str]]) -> str:
    words = (f"{name}={value}" for name, value in values)
    return " ".join((topic.block, str(topic.frame.message), *words)).encode("ascii", "replace").decode()


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in a message with their dotted names; arrays are not divided."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{name}.{key}" if name else key)
    else:
        yield name, value


def value_text(value: Any) -> str:
    """Return a value without blanks, except in quoted texts; arrays are truncated to the length of a label."""
    match value:
        case str():
            return json.dumps(value, ensure_ascii=False)
        case Mapping():
            return f"{{{','.join(f'{name}={value_text(inner)}' for name, inner in value.items())}}}"
        case list() | bytes():
            return f"[{','.join(map(value_text, islice(value, _LABEL_WIDTH)))}]"
        case _:
            return str(value)
