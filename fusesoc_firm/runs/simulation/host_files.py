"""Write the simulated host's two text files: stimuli and expected frames (docs/reference/simulation-host.md)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, takewhile
from typing import Any

from fusesoc_firm.frame.codec import field_at, pack_frame, used_bytes
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.runs.simulation.reference import Response
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter, Topic

SOFTWARE_FILE = "software.txt"
NO_BLOCK = "no block takes this field or one before it"
"""Why no more bytes of the first message are taken."""
_BYTES_A_LINE = 32
_LABEL_WIDTH = 160
_AT_BYTE = re.compile(r"fault in cycle \d+: '(?P<label>.*)': (?P<what>byte|only|stops after) (?P<byte>\d+)")


def stimulus_text(stimuli: Iterable[Stimulus], subscribers: Iterable[Converter], id_bytes: int = ID_BYTES) -> str:
    """Return the text of the stimulus file."""
    ids = {item.block: item.id for item in subscribers}
    lines: list[str] = []
    for stimulus in stimuli:
        lines.append(f"> {_label(stimulus.subscriber, stimulus.message)}")
        lines += hex_lines(pack_frame(ids[stimulus.subscriber.block], stimulus.payload, id_bytes))
    return "\n".join(lines) + "\n"


def expected_text(
    responses: Sequence[Response],
    publishers: Iterable[Converter],
    id_bytes: int = ID_BYTES,
    ways: Sequence[int] = (),
) -> str:
    """Return the text of the file of expected frames, in which padding matches any byte.

    Responses with different `ways`, unless they are 0, may come in any order.
    """
    ids = {item.block: item.id for item in publishers}
    lines: list[str] = []
    for response, way in zip(responses, ways or [0] * len(responses), strict=True):
        publisher = response.publisher
        cause = "" if response.cause is None else f"@{response.cause} "
        lines.append(f"< {cause}{_label(publisher, response.message)}")
        used = b"\1" * (id_bytes + LENGTH_BYTES) + used_bytes(publisher.frame, response.payload)
        lines += hex_lines(pack_frame(ids[publisher.block], response.payload, id_bytes), used)
        lines += [f"! way {way}"] if way else []
    return "\n".join(lines) + "\n"


def software_text(published: Iterable[Response]) -> str:
    """Return the text of the file of payloads from software to publishers, which the host does not read."""
    lines: list[str] = []
    for item in published:
        lines += [f"< @{item.cause or 0} {item.publisher.block}", *hex_lines(item.payload)]
    return "\n".join(lines) + "\n"


def with_field(
    fault: str,
    texts: tuple[str, str],
    topics: tuple[Iterable[Converter], Iterable[Converter]],
    id_bytes: int = ID_BYTES,
    reason: str = NO_BLOCK,
) -> str:
    """Return a fault of the host with the name of its byte's field, if it is known: `byte 32 (vector.y): ...`.

    `texts` are those of the stimulus file and of the file of expected frames, and `topics` the subscribers and the
    publishers. `reason` says why no more bytes of a message are taken.
    """
    if (match := _AT_BYTE.match(fault)) is None:
        return fault
    is_sent = match["what"] == "only"
    text, known = (texts[0], topics[0]) if is_sent else (texts[1], topics[1])
    frame = _frame_of(match["label"], text)[id_bytes + LENGTH_BYTES :]
    # For a frame that is not accepted, the last accepted byte.
    offset = int(match["byte"]) - id_bytes - LENGTH_BYTES - is_sent
    if not frame or offset < 0:
        return fault
    (topic,) = (item for item in known if item.block == match["label"].partition(" ")[0])
    if not (name := field_at(topic.frame, frame, offset)):
        return fault
    if match["what"] == "byte":
        return f"{fault[: match.end()]} ({name}){fault[match.end() :]}"
    return f"{fault}, up to {name}: {reason}" if is_sent else f"{fault}, before {name}"


def _frame_of(label: str, text: str) -> bytes:
    """Return the first frame with a label in a file, with zeros for padding, or no bytes if it is missing."""
    lines = iter(text.splitlines())
    if not any(re.fullmatch(rf"[<>] (@\d+ )?{re.escape(label)}", line) for line in lines):
        return b""
    return bytes.fromhex("".join(takewhile(lambda line: line.startswith("  "), lines)).replace("..", "00"))


def hex_lines(frame: bytes, used: bytes | None = None) -> Iterator[str]:
    """Yield the frame's bytes in hex; an unused byte is written as `..`."""
    digits = [f"{byte:02x}" if used is None or used[index] else ".." for index, byte in enumerate(frame)]
    for first in range(0, len(digits), _BYTES_A_LINE):
        yield "  " + " ".join(digits[first : first + _BYTES_A_LINE])


def _label(topic: Topic, message: dict[str, Any]) -> str:
    """Return the block, type and values on one line of plain ASCII.

    A long line omits zero and empty values; if still too long, it is truncated.
    """
    label = _line(topic, _elements(message))
    if len(label) > _LABEL_WIDTH:
        label = _line(topic, (item for item in _elements(message) if not is_zero(item[1])))
    return label if len(label) <= _LABEL_WIDTH else label[: _LABEL_WIDTH - 3] + "..."


def _line(topic: Topic, values: Iterable[tuple[str, Any]]) -> str:
    """Return the values on one line; values beyond the length of a label are omitted."""
    line = f"{topic.block} {topic.frame.message}"
    for name, value in values:
        if len(line) > _LABEL_WIDTH:
            break
        line += f" {name}={value_text(value)}"
    return line.encode("ascii", "replace").decode()


def _elements(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in a message with their dotted names, in arrays of messages with the index of the element."""
    match value:
        case [dict(), *_]:
            for number, element in enumerate(value):
                yield from _elements(element, f"{name}[{number}]")
        case dict():
            for key, inner in value.items():
                yield from _elements(inner, f"{name}.{key}" if name else key)
        case _:
            yield name, value


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in a message with their dotted names; arrays are not divided."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{name}.{key}" if name else key)
    else:
        yield name, value


def differences(expected: Any, received: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted name and both values of each value that differs between two messages."""
    if repr(expected) == repr(received):
        return
    if isinstance(expected, Mapping):
        for key, value in expected.items():
            yield from differences(value, received[key], f"{name}.{key}" if name else key)
    elif isinstance(expected, list | bytes) and len(expected) == len(received):
        for number, pair in enumerate(zip(expected, received, strict=True)):
            yield from differences(*pair, f"{name}[{number}]")
    else:
        yield name, expected, received


def is_zero(value: Any) -> bool:
    """Return whether a value is zero, empty, or contains only such values; a truth value is always told."""
    if isinstance(value, bool):
        return False
    if isinstance(value, dict):
        return all(map(is_zero, value.values()))
    return all(map(is_zero, value)) if isinstance(value, list | bytes) else not value


def value_text(value: Any) -> str:
    """Return a value without blanks, except in quoted texts; arrays are truncated to the length of a label."""
    match value:
        case str():
            return json.dumps(value, ensure_ascii=False)
        case Mapping():
            return f"{{{','.join(f'{name}={value_text(inner)}' for name, inner in leaves(value))}}}"
        case list() | bytes():
            return f"[{','.join(map(value_text, islice(value, _LABEL_WIDTH)))}]"
        case _:
            return str(value)
