"""The priority queues of robot:sched, their traces replayed on `heapq` and a sorted list."""

from __future__ import annotations

import bisect
import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.hdl.ghdl import CORES, Generic, Library, core_files
from tests.seeds import seeded

ITEMS = [1, 2, 3, 5, 8, 32, 100, 256]
KEY_BITS = 10
SEED = seeded(20240611)
BENCH = "firm_sched_queue_tb"
ENTITIES = {False: "firm_sched_heap", True: "firm_sched_sorted_queue"}
# Percents of inserts and pops: about even, filling up, running empty, and as fast as it goes.
FILLING = (90, 5)
RATES = [(30, 20), FILLING, (20, 90), (100, 100)]
# Items, those of a segment of the sorted queue, and cycles with the same rates.
SEGMENTED = [(5, 2, 10), (8, 2, 14), (13, 3, 17), (100, 32, 150), (256, 32, 270)]


@dataclass(frozen=True)
class Cycle:
    """A cycle of the bench's trace; `insert` is (id, key), and so is `first`, the item that can be popped."""

    insert: tuple[int, int] | None
    pop: bool
    ready: bool
    empty: bool
    root_valid: bool
    first: tuple[int, int] | None


@dataclass
class Model:
    """The content of the queue, kept in two ways: Python's heap, and a sorted list. Entries are (key, id)."""

    heap: list[tuple[int, int]] = field(default_factory=list)
    ordered: list[tuple[int, int]] = field(default_factory=list)

    def insert(self, key: int, item: int) -> None:
        heapq.heappush(self.heap, (key, item))
        bisect.insort(self.ordered, (key, item))

    def pop(self) -> tuple[int, int]:
        first = heapq.heappop(self.heap)
        assert first == self.ordered.pop(0)
        return first


@dataclass
class Unwrapped:
    """Keys that wrap around as numbers that do not: each is near the one before."""

    last: int = 0

    def __call__(self, key: int) -> int:
        modulus = 2**KEY_BITS
        self.last += (key - self.last + modulus // 2) % modulus - modulus // 2
        return self.last


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("queue"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sched/queue"))
    library.analyse(core_files("sched/queue", fileset="tb"))
    return library


def _cycles(
    library: Library, trace: Path, is_sorted: bool, items: int, rates: tuple[int, int], **others: Generic
) -> Iterator[list[Cycle]]:
    """The cycles of a run with `others` as generics of the bench, a list for each time between two resets."""
    generics: dict[str, Generic] = {
        "SORTED": is_sorted,
        "ITEMS": items,
        "KEY_BITS": KEY_BITS,
        "SEED": SEED,
        "CYCLES": 3000 + 12 * items,
        "INSERT_PERCENT": rates[0],
        "POP_PERCENT": rates[1],
        "TRACE": str(trace),
        **others,
    }
    result = library.run(BENCH, generics)
    assert result.exit_code == 0, f"{generics}\n{result.output}"
    yield from _segments(trace)


def _segments(trace: Path) -> Iterator[list[Cycle]]:
    for segment in trace.read_text(encoding="ascii").split("reset\n"):
        if segment:
            yield [_parse(line) for line in segment.splitlines()]


def _parse(line: str) -> Cycle:
    words = line.split()
    insert = None
    if words[0] == "insert":
        insert = (int(words[1]), int(words[2]))
        del words[1:3]
    first = None if words[5] == "-" else (int(words[5]), int(words[6]))
    return Cycle(insert, words[1] == "pop", words[2] == "1", words[3] == "1", words[4] == "1", first)


def _judge(cycles: list[Cycle], is_sorted: bool) -> tuple[int, int]:
    """Hold a queue's cycles after a reset against the model; how many items were popped, and how many were inside."""
    model = Model()
    unwrap = Unwrapped()
    popped = fullest = 0
    # The heap's root is refilled in the cycle after a pop; if the new root is popped, two cycles later.
    filling = owing = is_cleared = False
    for number, cycle in enumerate(cycles):
        where = f"cycle {number}: {cycle}, {model.ordered[:3]}"
        assert (cycle.first is None) == (owing or not model.ordered), where
        if cycle.first is not None:
            item, key = cycle.first
            assert (key, item) == (model.ordered[0][0] % 2**KEY_BITS, model.ordered[0][1]), where
        assert cycle.root_valid == (cycle.first is not None and not filling), where
        assert cycle.empty == (not (cycle.root_valid or filling or owing)), where
        is_cleared = is_cleared or cycle.ready or is_sorted
        assert cycle.ready == (is_sorted or not (cycle.pop or filling or owing)) or not is_cleared, where
        if cycle.pop:
            model.pop()
            popped += 1
        if cycle.insert is not None and cycle.ready:
            item, key = cycle.insert
            model.insert(unwrap(key), item)
            fullest = max(fullest, len(model.ordered))
        if not is_sorted:
            filling, owing = (cycle.pop and not filling) or owing, cycle.pop and filling
    return popped, fullest


@pytest.mark.one_in(9, 3)
@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("items", ITEMS)
@pytest.mark.parametrize("is_sorted", ENTITIES)
def test_it_is_a_priority_queue(
    library: Library, tmp_path: Path, is_sorted: bool, items: int, rates: tuple[int, int]
) -> None:
    segments = list(_cycles(library, tmp_path / "trace.txt", is_sorted, items, rates))
    assert len(segments) == 2
    for cycles in segments:
        popped, fullest = _judge(cycles, is_sorted)
        assert popped > 50
        assert fullest == items or rates != FILLING


# With small segments, two items often meet where one segment ends. The reset finds items on their way in two of the
# cases.
@pytest.mark.parametrize(("items", "segment", "burst"), SEGMENTED)
def test_segments_keep_the_order(library: Library, tmp_path: Path, items: int, segment: int, burst: int) -> None:
    _judge_segmented(library, tmp_path / "trace.txt", items, segment, burst)


def _judge_segmented(library: Library, trace: Path, items: int, segment: int, burst: int) -> None:
    generics: dict[str, Generic] = {"SEGMENT": segment, "BURST": burst, "CYCLES": 8000}
    for cycles in _cycles(library, trace, True, items, RATES[0], **generics):
        popped, fullest = _judge(cycles, True)
        assert popped > 500
        assert fullest == items


def test_the_netlist_of_segments_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    items, segment, burst = SEGMENTED[1]
    library.replace_by_netlist(ENTITIES[True], {"ITEMS": items, "KEY_BITS": KEY_BITS, "SEGMENT": segment})
    library.analyse(core_files("sched/queue", fileset="tb"))
    _judge_segmented(library, tmp_path / "trace.txt", items, segment, burst)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("items", [2, 5, 32])
@pytest.mark.parametrize("is_sorted", ENTITIES)
def test_the_netlist_does_the_same(tmp_path: Path, is_sorted: bool, items: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(ENTITIES[is_sorted], {"ITEMS": items, "KEY_BITS": KEY_BITS})
    library.analyse(core_files("sched/queue", fileset="tb"))
    for cycles in _cycles(library, tmp_path / "trace.txt", is_sorted, items, RATES[0]):
        assert _judge(cycles, is_sorted)[0] > 50


@pytest.mark.one_in(5)
@pytest.mark.parametrize("items", ITEMS)
@pytest.mark.parametrize("is_sorted", ENTITIES)
def test_it_is_latch_free(library: Library, is_sorted: bool, items: int) -> None:
    assert library.latches(ENTITIES[is_sorted], {"ITEMS": items, "KEY_BITS": KEY_BITS}) == []


@pytest.mark.parametrize(("name", "is_sorted"), [("queue", False), ("sorted", True)])
def test_the_trace_that_the_cores_own_bench_expects_is_right(name: str, is_sorted: bool) -> None:
    segments = list(_segments(CORES / "sched" / "tb" / "data" / f"{name}_expected.txt"))
    assert all(_judge(cycles, is_sorted)[0] > 10 for cycles in segments)
