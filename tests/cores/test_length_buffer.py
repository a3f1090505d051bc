"""The buffer that fills in a frame's length: every length right, what is too long dropped, nothing else touched."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.hdl.frames import Frame, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

BENCH = "firm_axis_pipe_tb"
WIDTHS = [8, 16, 32, 64, 128, 512]
SEED = seeded(20240610)
# Cycles from a frame's last beat in to its first beat out.
LATENCY = 4


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("length_buffer"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    library.analyse(core_files("axis/axis", fileset="tb"))
    return library


def _frames(width: int, depth: int, count: int = 120) -> list[Frame]:
    """Frames of any size up to more than `depth` beats, many of them next to a beat's end or to the bound."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    lanes = width // 8
    sizes = [source.randint(0, source.choice([4, 3 * lanes, depth * lanes // 2])) for _ in range(count)]
    sizes += [lanes * source.randint(1, depth) + source.randint(-6, 1) for _ in range(count // 2)]
    sizes += [lanes * depth - 5 + source.choice([-lanes, -1, 0, 1, lanes, 5 * lanes]) for _ in range(count // 4)]
    source.shuffle(sizes)
    return [Frame(source.randrange(256), source.randbytes(max(0, size))) for size in sizes]


def _write(directory: Path, frames: Sequence[Frame], width: int, depth: int) -> int:
    """The frames with anything for a length, and those to expect, with theirs; how many are dropped."""
    source = random.Random(SEED + 1)
    kept = [(number, frame.to_bytes()) for number, frame in enumerate(frames) if frame.beats(width) <= depth]
    write_stimulus(directory / "stimulus.txt", (bytes([f.id]) + source.randbytes(4) + f.payload for f in frames))
    write_expected(directory / "expected.txt", kept)
    dropped = len(frames) - len(kept)
    with (directory / "expected.txt").open("a", encoding="ascii") as file:
        file.write(f"! frame_error {dropped}\n")
    return dropped


def _run(library: Library, directory: Path, **generics: Generic) -> str:
    result = library.run(BENCH, {"PART": "length_buffer", **generics}, directory=directory)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("stalls", [(0, 0), (50, 0), (0, 60), (25, 25)])
def test_lengths_are_right_and_long_frames_dropped(
    library: Library, tmp_path: Path, width: int, stalls: tuple[int, int]
) -> None:
    depth = 30
    assert _write(tmp_path, _frames(width, depth), width, depth) > 10
    both, sink = stalls
    output = _run(library, tmp_path, WIDTH=width, DEPTH=depth, SEED=SEED, STALL_PERCENT=both, SINK_STALL_PERCENT=sink)
    assert set(re.findall(r"code (\d+)", output)) == {"6"}


@pytest.mark.parametrize("width", [8, 32, 512])
def test_aborted_frames_are_dropped(library: Library, tmp_path: Path, width: int) -> None:
    """Between frames that are right, of which some leave while the aborted one enters."""
    depth = 30
    source = random.Random(SEED + 2)
    frames = [frame for frame in _frames(width, depth) if frame.beats(width) < depth]
    aborted = {number for number in range(len(frames) - 1) if source.random() < 0.4}
    write_stimulus(tmp_path / "stimulus.txt", (frame.to_bytes() for frame in frames), aborted)
    kept = [(number, frame.to_bytes()) for number, frame in enumerate(frames) if number not in aborted]
    write_expected(tmp_path / "expected.txt", kept)
    for stalls in (0, 40):
        _run(library, tmp_path, WIDTH=width, DEPTH=depth, SEED=SEED, STALL_PERCENT=stalls, SINK_STALL_PERCENT=stalls)


def test_errors_of_the_publisher_are_passed_on(library: Library, tmp_path: Path) -> None:
    _write(tmp_path, [Frame(1, bytes(100)), Frame(2, bytes(20))], 8, 64)
    expected = tmp_path / "expected.txt"
    expected.write_text(
        expected.read_text(encoding="ascii").replace("frame_error 1", "frame_error 4"), encoding="ascii"
    )
    output = _run(library, tmp_path, WIDTH=8, DEPTH=64, PUBLISHER_ERRORS=3)
    assert re.findall(r"code (\d+)", output) == ["2", "2", "2", "6"]


@pytest.mark.parametrize("depth", [2, 3, 7, 64])
def test_any_depth(library: Library, tmp_path: Path, depth: int) -> None:
    _write(tmp_path, _frames(32, depth), 32, depth)
    _run(library, tmp_path, WIDTH=32, DEPTH=depth, SEED=SEED, STALL_PERCENT=30)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", WIDTHS)
def test_a_frame_is_sent_while_the_next_is_stored(library: Library, tmp_path: Path, width: int) -> None:
    beats, count = 20, 30
    frames = [Frame(number, bytes(beats * width // 8 - 5)) for number in range(count)]
    _write(tmp_path, frames, width, 2 * beats + LATENCY)
    figures = traffic(_run(library, tmp_path, WIDTH=width, DEPTH=2 * beats + LATENCY))
    assert figures.cycles == count * beats + LATENCY + beats - 1


@pytest.mark.parametrize("width", [64, 512])
def test_frames_of_a_beat_pass_in_every_cycle(library: Library, tmp_path: Path, width: int) -> None:
    frames = [Frame(number, bytes(number % 4)) for number in range(200)]
    _write(tmp_path, frames, width, 8)
    assert traffic(_run(library, tmp_path, WIDTH=width, DEPTH=8)).cycles == len(frames) + LATENCY


def test_many_short_frames_wait_behind_a_long_one(library: Library, tmp_path: Path) -> None:
    """More of them than there is room for lengths."""
    frames = [Frame(0, bytes(2000)), *(Frame(number, b"") for number in range(100)), Frame(1, bytes(2000))]
    _write(tmp_path, frames, 64, 300)
    _run(library, tmp_path, WIDTH=64, DEPTH=300, SINK_STALL_PERCENT=70, SEED=SEED)


@pytest.mark.parametrize("width", [8, 64])
def test_the_netlist_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_axis_length_buffer", {"WIDTH": width, "DEPTH": 12})
    library.analyse(path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH)
    _write(tmp_path, _frames(width, 12), width, 12)
    _run(library, tmp_path, WIDTH=width, DEPTH=12, SEED=SEED, STALL_PERCENT=30)


@pytest.mark.one_in(7)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("depth", [2, 5, 1024])
def test_there_is_no_latch(library: Library, width: int, depth: int) -> None:
    assert library.latches("firm_axis_length_buffer", {"WIDTH": width, "DEPTH": depth}) == []


@pytest.mark.parametrize(
    ("generics", "legal"), [({"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"), ({"DEPTH": 1}, "2 or more")]
)
def test_illegal_generics_are_named(library: Library, generics: dict[str, int], legal: str) -> None:
    result = library.run("firm_axis_length_buffer", generics)
    assert result.exit_code != 0
    (name, value) = next(iter(generics.items()))
    assert f"firm_axis_length_buffer: {name} is {value}; legal: {legal}" in result.output
