"""The queue of whole frames: nothing is lost but what is counted, and nothing stalls that may not."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.cores.queue_model import DROPPED, Cycle, QueueModel, read_trace
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

BENCH = "firm_axis_queue_tb"
PART = "firm_axis_queue"
WIDTHS = [8, 16, 32, 64, 128, 256, 512]
OVERFLOWS = ["block", "drop_newest", "drop_oldest"]
SEED = seeded(20250117)
# Cycles from the last beat of a frame in to its first beat out.
LATENCY = 2


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("queue"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    library.analyse(core_files("axis/axis", fileset="tb"))
    return library


def _overflow(kind: str) -> dict[str, Generic]:
    return {"DROP_NEWEST": kind == "drop_newest", "DROP_OLDEST": kind == "drop_oldest"}


def _run(library: Library, directory: Path, overflow: str, **generics: Generic) -> tuple[QueueModel, list[Cycle]]:
    """Simulate the queue, and replay the trace."""
    generics = {"WIDTH": 8, "FRAMES": 4, "BEATS": 8, "SEED": SEED, **generics}
    print(overflow, generics)
    result = library.run(BENCH, {**generics, **_overflow(overflow)}, directory=directory)
    assert result.exit_code == 0, result.output
    cycles = read_trace(directory / "trace.txt")
    model = QueueModel(int(generics["FRAMES"]), int(generics["BEATS"]), overflow)
    model.replay(cycles)
    assert model.left + model.dropped == model.entered == int(generics.get("COUNT", 200))
    assert sum(cycle.error and cycle.code == DROPPED for cycle in cycles) == model.dropped
    return model, cycles


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("overflow", OVERFLOWS)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("stops", [(0, 0), (60, 0), (0, 60), (30, 40)])
def test_nothing_is_lost_but_what_is_counted(
    library: Library, tmp_path: Path, width: int, overflow: str, stops: tuple[int, int]
) -> None:
    source, sink = stops
    model, _ = _run(library, tmp_path, overflow, WIDTH=width, SOURCE_PERCENT=source, SINK_PERCENT=sink, STOP_PERCENT=2)
    assert (model.dropped > 0) == (overflow != "block")


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("number", range(24))
def test_any_size(library: Library, tmp_path: Path, number: int) -> None:
    source = random.Random(SEED + number)
    overflow = source.choice(OVERFLOWS)
    frames = source.choice([2, 3, 5, 8, 16] if overflow == "drop_oldest" else [1, 2, 3, 5, 16])
    beats = source.choice([2, 3, 7, 16])
    _run(
        library,
        tmp_path,
        overflow,
        FRAMES=frames,
        BEATS=beats,
        LONGEST=source.choice([1, beats, 2 * beats]),
        SOURCE_PERCENT=source.choice([0, 30]),
        SINK_PERCENT=source.choice([0, 30, 80]),
        STOP_PERCENT=source.choice([0, 3]),
        SEED=SEED + number,
    )


@pytest.mark.parametrize("overflow", OVERFLOWS)
@pytest.mark.parametrize("longest", [1, 8])
def test_with_room_a_beat_enters_in_every_cycle(library: Library, tmp_path: Path, longest: int, overflow: str) -> None:
    """Short frames fill the places while a long one leaves, so there are many places."""
    model, cycles = _run(library, tmp_path, overflow, FRAMES=16, LONGEST=longest)
    assert model.dropped == 0
    taken = [number for number, cycle in enumerate(cycles) if cycle.entering.is_taken]
    assert taken == list(range(taken[0], taken[0] + len(taken)))
    first = next(number for number, cycle in enumerate(cycles) if cycle.entering.is_taken and cycle.entering.is_last)
    assert next(number for number, cycle in enumerate(cycles) if cycle.leaving.is_valid) == first + LATENCY


@pytest.mark.parametrize("overflow", ["drop_newest", "drop_oldest"])
def test_a_subscriber_that_never_takes_stalls_nobody(library: Library, tmp_path: Path, overflow: str) -> None:
    generics: dict[str, Generic] = {"WIDTH": 8, "FRAMES": 3, "BEATS": 8, "SINK_PERCENT": 100, "SEED": SEED}
    result = library.run(BENCH, {**generics, **_overflow(overflow)}, directory=tmp_path)
    assert result.exit_code == 0, result.output
    cycles = read_trace(tmp_path / "trace.txt")
    ends = sum(cycle.entering.is_taken and cycle.entering.is_last for cycle in cycles)
    assert ends == 200
    # One frame is about to leave, and two wait.
    assert sum(cycle.code == DROPPED for cycle in cycles) == ends - 3
    assert not any(cycle.entering.is_valid and not cycle.entering.is_ready for cycle in cycles)


def test_errors_of_the_subscriber_are_reported_as_well(library: Library, tmp_path: Path) -> None:
    generics: dict[str, Generic] = {"LONGEST": 1, "SINK_PERCENT": 60, "STOP_PERCENT": 5, "ERROR_PERCENT": 30}
    generics |= {"SOURCE_PERCENT": 70, "WIDTH": 64, "FRAMES": 2, "BEATS": 2, "SEED": SEED, **_overflow("drop_newest")}
    result = library.run(BENCH, generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    cycles = read_trace(tmp_path / "trace.txt")
    ends = [
        sum(beat.is_taken and beat.is_last for beat in beats)
        for beats in ([cycle.entering for cycle in cycles], [cycle.leaving for cycle in cycles])
    ]
    codes = [cycle.code for cycle in cycles if cycle.error]
    assert codes.count(DROPPED) == ends[0] - ends[1] > 0
    assert codes.count(2) == sum(cycle.subscriber_error for cycle in cycles) > 0


@pytest.mark.parametrize("overflow", OVERFLOWS)
@pytest.mark.parametrize("width", [8, 64])
def test_the_netlist_does_the_same(tmp_path: Path, width: int, overflow: str) -> None:
    library = _library(tmp_path)
    size: dict[str, Generic] = {"WIDTH": width, "FRAMES": 3, "BEATS": 7}
    library.replace_by_netlist(PART, {**size, **_overflow(overflow)})
    library.analyse(path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH)
    _run(library, tmp_path, overflow, **size, SINK_PERCENT=40, STOP_PERCENT=2)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("frames", [2, 5, 16])
@pytest.mark.parametrize("overflow", OVERFLOWS)
def test_there_is_no_latch(library: Library, width: int, frames: int, overflow: str) -> None:
    assert library.latches(PART, {"WIDTH": width, "FRAMES": frames, "BEATS": 10, **_overflow(overflow)}) == []


@pytest.mark.parametrize(
    ("generics", "message"),
    [
        ({"WIDTH": 24}, "WIDTH is 24; legal: 8, 16, 32, 64, 128, 256, 512"),
        ({"FRAMES": 1, "DROP_OLDEST": True}, "FRAMES is 1; legal: 1 or more, with DROP_OLDEST 2 or more"),
        ({"BEATS": 1}, "BEATS is 1; legal: 2 or more"),
        ({"DROP_NEWEST": True, "DROP_OLDEST": True}, "DROP_NEWEST and DROP_OLDEST are both true; legal: one at most"),
    ],
)
def test_illegal_generics_are_named(library: Library, generics: dict[str, Generic], message: str) -> None:
    result = library.run(PART, generics)
    assert result.exit_code != 0
    assert f"{PART}: {message}" in result.output
