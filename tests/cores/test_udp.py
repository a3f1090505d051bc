"""UDP datagrams from frames, against a model."""

from __future__ import annotations

import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from tests.cores.datagrams import GROUP, GROUP_MAC, PORTS, Packet, judged, random_frames
from tests.cores.ethernet import fcs, is_set, write_capture
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261126)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/udp")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("udp"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/udp", fileset="tb")])
    return library


def _row(frame: bytes, before: int = 0, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (before, int(is_aborted), len(frame), *frame))) + "\n"


def _results(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[str]:
    (folder / "frames.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_udp_receiver_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    return (folder / "datagrams.txt").read_text(encoding="ascii").splitlines()


@pytest.mark.parametrize("slow", [0, pytest.param(50, marks=pytest.mark.check)])
def test_datagrams_for_this_host_arrive_and_nothing_else(library: Library, tmp_path: Path, slow: int) -> None:
    seed = SEED + slow
    print(f"seed {seed}")
    # The longest datagram comes last, with the longest frame around it.
    frames = [*random_frames(700, seed), Packet(bytes(1472)).frame()]
    wanted = [row for frame in frames for row in judged(frame)]
    kinds = Counter(row.split()[0] for row in wanted)
    assert min(kinds[name] for name in ("datagram", "aborted", "broken", "fragment")) > 10
    assert _results(library, tmp_path, list(map(_row, frames)), SLOW_PERCENT=slow, SEED=seed) == wanted


def test_an_aborted_frame_aborts_its_datagram_and_is_not_told(library: Library, tmp_path: Path) -> None:
    """Frames are aborted at all their bytes; the next one is not disturbed."""
    frame = Packet(bytes(range(40))).frame()
    cut = [frame[:size] for size in range(1, len(frame) + 1)]
    rows = [row for part in cut for row in (_row(part, is_aborted=True), _row(frame))]
    wanted = [row for part in cut for row in (*judged(part, is_aborted=True), *judged(frame))]
    assert _results(library, tmp_path, rows) == wanted


def test_each_wrong_bit_of_headers_is_noticed(library: Library, tmp_path: Path) -> None:
    """Whatever bit of IPv4 or UDP is wrong, no wrong payload is passed on as good."""
    frame = Packet(b"good payload", mac=GROUP_MAC, address=GROUP).frame()
    frames = []
    for bit in range(14 * 8, (14 + 28 + 12) * 8):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        frames.append(bytes(damaged))
    rows = _results(library, tmp_path, list(map(_row, frames)))
    assert rows == [row for damaged in frames for row in judged(damaged)]
    assert not any(row.startswith("datagram") for row in rows)


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_udp_receiver", {"PORTS": 3})
    library.analyse(core_files("net/udp", fileset="tb"))
    frames = random_frames(150, SEED)
    assert _results(library, tmp_path, list(map(_row, frames))) == [row for frame in frames for row in judged(frame)]


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_udp_receiver") == []


def test_it_has_no_combinational_loop(tmp_path: Path) -> None:
    assert loops("firm_udp_receiver", tmp_path, core_files("net/udp"), core_files("axis/package")) == []


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_agrees_with_the_model(tmp_path: Path) -> None:
    """On checksums, fragments and payloads."""
    frames = [frame for frame in random_frames(700, SEED) if len(frame) > 41]
    write_capture(tmp_path / "frames.pcap", [frame + fcs(frame) for frame in frames])
    names = ("ip.checksum.status", "udp.checksum.status", "udp.port", "ip.flags.mf", "ip.frag_offset", "udp.payload")
    options = ["-o", "ip.check_checksum:TRUE", "-o", "udp.check_checksum:TRUE", "-o", "ip.defragment:FALSE"]
    fields = [word for name in names for word in ("-e", name)]
    command = ["tshark", "-r", "frames.pcap", *options, "-T", "fields", *fields]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    agreed = 0
    for frame, line in zip(frames, done.stdout.splitlines(), strict=True):
        header, udp, ports, more, offset, payload = line.split("\t")
        for row in judged(frame):
            kind, *numbers = row.split()
            if kind == "datagram":
                # 1 is right; 3 is a datagram without a checksum.
                assert (header, udp in "13", is_set(more), offset) == ("1", True, False, "0")
                # It shows what follows the datagram in its packet as well.
                assert bytes.fromhex(payload).startswith(bytes(map(int, numbers[14:])))
                assert ports.split(",")[1] in map(str, PORTS)
            elif kind == "fragment":
                assert (header, (is_set(more), offset) != (False, "0")) == ("1", True)
            elif kind == "aborted" and int.from_bytes(frame[16:18]) <= len(frame) - 14:
                # The frame holds its packet, so the checksum is wrong.
                assert udp == "0"
            agreed += 1
    assert agreed > 300


@pytest.mark.parametrize("value", [0, 17])
def test_a_bad_generic_is_reported(library: Library, value: int) -> None:
    result = library.run("firm_udp_receiver", {"PORTS": value})
    assert result.exit_code != 0
    assert f"firm_udp_receiver: PORTS is {value}; legal: 1 to 16" in result.output
