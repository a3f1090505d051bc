"""Ethernet frames from and to the line of a GMII, against zlib's CRC-32, a model of the receiver, and tshark."""

from __future__ import annotations

import random
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cores.ethernet import (
    GAP_BYTES,
    LONGEST,
    PREAMBLE,
    Burst,
    Verdict,
    fcs,
    on_line,
    random_bursts,
    read_bursts,
    udp_frame,
    verdict,
    write_capture,
)
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(20261124)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac")
PARTS = ("firm_mac_receiver", "firm_mac_store", "firm_mac_transmitter")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("mac"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/mac", fileset="tb")])
    return library


# --- receiving -----------------------------------------------------------------------------------------------------


def _received(
    library: Library, folder: Path, bursts: list[Burst], **generics: Generic
) -> tuple[list[str], list[bytes], int]:
    """The rows of the receiver, the frames of the store, and the number of those that are lost there."""
    (folder / "line.txt").write_text("".join(burst.row() for burst in bursts), encoding="ascii")
    result = library.run("firm_mac_receiver_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    received, stored = (
        (folder / name).read_text(encoding="ascii").splitlines() for name in ("received.txt", "stored.txt")
    )
    frames = [bytes(map(int, row.split()[1:])) for row in stored if row != "lost"]
    return received, frames, stored.count("lost")


def _frame_row(frame: bytes, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (int(is_aborted), len(frame), *frame)))


def _rows_of(judged: Verdict) -> list[str]:
    """What the receiver says of a burst."""
    frame = _frame_row(judged.frame, is_aborted=judged.pulse != "good")
    return [judged.pulse, *([frame] if judged.frame else [])]


@pytest.mark.parametrize(("slow", "stall"), [(0, 0), pytest.param(60, 0, marks=pytest.mark.check), (0, 40)])
def test_every_burst_is_judged_and_only_good_frames_leave_the_store(
    library: Library, tmp_path: Path, slow: int, stall: int
) -> None:
    longest, seed = 150, SEED + slow + stall
    print(f"seed {seed}")
    bursts = list(random_bursts(400, longest, seed))
    verdicts = [verdict(burst, longest) for burst in bursts]
    assert {item.pulse for item in verdicts} == {"good", "broken", "long"}
    received, stored, _ = _received(
        library, tmp_path, bursts, LONGEST=longest, SLOW_PERCENT=slow, STALL_PERCENT=stall, SEED=seed, DEPTH=8192
    )
    assert received == [row for item in verdicts for row in _rows_of(item)]
    assert stored == [item.frame for item in verdicts if item.pulse == "good"]


def test_the_longest_frame_of_ethernet_is_received_and_a_longer_one_is_not(library: Library, tmp_path: Path) -> None:
    frames = [random.Random(SEED).randbytes(size) for size in (LONGEST, LONGEST + 1, LONGEST)]
    received, stored, _ = _received(library, tmp_path, [Burst(on_line(frame)) for frame in frames], STALL_PERCENT=20)
    assert stored == [frames[0], frames[2]]
    assert _frame_row(frames[1][:LONGEST], is_aborted=True) in received


def test_a_frame_of_fewer_than_64_bytes_is_broken(library: Library, tmp_path: Path) -> None:
    frames = [bytes(size) for size in (59, 60, 0, 1, 61)]
    received, stored, _ = _received(library, tmp_path, [Burst(PREAMBLE + frame + fcs(frame)) for frame in frames])
    assert stored == [frames[1], frames[4]]
    assert received.count("broken") == 3


def test_a_frame_without_room_is_lost_whole_and_told(library: Library, tmp_path: Path) -> None:
    bursts = [burst for burst in random_bursts(300, 200, SEED) if verdict(burst, 200).pulse != "long"]
    _, stored, lost = _received(library, tmp_path, bursts, LONGEST=200, DEPTH=256, STALL_PERCENT=70)
    good = [judged.frame for judged in (verdict(burst, 200) for burst in bursts) if judged.pulse == "good"]
    assert len(good) == len(stored) + lost
    assert 10 < lost < len(good) - 10
    assert _is_part(stored, good)


def _is_part(some: list[bytes], whole: list[bytes]) -> bool:
    """Whether `whole` without some of its items is `some`."""
    left = iter(whole)
    return all(item in left for item in some)


def test_a_reset_in_a_frame_hides_it(library: Library, tmp_path: Path) -> None:
    """The line is busy when the reset of the bench ends, so the rest of that burst is not a frame."""
    received, _, _ = _received(library, tmp_path, [Burst(on_line(b"a"), idle=0), Burst(on_line(b"b"))])
    assert received == _rows_of(verdict(Burst(on_line(b"b"))))


# --- sending -------------------------------------------------------------------------------------------------------


def _row(frame: bytes, before: int = 0, *, is_aborted: bool = False, pause: int = -1) -> str:
    return " ".join(map(str, (before, int(is_aborted), pause, len(frame), *frame))) + "\n"


def _sent(library: Library, folder: Path, rows: list[str], **generics: Generic) -> tuple[list[Burst], str]:
    (folder / "frames.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_mac_transmitter_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    counts, last = result.output.splitlines()[-2:]
    assert last == "PASS"
    return read_bursts(folder / "sent.txt"), counts


@pytest.mark.parametrize("slow", [0, 60])
def test_frames_are_sent_as_zlib_and_the_standard_say(library: Library, tmp_path: Path, slow: int) -> None:
    random_ = random.Random(SEED + slow)
    sizes = [1, 14, 59, 60, 61, LONGEST, *(random_.randrange(1, 300) for _ in range(60))]
    frames = [random_.randbytes(size) for size in sizes]
    rows = [_row(frame, random_.choice([0, 0, 20])) for frame in frames]
    bursts, counts = _sent(library, tmp_path, rows, SLOW_PERCENT=slow, SEED=SEED)
    assert [(burst.data, burst.fault) for burst in bursts] == [(on_line(frame), -1) for frame in frames]
    assert min(burst.idle for burst in bursts[1:]) == GAP_BYTES
    assert counts == f"sent {len(frames)} spoiled 0"


def test_a_frame_that_cannot_be_sent_whole_is_spoiled_and_no_other(library: Library, tmp_path: Path) -> None:
    """Aborted, with a pause of the source, or too long; a receiver drops each, and takes those between."""
    random_ = random.Random(SEED)
    longest = 100
    rows, wanted = [], []
    for number in range(120):
        frame = random_.randbytes(random_.randrange(2, longest + 1))
        match number % 4:
            case 0:
                rows.append(_row(frame, is_aborted=True))
            case 1:
                rows.append(_row(frame, pause=random_.randrange(1, len(frame))))
            case 2:
                rows.append(_row(random_.randbytes(longest + random_.randrange(1, 200))))
            case 3:
                rows.append(_row(frame))
                wanted.append(on_line(frame))
    bursts, counts = _sent(library, tmp_path, rows, LONGEST=longest)
    assert counts == "sent 30 spoiled 90"
    assert [burst.data for burst in bursts if burst.fault < 0] == wanted
    for burst in bursts:
        assert verdict(burst, longest).pulse == ("broken" if burst.fault >= 0 else "good")
        # A receiver without the PHY's error signal sees the FCS.
        assert verdict(Burst(burst.data), longest).pulse == ("broken" if burst.fault >= 0 else "good")
        assert burst.data.startswith(PREAMBLE)
        assert len(burst.data) <= len(PREAMBLE) + longest + 4


def test_what_is_sent_is_received(library: Library, tmp_path: Path) -> None:
    random_ = random.Random(SEED)
    frames = [random_.randbytes(random_.randrange(60, 400)) for _ in range(40)]
    bursts, _ = _sent(library, tmp_path, [_row(frame, 20) for frame in frames])
    assert _received(library, tmp_path, bursts)[1] == frames


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_takes_what_is_sent(library: Library, tmp_path: Path) -> None:
    frames = [udp_frame(bytes(range(size))) for size in (1, 17, 18, 19, 100, 255)]
    broken = udp_frame(b"aborted")
    bursts, _ = _sent(library, tmp_path, [*map(_row, frames), _row(broken, is_aborted=True)])
    write_capture(tmp_path / "sent.pcap", [burst.data.removeprefix(PREAMBLE) for burst in bursts])
    fields = ("eth.fcs.status", "ip.checksum.status", "udp.length", "frame.len")
    options = ["-o", "eth.check_fcs:TRUE", "-o", "ip.check_checksum:TRUE", "-T", "fields"]
    command = ["tshark", "-r", "sent.pcap", *options, *(word for name in fields for word in ("-e", name))]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # 1 is right, 0 is wrong.
    right = [f"1\t1\t{len(frame) - 34}\t{max(60, len(frame)) + 4}" for frame in frames]
    assert done.stdout.splitlines() == [*right, f"0\t1\t{len(broken) - 34}\t64"]


# --- hardware ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entity", "generic", "value"), [("firm_mac_receiver", "LONGEST", 150), ("firm_mac_store", "DEPTH", 1024)]
)
def test_the_netlist_of_a_receiving_part_does_the_same(tmp_path: Path, entity: str, generic: str, value: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(entity, {generic: value})
    library.analyse(core_files("net/mac", fileset="tb"))
    bursts = list(random_bursts(100, 150, SEED))
    verdicts = [verdict(burst, 150) for burst in bursts]
    received, stored, _ = _received(library, tmp_path, bursts, LONGEST=150, DEPTH=1024, SLOW_PERCENT=20)
    assert received == [row for item in verdicts for row in _rows_of(item)]
    assert stored == [item.frame for item in verdicts if item.pulse == "good"]


def test_the_netlist_of_the_transmitter_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_mac_transmitter", {"LONGEST": 150})
    library.analyse(core_files("net/mac", fileset="tb"))
    frames = [random.Random(SEED).randbytes(size) for size in (1, 60, 61, 150)]
    rows = [*map(_row, frames), _row(bytes(20), pause=5), _row(bytes(151)), _row(bytes(3))]
    bursts, counts = _sent(library, tmp_path, rows, LONGEST=150)
    assert [burst.data for burst in bursts if burst.fault < 0] == [*map(on_line, frames), on_line(bytes(3))]
    assert counts == "sent 5 spoiled 2"


@pytest.mark.parametrize("part", PARTS)
def test_no_part_has_a_latch(library: Library, part: str) -> None:
    assert library.latches(part) == []


@pytest.mark.parametrize(
    ("part", "generic", "value", "legal"),
    [
        ("firm_mac_receiver", "LONGEST", 59, "60 to 9000"),
        ("firm_mac_receiver", "LONGEST", 9001, "60 to 9000"),
        ("firm_mac_transmitter", "LONGEST", 59, "60 to 9000"),
        ("firm_mac_store", "DEPTH", 1000, "powers of two, 4 or more"),
        ("firm_mac_store", "DEPTH", 2, "powers of two, 4 or more"),
    ],
)
def test_a_bad_generic_is_reported(library: Library, part: str, generic: str, value: int, legal: str) -> None:
    result = library.run(part, {generic: value})
    assert result.exit_code != 0
    assert f"{part}: {generic} is {value}; legal: {legal}" in result.output


def test_the_model_knows_zlibs_checksum() -> None:
    """The check value of CRC-32 that catalogues list."""
    assert fcs(b"123456789").hex() == "2639f4cb"
