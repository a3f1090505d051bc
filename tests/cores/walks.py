"""RTPS packets, and what the bench of the walker writes about them: a model on top of the reference's parser."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterable, Iterator

from fusesoc_firm.fabric.rtps import Kind, Parameter
from tests.fabric.messages import (
    AckNack,
    Data,
    DataFrag,
    Gap,
    Heartbeat,
    HeartbeatFrag,
    InfoDestination,
    NackFrag,
    Numbers,
    Other,
    Submessage,
    parse,
)
from tests.fabric.test_messages import random_packets

# The record of firm_rtps_pkg.
READER, NUMBER, SECOND, FRAGMENT, COUNT, FRAGMENTS, SET_SIZE = 0, 8, 16, 24, 28, 32, 44
DESTINATION, STATUS, SET, KEY_HASH, KIND, SOURCE_MAC, SOURCE = 48, 60, 64, 96, 112, 128, 144
_SENDER = bytes.fromhex("020000000001")
Record = dict[int, int]


def walked(packet: bytes, *, is_aborted: bool = False) -> list[str]:
    """The rows for a packet."""
    message = parse(packet)
    if is_aborted:
        return ["aborted"]
    if message is None:
        return ["foreign"]
    heads = _heads(packet)
    rows, source = [], {**_at(SOURCE_MAC, _SENDER), **_at(SOURCE, message.prefix)}
    for item in message.submessages:
        kind, flags = next(heads)
        assert kind == item.kind
        if not isinstance(item, Other):
            rows.append(_row(item, flags, source))
            source = {}
    return [*rows, "whole" if message.is_whole else "faulty"]


def _heads(packet: bytes) -> Iterator[tuple[int, int]]:
    """Kind and flags of each submessage."""
    place = 20
    while place < len(packet):
        kind, flags = packet[place : place + 2]
        (length,) = struct.unpack_from("<H" if flags & 1 else ">H", packet, place + 2)
        yield kind, flags
        is_open = not length and kind not in (Kind.PAD, Kind.INFO_TIMESTAMP)
        place = len(packet) if is_open else place + 4 + length


def _row(item: Submessage, flags: int, source: Record) -> str:
    record = sorted({**source, **_at(KIND, bytes([item.kind, flags])), **_record(item)}.items())
    key = _first(item, Parameter.KEY_HASH, 16)
    status = _first(item, Parameter.STATUS_INFO, 4)
    payload = getattr(item, "payload", None) or b""
    numbers = [item.kind, flags, int(key is not None), int(status is not None), len(record)]
    return " ".join(map(str, ["submessage", *numbers, *(n for pair in record for n in pair), len(payload), *payload]))


def _first(item: Submessage, number: int, size: int) -> bytes | None:
    inline = getattr(item, "inline", ())
    return next((value[:size] for found, value in inline if found == number and len(value) >= size), None)


def _at(address: int, value: bytes) -> Record:
    return dict(enumerate(value, address))


def _little(address: int, *numbers: tuple[int, int]) -> Record:
    """Numbers with their sizes, one after the other."""
    return _at(address, b"".join((value & (1 << 8 * size) - 1).to_bytes(size, "little") for value, size in numbers))


def _set(numbers: Numbers) -> Record:
    """The words of the set, without the bits that the walker does not look at."""
    size = 4 * -(-numbers.size // 32)
    bits = numbers.bits << (8 * size - numbers.size)
    return {**_little(SET_SIZE, (numbers.size, 4)), **_at(SET, bits.to_bytes(size, "big"))}


def _record(item: Submessage) -> Record:
    if isinstance(item, InfoDestination):
        return _at(DESTINATION, item.prefix)
    assert not isinstance(item, Other)
    return {**_at(READER, item.reader + item.writer), **_numbers(item), **_inline(item)}


def _inline(item: Submessage) -> Record:
    found = ((STATUS, _first(item, Parameter.STATUS_INFO, 4)), (KEY_HASH, _first(item, Parameter.KEY_HASH, 16)))
    return {place: byte for address, value in found if value for place, byte in _at(address, value).items()}


def _numbers(item: Submessage) -> Record:
    match item:
        case Data(number=number):
            return _little(NUMBER, (number, 8))
        case DataFrag():
            sizes = (item.first, 4), (item.count, 2), (item.fragment_bytes, 2), (item.size, 4)
            return {**_little(NUMBER, (item.number, 8)), **_little(FRAGMENTS, *sizes)}
        case Heartbeat():
            return {**_little(NUMBER, (item.first, 8), (item.last, 8)), **_little(COUNT, (item.count, 4))}
        case AckNack():
            base = _little(NUMBER, (item.missing.base, 8))
            return {**base, **_set(item.missing), **_little(COUNT, (item.count, 4))}
        case Gap():
            return {**_little(NUMBER, (item.start, 8), (item.others.base, 8)), **_set(item.others)}
        case HeartbeatFrag():
            return {**_little(NUMBER, (item.number, 8)), **_little(FRAGMENT, (item.last, 4), (item.count, 4))}
        case NackFrag():
            numbers = _little(NUMBER, (item.number, 8)), _little(FRAGMENT, (item.missing.base, 4), (item.count, 4))
            return {**numbers[0], **numbers[1], **_set(item.missing)}
    raise AssertionError(item)


def masked(row: str) -> str:
    """A row of the bench without the bits of a set after its size."""
    kind, *numbers = row.split()
    if kind != "submessage":
        return row
    head, count = list(map(int, numbers[:5])), int(numbers[4])
    record = dict(zip(map(int, numbers[5 : 5 + 2 * count : 2]), map(int, numbers[6 : 5 + 2 * count : 2]), strict=True))
    size = sum(record.get(SET_SIZE + place, 0) << 8 * place for place in range(4))
    for place in range(32):
        if SET + place in record:
            unused = min(8, max(0, 8 * (place + 1) - size))
            record[SET + place] = record[SET + place] >> unused << unused
    pairs = [number for pair in sorted(record.items()) for number in pair]
    return " ".join(map(str, [kind, *head, *pairs, *numbers[5 + 2 * count :]]))


def mixed_packets(count: int, seed: int) -> list[bytes]:
    """Packets of which half are damaged, cut, or without the last length; some have lists of odd parameters."""
    chance = random.Random(seed)
    return [_changed(packet, chance) for packet, _, _ in random_packets(count, seed)] + list(_edges())


def _changed(packet: bytes, chance: random.Random) -> bytes:
    way = chance.randrange(8)
    if way == 0:
        return packet[: chance.randrange(1, len(packet) + 1)]
    if way < 4:
        damaged = bytearray(packet)
        for _ in range(chance.randrange(1, 4)):
            damaged[chance.randrange(len(damaged))] = chance.choice([0, 1, 16, 255, chance.randrange(256)])
        return bytes(damaged)
    if way == 4:
        heads = list(_places(packet))
        place = chance.choice(heads)
        return packet[: place + 2] + b"\0\0" + packet[place + 4 :]
    return packet


def _places(packet: bytes) -> Iterable[int]:
    place = 20
    for _, flags in list(_heads(packet)):
        yield place
        place += 4 + struct.unpack_from("<H" if flags & 1 else ">H", packet, place + 2)[0]


def _edges() -> Iterator[bytes]:
    """Inline parameters of any length, in any order and more than once; sets of all sizes; empty submessages."""
    header = b"RTPS\2\2\0\0" + bytes(range(1, 13))
    ends = b"readwrit" + bytes(8)
    lists = [
        [(Parameter.KEY_HASH, bytes(range(15))), (Parameter.KEY_HASH, bytes(range(20))), (0x70, bytes(16))],
        [(Parameter.STATUS_INFO, b"\0\0\1"), (0, b""), (Parameter.STATUS_INFO, b"\0\0\0\3\4"), (0x71, b"\0\0\0\1")],
        [(0x7000, bytes(range(40))), (0x0100, b""), (0x0170, bytes(16))],
    ]
    for order, flag in (("<", 1), (">", 0)):
        for items in lists:
            text = b"".join(struct.pack(order + "HH", number, len(value)) + value for number, value in items)
            text += struct.pack(order + "HH", Parameter.SENTINEL, 7)
            for more in (b"", b"payload"):
                for further in (0, 1, 5):
                    body = struct.pack(order + "HH", 9, 16 + further) + ends + bytes(further) + text + more
                    yield header + struct.pack(order + "BBH", Kind.DATA, flag | 6, len(body)) + body
                    yield header + struct.pack(order + "BBH", Kind.DATA, flag | 2, len(body)) + body
        for size in (*range(0, 258, 5), 255, 256, 257, 1 << 16, 1 << 31):
            words = (min(size, 257) + 31) // 32
            tail = struct.pack(order + "I", size) + b"\xa5\x5a\xf0\x0f" * words
            for kind, more in ((Kind.ACKNACK, b"coun"), (Kind.GAP, b""), (Kind.NACK_FRAG, b"coun")):
                middle = b"frag" if kind == Kind.NACK_FRAG else b"12345678" if kind == Kind.GAP else b""
                body = ends + middle + tail + more
                yield header + struct.pack(order + "BBH", kind, flag, len(body)) + body
        for any_kind in range(0x18):
            yield header + struct.pack(order + "BBH", any_kind, flag, 0)
            yield header + struct.pack(order + "BBH", any_kind, flag, 1) + b"x"
            yield header + struct.pack(order + "BBH", any_kind, flag, 3) + b"xy"
            yield header + struct.pack(order + "BBHBBH", any_kind, flag, 0, Kind.INFO_DESTINATION, flag, 12) + bytes(12)
    yield from (header[:size] for size in range(1, 24))
    yield b"RTPX" + header[4:]
    yield b"RTPS\1" + header[5:]
