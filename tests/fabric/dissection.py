"""What tshark finds in RTPS messages, beside what this folder's parser finds."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Parameter
from tests.cores.ethernet import is_set
from tests.fabric.messages import (
    AckNack,
    Data,
    DataFrag,
    Gap,
    Heartbeat,
    HeartbeatFrag,
    InfoDestination,
    Message,
    NackFrag,
    Numbers,
    Other,
    ParameterList,
    Submessage,
    parse,
)


def _unsigned(text: str) -> int:
    """A word, which tshark may show as a negative number."""
    return int(text) & 0xFFFFFFFF


Fields = list[tuple[str, object]]
# The fields that are compared, with the form of their values.
_FORMS: dict[str, Callable[[str], Any]] = {
    "rtps.sm.id": lambda text: int(text, 16),
    "rtps.guidPrefix.dst": bytes.fromhex,
    "rtps.sm.rdEntityId": lambda text: bytes.fromhex(text.removeprefix("0x")),
    "rtps.sm.wrEntityId": lambda text: bytes.fromhex(text.removeprefix("0x")),
    "rtps.sm.seqNumber": int,
    "rtps.flag.final": is_set,
    "rtps.flag.data_present": is_set,
    "rtps.flag.data.serialized_key": is_set,
    "rtps.data_frag.number": _unsigned,
    "rtps.data_frag.num_fragments": int,
    "rtps.data_frag.size": int,
    "rtps.data_frag.sample_size": _unsigned,
    "rtps.heartbeat_count": _unsigned,
    "rtps.acknack.count": _unsigned,
    "rtps.heartbeat_frag.number": _unsigned,
    "rtps.heartbeat_frag.count": _unsigned,
    "rtps.fragment_number.base32": _unsigned,
    "rtps.fragment_number.num_bits": int,
    "rtps.nack_frag.count": _unsigned,
    "rtps.param.id": lambda text: int(text, 16),
    "rtps.param.length": int,
    "rtps.bitmap.num_bits": int,
}


def dissect(capture: Path) -> Iterator[tuple[bytes, list[Fields]]]:
    """The payload of each datagram with RTPS, reassembled by tshark, and the fields of each submessage."""
    command = ["tshark", "-r", str(capture), "-Y", "rtps", "-T", "pdml"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    for packet in ET.fromstring(done.stdout).iter("packet"):
        payload = next(field.get("value", "") for field in packet.iter("field") if field.get("name") == "udp.payload")
        (message,) = (part for part in packet.iter("proto") if part.get("name") == "rtps")
        parts = [part for part in message if part.get("name") == "rtps.sm.id"]
        yield bytes.fromhex(payload), [list(_fields(part)) for part in parts]


def _fields(part: ET.Element) -> Iterator[tuple[str, object]]:
    is_little, size = False, 0
    for field in part.iter("field"):
        name, text = field.get("name", ""), field.get("show", "").replace(":", "")
        if name == "rtps.flag.endianness":
            is_little = is_set(text)
        elif name == "rtps.bitmap":
            words = bytes.fromhex(text)
            bits = b"".join(words[at : at + 4][:: -1 if is_little else 1] for at in range(0, len(words), 4))
            # Cyclone DDS sends further bits, which do not count.
            unused = 8 * len(bits) - size
            yield name, (int.from_bytes(bits, "big") >> unused << unused).to_bytes(len(bits), "big")
        elif name in _FORMS:
            value = _FORMS[name](text)
            size = value if name.endswith("num_bits") else size
            yield name, value


def fields_of(item: Submessage) -> Fields:
    """The fields that tshark should find in a submessage."""
    kind: Fields = [("rtps.sm.id", int(item.kind))]
    match item:
        case Other():
            return kind
        case InfoDestination(prefix):
            return [*kind, ("rtps.guidPrefix.dst", prefix)]
        case Data():
            flags = ("rtps.flag.data.serialized_key", int(item.is_key))
            kind += [flags, ("rtps.flag.data_present", int(item.payload is not None and not item.is_key))]
        case Heartbeat() | AckNack():
            kind += [("rtps.flag.final", int(item.is_final))]
    ends: Fields = [("rtps.sm.rdEntityId", item.reader), ("rtps.sm.wrEntityId", item.writer)]
    return [*kind, *ends, *_others(item)]


def _number(number: int) -> tuple[str, object]:
    return "rtps.sm.seqNumber", number


def _others(item: Submessage) -> Fields:
    match item:
        case Data():
            return [_number(item.number), *_inline(item.inline), *_listed(item.payload or b"")]
        case DataFrag():
            names = ("number", "num_fragments", "size", "sample_size")
            values = (item.first, item.count, item.fragment_bytes, item.size)
            fields = [(f"rtps.data_frag.{name}", value) for name, value in zip(names, values, strict=True)]
            return [_number(item.number), *fields, *_inline(item.inline)]
        case Heartbeat():
            return [_number(item.first), _number(item.last), ("rtps.heartbeat_count", item.count)]
        case AckNack():
            return [_number(item.missing.base), *_set(item.missing), ("rtps.acknack.count", item.count)]
        case Gap():
            return [_number(item.start), _number(item.others.base), *_set(item.others)]
        case HeartbeatFrag():
            fields = [("rtps.heartbeat_frag.number", item.last), ("rtps.heartbeat_frag.count", item.count)]
            return [_number(item.number), *fields]
        case NackFrag():
            base = ("rtps.fragment_number.base32", item.missing.base)
            fragments = _set(item.missing, "rtps.fragment_number.num_bits")
            # The bits of a single one are not shown.
            fragments = fragments[:1] if item.missing.size == 1 else fragments
            return [_number(item.number), base, *fragments, ("rtps.nack_frag.count", item.count)]
    return []


def _set(numbers: Numbers, name: str = "rtps.bitmap.num_bits") -> Fields:
    words = -(-numbers.size // 32)
    bits = numbers.bits << (32 * words - numbers.size)
    return [(name, numbers.size), *([("rtps.bitmap", bits.to_bytes(4 * words, "big"))] if words else [])]


def _inline(items: tuple[tuple[int, bytes], ...]) -> Fields:
    return _parameters(items) if items else []


def _listed(payload: bytes) -> Fields:
    """The parameters of a payload, if it is a list of some."""
    is_list = payload[:2] in (rtps.PARAMETER_LIST[:2], b"\0\2")
    return _parameters(ParameterList.of(payload).items) if is_list else []


def _parameters(items: tuple[tuple[int, bytes], ...]) -> Fields:
    ids = [[("rtps.param.id", number), ("rtps.param.length", len(value))] for number, value in items]
    return [*(field for both in ids for field in both), ("rtps.param.id", int(Parameter.SENTINEL))]


def read_alike(capture: Path) -> Iterator[tuple[bytes, Message]]:
    """The messages of a capture with their bytes. In each, tshark has to find what this folder's parser finds."""
    for payload, fields in dissect(capture):
        message = parse(payload)
        assert message is not None and message.is_whole, payload.hex()
        assert fields == [fields_of(item) for item in message.submessages], payload.hex()
        yield payload, message
