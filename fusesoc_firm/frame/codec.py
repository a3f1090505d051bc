"""Frames in Python: a message as nested dictionaries and lists to payload bytes, and back.

The codec follows the same Frame that the hardware is made of. It is the tool of stimuli and reports, never
the judge of the converters: those are compared with serialisers that are not ours.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any

from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES, Frame, FrameField, Step

MessageValue = Mapping[str, Any]


class CodecError(ValueError):
    """A value that does not fit its message, or bytes that do not fit their frame."""


def encode(frame: Frame, message: MessageValue) -> bytes:
    """The payload of `message`; padding bytes are zero, a missing field is an error."""
    _reject_unknown(frame, message)
    payload = bytearray(frame.payload_bytes)
    payload[: len(frame.prefix)] = frame.prefix
    for field in frame.fields:
        values = _gather(message, field.path, field)
        for offset, value in zip(field.offsets, values, strict=True):
            payload[offset : offset + field.type.size] = _pack(field, value)
    return bytes(payload)


def decode(frame: Frame, payload: bytes) -> dict[str, Any]:
    """The message of a payload; numbers are Python numbers, arrays lists.

    Raises:
        CodecError: the length or the encoding is not one that the frame allows.
    """
    trailing = len(payload) - frame.payload_bytes
    if not 0 <= trailing <= frame.trailing_bytes:
        raise CodecError(f"{frame.message} takes {frame.payload_bytes} bytes, not {len(payload)}")
    checked = payload[: frame.checked_prefix]
    if checked != frame.prefix[: frame.checked_prefix]:
        raise CodecError(f"unknown encoding {checked.hex()} of {frame.message}")
    message: dict[str, Any] = {}
    for field in frame.fields:
        values = (struct.unpack_from(f"<{field.type.code}", payload, offset)[0] for offset in field.offsets)
        _scatter(message, field.path, values)
    return message


def used_bytes(frame: Frame) -> bytes:
    """One byte for each byte of the payload: 1 where a value or the prefix lies, 0 where only padding does."""
    used = bytearray(frame.payload_bytes)
    used[: len(frame.prefix)] = b"\1" * len(frame.prefix)
    for field in frame.fields:
        for run in field.runs:
            length = run.count * field.type.size
            used[run.offset : run.offset + length] = b"\1" * length
    return bytes(used)


def pack_frame(identifier: int, payload: bytes) -> bytes:
    """The whole frame: id, length, payload."""
    return identifier.to_bytes(ID_BYTES, "little") + len(payload).to_bytes(LENGTH_BYTES, "little") + payload


def _pack(field: FrameField, value: object) -> bytes:
    try:
        # `struct` takes anything for a bool: the text "False" would be sent as true.
        if field.type.code == "?" and value not in (False, True):
            raise TypeError
        return struct.pack(f"<{field.type.code}", value)
    except (struct.error, OverflowError, TypeError, ValueError) as error:
        raise CodecError(f"'{'.'.join(field.names)}' takes a {field.type.name}, not {value!r}") from error


def _gather(value: Any, path: tuple[Step, ...], field: FrameField) -> Iterator[Any]:
    """Every element that `path` leads to, in wire order."""
    if not path:
        yield value
        return
    step, rest = path[0], path[1:]
    if not isinstance(value, Mapping) or step.name not in value:
        raise CodecError(f"no value for '{'.'.join(field.names)}'")
    inner = value[step.name]
    if step.count is None:
        yield from _gather(inner, rest, field)
        return
    if not isinstance(inner, list | tuple) or len(inner) != step.count:
        raise CodecError(f"'{step.name}' takes a list of {step.count}, not {inner!r}")
    for element in inner:
        yield from _gather(element, rest, field)


def _scatter(message: dict[str, Any], path: tuple[Step, ...], values: Iterator[Any]) -> None:
    """Put the elements of one leaf, in wire order, where `path` leads to."""
    step, rest = path[0], path[1:]
    if not rest:
        message[step.name] = next(values) if step.count is None else [next(values) for _ in range(step.count)]
    elif step.count is None:
        _scatter(message.setdefault(step.name, {}), rest, values)
    else:
        for element in message.setdefault(step.name, [{} for _ in range(step.count)]):
            _scatter(element, rest, values)


def _reject_unknown(frame: Frame, message: MessageValue) -> None:
    known = {field.names for field in frame.fields}
    for names in _leaves(message):
        if not any(names[: len(path)] == path for path in known):
            raise CodecError(f"{frame.message} has no field '{'.'.join(names)}'")


def _leaves(value: Any, names: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(inner, (*names, str(name)))
    elif isinstance(value, list | tuple) and (not value or isinstance(value[0], Mapping)):
        # An array of no elements holds nothing that could be unknown.
        for inner in value:
            yield from _leaves(inner, names)
    elif names:
        yield names
