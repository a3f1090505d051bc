"""AXI DMA without scatter-gather, through the channels of PYNQ's driver, for block designs that users draw.

A channel transfers one buffer at a time: while a received burst is copied, the system waits. cocotbpynq simulates such
designs. Its channels tell neither whether they are idle nor how many bytes they received, its engine drives no `tkeep`
and has no registers.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol, cast

from fusesoc_firm.node.transport.abort_record import burst_of
from fusesoc_firm.node.transport.dma import has_reset
from fusesoc_firm.node.transport.dma_device import DMA_ALIGNMENT, POLL_SECONDS, Registers
from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError
from fusesoc_firm.node.transport.whole_beats import frame_in, in_whole_beats


class Channel(Protocol):
    """What all channels have. PYNQ's also have `start`, `idle`, `error` and `transferred`."""

    def transfer(self, array: Any, start: int = 0, nbytes: int = 0) -> None:
        """Begin a transfer."""

    def wait(self) -> None:
        """Wait for its end. May raise `RuntimeError`."""


class Dma(Protocol):
    """PYNQ's driver of an engine, such as `overlay.dma`, which also has `buffer_max_size`, `read` and `write`."""

    @property
    def sendchannel(self) -> Channel:
        """The channel to the system."""

    @property
    def recvchannel(self) -> Channel:
        """The channel from the system."""


class ChannelTransport(Closing):
    """A transport over both channels of an engine."""

    def __init__(self, dma: Dma, allocate: Callable[..., Any], size: int = 2**16, beat_bytes: int = 0) -> None:
        """Reset the engine, and begin to receive; `allocate` is PYNQ's.

        No frame to the system, and no burst from the system, has more than `size` bytes, or fewer if the engine is
        built for fewer. An engine that does not drive `tkeep` has beats of `beat_bytes` bytes. May raise
        `TransportError`.
        """
        self._size = min(size, getattr(dma, "buffer_max_size", size)) // DMA_ALIGNMENT * DMA_ALIGNMENT
        self._beat_bytes = beat_bytes
        self._dma = dma
        self._to_system, self._from_system = dma.sendchannel, dma.recvchannel
        self._sent, self._received = (allocate(shape=(self._size,), dtype="u1") for _ in range(2))
        self._sends = self._is_closed = False
        if not self._reset():
            raise TransportError("the DMA engine does not leave reset; check the engine's clock")
        for channel in (self._to_system, self._from_system):
            getattr(channel, "start", lambda: None)()
        self._begin(self._from_system, self._received, self._size)

    def send(self, frame: bytes) -> None:
        """Send a whole frame; wait for the end of the last transfer. May raise `TransportError`."""
        while not self.has_room(len(frame)):
            time.sleep(POLL_SECONDS)
        data = in_whole_beats(frame, self._beat_bytes) if self._beat_bytes else frame
        if len(data) > self._size:
            raise TransportError(f"a frame has {len(data)} bytes; the buffer has {self._size}")
        if self._sends:
            self._end(self._to_system)
        memoryview(self._sent)[: len(data)] = data
        self._begin(self._to_system, self._sent, len(data))
        self._sends = True

    def is_ready(self) -> bool:
        """Return whether the last transfer has ended."""
        return self.has_room(0)

    def has_room(self, size: int) -> bool:
        """Return whether the last transfer has ended, so that any frame can be sent. May raise `TransportError`."""
        self._check_open()
        return not self._sends or _is_over(self._to_system)

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next burst, as `Transport.receive` does.

        A channel without `idle` is not waited for if `timeout` is 0, else without a limit.
        """
        if timeout == 0 and not hasattr(self._from_system, "idle"):
            return None
        end = None if timeout is None else time.monotonic() + timeout
        while not self._is_closed:
            if _is_over(self._from_system):
                return self._take()
            if end is not None and time.monotonic() >= end:
                break
            time.sleep(POLL_SECONDS)
        return None

    def is_at_rest(self) -> None:
        """Return None, because the engine cannot determine whether the hardware is working."""

    def close(self) -> None:
        """Stop the engine, so that it does not write to memory that has been released. A second call does nothing."""
        if not self._is_closed:
            self._is_closed = True
            self._reset()

    def _reset(self) -> bool:
        return has_reset(cast("Registers", self._dma)) if hasattr(self._dma, "write") else True

    def _take(self) -> Burst:
        """Return the received burst, and begin to receive the next one."""
        self._end(self._from_system)
        size = getattr(self._from_system, "transferred", self._size)
        data = bytes(memoryview(self._received)[:size])
        self._begin(self._from_system, self._received, self._size)
        return burst_of(frame_in(data) if self._beat_bytes else data)

    def _begin(self, channel: Channel, array: Any, size: int) -> None:
        try:
            channel.transfer(array, nbytes=size)
        except RuntimeError as error:
            raise TransportError(f"the DMA engine begins no transfer: {error}") from None

    def _end(self, channel: Channel) -> None:
        try:
            channel.wait()
        except RuntimeError as error:
            raise TransportError(f"the DMA engine has failed: {error}") from None

    def _check_open(self) -> None:
        if self._is_closed:
            raise TransportError("the transport is closed")


def _is_over(channel: Channel) -> bool:
    """Return whether a transfer has ended; `wait` tells an error, and waits for a channel that does not tell this."""
    return bool(getattr(channel, "idle", True) or getattr(channel, "error", False))
