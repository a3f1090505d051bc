"""The model of AXI DMA beside the product guide: registers, interrupts and errors that no driver brings about."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator

import pytest

from tests.node.dma_engine import (
    DMA_DECODE,
    DMA_INTERNAL,
    HALTED,
    MM2S,
    S2MM,
    SG_DECODE,
    SG_INTERNAL,
    Built,
    Engine,
)

ADDRESS = 0x1000_0000
CONTROL, STATUS, CURRENT, TAIL = 0x00, 0x04, 0x08, 0x10
RUN, RESET, IDLE = 1, 4, 2
IOC, DELAY, ERROR = 1 << 12, 1 << 13, 1 << 14
BUFFERS = 1024
"""The place of the buffers, of 64 bytes each."""
COMPLETE, START, END = 1 << 31, 1 << 27, 1 << 26


class Bench:
    """An engine, and descriptors at 0 for MM2S and at 512 for S2MM."""

    def __init__(self, built: Built) -> None:
        self.memory = memoryview(bytearray(4096))
        self.engine = Engine(self.memory, ADDRESS, built=built)

    def describe(self, place: int, control: int, *, status: int = 0, buffer: int | None = None) -> None:
        address = ADDRESS + BUFFERS + place if buffer is None else buffer
        words = (ADDRESS + place + 64, 0, address, 0, 0, 0, control, status)
        struct.pack_into("<8I", self.memory, place, *words)

    def status(self, place: int) -> int:
        return int.from_bytes(self.memory[place + 0x1C : place + 0x20], "little")

    def start(self, channel: int, first: int, control: int = 0) -> None:
        self.engine.write(channel + CURRENT, ADDRESS + first)
        self.engine.write(channel + CONTROL, RUN | control)

    def hand_over(self, channel: int, last: int) -> None:
        self.engine.write(channel + TAIL, ADDRESS + last)

    def wait(self, channel: int, bits: int) -> int:
        """Wait until bits of the status are set."""
        while (status := self.engine.read(channel + STATUS)) & bits != bits:
            time.sleep(0.001)
        return status

    def send(self, count: int, control: int) -> None:
        """Send `count` frames of 8 bytes; S2MM starts with this control word."""
        for number in range(count):
            self.describe(64 * number, 8 | START | END)
            self.describe(512 + 64 * number, 64)
        self.start(MM2S, 0)
        self.start(S2MM, 512, control)
        self.hand_over(S2MM, 512 + 64 * (count - 1))
        self.hand_over(MM2S, 64 * (count - 1))
        self.wait(S2MM, IDLE)


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(getattr(request, "param", Built()))
    yield made
    made.engine.close()


def test_values_after_a_reset(bench: Bench) -> None:
    """Halted with SGIncld, a threshold of 1; one channel's reset is that of both and takes time."""
    for channel in (MM2S, S2MM):
        assert (bench.engine.read(channel), bench.engine.read(channel + STATUS)) == (0x10002, 0x10009)
    bench.start(S2MM, 512)
    bench.engine.write(MM2S, RESET)
    assert bench.engine.read(MM2S) & RESET
    while bench.engine.read(MM2S) & RESET:
        time.sleep(0.001)
    assert bench.engine.read(S2MM + STATUS) & HALTED
    assert not bench.engine.broken


@pytest.mark.parametrize("bench", [Built(has_scatter_gather=False)], indirect=True)
def test_an_engine_without_scatter_gather(bench: Bench) -> None:
    assert bench.engine.read(STATUS) == 0x10001


def test_a_frame_in_parts(bench: Bench) -> None:
    """Each descriptor is completed by itself; the first has RXSOF, the last RXEOF; then the channel is idle."""
    bench.memory[BUFFERS : BUFFERS + 64] = bytes(range(64))
    bench.describe(0, 64 | START)
    bench.describe(64, 8 | END)
    for place, size in ((512, 32), (576, 32), (640, 64)):
        bench.describe(place, size)
    bench.start(MM2S, 0)
    bench.start(S2MM, 512, IOC)
    bench.hand_over(MM2S, 64)
    bench.hand_over(S2MM, 640)
    assert bench.wait(S2MM, IDLE) & IOC
    assert [bench.status(place) for place in (0, 64)] == [64 | COMPLETE, 8 | COMPLETE]
    expected = [32 | COMPLETE | START, 32 | COMPLETE, 8 | COMPLETE | END]
    assert [bench.status(place) for place in (512, 576, 640)] == expected
    assert bench.memory[BUFFERS + 512 : BUFFERS + 544] == bytes(range(32))


def test_a_threshold_counts_frames_and_a_written_one_clears(bench: Bench) -> None:
    bench.send(3, IOC | 3 << 16)
    assert bench.engine.read(S2MM + STATUS) & IOC
    assert bench.engine.wait_for_interrupt(lambda: False)
    bench.engine.write(S2MM + STATUS, ERROR)
    assert bench.engine.read(S2MM + STATUS) & IOC
    bench.engine.write(S2MM + STATUS, IOC)
    assert not bench.engine.read(S2MM + STATUS) & IOC


def test_a_threshold_that_is_not_reached_is_shown(bench: Bench) -> None:
    bench.send(3, IOC | 5 << 16)
    status = bench.engine.read(S2MM + STATUS)
    assert (status >> 16 & 0xFF, status & (IOC | DELAY)) == (2, 0)


def test_the_delay_interrupts_below_the_threshold(bench: Bench) -> None:
    bench.send(3, IOC | DELAY | 5 << 16 | 200 << 24)
    assert not bench.wait(S2MM, DELAY) & IOC
    assert bench.engine.wait_for_interrupt(lambda: False)


@pytest.mark.parametrize(
    ("control", "status", "buffer", "error"),
    [
        (8 | START | END, COMPLETE, None, SG_INTERNAL),
        (START | END, 0, None, DMA_INTERNAL),
        (8 | START | END, 0, ADDRESS + 4096, DMA_DECODE),
    ],
)
def test_a_wrong_descriptor_halts(bench: Bench, control: int, status: int, buffer: int | None, error: int) -> None:
    """RS is cleared, the channel halts and stays at the descriptor, which has the errors of a transfer."""
    bench.describe(0, control, status=status, buffer=buffer)
    bench.start(MM2S, 0, ERROR)
    bench.hand_over(MM2S, 0)
    assert bench.wait(MM2S, HALTED | error | ERROR) & 0x7F0 == error
    assert not bench.engine.read(MM2S) & RUN
    assert bench.engine.read(CURRENT) == ADDRESS
    assert bench.status(0) == (status or (error << 24))


def test_a_descriptor_beyond_the_memory_halts(bench: Bench) -> None:
    bench.start(MM2S, 1 << 20)
    bench.hand_over(MM2S, 1 << 20)
    bench.wait(MM2S, HALTED | SG_DECODE)


@pytest.mark.parametrize("bench", [Built(length_bits=14)], indirect=True)
def test_lengths_have_the_bits_that_were_built(bench: Bench) -> None:
    bench.describe(0, 8 | 1 << 14 | START | END)
    bench.start(MM2S, 0)
    bench.hand_over(MM2S, 0)
    bench.wait(MM2S, IDLE)
    assert bench.status(0) == 8 | COMPLETE


def test_a_rule_that_is_broken_is_kept(bench: Bench) -> None:
    bench.engine.write(MM2S, RUN)
    bench.engine.write(CURRENT, ADDRESS)
    bench.engine.write(TAIL + 4, 0)
    bench.engine.read(0x18)
    assert [rule.split()[0] for rule in bench.engine.broken] == ["the", "an", "a"]
