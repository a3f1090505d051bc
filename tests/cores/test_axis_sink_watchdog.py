"""The watchdog towards a sink: a sink that takes nothing costs the source its limit, and frames that are counted."""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from tests.cores.queue_model import Cycle, read_trace
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

BENCH = "firm_axis_queue_tb"
PART = "firm_axis_sink_watchdog"
WIDTHS = [8, 16, 32, 64, 128, 256, 512]
SEED = seeded(20250301)
COUNT = 200
# Stops of the sink last 50 cycles on average.
STOPPING: dict[str, Generic] = {"STOP_PERCENT": 2, "GO_PERCENT": 2}

Beats = list[tuple[int, int]]


@dataclass(frozen=True)
class SentFrame:
    """A frame at one side, as (data, lanes) of its beats."""

    beats: Beats
    is_aborted: bool


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("sink_watchdog"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    library.analyse(core_files("axis/axis", fileset="tb"))
    return library


def _trace(library: Library, directory: Path, **generics: Generic) -> list[Cycle]:
    generics = {"WIDTH": 8, "LIMIT": 20, "SEED": SEED, "COUNT": COUNT, **generics}
    print(generics)
    result = library.run(BENCH, generics, directory=directory)
    assert result.exit_code == 0, result.output
    return read_trace(directory / "trace.txt")


def _entered(cycles: list[Cycle]) -> list[SentFrame]:
    frames: list[Beats] = [[]]
    for beat in (cycle.entering for cycle in cycles if cycle.entering.is_taken):
        frames[-1].append((beat.data, beat.lanes))
        if beat.is_last:
            frames.append([])
    assert not frames.pop()
    return [SentFrame(beats, is_aborted=False) for beats in frames]


def _left(cycles: list[Cycle]) -> list[SentFrame]:
    frames: list[SentFrame] = []
    beats: Beats = []
    for cycle in cycles:
        if cycle.leaving.is_taken:
            beats.append((cycle.leaving.data, cycle.leaving.lanes))
            if cycle.leaving.is_last:
                frames.append(SentFrame(beats[:-1] if cycle.is_aborted else beats, cycle.is_aborted))
                beats = []
    assert not beats
    return frames


def _judge(cycles: list[Cycle]) -> int:
    """Check that frames leave whole and in order, but for those that are reported; return the number of these."""
    left = iter(_left(cycles))
    leaves = next(left, None)
    reported = 0
    for frame in _entered(cycles):
        if leaves and leaves.is_aborted and frame.beats[: len(leaves.beats)] == leaves.beats:
            # Its abort takes the place of at least one beat.
            assert 0 < len(leaves.beats) < len(frame.beats)
            reported += 1
            leaves = next(left, None)
        elif leaves == frame:
            leaves = next(left, None)
        else:
            reported += 1
    assert leaves is None, "a frame left that had not entered"
    assert sum(cycle.code == Fault.WATCHDOG for cycle in cycles if cycle.error) == reported
    return reported


def _longest_wait(cycles: list[Cycle]) -> int:
    waits = [cycle.entering.is_valid and not cycle.entering.is_ready for cycle in cycles]
    return max(len([*run]) if waiting else 0 for waiting, run in groupby(waits))


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("limit", [1, 20])
@pytest.mark.parametrize("stops", [(0, 0), (60, 0), (0, 60), (30, 40)])
def test_nothing_is_lost_but_what_is_counted(
    library: Library, tmp_path: Path, width: int, limit: int, stops: tuple[int, int]
) -> None:
    source, sink = stops
    sizes: dict[str, Generic] = {"WIDTH": width, "LIMIT": limit, "SOURCE_PERCENT": source, "SINK_PERCENT": sink}
    cycles = _trace(library, tmp_path, **sizes, **STOPPING)
    assert _judge(cycles) > 0
    assert _longest_wait(cycles) == limit


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("number", range(12))
def test_any_limit(library: Library, tmp_path: Path, number: int) -> None:
    source = random.Random(SEED + number)
    cycles = _trace(
        library,
        tmp_path,
        LIMIT=source.choice([1, 2, 3, 16, 50]),
        LONGEST=source.choice([1, 2, 10, 40]),
        SOURCE_PERCENT=source.choice([0, 30, 80]),
        SINK_PERCENT=source.choice([0, 30, 80]),
        SEED=SEED + number,
        **STOPPING,
    )
    _judge(cycles)


def test_a_sink_that_keeps_up_is_left_alone_at_full_rate(library: Library, tmp_path: Path) -> None:
    cycles = _trace(library, tmp_path, LIMIT=1)
    assert _judge(cycles) == 0
    taken = [number for number, cycle in enumerate(cycles) if cycle.leaving.is_taken]
    assert taken == list(range(taken[0], taken[0] + len(taken)))


def test_a_sink_that_never_takes_costs_one_limit(library: Library, tmp_path: Path) -> None:
    limit = 100
    cycles = _trace(library, tmp_path, LIMIT=limit, SINK_PERCENT=100)
    waits = sum(cycle.entering.is_valid and not cycle.entering.is_ready for cycle in cycles)
    assert waits == limit
    ends = sum(cycle.entering.is_taken and cycle.entering.is_last for cycle in cycles)
    assert ends == COUNT
    # The first frame may be at the output as a whole.
    assert sum(cycle.error for cycle in cycles) in (COUNT, COUNT - 1)


def test_errors_of_the_sink_are_reported_as_well(library: Library, tmp_path: Path) -> None:
    """All but those of aborted frames, which this entity has reported."""
    cycles = _trace(library, tmp_path, ERROR_PERCENT=10, LONGEST=3, WIDTH=64, **STOPPING)
    aborted = sum(frame.is_aborted for frame in _left(cycles))
    codes = [cycle.code for cycle in cycles if cycle.error]
    assert aborted > 0
    assert codes.count(2) == sum(cycle.subscriber_error for cycle in cycles) - aborted
    assert codes.count(Fault.WATCHDOG) == _judge(cycles)


@pytest.mark.parametrize("width", [8, 64])
def test_the_netlist_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    size: dict[str, Generic] = {"WIDTH": width, "LIMIT": 20}
    library.replace_by_netlist(PART, size)
    library.analyse(path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH)
    assert _judge(_trace(library, tmp_path, **size, SINK_PERCENT=40, **STOPPING)) > 0


@pytest.mark.parametrize("width", WIDTHS)
def test_there_is_no_latch(library: Library, width: int) -> None:
    assert library.latches(PART, {"WIDTH": width, "LIMIT": 1 << 20}) == []


@pytest.mark.parametrize(
    ("generics", "message"),
    [
        ({"WIDTH": 24}, "WIDTH is 24; legal: 8, 16, 32, 64, 128, 256, 512"),
        ({"LIMIT": 0}, "LIMIT is 0; legal: 1 or more"),
    ],
)
def test_illegal_generics_are_named(library: Library, generics: dict[str, Generic], message: str) -> None:
    result = library.run(PART, generics)
    assert result.exit_code != 0
    assert f"{PART}: {message}" in result.output
