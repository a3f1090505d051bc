"""The Manager under preemption: bursts of a grant that moves at random, joined as the host joins them."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import pytest

from fusesoc_firm.node.engine.bursts import BurstJoiner
from tests.cores.managers import manager_library
from tests.hdl.ghdl import CORES, Generic, Library, core_files
from tests.seeds import seeded

BENCH = "firm_manager_burst_tb"
WIDTHS = [8, 64, 512]
SEED = seeded(20240611)

# Publishers, and the frames that each of them sends.
FRAMES = {1: 20, 2: 40, 5: 20, 16: 8, 256: 2}
LONGEST = 150

# Cycles of a beat from a publisher to the host: held back, then the register slice's.
LATENCY = 2


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return manager_library(tmp_path_factory.mktemp("bursts"))


@dataclass(frozen=True)
class Outcome:
    """Bursts as (`tid`, bytes), and the bench's figures."""

    bursts: list[tuple[int, bytes]]
    beats_in: int
    beats_out: int
    cycles: int


def _run(library: Library, directory: Path, generics: dict[str, Generic]) -> Outcome:
    print(f"seed {SEED}")
    result = library.run(BENCH, {"SEED": SEED, "LONGEST": LONGEST, **generics}, directory=directory)
    assert result.exit_code == 0, result.output
    return Outcome(_read(directory / "bursts.txt"), *map(int, result.output.splitlines()[-1].split()))


def _read(path: Path) -> list[tuple[int, bytes]]:
    lines = path.read_text(encoding="ascii").splitlines()
    return [(int(tid, 16), bytes.fromhex(burst)) for tid, burst in (line.split() for line in lines)]


def _payload(publisher: int, frame: int, longest: int = LONGEST) -> bytes:
    """Return the frames that the bench's publishers send."""
    return bytes(
        (publisher + 31 * frame + 7 * place) % 256 for place in range((17 * publisher + 29 * frame) % (longest + 1))
    )


def _beats(payload: bytes, width: int) -> int:
    return -(-8 * (5 + len(payload)) // width)


def _check(outcome: Outcome, publishers: int, frames: int, width: int) -> int:
    """Join the bursts and compare every byte; the number of bursts that resume a frame."""
    joiner = BurstJoiner(publishers, width)
    found: dict[int, list[bytes]] = defaultdict(list)
    resumed = 0
    cut = None  # the publisher whose frame the burst before left unfinished
    for tid, burst in outcome.bursts:
        assert tid != cut, "a run was cut although nobody came between"
        resumed += tid in joiner.unfinished
        if frame := joiner.push(burst, tid):
            found[frame.id].append(frame.payload)
        cut = tid if tid in joiner.unfinished else None
    joiner.close()
    sent = {publisher: [_payload(publisher, number) for number in range(frames)] for publisher in range(publishers)}
    assert found == sent
    assert outcome.beats_in == sum(_beats(payload, width) for payloads in sent.values() for payload in payloads)
    assert outcome.beats_out == outcome.beats_in + resumed
    return resumed


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("publishers", FRAMES)
def test_every_frame_is_joined_again(library: Library, tmp_path: Path, publishers: int, width: int) -> None:
    frames = FRAMES[publishers]
    for move, idle, pause, stall in ((30, 0, 50, 30), (100, 0, 10, 10), (20, 20, 80, 50), (0, 100, 0, 0)):
        generics: dict[str, Generic] = {
            "WIDTH": width,
            "PUBLISHERS": publishers,
            "FRAMES": frames,
            "MOVE_PERCENT": move,
            # Of many publishers the one that is wanted last would wait for long.
            "IDLE_PERCENT": idle if publishers < 100 else min(idle, 20),
            "PAUSE_PERCENT": pause,
            "STALL_PERCENT": stall,
        }
        resumed = _check(_run(library, tmp_path, generics), publishers, frames, width)
        assert (resumed > 0) == (publishers > 1)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("move", [0, 20, 50, 100])
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("publishers", [2, 5, 16])
def test_only_the_resuming_beats_cost_cycles(
    library: Library, tmp_path: Path, publishers: int, width: int, move: int
) -> None:
    frames = FRAMES[publishers]
    generics: dict[str, Generic] = {"WIDTH": width, "PUBLISHERS": publishers, "FRAMES": frames, "MOVE_PERCENT": move}
    outcome = _run(library, tmp_path, generics)
    resumed = _check(outcome, publishers, frames, width)
    assert (resumed > 0) == (move > 0)
    assert outcome.cycles == outcome.beats_in + resumed + LATENCY


@pytest.mark.parametrize("width", [8, 16])
def test_a_publisher_that_stops_within_a_frame_stops_nobody(library: Library, tmp_path: Path, width: int) -> None:
    generics: dict[str, Generic] = {"WIDTH": width, "PUBLISHERS": 3, "FRAMES": 20, "STOPPED": True}
    outcome = _run(library, tmp_path, generics)
    joiner = BurstJoiner(3, width)
    found = [frame.id for tid, burst in outcome.bursts if (frame := joiner.push(burst, tid))]
    assert sorted(found) == [1] * 20 + [2] * 20
    assert joiner.unfinished == (0,)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_grant_that_keeps_to_frames_gives_whole_frames(library: Library, tmp_path: Path, width: int) -> None:
    generics: dict[str, Generic] = {"WIDTH": width, "PUBLISHERS": 5, "FRAMES": 20, "PREEMPTIVE": False}
    outcome = _run(library, tmp_path, generics)
    assert _check(outcome, 5, 20, width) == 0
    assert outcome.cycles == outcome.beats_in + LATENCY - 1


@pytest.mark.one_in(3)
@pytest.mark.parametrize("preemptive", [False, True])
@pytest.mark.parametrize(("publishers", "frames"), [(2, 100), (8, 30), (256, 3)])
def test_the_channel_is_used_if_there_is_something_to_send(
    library: Library, tmp_path: Path, publishers: int, frames: int, preemptive: bool
) -> None:
    """99.5 % at least, under the scheduler, from the first beat of a publisher to the last beat at the host."""
    generics: dict[str, Generic] = {
        "PUBLISHERS": publishers,
        "FRAMES": frames,
        "SCHEDULED": True,
        "PREEMPTIVE": preemptive,
    }
    outcome = _run(library, tmp_path, generics)
    assert _check(outcome, publishers, frames, 8) == 0
    assert min(len(burst) for _, burst in outcome.bursts) < 10
    assert outcome.beats_out >= 0.995 * outcome.cycles


@pytest.mark.parametrize(("width", "publishers"), [(8, 1), (8, 5), (64, 16)])
def test_the_netlist_does_the_same(tmp_path: Path, width: int, publishers: int) -> None:
    library = manager_library(tmp_path)
    sizes: dict[str, Generic] = {"WIDTH": width, "SUBSCRIBERS": 1, "PUBLISHERS": publishers, "PREEMPTIVE": True}
    library.replace_by_netlist("firm_manager", sizes)
    library.analyse(core_files("manager/manager", fileset="tb"))
    for stall in (0, 40):
        generics: dict[str, Generic] = {
            "WIDTH": width,
            "PUBLISHERS": publishers,
            "FRAMES": FRAMES[publishers],
            "PAUSE_PERCENT": stall,
            "STALL_PERCENT": stall,
        }
        resumed = _check(_run(library, tmp_path, generics), publishers, FRAMES[publishers], width)
        assert (resumed > 0) == (publishers > 1)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("publishers", FRAMES)
def test_it_is_latch_free(library: Library, width: int, publishers: int) -> None:
    sizes = {"WIDTH": width, "SUBSCRIBERS": publishers, "PUBLISHERS": publishers, "PREEMPTIVE": True}
    assert library.latches("firm_manager", sizes) == []


@pytest.mark.parametrize(
    ("generic", "value", "legal"), [("WIDTH", 48, "8, 16, 32, 64, 128, 256, 512"), ("SOURCES", 257, "1 to 256")]
)
def test_illegal_generics_are_named(library: Library, generic: str, value: int, legal: str) -> None:
    result = library.run("firm_axis_burst", {generic: value})
    assert result.exit_code != 0
    assert f" is {value}; legal: {legal}" in result.output


def test_the_bursts_that_the_cores_own_bench_expects_are_right() -> None:
    # The bench's own numbers of publishers, of their frames, and the longest payload.
    bursts = _read(CORES / "manager" / "tb" / "data" / "bursts_expected.txt")
    joiner = BurstJoiner(2, 8)
    frames = [frame for tid, burst in bursts if (frame := joiner.push(burst, tid))]
    joiner.close()
    for publisher in range(2):
        payloads = [frame.payload for frame in frames if frame.id == publisher]
        assert payloads == [_payload(publisher, number, longest=100) for number in range(10)]
