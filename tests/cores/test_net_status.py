"""Requests of the status by UDP: the system gets them, and their senders the answers."""

from __future__ import annotations

import random
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cores.datagrams import MAC, PEER_MAC, Packet
from tests.cores.ethernet import checksum
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
PORT = 7399
HEADERS_BYTES = 14 + 20 + 8
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/status")
# A request is dropped while the one before it is under way.
APART = 200


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("status"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/status", fileset="tb")])
    return library


def _row(frame: bytes, before: int = APART, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (before, int(is_aborted), len(frame), *frame))) + "\n"


def _request(chance: random.Random) -> Packet:
    return Packet(chance.randbytes(8), port=PORT)


def _reply(request: Packet) -> bytes:
    """The reply, built from its fields; the system has inverted the word."""
    frame = request.frame()
    header, (ours, theirs) = frame[14:34], struct.unpack(">2H", frame[34:38])
    header = header[:12] + header[16:20] + header[12:16]
    assert not checksum(header)
    data = request.data[:4] + bytes(255 - byte for byte in request.data[4:])
    return PEER_MAC + MAC + frame[12:14] + header + struct.pack(">4H", theirs, ours, 16, 0) + data


def _replies(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[bytes]:
    (folder / "frames.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_net_status_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "replies.txt").read_text(encoding="ascii").splitlines()
    return [bytes(map(int, line.split()[1:])) for line in lines]


def _other(chance: random.Random) -> Packet:
    """A packet that is nearly a request."""
    changes = (
        {"mac": MAC[:5] + bytes([3])},
        {"sender": bytes([PEER_MAC[0] | 1]) + PEER_MAC[1:]},
        {"address": bytes([192, 0, 2, chance.choice((0, 3, 255))])},
        {"port": PORT ^ 1 << chance.randrange(16)},
        {"kind": b"\x86\xdd"},
        {"version": 6},
        {"options": bytes(4)},
        {"protocol": 6},
        {"fragment": chance.choice((0x2000, 1, 0x3FFF))},
        {"data": bytes(chance.choice((0, 7, 9, 16)))},
    )
    return replace(_request(chance), **chance.choice(changes))


@pytest.mark.parametrize(("slow", "stall"), [(0, 0), (50, 40)])
def test_requests_are_answered_and_nothing_else(library: Library, tmp_path: Path, slow: int, stall: int) -> None:
    seed = SEED + slow
    print(f"seed {seed}")
    chance = random.Random(seed)
    requests = [_request(chance) for _ in range(100)]
    rows = [row for item in requests for row in (_row(_other(chance).frame()), _row(item.frame()))]
    generics: dict[str, Generic] = {"SLOW_PERCENT": slow, "STALL_PERCENT": stall, "SEED": SEED}
    assert _replies(library, tmp_path, rows, **generics) == [_reply(item) for item in requests]


def test_an_aborted_request_is_not_answered(library: Library, tmp_path: Path) -> None:
    request = Packet(bytes(range(8)), port=PORT)
    frame = request.frame()
    aborted = [_row(frame[:size], is_aborted=True) for size in range(1, len(frame) + 1)]
    cut = [_row(frame[:size]) for size in range(1, HEADERS_BYTES + 8)]
    assert _replies(library, tmp_path, [*aborted, *cut, _row(frame)]) == [_reply(request)]


def test_requests_at_once_are_dropped_but_the_first(library: Library, tmp_path: Path) -> None:
    """The senders of the others ask again."""
    requests = [Packet(bytes([number] * 8), port=PORT) for number in range(2)]
    rows = [_row(item.frame(), 6) for _ in range(20) for item in requests]
    replies = _replies(library, tmp_path, rows, STALL_PERCENT=60)
    assert replies[0] == _reply(requests[0])
    assert 2 < len(replies) < len(rows)
    assert {*replies} <= {_reply(item) for item in requests}


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    assert library.latches("firm_net_status") == []
    assert loops("firm_net_status", tmp_path, core_files("net/status")) == []
    library.replace_by_netlist("firm_net_status", {})
    library.analyse(core_files("net/status", fileset="tb"))
    chance = random.Random(SEED)
    requests = [_request(chance) for _ in range(20)]
    rows = [_row(item.frame()) for item in requests]
    assert _replies(library, tmp_path, rows, STALL_PERCENT=30) == [_reply(item) for item in requests]
