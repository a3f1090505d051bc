"""Long messages of live peers to a simulated board: packets in fragments of IPv4, and samples in fragments of RTPS."""

from __future__ import annotations

import random
import string
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import reduce
from pathlib import Path

import pytest

from tests.fabric.dissection import read_alike
from tests.fabric.hosts import captured
from tests.fabric.live import BESIDES, Lab, long_board, skip_without_peers
from tests.fabric.messages import DataFrag
from tests.fabric.test_peers import Peer
from tests.seeds import seeded

SEED = seeded(20261127)
SIZES = (1, 1335, 1336, 1337, 4000, 5376, 16000 - BESIDES)
# Texts of which one is answered, at one in five seconds at most.
SETTLING = 60
# Without MaxMessageSize, Cyclone DDS puts samples of up to 14,720 bytes into one packet.
CYCLONE = "<CycloneDDS><Domain><General><MaxMessageSize>{size}</MaxMessageSize></General></Domain></CycloneDDS>"

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    skip_without_peers("dumpcap", "tshark")
    with ExitStack() as stack:
        yield Lab(long_board(), tmp_path, stack)


def _digest(text: str) -> int:
    """What digest.vhd computes."""
    return reduce(lambda digest, byte: (31 * digest + byte) & 0xFFFFFFFF, text.encode(), 0)


def _text(chance: random.Random, size: int) -> str:
    return "".join(chance.choices(string.ascii_letters, k=size))


def _answered(peer: Peer, texts: Sequence[str]) -> None:
    """Each text is answered once, and in order."""
    peer.send([("summed", [text]) for text in texts])
    assert peer.take(len(texts)) == [("sum", [_digest(text)]) for text in texts]


def _settle(peer: Peer) -> None:
    """Wait until a text is answered: a peer does not know whether the board has matched its reader."""
    print(peer.wait_until_matched())
    for number in range(SETTLING):
        peer.send([("summed", [str(number)])])
        while sample := peer.next_sample(5):
            if sample == ("sum", [_digest(str(number))]):
                return
    pytest.fail(f"none of {SETTLING} texts is answered")


@pytest.mark.parametrize("size", ["1456B", "14720B"])
def test_cyclone_sends_long_messages_in_fragments_of_rtps(
    lab: Lab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: str
) -> None:
    """With one fragment in a packet, and with up to ten, all of a burst are answered, also those that are repeated."""
    print(f"seed {SEED}")
    monkeypatch.setenv("CYCLONEDDS_URI", CYCLONE.format(size=size))
    chance, capture = random.Random(SEED), tmp_path / "capture.pcapng"
    with captured(lab.switch, capture):
        lab.board()
        peer = lab.cyclone({"sum": "UInt32"}, {"summed": "String"})
        _settle(peer)
        for length in SIZES:
            _answered(peer, [_text(chance, length)])
        _answered(peer, [_text(chance, SIZES[-1]) for _ in range(6)])
    kinds = {type(item) for _, message in read_alike(capture) for item in message.submessages}
    assert DataFrag in kinds


@pytest.mark.parametrize("kind", ["rclpy", "cyclone"])
def test_bursts_of_messages_of_65000_bytes_are_answered(lab: Lab, kind: str) -> None:
    """Between short ones, as one packet of IPv4 each (Fast DDS), or in fragments of RTPS."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    lab.board()
    peer: Peer = getattr(lab, kind)({"sum": "UInt32"}, {"summed": "String"})
    _settle(peer)
    for length in (65000, 30_000, 65280):
        _answered(peer, [_text(chance, size - BESIDES) for size in (length, length, 100, length, 2000, length)])


def test_what_fast_dds_sent_while_the_cable_was_out_is_asked_for(lab: Lab) -> None:
    """It may come in packets of several messages, longer than any of them."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    lab.board()
    peer = lab.rclpy({"sum": "UInt32"}, {"summed": "String"})
    _settle(peer)
    for length in SIZES:
        _answered(peer, [_text(chance, length)])
    texts = [_text(chance, 4000) for _ in range(12)]
    lab.switch.run("ip", "link", "set", "port1", "down")
    peer.send([("summed", [text]) for text in texts[:-1]])
    assert peer.next_sample(2) is None
    lab.switch.run("ip", "link", "set", "port1", "up")
    peer.send([("summed", [texts[-1]])])
    assert peer.take(len(texts)) == [("sum", [_digest(text)]) for text in texts]
