"""The UART in C++ over a pseudo-terminal, whose other end plays the board."""

from __future__ import annotations

import os
import pty
import random
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from fusesoc_firm.frame.codec import pack_frame
from tests.node.drivers import Driver
from tests.node.test_cpp_node import by_converter, payloads_of, puts, run

SEED = 20261122

# What a board does with a frame: bytes for the line.
Answer = Callable[[int, bytes], bytes]


@contextmanager
def board(answer: Answer, silence: float = 0.0) -> Iterator[str]:
    """A board at a line, whose name it gives; it answers the number-th frame, in pieces with `silence` between them."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    stop = threading.Event()

    def frames() -> Iterator[bytes]:
        row = b""
        while not stop.is_set():
            if select.select([ours], [], [], 0.05)[0]:
                row += os.read(ours, 4096)
            while len(row) >= 5 and len(row) >= (size := 5 + int.from_bytes(row[1:5], "little")):
                yield row[:size]
                row = row[size:]

    def play() -> None:
        for number, frame in enumerate(frames()):
            pieces = answer(number, frame).split(b"|PAUSE|")
            for place, piece in enumerate(pieces):
                if place:
                    time.sleep(silence)
                os.write(ours, piece)

    thread = threading.Thread(target=play, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        stop.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize("option", ["", ":rtscts"])
def test_frames_go_there_and_back(node_driver: Driver, option: str) -> None:
    print(f"seed {SEED}")
    messages = payloads_of(random.Random(SEED), 3, 200, 300)
    with board(lambda _, frame: frame) as line:
        outcome = run(node_driver, puts(messages), f"uart:{line}:1000000{option}", converters=3)
    assert outcome.said["status"] == "0" and outcome.count("errors") == 0
    assert outcome.published == by_converter(messages)
    # The one that opens the line.
    assert outcome.count("breaks") == 1


@pytest.mark.parametrize(
    "garbage",
    [
        b"\xff" * 20 + pack_frame(0, b"lost"),  # no such publisher
        b"\0\xff\xff\xff\xff" + bytes(20) + pack_frame(0, b"lost"),  # longer than any payload
        b"\0\x10\0\0\0half",  # a frame that does not go on
    ],
)
def test_bytes_that_are_no_frame_are_dropped_until_the_line_is_silent(node_driver: Driver, garbage: bytes) -> None:
    """What the board sends in the same breath is lost, what it sends after a silence is not."""

    def answer(number: int, frame: bytes) -> bytes:
        return garbage + b"|PAUSE|" + frame if number == 2 else frame

    lines = ["put 0 00", "await 1", "put 1 01", "await 2", "put 0 02", "await 3", "put 1 03"]
    with board(answer, silence=0.6) as line:
        outcome = run(node_driver, lines, f"uart:{line}:115200")
    assert outcome.said["status"] == "0"
    assert outcome.published == {0: [b"\0", b"\2"], 1: [b"\1", b"\3"]}
    assert (outcome.count("errors"), outcome.count("breaks")) == (1, 2)


def test_nothing_is_sent_that_would_be_answered_before_the_line_is_silent(node_driver: Driver) -> None:
    """Of more frames than the line holds, only those are lost whose answers follow garbage."""
    lines = [f"put 0 {number:04x}{'00' * 500}" for number in range(300)]
    with board(lambda number, frame: b"\xff" + frame if number == 20 else frame) as line:
        outcome = run(node_driver, lines, f"uart:{line}:115200")
    found = [int.from_bytes(payload[:2]) for payload in outcome.published[0]]
    assert found == sorted(found) and found[:20] == [*range(20)] and found[-1] == 299
    lost = sorted({*range(300)} - {*found})
    assert lost == [*range(20, 20 + len(lost))] and lost
    assert outcome.count("errors") == 1


def test_what_came_before_the_line_was_opened_is_no_frame(node_driver: Driver) -> None:
    """A board that was in the middle of a frame."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    try:
        os.write(ours, b"\0\4\0\0\0ol")
        outcome = run(node_driver, [], f"uart:{os.ttyname(theirs)}:115200")
    finally:
        os.close(ours)
        os.close(theirs)
    assert outcome.said["status"] == "0" and outcome.count("errors") == 0 and outcome.published == {}


def test_a_board_that_is_never_silent_cannot_be_read(node_driver: Driver) -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    stop = threading.Event()

    def chatter() -> None:
        while not stop.wait(0.01):
            os.write(ours, b"\0")

    thread = threading.Thread(target=chatter, daemon=True)
    thread.start()
    outcome = run(node_driver, [], f"uart:{os.ttyname(theirs)}:115200")
    stop.set()
    thread.join()
    os.close(ours)
    os.close(theirs)
    assert outcome.said["error"].endswith("the board is never silent, so the start of a frame cannot be found")


def test_a_line_that_goes_ends_the_node(node_driver: Driver) -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    line = os.ttyname(theirs)
    threading.Timer(1.0, os.close, [ours]).start()
    # It waits for an answer that does not come.
    outcome = run(node_driver, ["put 0 00", "await 1"], f"uart:{line}:115200")
    os.close(theirs)
    assert outcome.said["status"] == "1"
    assert outcome.said["error"].startswith(line)


def test_legal_rates_are_named(node_driver: Driver) -> None:
    ours, theirs = pty.openpty()
    try:
        outcome = run(node_driver, [], f"uart:{os.ttyname(theirs)}:12345")
    finally:
        os.close(ours)
        os.close(theirs)
    assert outcome.said["error"].startswith("the baud rate is 12345; legal: 9600, 19200, ")
