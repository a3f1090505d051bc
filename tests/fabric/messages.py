"""RTPS messages as bytes and as values (OMG DDSI-RTPS 2.5, chapters 8.3 and 9.4).

`parse` defines what the hardware has to find in a packet, whatever its bytes are: a fault ends the message there, and
what came before it counts.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import ClassVar

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Kind, Parameter

MOST_NUMBERS = 256
_HEADER_BYTES = 20
_LOCATOR_BYTES, _LOCATOR_UDP = 24, 1
_LITTLE, _FINAL, _INLINE, _DATA, _KEY, _KEY_OF_FRAGMENT = 1, 2, 2, 4, 8, 4


@dataclass(frozen=True)
class Address:
    """Where packets go: an IPv4 address as text, and a port."""

    host: str
    port: int


@dataclass(frozen=True)
class Numbers:
    """A set of sequence numbers or of fragments: `base`, and `size` bits, the first of which is the highest."""

    base: int
    size: int = 0
    bits: int = 0

    @staticmethod
    def of(numbers: Iterable[int], base: int) -> Numbers:
        """The set of numbers from `base` on; those beyond its reach are left out."""
        chosen = [number - base for number in numbers if 0 <= number - base < MOST_NUMBERS]
        size = max(chosen, default=-1) + 1
        return Numbers(base, size, sum(1 << (size - 1 - offset) for offset in set(chosen)))

    def __iter__(self) -> Iterator[int]:
        return (self.base + offset for offset in range(self.size) if self.bits >> (self.size - 1 - offset) & 1)


@dataclass(frozen=True)
class Data:
    """A sample, or the end of an instance (`status`), of which there may be only the key."""

    reader: bytes
    writer: bytes
    number: int
    payload: bytes | None
    inline: tuple[tuple[int, bytes], ...] = ()
    is_key: bool = False
    kind: ClassVar[Kind] = Kind.DATA

    @property
    def status(self) -> int:
        """The flags of an instance: rtps.DISPOSED, rtps.UNREGISTERED."""
        values = [value for number, value in self.inline if number == Parameter.STATUS_INFO and len(value) >= 4]
        return values[0][3] if values else 0

    @property
    def key(self) -> bytes | None:
        """The key hash among the inline parameters."""
        return next((value for number, value in self.inline if number == Parameter.KEY_HASH and len(value) >= 16), None)


@dataclass(frozen=True)
class DataFrag:
    """`count` fragments of a sample of `size` bytes, from number `first` on; all but the sample's last are as long."""

    reader: bytes
    writer: bytes
    number: int
    first: int
    count: int
    fragment_bytes: int
    size: int
    payload: bytes
    inline: tuple[tuple[int, bytes], ...] = ()
    is_key: bool = False
    kind: ClassVar[Kind] = Kind.DATA_FRAG


@dataclass(frozen=True)
class Heartbeat:
    """The numbers that a writer has."""

    reader: bytes
    writer: bytes
    first: int
    last: int
    count: int
    is_final: bool = False
    kind: ClassVar[Kind] = Kind.HEARTBEAT


@dataclass(frozen=True)
class AckNack:
    """The numbers that a reader lacks; it has all below the set's base."""

    reader: bytes
    writer: bytes
    missing: Numbers
    count: int
    is_final: bool = True
    kind: ClassVar[Kind] = Kind.ACKNACK


@dataclass(frozen=True)
class Gap:
    """Numbers that never come: from `start` up to the set's base, and the set."""

    reader: bytes
    writer: bytes
    start: int
    others: Numbers
    kind: ClassVar[Kind] = Kind.GAP


@dataclass(frozen=True)
class HeartbeatFrag:
    """The fragments of a sample that a writer has sent."""

    reader: bytes
    writer: bytes
    number: int
    last: int
    count: int
    kind: ClassVar[Kind] = Kind.HEARTBEAT_FRAG


@dataclass(frozen=True)
class NackFrag:
    """The fragments of a sample that a reader lacks."""

    reader: bytes
    writer: bytes
    number: int
    missing: Numbers
    count: int
    kind: ClassVar[Kind] = Kind.NACK_FRAG


@dataclass(frozen=True)
class InfoDestination:
    """The participant for which the following submessages are; twelve zeros are all."""

    prefix: bytes
    kind: ClassVar[Kind] = Kind.INFO_DESTINATION


@dataclass(frozen=True)
class Other:
    """A submessage of another kind, which is skipped."""

    kind: int
    body: bytes


Submessage = Data | DataFrag | Heartbeat | AckNack | Gap | HeartbeatFrag | NackFrag | InfoDestination | Other


@dataclass(frozen=True)
class Message:
    """A message of the participant `prefix`; unless `is_whole`, the rest of its packet is faulty."""

    prefix: bytes
    submessages: tuple[Submessage, ...]
    is_whole: bool = True


class SubmessageError(Exception):
    """Bytes that are not a submessage."""


# --- to bytes --------------------------------------------------------------------------------------------------------


class Writer:
    """Writes submessages with either byte order."""

    def __init__(self, *, is_little: bool = True) -> None:
        self._order = "<" if is_little else ">"
        self._flag = _LITTLE if is_little else 0

    def message(self, prefix: bytes, *submessages: Submessage) -> bytes:
        """A packet."""
        return rtps.HEADER + rtps.VENDOR + prefix + b"".join(map(self.submessage, submessages))

    def submessage(self, item: Submessage) -> bytes:
        """A submessage. Its length is always given, except one above 65535 bytes: then it has to be the last."""
        flags, body = self._body(item)
        length = len(body) if len(body) < 1 << 16 else 0
        return self._pack("BBH", item.kind, flags | self._flag, length) + body

    def _pack(self, form: str, *values: int) -> bytes:
        return struct.pack(self._order + form, *values)

    def _number(self, number: int) -> bytes:
        return self._pack("iI", number >> 32, number & 0xFFFFFFFF)

    def _set(self, numbers: Numbers) -> bytes:
        words = -(-numbers.size // 32)
        bits = (numbers.bits << (32 * words - numbers.size)).to_bytes(4 * words, "big")
        return self._pack(f"I{words}I", numbers.size, *struct.unpack(f">{words}I", bits))

    def _inline(self, inline: tuple[tuple[int, bytes], ...]) -> bytes:
        if not inline:
            return b""
        texts = [self._pack("HH", number, len(value)) + value for number, value in (*inline, (Parameter.SENTINEL, b""))]
        return b"".join(texts)

    def _body(self, item: Submessage) -> tuple[int, bytes]:
        match item:
            case InfoDestination(prefix):
                return 0, prefix
            case Other(_, body):
                return 0, body
            case Data():
                return self._data(item)
            case DataFrag():
                return self._data_frag(item)
        ends = item.reader + item.writer
        match item:
            case Heartbeat(_, _, first, last, count, is_final):
                numbers = self._number(first) + self._number(last)
                return _FINAL * is_final, ends + numbers + self._pack("I", count)
            case AckNack(_, _, missing, count, is_final):
                numbers = self._number(missing.base) + self._set(missing)
                return _FINAL * is_final, ends + numbers + self._pack("I", count)
            case Gap(_, _, start, others):
                return 0, ends + self._number(start) + self._number(others.base) + self._set(others)
            case HeartbeatFrag(_, _, number, last, count):
                return 0, ends + self._number(number) + self._pack("II", last, count)
            case NackFrag(_, _, number, missing, count):
                fragments = self._pack("I", missing.base) + self._set(missing)
                return 0, ends + self._number(number) + fragments + self._pack("I", count)

    def _data(self, item: Data) -> tuple[int, bytes]:
        flags = _INLINE * bool(item.inline)
        if item.payload is not None:
            flags |= _KEY if item.is_key else _DATA
        head = self._pack("HH", 0, 16) + item.reader + item.writer + self._number(item.number)
        return flags, head + self._inline(item.inline) + (item.payload or b"")

    def _data_frag(self, item: DataFrag) -> tuple[int, bytes]:
        flags = _INLINE * bool(item.inline) | _KEY_OF_FRAGMENT * item.is_key
        head = self._pack("HH", 0, 28) + item.reader + item.writer + self._number(item.number)
        numbers = self._pack("IHHI", item.first, item.count, item.fragment_bytes, item.size)
        return flags, head + numbers + self._inline(item.inline) + item.payload


# --- from bytes ------------------------------------------------------------------------------------------------------


def parse(packet: bytes) -> Message | None:
    """The message in a packet, or None if it has no header of RTPS 2."""
    if len(packet) < _HEADER_BYTES or packet[:5] != rtps.HEADER[:5]:
        return None
    found = tuple(_submessages(packet[_HEADER_BYTES:]))
    is_whole = None not in found
    return Message(packet[8:_HEADER_BYTES], tuple(item for item in found if item is not None), is_whole)


def _submessages(rest: bytes) -> Iterator[Submessage | None]:
    """The submessages; None stands for a fault and is the last."""
    try:
        while rest:
            head = _Reader(rest[1] if len(rest) > 1 else 0, rest)
            kind, flags, length, rest = head.header()
            yield _Reader(flags, rest[:length]).submessage(kind)
            rest = rest[length:]
    except SubmessageError:
        yield None


def _order(flags: int) -> str:
    return "<" if flags & _LITTLE else ">"


class _Reader:
    """Reads the body of a submessage from its start."""

    def __init__(self, flags: int, body: bytes) -> None:
        self._flags, self._rest, self._order = flags, body, _order(flags)

    def header(self) -> tuple[int, int, int, bytes]:
        """Kind, flags, length, and the rest of the packet, from the header of a submessage."""
        kind, flags, length = self._unpack("BBH")
        if not length and kind not in (Kind.PAD, Kind.INFO_TIMESTAMP):
            length = len(self._rest)
        if length > len(self._rest):
            raise SubmessageError
        return kind, flags, length, self._rest

    def submessage(self, kind: int) -> Submessage:
        readers: dict[int, Callable[[], Submessage]] = {
            Kind.DATA: self._data,
            Kind.DATA_FRAG: self._data_frag,
            Kind.HEARTBEAT: lambda: Heartbeat(*self._ends(), self._sn(), self._sn(), self._word(), self._has(_FINAL)),
            Kind.ACKNACK: lambda: AckNack(*self._ends(), self._set(self._sn()), self._word(), self._has(_FINAL)),
            Kind.GAP: lambda: Gap(*self._ends(), self._sn(), self._set(self._sn())),
            Kind.HEARTBEAT_FRAG: lambda: HeartbeatFrag(*self._ends(), self._sn(), self._word(), self._word()),
            Kind.NACK_FRAG: lambda: NackFrag(*self._ends(), self._sn(), self._set(self._word()), self._word()),
            Kind.INFO_DESTINATION: lambda: InfoDestination(self._take(12)),
        }
        return readers[kind]() if kind in readers else Other(kind, self._rest)

    def _has(self, flag: int) -> bool:
        return bool(self._flags & flag)

    def _take(self, size: int) -> bytes:
        if size > len(self._rest):
            raise SubmessageError
        taken, self._rest = self._rest[:size], self._rest[size:]
        return taken

    def _unpack(self, form: str) -> tuple[int, ...]:
        return struct.unpack(self._order + form, self._take(struct.calcsize(self._order + form)))

    def _word(self) -> int:
        return self._unpack("I")[0]

    def _sn(self) -> int:
        high, low = self._unpack("iI")
        return high << 32 | low

    def _ends(self) -> tuple[bytes, bytes]:
        return self._take(4), self._take(4)

    def _set(self, base: int) -> Numbers:
        size = self._word()
        if size > MOST_NUMBERS:
            raise SubmessageError
        words = self._unpack(f"{-(-size // 32)}I")
        bits = 0
        for word in words:
            bits = bits << 32 | word
        return Numbers(base, size, bits >> (32 * len(words) - size))

    def _inline(self, before: int) -> tuple[tuple[int, bytes], ...]:
        """The inline parameters, which begin after the field that says where, `before` bytes from here."""
        self._take(before)
        found = []
        if self._has(_INLINE):
            while (item := self.parameter())[0] != Parameter.SENTINEL:
                found.append(item)
        return tuple(found)

    def parameter(self) -> tuple[int, bytes]:
        """The next parameter."""
        number, length = self._unpack("HH")
        return number, b"" if number == Parameter.SENTINEL else self._take(length)

    def _offset(self, least: int) -> int:
        _, offset = self._unpack("HH")
        if offset < least:
            raise SubmessageError
        return offset - least

    def _data(self) -> Data:
        further = self._offset(16)
        reader, writer, number = *self._ends(), self._sn()
        inline = self._inline(further)
        is_key = self._has(_KEY)
        if is_key and self._has(_DATA):
            raise SubmessageError
        payload = self._rest if is_key or self._has(_DATA) else None
        return Data(reader, writer, number, payload, inline, is_key)

    def _data_frag(self) -> DataFrag:
        further = self._offset(28)
        reader, writer, number = *self._ends(), self._sn()
        first, count, fragment_bytes, size = self._unpack("IHHI")
        inline = self._inline(further)
        is_key = self._has(_KEY_OF_FRAGMENT)
        return DataFrag(reader, writer, number, first, count, fragment_bytes, size, self._rest, inline, is_key)


@dataclass(frozen=True)
class ParameterList:
    """The parameters of a payload; of several with one id, the first is read, except of locators."""

    order: str
    items: tuple[tuple[int, bytes], ...]

    @staticmethod
    def of(payload: bytes) -> ParameterList:
        """The parameters up to the first fault; none if the payload is not a list."""
        if payload[:1] != b"\0" or payload[1:2] not in (b"\2", b"\3"):
            return ParameterList("<", ())
        reader = _Reader(payload[1] & 1, payload[4:])
        found: list[tuple[int, bytes]] = []
        with suppress(SubmessageError):
            while (item := reader.parameter())[0] != Parameter.SENTINEL:
                found.append(item)
        return ParameterList(_order(payload[1] & 1), tuple(found))

    def all(self, number: int) -> list[bytes]:
        """The values of a parameter."""
        return [value for found, value in self.items if found == number]

    def integers(self, number: int, form: str) -> tuple[int, ...] | None:
        """The integers at the start of a parameter's value, or None if it is missing or too short."""
        values = self.all(number)
        if not values or len(values[0]) < struct.calcsize(self.order + form):
            return None
        return struct.unpack_from(self.order + form, values[0])

    def octets(self, number: int) -> bytes:
        """The bytes of a string, without its NUL, or of a sequence; empty if it is missing or its length is wrong."""
        length = self.integers(number, "I")
        value = self.all(number)[0][4:] if length else b""
        return value[: length[0]].rstrip(b"\0") if length and length[0] <= len(value) else b""

    def string(self, number: int) -> str:
        """A string; empty if it is missing, its length is wrong, or it does not end with its only NUL."""
        length = self.integers(number, "I")
        value = self.all(number)[0][4 : 4 + length[0]] if length else b""
        is_string = value[-1:] == b"\0" and value.count(0) == 1 and length == (len(value),)
        return value[:-1].decode(errors="replace") if is_string else ""

    def address(self, number: int) -> Address | None:
        """The first locator for UDP over IPv4."""
        for value in self.all(number):
            if len(value) == _LOCATOR_BYTES:
                kind, port = struct.unpack_from(self.order + "iI", value)
                if kind == _LOCATOR_UDP and port < 1 << 16:
                    return Address(str(IPv4Address(value[20:])), port)
        return None
