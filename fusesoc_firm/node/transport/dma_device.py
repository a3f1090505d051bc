"""Access to AXI DMA from user space under Linux: registers, an interrupt, and memory shared with the engine.

UIO provides the registers and the interrupt, and u-dma-buf (https://github.com/ikwzm/udmabuf) provides the memory.
"""

from __future__ import annotations

import mmap
import os
import select
import time
from pathlib import Path
from typing import Protocol

from fusesoc_firm.node.transport.transport import TransportError

# Descriptors and buffers begin at multiples of the widest stream's beat.
DMA_ALIGNMENT = 64
# Bytes.
DMA_REACH = 2**32
_WORD_BYTES = 4
POLL_SECONDS = 50e-6
# The mode of u-dma-buf that is neither cached nor mapped as device memory; device memory allows only aligned accesses.
_WRITE_COMBINE = "2"


class Registers(Protocol):
    """The driver's only access to the engine's registers. In tests, it is a model of the engine."""

    def read(self, offset: int) -> int:
        """Return the value of the register at `offset` (in bytes)."""

    def write(self, offset: int, value: int) -> None:
        """Set the register at `offset` (in bytes)."""


class DmaDevice(Registers, Protocol):
    """The driver's interface to the engine."""

    @property
    def memory(self) -> memoryview:
        """The memory that processor and engine share."""

    @property
    def address(self) -> int:
        """The address of the memory's first byte, as the engine sees it."""

    def wait(self, timeout: float | None) -> None:
        """Wait for an unacknowledged interrupt, the timeout (in seconds) or a call of `end`."""

    def end(self) -> None:
        """Wake all threads that wait, now and later."""


class MappedRegisters:
    """The registers in the first map of a UIO device, open as `file`."""

    def __init__(self, file: int, size: int) -> None:
        self._words = memoryview(mmap.mmap(file, size)).cast("I")

    def read(self, offset: int) -> int:
        """Return the value of the register at `offset` (in bytes)."""
        return self._words[offset // _WORD_BYTES]

    def write(self, offset: int, value: int) -> None:
        """Set the register at `offset` (in bytes)."""
        self._words[offset // _WORD_BYTES] = value


class LinuxDmaDevice:
    """The engine of a board that runs Linux."""

    def __init__(
        self,
        uio: str,
        buffer: str,
        *,
        has_interrupt: bool,
        root: Path = Path("/"),
        registers: Registers | None = None,
    ) -> None:
        """Open the engine; `uio` is a device such as /dev/uio0, `buffer` a name such as udmabuf0.

        The first map of `uio` holds the registers, unless they are given. Without an interrupt, the registers are
        polled every 50 us. All paths begin with `root`. May raise `TransportError`.
        """
        self._has_interrupt = has_interrupt
        about = root / "sys/class/u-dma-buf" / buffer
        if not about.is_dir():
            # The path that older releases of u-dma-buf use.
            about = root / "sys/class/udmabuf" / buffer
        self._address, size = number_in(about / "phys_addr"), number_in(about / "size")
        check_place(buffer, self._address, size)
        maps = root / "sys/class/uio" / Path(uio).name / "maps/map0"
        device = root / uio.lstrip("/")
        try:
            (about / "sync_mode").write_text(_WRITE_COMBINE, encoding="ascii")
            self._interrupt = os.open(device, os.O_RDWR | os.O_SYNC)
            self._registers = registers or MappedRegisters(self._interrupt, number_in(maps / "size"))
            shared = os.open(root / "dev" / buffer, os.O_RDWR | os.O_SYNC)
            try:
                self._memory = memoryview(mmap.mmap(shared, size))
            finally:
                os.close(shared)
        except (OSError, ValueError) as error:
            raise TransportError(f"cannot use the DMA devices {uio} and {buffer}: {error}") from None
        self._wake, self._woken = os.pipe()

    @property
    def memory(self) -> memoryview:
        """The memory that processor and engine share."""
        return self._memory

    @property
    def address(self) -> int:
        """The address of the memory's first byte, as the engine sees it."""
        return self._address

    def read(self, offset: int) -> int:
        """Return the value of the register at `offset` (in bytes)."""
        return self._registers.read(offset)

    def write(self, offset: int, value: int) -> None:
        """Set the register at `offset` (in bytes)."""
        self._registers.write(offset, value)

    def wait(self, timeout: float | None) -> None:
        """Wait for an unacknowledged interrupt, the timeout (in seconds) or a call of `end`."""
        if not self._has_interrupt:
            time.sleep(POLL_SECONDS)
            return
        try:
            # The kernel disables the interrupt when it occurs.
            os.write(self._interrupt, (1).to_bytes(_WORD_BYTES, "little"))
            if self._interrupt in select.select([self._interrupt, self._wake], [], [], timeout)[0]:
                os.read(self._interrupt, _WORD_BYTES)
        except OSError as error:
            raise TransportError(f"cannot wait for the DMA engine's interrupt: {error.strerror}") from None

    def end(self) -> None:
        """Wake all threads that wait, now and later."""
        os.close(self._woken)


def check_place(buffer: str, address: int, size: int) -> None:
    """Raise `TransportError` unless the engine can use the memory of this name."""
    if address + size > DMA_REACH:
        raise TransportError(f"{buffer} ends beyond the 4 GiB that the DMA engine reaches")
    if address % DMA_ALIGNMENT:
        raise TransportError(f"{buffer} begins at {address:#x}, which is not a multiple of {DMA_ALIGNMENT}")


def number_in(path: Path) -> int:
    """Return the number in a device's single-line file."""
    try:
        text = path.read_text(encoding="ascii").strip()
        return int(text, 0)
    except OSError:
        raise TransportError(f"cannot read {path}; check whether the driver is loaded") from None
    except ValueError:
        raise TransportError(f"{path} contains '{text}', which is not a number") from None
