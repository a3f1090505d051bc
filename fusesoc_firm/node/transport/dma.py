"""AXI DMA between memory and the system's streams, for the block design of a board with a processor.

The engine supports scatter-gather, 26-bit lengths and 32-bit addresses, but not realignment
(docs/how-to/build-for-a-board.md). Each direction has a ring of descriptors, each with a buffer. Frames are copied into
free buffers, and bursts fill the next free buffers. A frame or burst that is longer than a buffer continues in the next
buffer. PG021 (AXI DMA) describes registers and descriptors.

Python has no barrier between memory and registers. This module relies on the many instructions that the interpreter
executes between a write to memory and a write to a register; a C++ program could not rely on them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag

from fusesoc_firm.node.transport.abort_record import burst_of
from fusesoc_firm.node.transport.dma_device import DMA_ALIGNMENT, DmaDevice, Registers
from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError

# The addresses of the first registers of the channels to and from the system; other registers are at offsets from them.
TO_SYSTEM, FROM_SYSTEM = 0x00, 0x30
CONTROL, STATUS, FIRST_DESCRIPTOR, LAST_DESCRIPTOR = 0x00, 0x04, 0x08, 0x10
_NAMES = {TO_SYSTEM: "MM2S", FROM_SYSTEM: "S2MM"}


class Control(IntFlag):
    """The bits of a channel's control register."""

    RUN = 1 << 0
    RESET = 1 << 2
    INTERRUPT_ON_COMPLETE = 1 << 12
    INTERRUPT_ON_ERROR = 1 << 14
    ONE_FRAME_AN_INTERRUPT = 1 << 16


class Status(IntFlag):
    """The bits of a channel's status register."""

    HALTED = 1 << 0
    HAS_SCATTER_GATHER = 1 << 3
    INTERRUPTS = 7 << 12


_FAULTS = {
    1 << 4: "DMAIntErr (internal)",
    1 << 5: "DMASlvErr (response from memory)",
    1 << 6: "DMADecErr (address)",
    1 << 8: "SGIntErr (descriptor)",
    1 << 9: "SGSlvErr (response from memory)",
    1 << 10: "SGDecErr (address)",
}

# The words of a descriptor, and the bits in the descriptor's control and status words.
DESCRIPTOR_BYTES = 64
NEXT, BUFFER, DESCRIPTOR_CONTROL, DESCRIPTOR_STATUS = 0, 2, 6, 7
LENGTH, END_OF_FRAME, START_OF_FRAME, COMPLETE = (1 << 26) - 1, 1 << 26, 1 << 27, 1 << 31
_RESET_SECONDS = 1.0
# The interrupt comes at the end of a frame. For one that is longer than all buffers, they must be emptied before.
_LOOK_SECONDS = 0.01
_SHORTEST_PAUSE, _LONGEST_PAUSE = 5e-6, 500e-6


@dataclass(frozen=True)
class DmaBuffers:
    """The number of buffers per direction, and the size of each in bytes: a multiple of 64, or 0 for the maximum."""

    send: int = 16
    receive: int = 16
    size: int = 0


class _Ring:
    """The descriptors and buffers of one direction, used in turn."""

    def __init__(self, device: DmaDevice, channel: int, count: int, places: tuple[int, int, int]) -> None:
        """Create a ring.

        `places` are the memory offsets of descriptors and buffers, and the size of each buffer in bytes.
        """
        self._device, self._channel, self._count = device, channel, count
        self._descriptors, self._buffers, self.size = places
        self._words = device.memory.cast("I")
        for index in range(count):
            for word in range(DESCRIPTOR_BYTES // 4):
                self._set(index, word, 0)
            self._set(index, NEXT, self._address(self.next(index)))
            self._set(index, BUFFER, device.address + self._buffers + index * self.size)

    def start(self, interrupts: int) -> None:
        """Start the channel, which then waits for descriptors."""
        self._device.write(self._channel + FIRST_DESCRIPTOR, self._address(0))
        self._device.write(self._channel + CONTROL, Control.RUN | Control.ONE_FRAME_AN_INTERRUPT | interrupts)

    def next(self, index: int) -> int:
        """Return the index of the descriptor after `index`."""
        return (index + 1) % self._count

    def buffer(self, index: int) -> memoryview:
        """Return the buffer of a descriptor."""
        first = self._buffers + index * self.size
        return self._device.memory[first : first + self.size]

    def hand_over(self, index: int, control: int) -> None:
        """Hand a descriptor with its control word to the engine."""
        self._set(index, DESCRIPTOR_CONTROL, control)
        self._set(index, DESCRIPTOR_STATUS, 0)
        self._device.write(self._channel + LAST_DESCRIPTOR, self._address(index))

    def done(self, index: int) -> int | None:
        """Return the status word of a descriptor, or None until the engine has completed the descriptor."""
        status = self._words[self._place(index) + DESCRIPTOR_STATUS]
        return status if status & COMPLETE else None

    def _place(self, index: int) -> int:
        return (self._descriptors + index * DESCRIPTOR_BYTES) // 4

    def _address(self, index: int) -> int:
        return self._device.address + self._descriptors + index * DESCRIPTOR_BYTES

    def _set(self, index: int, word: int, value: int) -> None:
        self._words[self._place(index) + word] = value


class DmaTransport(Closing):
    """A transport over AXI DMA."""

    def __init__(self, device: DmaDevice, buffers: DmaBuffers | None = None, longest: int = 2**26) -> None:
        """Reset the engine and thereby the system.

        No burst has more than `longest` bytes. May raise `TransportError`.
        """
        self._device = device
        self._longest = longest
        self._buffers = buffers or DmaBuffers()
        self._closing = threading.Event()
        self._sending, self._receiving = threading.Lock(), threading.Lock()
        size = self._buffer_bytes()
        count = self._buffers.send + self._buffers.receive
        first_buffer = count * DESCRIPTOR_BYTES
        self._to_system = _Ring(device, TO_SYSTEM, self._buffers.send, (0, first_buffer, size))
        self._from_system = _Ring(
            device,
            FROM_SYSTEM,
            self._buffers.receive,
            (self._buffers.send * DESCRIPTOR_BYTES, first_buffer + self._buffers.send * size, size),
        )
        # Sender: the next descriptor, the first descriptor that the engine owns, and the number of descriptors that it
        # owns.
        self._next_sent, self._first_sent, self._handed_over = 0, 0, 0
        # Receiver: the descriptor whose buffer is filled next, and the bytes of the current burst.
        self._next_received, self._burst = 0, bytearray()
        self._start()

    def send(self, frame: bytes) -> None:
        """Send a whole frame; wait while all buffers are in use. May raise `TransportError`."""
        with self._sending:
            rest, mark = memoryview(frame), START_OF_FRAME
            while rest:
                self._wait_for_room()
                part = rest[: self._to_system.size]
                rest = rest[len(part) :]
                self._to_system.buffer(self._next_sent)[: len(part)] = part
                self._to_system.hand_over(self._next_sent, len(part) | mark | (0 if rest else END_OF_FRAME))
                self._next_sent = self._to_system.next(self._next_sent)
                self._handed_over += 1
                mark = 0

    def is_ready(self) -> bool:
        """Return False, because the number of buffers that a frame needs is unknown."""
        return False

    def has_room(self, size: int) -> bool:
        """Return whether free buffers hold a frame of this size in bytes, or all buffers are free.

        May raise `TransportError`.
        """
        self._take_back()
        return not self._handed_over or size <= (self._buffers.send - self._handed_over) * self._to_system.size

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next burst, as `Transport.receive` does."""
        end = None if timeout is None else time.monotonic() + timeout
        with self._receiving:
            while not self._closing.is_set():
                if (status := self._from_system.done(self._next_received)) is not None:
                    if self._take(status):
                        burst, self._burst = bytes(self._burst), bytearray()
                        return burst_of(burst)
                    continue
                # A caller without further frames would not notice the loss of a frame in transit.
                self._check(TO_SYSTEM)
                self._check(FROM_SYSTEM)
                rest = None if end is None else end - time.monotonic()
                if rest is not None and rest <= 0:
                    break
                # Acknowledge the interrupt before checking the descriptors, so that no completion is missed.
                self._device.write(FROM_SYSTEM + STATUS, Status.INTERRUPTS)
                if self._from_system.done(self._next_received) is None:
                    self._device.wait(_LOOK_SECONDS if rest is None else min(rest, _LOOK_SECONDS))
        return None

    def is_at_rest(self) -> None:
        """Return None, because the engine cannot determine whether the hardware is working."""

    def close(self) -> None:
        """Stop the engine, so that it does not write to memory that has been released. A second call does nothing."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._device.end()
        with self._receiving, self._sending:
            self._reset()

    def _buffer_bytes(self) -> int:
        """Return the size of each buffer in bytes.

        Raise `TransportError` if the size or number of buffers is illegal.
        """
        count, size = self._buffers.send + self._buffers.receive, self._buffers.size
        room = len(self._device.memory) - count * DESCRIPTOR_BYTES
        most = min(max(0, room) // max(1, count), LENGTH) // DMA_ALIGNMENT * DMA_ALIGNMENT
        size = size or most
        if min(self._buffers.send, self._buffers.receive) < 2 or size % DMA_ALIGNMENT or not 0 < size <= most:
            raise TransportError(
                f"the DMA has {self._buffers.send} and {self._buffers.receive} buffers of {size} bytes; legal: 2 or"
                f" more, a multiple of {DMA_ALIGNMENT}, and all within the {len(self._device.memory)} bytes of memory"
            )
        return size

    def _start(self) -> None:
        if not self._reset():
            raise TransportError("the DMA engine does not leave reset; check the engine's clock")
        if not self._device.read(TO_SYSTEM + STATUS) & Status.HAS_SCATTER_GATHER:
            raise TransportError(
                "the DMA engine does not support scatter-gather, so it is not from a generated block design"
            )
        self._to_system.start(Control.INTERRUPT_ON_ERROR)
        self._from_system.start(Control.INTERRUPT_ON_COMPLETE | Control.INTERRUPT_ON_ERROR)
        if not all(_soon(self._runs(channel)) for channel in (TO_SYSTEM, FROM_SYSTEM)):
            raise TransportError("the DMA engine does not start")
        for index in range(self._buffers.receive):
            self._from_system.hand_over(index, self._from_system.size)

    def _runs(self, channel: int) -> Callable[[], bool]:
        return lambda: not self._device.read(channel + STATUS) & Status.HALTED

    def _reset(self) -> bool:
        return has_reset(self._device)

    def _wait_for_room(self) -> None:
        pause = _SHORTEST_PAUSE
        while True:
            self._take_back()
            if self._handed_over < self._buffers.send:
                return
            # The only interrupt of UIO belongs to the receiver.
            time.sleep(pause)
            pause = min(2 * pause, _LONGEST_PAUSE)

    def _take_back(self) -> None:
        """Take back the buffers that the engine has sent."""
        if self._closing.is_set():
            raise TransportError("the transport is closed")
        self._check(TO_SYSTEM)
        while self._handed_over and self._to_system.done(self._first_sent) is not None:
            self._first_sent = self._to_system.next(self._first_sent)
            self._handed_over -= 1

    def _take(self, status: int) -> bool:
        """Append the content of a buffer; return whether the burst is complete."""
        size = status & LENGTH
        if size > self._from_system.size:
            raise TransportError("the DMA engine wrote past the end of a buffer")
        if status & START_OF_FRAME:
            self._burst.clear()
        self._burst += self._from_system.buffer(self._next_received)[:size]
        if len(self._burst) > self._longest:
            raise TransportError(f"a burst is longer than {self._longest} bytes")
        self._from_system.hand_over(self._next_received, self._from_system.size)
        self._next_received = self._from_system.next(self._next_received)
        return bool(status & END_OF_FRAME)

    def _check(self, channel: int) -> None:
        status = self._device.read(channel + STATUS)
        found = [text for bit, text in _FAULTS.items() if status & bit]
        if status & Status.HALTED and not found:
            found = ["the channel has halted"]
        if found and not self._closing.is_set():
            raise TransportError(f"the DMA engine's {_NAMES[channel]}: {', '.join(found)}")


def has_reset(registers: Registers) -> bool:
    """Reset both channels of an engine with a single reset; return whether the reset has finished."""
    # PYNQ's registers take no subclass of int.
    registers.write(TO_SYSTEM + CONTROL, int(Control.RESET))
    return _soon(lambda: not registers.read(TO_SYSTEM + CONTROL) & Control.RESET)


def _soon(condition: Callable[[], bool]) -> bool:
    """Return whether a condition becomes true within a short time."""
    end = time.monotonic() + _RESET_SECONDS
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(_SHORTEST_PAUSE)
    return True
