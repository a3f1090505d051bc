"""The joiner of bursts that stands for the host's software: frames cut at random and mixed come out whole."""

from __future__ import annotations

import random
from collections import defaultdict
from pathlib import Path

import pytest

from tests.hdl.benches import SIMULATORS, Bench, bench
from tests.hdl.frames import Frame, random_frames, write_expected, write_stimulus
from tests.seeds import seeded

SEED = seeded(20240719)


@pytest.fixture(scope="module", params=SIMULATORS)
def joiner(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    cores = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts")
    return bench(request.param, "firm_sim_join_tb", cores, tmp_path_factory.mktemp("join"))


def bursts_of(frame: Frame, width: int, source: random.Random) -> list[bytes]:
    """A frame as a preempted publisher sends it: cut between beats, and every later burst begins with a beat more."""
    lanes = width // 8
    data = frame.to_bytes()
    beats = [data[start : start + lanes] for start in range(0, len(data), lanes)]
    cuts = sorted({0, *source.sample(range(len(beats)), source.randint(0, min(5, len(beats))))})
    pieces = [b"".join(beats[start:end]) for start, end in zip(cuts, [*cuts[1:], None], strict=True)]
    return [pieces[0], *(bytes([frame.id]) + source.randbytes(lanes - 1) + piece for piece in pieces[1:])]


def mixed(frames: list[Frame], width: int, seed: int) -> tuple[list[bytes], list[tuple[int, bytes]]]:
    """Bursts, those of an id in their order, and the frames as they become whole, with their last bursts' numbers."""
    source = random.Random(seed)
    waiting: dict[int, list[tuple[bytes, bytes | None]]] = defaultdict(list)
    for frame in frames:
        *others, last = bursts_of(frame, width, source)
        waiting[frame.id] += [*((burst, None) for burst in others), (last, frame.to_bytes())]
    bursts: list[bytes] = []
    whole = []
    while waiting:
        number = source.choice(sorted(waiting))
        burst, frame_bytes = waiting[number].pop(0)
        if frame_bytes is not None:
            whole.append((len(bursts), frame_bytes))
        bursts.append(burst)
        if not waiting[number]:
            del waiting[number]
    return bursts, whole


def run(joiner: Bench, folder: Path, bursts: list[bytes], whole: list[tuple[int, bytes]], **generics: int) -> str:
    write_stimulus(folder / "stimulus.txt", bursts)
    write_expected(folder / "expected.txt", whole)
    return joiner.run(folder, **{"SEED": SEED, **generics}).output


def test_an_aborted_frame_ends_in_any_burst(joiner: Bench, tmp_path: Path) -> None:
    """The burst that is aborted ends its publisher's frame, and no other one."""
    stimulus = (
        "> first part\n  01 08000000 aa bb\n> other\n  02 04000000 11 22\n> aborted\n  01 cc\n! aborted 1 10\n"
        "> next\n  01 01000000 dd\n> rest of the other\n  02 33 44\n"
    )
    (tmp_path / "stimulus.txt").write_text(stimulus, encoding="ascii")
    expected = "< a\n  01\n! aborted 1 10\n< next\n  01 01000000 dd\n< other\n  02 04000000 11223344\n"
    (tmp_path / "expected.txt").write_text(expected, encoding="ascii")
    result = joiner.run(tmp_path, WIDTH=8)
    assert result.exit_code == 0, result.output
    assert "  0108000000aabbcc\n! aborted 1 10\n" in (tmp_path / "received.txt").read_text()


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", [8, 16, 64, 512])
@pytest.mark.parametrize("stall", [0, 50])
def test_frames_come_out_whole(joiner: Bench, tmp_path: Path, width: int, stall: int) -> None:
    frames = random_frames([0, 1, 7, 255], 60, 3 * width // 8 + 9, SEED)
    bursts, whole = mixed(frames, width, SEED)
    assert len(bursts) > 1.5 * len(frames)
    output = run(joiner, tmp_path, bursts, whole, WIDTH=width, STALL_PERCENT=stall)
    assert output.splitlines()[-1] == "PASS 60/60", output


def test_a_lost_byte_is_seen(joiner: Bench, tmp_path: Path) -> None:
    bursts, whole = mixed([Frame(1, b"abcdefgh"), Frame(2, b"ijkl")], 8, SEED)
    assert "FAIL" in run(joiner, tmp_path, [*bursts[:-1], bursts[-1][:-1]], whole)


@pytest.mark.parametrize(
    ("bursts", "message"),
    [
        ([b"\x01\x02\0\0\0ab\x01"], "burst of id 1 continues after its frame"),
        ([b"\x01\x02\0\0", b"\x01"], "burst of id 1 resumes a frame without a beat of it"),
    ],
)
def test_a_burst_that_does_not_fit_is_named(joiner: Bench, tmp_path: Path, bursts: list[bytes], message: str) -> None:
    assert message in run(joiner, tmp_path, bursts, [(0, b"\x01\x02\0\0\0ab")])


def test_more_than_verilog_has_room_for_is_named(tmp_path: Path) -> None:
    joiner = bench("icarus", "firm_sim_join_tb", (), tmp_path)
    bursts, whole = mixed([Frame(1, bytes(20))], 8, SEED)
    assert "PASS 1/1" in run(joiner, tmp_path, bursts, whole, BEATS=25)
    assert "firm_sim_join: more than BEATS, 24, beats wait" in run(joiner, tmp_path, bursts, whole, BEATS=24)
