"""RTPS messages: written and read again, cut, damaged, and as tshark reads them."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Kind, Parameter
from tests.cores.ethernet import fcs, udp_frame, write_capture
from tests.fabric.dissection import dissect, fields_of
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
    Writer,
    parse,
)
from tests.seeds import seeded

SEED = seeded(20261126)
LARGEST = 1 << 40


def random_submessages(chance: random.Random) -> list[Submessage]:
    """One to six submessages, with numbers and sets of all sizes."""
    return [chance.choice(MAKERS)(chance) for _ in range(chance.randrange(1, 7))]


def _ends(chance: random.Random) -> tuple[bytes, bytes]:
    return chance.choice([rtps.NO_ENTITY, chance.randbytes(4)]), chance.randbytes(4)


def _number(chance: random.Random) -> int:
    return chance.choice([1, 2, 0x7FFFFFFF, 0xFFFFFFFF, 0x100000000, chance.randrange(1, LARGEST)])


def _word(chance: random.Random) -> int:
    return chance.choice([1, 0xFFFFFFFF, chance.randrange(1, 1 << 32)])


def _set(chance: random.Random, base: int) -> Numbers:
    reach = chance.choice([1, 5, 32, 33, 64, 256])
    return Numbers.of((base + offset for offset in range(reach) if chance.random() < 0.3), base)


def _inline(chance: random.Random) -> tuple[tuple[int, bytes], ...]:
    status = (Parameter.STATUS_INFO, bytes([0, 0, 0, chance.randrange(4)]))
    key = (Parameter.KEY_HASH, chance.randbytes(16))
    return chance.choice([(), (), (status,), (key, status)])


def _payload(chance: random.Random) -> bytes:
    return rtps.XCDR1 + chance.randbytes(4 * chance.randrange(1, 20))


def _data(chance: random.Random) -> Data:
    payload = chance.choice([None, _payload(chance), _payload(chance)])
    is_key = payload is not None and chance.random() < 0.2
    return Data(*_ends(chance), _number(chance), payload, _inline(chance), is_key)


def _fragments(chance: random.Random) -> DataFrag:
    payload = chance.randbytes(4 * chance.randrange(1, 50))
    # Fragment 1 would be dissected as the start of a sample.
    return DataFrag(*_ends(chance), _number(chance), chance.randrange(2, 99), 1, len(payload), 1 << 20, payload)


def _gap(chance: random.Random) -> Gap:
    return Gap(*_ends(chance), _number(chance), _set(chance, _number(chance)))


MAKERS: list[Callable[[random.Random], Submessage]] = [
    _data,
    _data,
    _fragments,
    lambda c: Heartbeat(*_ends(c), _number(c), _number(c), _word(c), c.random() < 0.5),
    lambda c: AckNack(*_ends(c), _set(c, _number(c)), _word(c), c.random() < 0.5),
    _gap,
    lambda c: HeartbeatFrag(*_ends(c), _number(c), _word(c), _word(c)),
    lambda c: NackFrag(*_ends(c), _number(c), _set(c, c.randrange(1, 99)), _word(c)),
    lambda c: InfoDestination(c.randbytes(12)),
    lambda c: Other(Kind.INFO_TIMESTAMP, c.randbytes(8)),
]


def random_packets(count: int, seed: int) -> list[tuple[bytes, bytes, list[Submessage]]]:
    """Packets of both byte orders, each with its prefix and its submessages."""
    print(f"seed {seed}")
    chance = random.Random(seed)
    found = []
    for _ in range(count):
        prefix, items = chance.randbytes(12), random_submessages(chance)
        found.append((Writer(is_little=chance.random() < 0.7).message(prefix, *items), prefix, items))
    return found


def test_what_is_written_is_read() -> None:
    for packet, prefix, items in random_packets(500, SEED):
        message = parse(packet)
        assert message is not None and message.is_whole
        assert (message.prefix, list(message.submessages)) == (prefix, items)


def test_what_comes_before_the_cut_counts() -> None:
    for packet, _, items in random_packets(50, SEED + 1):
        for size in range(len(packet)):
            message = parse(packet[:size])
            if message is None:
                assert size < 20
                continue
            kept = list(message.submessages)
            # A packet that ends with a submessage is whole.
            assert kept == items[: len(kept)]
            assert message.is_whole == (size == len(Writer().message(b"", *items[: len(kept)])) + 12)


def test_damaged_packets_are_read_to_some_end() -> None:
    chance = random.Random(SEED + 2)
    faulty = 0
    for packet, _, _ in random_packets(2000, SEED + 2):
        damaged = bytearray(packet)
        for _ in range(chance.randrange(1, 4)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        message = parse(bytes(damaged))
        faulty += message is None or not message.is_whole
    assert 100 < faulty < 1900


def test_the_last_submessage_may_be_without_a_length() -> None:
    packet = Writer().message(bytes(12), Data(b"read", b"writ", 1, bytes(100)))
    assert parse(packet[:22] + b"\0\0" + packet[24:]) == parse(packet)


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_the_same(tmp_path: Path) -> None:
    packets = random_packets(200, SEED + 3)
    capture = tmp_path / "written.pcap"
    frames = [udp_frame(packet) for packet, _, _ in packets]
    write_capture(capture, [frame + fcs(frame) for frame in frames])
    found = list(dissect(capture))
    assert len(found) == len(packets)
    for (packet, _, items), (payload, fields) in zip(packets, found, strict=True):
        assert payload == packet
        assert fields == [fields_of(item) for item in items]
