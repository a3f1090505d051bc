"""The UART in C++ over a pseudo-terminal, whose other end plays the board."""

from __future__ import annotations

import os
import pty
import random
import select
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from fusesoc_firm.frame.codec import pack_frame
from tests.links import coded, decoded
from tests.node.drivers import Driver
from tests.node.test_cpp_node import by_converter, payloads_of, puts, run
from tests.seeds import seeded

SEED = seeded(20261122)

# What a board does with a frame: bytes for the line.
Answer = Callable[[int, bytes], bytes]


@contextmanager
def board(answer: Answer) -> Iterator[str]:
    """A board at a line, whose name it gives; it answers the number-th frame."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    stop = threading.Event()

    def frames() -> Iterator[bytes]:
        row = b""
        while not stop.is_set():
            if select.select([ours], [], [], 0.05)[0]:
                row += os.read(ours, 4096)
            *_, begun = row.split(b"\0")
            for frame in decoded(row):
                assert frame is not None
                yield frame
            row = begun

    def play() -> None:
        for number, frame in enumerate(frames()):
            os.write(ours, answer(number, frame))

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
    with board(lambda _, frame: coded(frame)) as line:
        outcome = run(node_driver, puts(messages), f"uart:{line}:1000000{option}", converters=3)
    assert outcome.said["status"] == "0" and outcome.count("errors") == 0
    assert outcome.published == by_converter(messages)
    # The one that opens the line.
    assert outcome.count("breaks") == 1


@pytest.mark.parametrize(
    "broken",
    [
        coded(pack_frame(0, b"lost"))[1:],
        coded(b"\0\5\0\0\0lost"),
        coded(b"\0\3\0\0\0lost"),
        coded(b"\0\4"),
        b"\5\0",
    ],
)
def test_a_broken_frame_costs_itself_alone(node_driver: Driver, broken: bytes) -> None:
    lines = ["put 0 00", "await 1", "put 1 01", "await 2", "put 0 02", "await 3", "put 1 03"]
    with board(lambda number, frame: coded(frame) + (broken + b"\0" if number == 1 else b"")) as line:
        outcome = run(node_driver, lines, f"uart:{line}:115200")
    assert outcome.said["status"] == "0"
    assert outcome.published == {0: [b"\0", b"\2"], 1: [b"\1", b"\3"]}
    assert (outcome.count("errors"), outcome.count("breaks")) == (1, 1)


def test_the_rest_of_a_frame_is_no_fault(node_driver: Driver) -> None:
    """The board was in the middle of a frame when the line was opened."""
    with board(lambda number, frame: (b"" if number else b"lost\0") + coded(frame)) as line:
        outcome = run(node_driver, ["put 0 00"], f"uart:{line}:115200")
    assert outcome.said["status"] == "0" and outcome.count("errors") == 0 and outcome.published == {0: [b"\0"]}


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
