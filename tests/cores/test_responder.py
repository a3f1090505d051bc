"""Replies to ARP and ICMP echo requests: against a model, and against the network of this machine's kernel."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cores.requests import (
    BROADCAST,
    arp_reply,
    arp_request,
    echo_reply,
    echo_request,
    random_requests,
    reply,
)
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilator import compiled
from tests.hdl.verilog import loops, netlist
from tests.seeds import seeded

SEED = seeded(20261125)
HERE = Path(__file__).parent
HARDWARE = core_files("axis/package", "axis/axis", "net/mac", "net/package", "net/responder")
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/package", "net/responder")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("responder"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/responder", fileset="tb")])
    return library


def _row(frame: bytes, before: int = 0, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (before, int(is_aborted), len(frame), *frame))) + "\n"


def _replies(library: Library, folder: Path, rows: list[str], **generics: Generic) -> tuple[list[bytes], int]:
    """The replies, and the number of those that were lost."""
    (folder / "frames.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_net_responder_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "replies.txt").read_text(encoding="ascii").splitlines()
    return [bytes(map(int, line.split()[1:])) for line in lines if line != "lost"], lines.count("lost")


def test_the_model_makes_the_replies_of_the_rfcs() -> None:
    """The model changes its request; the expected replies are built from their fields."""
    for data in (b"", b"a", bytes(range(100)), b"\xff" * 33):
        assert (reply(echo_request(data)) or b"").startswith(echo_reply(data))
    assert (reply(arp_request(BROADCAST)) or b"").startswith(arp_reply())


@pytest.mark.parametrize(("slow", "stall"), [(0, 0), (50, 40)])
def test_requests_for_this_host_are_answered_and_nothing_else(
    library: Library, tmp_path: Path, slow: int, stall: int
) -> None:
    seed = SEED + slow
    print(f"seed {seed}")
    frames = random_requests(1000, seed)
    wanted = [answer for answer in map(reply, frames) if answer is not None]
    assert 200 < len(wanted) < 800
    rows = [_row(frame) for frame in frames]
    generics: dict[str, Generic] = {"DEPTH": 32768, "SLOW_PERCENT": slow, "STALL_PERCENT": stall, "SEED": SEED}
    assert _replies(library, tmp_path, rows, **generics) == (wanted, 0)


def test_an_aborted_request_is_not_answered(library: Library, tmp_path: Path) -> None:
    """Frames of all sizes are aborted at all their bytes."""
    request = echo_request(bytes(range(40)))
    rows = [
        row for size in range(1, len(request) + 1) for row in (_row(request[:size], is_aborted=True), _row(request))
    ]
    assert _replies(library, tmp_path, rows, DEPTH=16384) == ([reply(request)] * len(request), 0)


def test_a_reply_without_room_is_lost_and_told(library: Library, tmp_path: Path) -> None:
    frames = [echo_request(bytes([number]) * 100) for number in range(60)]
    replies, lost = _replies(library, tmp_path, [_row(frame) for frame in frames], DEPTH=512, STALL_PERCENT=60)
    assert len(replies) + lost == len(frames)
    assert lost > 10
    left = iter(map(reply, frames))
    assert all(answer in left for answer in replies)


def test_a_frame_for_others_is_not_reported_as_lost(library: Library, tmp_path: Path) -> None:
    other = echo_request(bytes(900)).replace(bytes([192, 0, 2, 2]), bytes([192, 0, 2, 3]), 1)
    assert _replies(library, tmp_path, [_row(other), _row(arp_request())] * 3, DEPTH=512) == (
        [reply(arp_request())] * 3,
        0,
    )


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    """MAC and address are ports, so the netlist serves any host."""
    library = _library(tmp_path)
    library.replace_by_netlist("firm_net_responder", {"DEPTH": 32768})
    library.analyse(core_files("net/responder", fileset="tb"))
    frames = random_requests(300, SEED)
    wanted = [answer for answer in map(reply, frames) if answer is not None]
    assert _replies(library, tmp_path, [_row(frame) for frame in frames], DEPTH=32768) == (wanted, 0)


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_net_responder") == []


def test_a_board_has_no_combinational_loop(tmp_path: Path) -> None:
    assert loops("net_board", tmp_path, [HERE / "net_board.vhd"], HARDWARE) == []


# --- the kernel ----------------------------------------------------------------------------------------------------

# A network namespace of its own, with the right to create a TAP device there.
NAMESPACE = ["unshare", *(["--map-root-user"] if os.geteuid() else []), "--net"]


def _can_make_a_network() -> bool:
    if not all(map(shutil.which, ("unshare", "ip", "verilator"))):
        return False
    made = subprocess.run(
        [*NAMESPACE, "ip", "tuntap", "add", "dev", "tap0", "mode", "tap"], capture_output=True, check=False
    )
    return made.returncode == 0


@pytest.mark.check
@pytest.mark.skipif(not _can_make_a_network(), reason="no network namespaces with TAP devices here, or no Verilator")
def test_the_kernel_finds_the_board_and_its_echoes(tmp_path: Path) -> None:
    verilog = netlist("net_board", tmp_path, [HERE / "net_board.vhd"], HARDWARE).read_text(encoding="utf-8")
    program = compiled(verilog, "net_board", (HERE / "net_board.cpp").read_text(encoding="ascii"), tmp_path, [HERE])
    command = [*NAMESPACE, sys.executable, str(HERE / "net_peer.py"), str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.pop("answered") == found.pop("sent") == 300
    programs = found.pop("programs")
    print(programs)
    assert found == {"neighbour": "02:00:00:00:00:02", "different": 0, "InErrors": 0, "InCsumErrors": 0}
    assert all(code == 0 for code in programs.values())
