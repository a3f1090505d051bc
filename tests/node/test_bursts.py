"""Bursts joined to frames, in Python and in C++ with the same bursts and the same words."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.bursts import WIDTHS, BurstError, BurstJoiner, JoinedFrame, split_frame
from tests.node.drivers import Driver, cpp_driver
from tests.seeds import seeded

SEED = seeded(20240612)
LONGEST = 1000


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("bursts")


def _python_answers(lines: Sequence[str]) -> list[str]:
    """What the driver would say, by the Python class."""
    answers = []
    joiner = BurstJoiner(1, 8)
    for line in lines:
        command, *words = line.split()
        try:
            if command == "joiner":
                publishers, width, longest = map(int, words)
                joiner = BurstJoiner(publishers, width, longest)
                answers.append("ready")
            elif command == "close":
                joiner.close()
                answers.append("closed")
            else:
                tid, burst = words[0], bytes.fromhex("".join(words[1:]))
                frame = joiner.push(burst, None if tid == "-" else int(tid), is_aborted=command == "abort")
                begun = " ".join(["unfinished", *map(str, joiner.unfinished)])
                answers.append(f"frame {frame.id} {frame.payload.hex()}" if frame else begun)
        except ValueError as error:
            answers.append(f"error: {error}")
    return answers


def _interleaved(source: random.Random, publishers: int, width: int) -> tuple[list[bytes], list[JoinedFrame]]:
    """Bursts of random frames cut at random, and the frames in the order in which they end."""
    rest: dict[int, list[tuple[bytes, JoinedFrame | None]]] = {}
    for identifier in range(publishers):
        rest[identifier] = []
        for _ in range(3):
            payload = source.randbytes(source.randint(0, 6 * width // 8))
            frame = pack_frame(identifier, payload)
            cuts = sorted(place for place in range(width // 8, len(frame), width // 8) if source.random() < 0.4)
            runs = [(two - one) * 8 // width for one, two in zip([0, *cuts], cuts, strict=False)]
            *bursts, last = split_frame(frame, width, runs)
            rest[identifier] += [*((burst, None) for burst in bursts), (last, JoinedFrame(identifier, payload))]
    bursts, frames = [], []
    while any(rest.values()):
        burst, whole = rest[source.choice([identifier for identifier, left in rest.items() if left])].pop(0)
        bursts.append(burst)
        frames += [whole] if whole else []
    return bursts, frames


@pytest.mark.parametrize("width", WIDTHS)
def test_bursts_become_frames_again(driver: Driver, width: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED + width)
    for publishers in (1, 2, 5, 256):
        bursts, frames = _interleaved(source, publishers, width)
        joiner = BurstJoiner(publishers, width, LONGEST)
        assert [frame for burst in bursts if (frame := joiner.push(burst, burst[0]))] == frames
        assert joiner.unfinished == ()
        joiner.close()
        lines = [
            f"joiner {publishers} {width} {LONGEST}",
            *(f"push {burst[0]} {burst.hex()}" for burst in bursts),
            "close",
        ]
        assert driver.answers(lines) == _python_answers(lines)


def test_garbage_is_told_in_the_same_words(driver: Driver) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    lines, kinds = [], set()
    for _ in range(300):
        width = source.choice(WIDTHS[:4])
        lines.append(f"joiner {source.choice([1, 3])} {width} 20")
        for _ in range(10):
            burst = bytes([source.randint(0, 3), source.choice([0, 5, 25]), 0, 0, 0]) + bytes(source.randint(0, 20))
            burst = burst[: source.randint(0, len(burst))]
            lines.append(f"push {source.choice(['-', '-', '-', '0', '1'])} {burst.hex()}")
        lines.append("close")
    answers = _python_answers(lines)
    assert driver.answers(lines) == answers
    kinds = {" ".join(word for word in answer.split() if not any(map(str.isdigit, word))) for answer in answers}
    assert len({kind for kind in kinds if kind.startswith("error")}) >= 7, kinds


@pytest.mark.parametrize(
    ("bursts", "message"),
    [
        ([""], "the burst is empty"),
        (["04"], "the id is 4, but the publishers are 0 to 3"),
        (["0101000000"], "a burst with id 1 ends within a beat: 5 bytes at 4 per beat, and the frame is incomplete"),
        (["0101000000aabb"], "the frame with id 1 is 1 bytes longer than its header announces"),
        (
            ["01e9030000000000"],
            "the frame with id 1 announces 1001 bytes of payload; the longest payload has 1000 bytes",
        ),
        (["01040000", "01000000"], "the burst that resumes the frame with id 1 contains nothing but the id"),
        (["01040000", "0100000000aabbccddee"], "the frame with id 1 is 1 bytes longer than its header announces"),
        (["01040000", "01000000000aabbc", "close"], "the stream ends within frames: 8 bytes with id 1"),
    ],
)
def test_what_no_manager_sends_is_an_error(driver: Driver, bursts: list[str], message: str) -> None:
    lines = ["joiner 4 32 1000", *(burst if burst == "close" else f"push - {burst}" for burst in bursts)]
    assert _python_answers(lines)[-1] == f"error: {message}"
    # The frame is dropped; the next one of that id is received.
    lines += ["push - 0101000000aa"]
    assert _python_answers(lines)[-1] == "frame 1 aa"
    assert driver.answers(lines) == _python_answers(lines)


def test_an_aborted_frame_is_dropped(driver: Driver) -> None:
    """Whether it has begun or not, and however many bytes came; frames of other ids stay."""
    lines = ["joiner 4 32 1000", "push - 02040000", "push - 01040000", "abort - 0100000000aabbccdd", "abort - 03"]
    lines += ["push - 0101000000aa", "push - 0200000000aabbccdd"]
    assert _python_answers(lines)[3:] == [
        "error: the frame with id 1 was aborted",
        "error: the frame with id 3 was aborted",
        "frame 1 aa",
        "frame 2 aabbccdd",
    ]
    assert driver.answers(lines) == _python_answers(lines)


def test_tid_must_repeat_the_id(driver: Driver) -> None:
    with pytest.raises(BurstError, match="tid is 2, but the burst begins with id 1"):
        BurstJoiner(4, 8).push(b"\1\0\0\0\0", 2)
    lines = ["joiner 4 8 9", "push 2 0100000000"]
    assert driver.answers(lines) == _python_answers(lines)


@pytest.mark.parametrize(("publishers", "width"), [(0, 8), (257, 8), (1, 0), (1, 24), (1, 1024)])
def test_illegal_sizes_are_named(driver: Driver, publishers: int, width: int) -> None:
    with pytest.raises(ValueError, match=r"is \d+; legal: "):
        BurstJoiner(publishers, width)
    lines = [f"joiner {publishers} {width} 9"]
    assert driver.answers(lines) == _python_answers(lines)


@pytest.mark.parametrize("runs", [[0], [-1], [3], [1, 2]])
def test_a_frame_is_split_only_between_its_beats(runs: list[int]) -> None:
    with pytest.raises(ValueError, match="legal: 1 or more, but fewer than remain"):
        split_frame(pack_frame(1, bytes(7)), 32, runs)


def test_a_frame_in_two_bursts() -> None:
    frame = pack_frame(7, b"abcdefg")
    assert split_frame(frame, 32, [2]) == [frame[:8], b"\7\0\0\0" + frame[8:]]
    assert split_frame(frame, 32, []) == [frame]
