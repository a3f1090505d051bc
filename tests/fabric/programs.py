"""A model of firm_packet_builder: it runs the programs of packets."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.fabric.packets import Field, Programs
from tests.cores.ethernet import checksum

PORT = 7411
_LAST, _PRELUDE = 1 << 10, 8


@dataclass(frozen=True)
class Target:
    """The addresses of a peer."""

    mac: bytes
    address: bytes


PEER = Target(bytes.fromhex("020000000001"), bytes([192, 0, 2, 1]))


@dataclass(frozen=True)
class Fields:
    """The values of all fields."""

    prefix: bytes
    reader: bytes
    writer: bytes
    count: int
    number: int
    first: int
    last: int
    set: int
    fragment: int
    fragment_set: int
    sample_bytes: int
    second_count: int

    def content(self) -> dict[Field, bytes]:
        """As the hardware holds them: an ACKNACK is final, and a set has 32 numbers."""
        words = {
            Field.COUNT: self.count,
            Field.SET_SIZE: 32,
            Field.SET: self.set,
            Field.FRAGMENT: self.fragment,
            Field.FRAGMENT_SET_SIZE: 32,
            Field.FRAGMENT_SET: self.fragment_set,
            Field.SAMPLE_BYTES: self.sample_bytes,
            Field.SECOND_COUNT: self.second_count,
        }
        numbers = {Field.NUMBER: self.number, Field.FIRST: self.first, Field.LAST: self.last}
        return {
            Field.MAC: PEER.mac,
            Field.FLAGS: b"\3",
            Field.ADDRESS: PEER.address,
            Field.PORT: PORT.to_bytes(2, "big"),
            Field.PREFIX: self.prefix,
            Field.READER: self.reader,
            Field.WRITER: self.writer,
            **{field: word.to_bytes(4, "little") for field, word in words.items()},
            **{
                field: (number >> 32).to_bytes(4, "little") + (number & 0xFFFFFFFF).to_bytes(4, "little")
                for field, number in numbers.items()
            },
        }

    def memory(self) -> bytes:
        """The memory of the fields."""
        content = bytearray(128)
        for field, value in self.content().items():
            assert len(value) == field.size
            content[field.address : field.address + field.size] = value
        return bytes(content)


def random_fields(chance: random.Random) -> Fields:
    words = [chance.randrange(1, 1 << 32) for _ in range(6)]
    numbers = [chance.randrange(1, 1 << 40) for _ in range(3)]
    prefix, reader, writer = chance.randbytes(12), chance.randbytes(4), chance.randbytes(4)
    count, *others = words
    return Fields(prefix, reader, writer, count, *numbers, *others)


def run(programs: Programs, name: str, fields: Fields, payload: bytes = b"", own: bytes = b"") -> bytes:
    """The frame without padding and FCS; an empty payload is one byte there.

    `own` are the bytes of a host with DHCP, whose preludes are longer.
    """
    memory, padded = fields.memory().ljust(128, b"\0") + own, payload + bytes(-len(payload) % 4)
    words, size = list(_words(programs, programs.entries[name])), _PRELUDE + 4 * bool(own)
    prelude = bytes(_constant(word, memory) for word in words[:size])
    total = int.from_bytes(prelude[2:4]) + len(padded)
    header = prelude[:2] + total.to_bytes(2, "big") + prelude[4:]
    results = b"".join(number.to_bytes(2, "big") for number in (total, max(0, total - 20), checksum(header)))
    frame = b""
    for word in words[size:]:
        source = word >> 8 & 3
        frame += (
            (padded or b"\0")
            if source == 2
            else (results + ((word >> 3 & 31) * 4 + len(padded)).to_bytes(2, "little"))[word & 7 :][:1]
            if source == 3
            else bytes([_constant(word, memory)])
        )
    return frame


def _words(programs: Programs, entry: int) -> Iterator[int]:
    for word in programs.words[entry:]:
        yield word
        if word & _LAST:
            return


def _constant(word: int, memory: bytes) -> int:
    return memory[word & 255] if word >> 8 & 3 == 1 else word & 255
