"""Long messages both ways: a simulated board sends the texts of live peers back, in fragments of RTPS."""

from __future__ import annotations

import random
import signal
import string
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.packets import FRAGMENT_BYTES
from tests.fabric.dissection import read_alike
from tests.fabric.hosts import captured
from tests.fabric.live import BESIDES, LONGEST, Lab, exchange, long_board, settled, skip_without_peers
from tests.fabric.messages import DataFrag, InfoDestination, NackFrag
from tests.fabric.test_peers import Peer
from tests.seeds import seeded

SEED = seeded(20261127)
# A payload needs fragments from 1,345 bytes on.
SIZES = (1, 2, 3, 1335, 1336, 1337, 2679, 2680, 5001, 20_000, LONGEST - BESIDES)
# Rounds of which one comes to all.
SETTLING = 20
LOSS = 3  # percent of the frames each way
TYPES = {"text": "String"}
BOARD = rtps.VENDOR + bytes.fromhex("020000000009") + bytes(4)

pytestmark = [pytest.mark.check, pytest.mark.xdist_group("fabric")]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    skip_without_peers("dumpcap", "tshark")
    with ExitStack() as stack:
        yield Lab(long_board(), tmp_path, stack)


def _text(chance: random.Random, size: int) -> str:
    return "".join(chance.choices(string.ascii_letters, k=size))


def _exchange(peers: Sequence[Peer], texts: Sequence[str]) -> None:
    """Each peer sends its text, and all of them get all."""
    exchange(peers, ([(peer, ("text", [text])) for peer, text in zip(peers, texts, strict=True)], _samples(texts)))


def _samples(texts: Sequence[str]) -> list[tuple[str, list[str]]]:
    return [("text", [text]) for text in texts]


def _peers(lab: Lab) -> list[Peer]:
    """A peer of each kind, when the board sends it what the other one says."""
    peers = [lab.rclpy(TYPES, TYPES), lab.cyclone(TYPES, TYPES)]
    for peer in peers:
        print(peer.wait_until_matched())
    for number in range(SETTLING):
        texts = [f"{name}{number}" for name in "ab"]
        sent = [(peer, ("text", [text])) for peer, text in zip(peers, texts, strict=True)]
        if settled(peers, (sent, _samples(texts))):
            return peers
    pytest.fail(f"none of {SETTLING} rounds came to all")


def test_texts_of_all_sizes_come_back_to_both_peers(lab: Lab, tmp_path: Path) -> None:
    """Byte for byte, also while one of them is stopped: it delays nobody else."""
    print(f"seed {SEED}")
    chance, capture = random.Random(SEED), tmp_path / "capture.pcapng"
    lab.board()
    peers = _peers(lab)
    with captured(lab.switch, capture):
        for size in SIZES:
            _exchange(peers, [_text(chance, size) for _ in peers])
        slow, other = peers
        slow.send_signal(signal.SIGSTOP)
        for size in SIZES:
            _exchange([other], [_text(chance, size)])
        slow.send_signal(signal.SIGCONT)
    sent = [message for _, message in read_alike(capture) if message.prefix == BOARD]
    sizes = {item.size for message in sent for item in message.submessages if isinstance(item, DataFrag)}
    # A publisher pads its payloads to multiples of four bytes.
    wanted = {-(-(size + BESIDES) // 4) * 4 for size in SIZES}
    assert sizes == {size for size in wanted if size > FRAGMENT_BYTES}


def test_what_gets_lost_is_sent_again(lab: Lab, tmp_path: Path) -> None:
    """Some fragments of most messages get lost; each peer asks for them alone, and gets them."""
    print(f"seed {SEED}")
    chance, capture = random.Random(SEED), tmp_path / "capture.pcapng"
    with lab.lossy(LOSS, SEED) as lost, captured(lab.switch, capture):
        lab.board()
        peers = _peers(lab)
        for size in (100, 5000, 1400, 20_000, 9000, 40_000):
            _exchange(peers, [_text(chance, size) for _ in peers])
    asked, answered = _requests(capture)
    print(f"{lost} frames lost; {asked} fragments asked for, {answered} of them sent then")
    assert min(lost) > 0
    assert len(asked) == len(answered) == len(peers)


def _requests(capture: Path) -> tuple[Counter[bytes], Counter[bytes]]:
    """Of each peer's reader, the fragments that it asked for, and those that the board sent after that."""
    wanted: set[tuple[bytes, bytes, int, int]] = set()
    asked, answered = Counter[bytes](), Counter[bytes]()
    to = b""
    for _, message in read_alike(capture):
        for item in message.submessages:
            match item:
                case InfoDestination():
                    to = item.prefix
                case NackFrag() if message.prefix != BOARD:
                    fragments = {(message.prefix, item.reader, item.number, place) for place in item.missing}
                    asked[message.prefix] += len(fragments - wanted)
                    wanted |= fragments
                case DataFrag() if message.prefix == BOARD:
                    fragment = to, item.reader, item.number, item.first
                    answered[to] += fragment in wanted
                    wanted.discard(fragment)
    return asked, +answered
