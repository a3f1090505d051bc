"""AXI DMA through PYNQ, instead of UIO and u-dma-buf: registers by its `MMIO`, memory by its `allocate`.

This module imports nothing of PYNQ. PYNQ allocates memory that is not cached, unless it is asked to.
"""

from __future__ import annotations

import time
from typing import Any

from fusesoc_firm.node.transport.dma_device import POLL_SECONDS, Registers, check_place


class PynqDmaDevice:
    """The engine of an overlay. PYNQ's interrupts serve coroutines only, so the registers are polled."""

    def __init__(self, registers: Registers, memory: Any) -> None:
        """Use an `MMIO` of the engine's registers, and an array of bytes from `allocate`.

        Raise `TransportError` if the engine cannot reach the array.
        """
        self._registers = registers
        # The array releases the memory at its end.
        self._array = memory
        self._memory = memoryview(memory)
        check_place("the allocated memory", self.address, self._memory.nbytes)

    @property
    def memory(self) -> memoryview:
        """The memory that processor and engine share."""
        return self._memory

    @property
    def address(self) -> int:
        """The address of the memory's first byte, as the engine sees it."""
        return int(self._array.physical_address)

    def read(self, offset: int) -> int:
        """Return the value of the register at `offset` (in bytes)."""
        return self._registers.read(offset)

    def write(self, offset: int, value: int) -> None:
        """Set the register at `offset` (in bytes)."""
        # `MMIO` refuses subclasses of int.
        self._registers.write(offset, int(value))

    def wait(self, timeout: float | None) -> None:
        """Wait for a short time, but no longer than `timeout` (in seconds)."""
        time.sleep(POLL_SECONDS if timeout is None else min(timeout, POLL_SECONDS))

    def end(self) -> None:
        """Do nothing, since each wait is short."""
