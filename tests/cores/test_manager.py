"""The Manager with the fixed-priority scheduler between the simulation host and one echo a channel."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cores.managers import manager_library
from tests.hdl.frames import Frame, random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

WIDTHS = [8, 64, 512]
CHANNELS = [1, 2, 3, 5, 16]
SEED = seeded(20240502)

BENCH = "firm_manager_tb"

# Cycles: a register slice each way, the echo's FIFO and the scheduler's choice.
LONGEST_LATENCY = 6


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return manager_library(tmp_path_factory.mktemp("manager"))


def _write_files(directory: Path, frames: list[Frame], subscribers: int, publishers: int) -> int:
    """Files for these frames, sent to `subscribers` and answered by `publishers`; the number of answers."""
    write_stimulus(directory / "stimulus.txt", (frame.to_bytes() for frame in frames))
    answers = [(n, frame.to_bytes()) for n, frame in enumerate(frames) if frame.id < min(subscribers, publishers)]
    write_expected(directory / "expected.txt", answers, sum(frame.id >= subscribers for frame in frames))
    return len(answers)


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("channels", CHANNELS)
def test_every_frame_comes_back_under_stalls(library: Library, tmp_path: Path, channels: int, width: int) -> None:
    ids = range(min(channels + 3, 256))  # three of them are unknown
    answers = _write_files(tmp_path, random_frames(ids, 120, 5 * width // 8, SEED), channels, channels)
    for host_stall, echo_stall in ((30, 60), (70, 10)):
        generics = {
            "WIDTH": width,
            "SUBSCRIBERS": channels,
            "PUBLISHERS": channels,
            "SEED": SEED,
            "STALL_PERCENT": host_stall,
            "ECHO_STALL_PERCENT": echo_stall,
        }
        result = library.run(BENCH, generics, directory=tmp_path)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == f"PASS {answers}/{answers}"


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("channels", CHANNELS)
def test_no_cycle_is_lost_without_stalls(library: Library, tmp_path: Path, channels: int, width: int) -> None:
    frames = random_frames(range(channels), 120, 5 * width // 8, SEED)
    _write_files(tmp_path, frames, channels, channels)
    generics = {"WIDTH": width, "SUBSCRIBERS": channels, "PUBLISHERS": channels}
    result = library.run(BENCH, generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    beats = sum(frame.beats(width) for frame in frames)
    found = traffic(result.output)
    assert (found.beats_in, found.beats_out) == (beats, beats)
    assert found.cycles <= beats + LONGEST_LATENCY


def test_256_channels_work(library: Library, tmp_path: Path) -> None:
    frames = [Frame(number, bytes([number, 255 - number])) for number in range(256)]
    _write_files(tmp_path, frames, 256, 256)
    generics = {"SUBSCRIBERS": 256, "PUBLISHERS": 256, "STALL_PERCENT": 20, "SEED": SEED}
    result = library.run(BENCH, generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS 256/256"


@pytest.mark.parametrize(("subscribers", "publishers"), [(1, 4), (5, 2), (3, 1)])
def test_the_two_sides_are_numbered_apart(library: Library, tmp_path: Path, subscribers: int, publishers: int) -> None:
    frames = random_frames(range(subscribers), 60, 30, SEED)
    answers = _write_files(tmp_path, frames, subscribers, publishers)
    generics = {"WIDTH": 32, "SUBSCRIBERS": subscribers, "PUBLISHERS": publishers, "STALL_PERCENT": 30, "SEED": SEED}
    result = library.run(BENCH, generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == f"PASS {answers}/{answers}"


def test_a_frame_that_is_only_an_id_is_swallowed(library: Library, tmp_path: Path) -> None:
    whole = Frame(1, b"abc").to_bytes()
    write_stimulus(tmp_path / "stimulus.txt", [b"\x01", whole, b"\x00", b"\x09", whole])
    write_expected(tmp_path / "expected.txt", [(1, whole), (4, whole)], id_errors=3)
    result = library.run(BENCH, {"STALL_PERCENT": 30, "SEED": SEED}, directory=tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("width", "subscribers", "publishers"), [(8, 1, 1), (8, 5, 3), (64, 3, 5)])
def test_the_netlist_does_the_same(tmp_path: Path, width: int, subscribers: int, publishers: int) -> None:
    library = manager_library(tmp_path)
    sizes = {"WIDTH": width, "SUBSCRIBERS": subscribers, "PUBLISHERS": publishers}
    library.replace_by_netlist("firm_manager", sizes)
    library.replace_by_netlist("firm_sched_fixed_priority", {"REQUESTERS": publishers})
    library.analyse(core_files("manager/manager", fileset="tb"))
    answers = _write_files(tmp_path, random_frames(range(subscribers + 2), 100, width, SEED), subscribers, publishers)
    for stall in (0, 40):
        result = library.run(BENCH, {**sizes, "STALL_PERCENT": stall, "ECHO_STALL_PERCENT": stall, "SEED": SEED})
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[-1] == f"PASS {answers}/{answers}"


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(("subscribers", "publishers"), [(1, 1), (2, 2), (3, 5), (16, 16), (256, 256)])
def test_it_is_latch_free(library: Library, width: int, subscribers: int, publishers: int) -> None:
    sizes = {"WIDTH": width, "SUBSCRIBERS": subscribers, "PUBLISHERS": publishers}
    assert library.latches("firm_manager", sizes) == []


@pytest.mark.parametrize(
    ("generic", "value", "legal"),
    [
        ("WIDTH", 48, "8, 16, 32, 64, 128, 256, 512"),
        ("SUBSCRIBERS", 0, "1 to "),
        ("SUBSCRIBERS", 257, "1 to 256"),
        ("PUBLISHERS", 0, "1 to 256"),
        ("PUBLISHERS", 257, "1 to 256"),
    ],
)
def test_illegal_generics_are_named(library: Library, generic: str, value: int, legal: str) -> None:
    result = library.run("firm_manager", {generic: value})
    assert result.exit_code != 0
    # The part that the generic goes to may be the first to name it, under its own name and with its own limit.
    assert f" is {value}; legal: {legal}" in result.output
