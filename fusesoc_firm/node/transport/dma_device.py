"""What a driver in user space needs of AXI DMA under Linux: registers, an interrupt, and memory that both see.

Registers and interrupt come by UIO, the memory by u-dma-buf (https://github.com/ikwzm/udmabuf).
"""

from __future__ import annotations

import mmap
import os
import select
import time
from pathlib import Path
from typing import Protocol

from fusesoc_firm.node.transport.transport import TransportError

_WORD_BYTES = 4
_POLL_SECONDS = 50e-6
_REACH = 2**32
# Of u-dma-buf: not cached, and not a device's memory either, which takes aligned accesses only.
_WRITE_COMBINE = "2"


class DmaDevice(Protocol):
    """The engine as its driver sees it; a test may have one of its own."""

    @property
    def memory(self) -> memoryview:
        """Bytes that processor and engine share."""

    @property
    def address(self) -> int:
        """The address of the first of them for the engine."""

    def read(self, offset: int) -> int:
        """A register, by its offset in bytes."""

    def write(self, offset: int, value: int) -> None:
        """Set a register."""

    def wait(self, timeout: float | None) -> None:
        """Sleep until an interrupt that has not been answered, until the time is over, or after `end`."""

    def end(self) -> None:
        """Wake who waits, now and later."""


class LinuxDmaDevice:
    """The engine of a board that runs Linux."""

    def __init__(self, uio: str, buffer: str, *, has_interrupt: bool, root: Path = Path("/")) -> None:
        """`uio` such as /dev/uio0, whose first map are the registers; `buffer` such as udmabuf0.

        Without an interrupt it is looked at every 50 us. All paths begin with `root`. Raises `TransportError`.
        """
        self._has_interrupt = has_interrupt
        about = root / "sys/class/u-dma-buf" / buffer
        if not about.is_dir():
            # Older releases call it so.
            about = root / "sys/class/udmabuf" / buffer
        self._address, size = _number(about / "phys_addr"), _number(about / "size")
        if self._address + size > _REACH:
            raise TransportError(f"{buffer} ends beyond the 4 GiB that the DMA engine reaches")
        maps = root / "sys/class/uio" / Path(uio).name / "maps/map0"
        device = root / uio.lstrip("/")
        try:
            (about / "sync_mode").write_text(_WRITE_COMBINE, encoding="ascii")
            self._interrupt = os.open(device, os.O_RDWR | os.O_SYNC)
            self._registers = memoryview(mmap.mmap(self._interrupt, _number(maps / "size"))).cast("I")
            shared = os.open(root / "dev" / buffer, os.O_RDWR | os.O_SYNC)
            try:
                self._memory = memoryview(mmap.mmap(shared, size))
            finally:
                os.close(shared)
        except (OSError, ValueError) as error:
            raise TransportError(f"the DMA devices {uio} and {buffer} cannot be used: {error}") from None
        self._wake, self._woken = os.pipe()

    @property
    def memory(self) -> memoryview:
        """Bytes that processor and engine share."""
        return self._memory

    @property
    def address(self) -> int:
        """The address of the first of them for the engine."""
        return self._address

    def read(self, offset: int) -> int:
        """A register, by its offset in bytes."""
        return self._registers[offset // _WORD_BYTES]

    def write(self, offset: int, value: int) -> None:
        """Set a register."""
        self._registers[offset // _WORD_BYTES] = value

    def wait(self, timeout: float | None) -> None:
        """Sleep until an interrupt that has not been answered, until the time is over, or after `end`."""
        if not self._has_interrupt:
            time.sleep(_POLL_SECONDS)
            return
        try:
            # The kernel has switched the interrupt off when it came.
            os.write(self._interrupt, (1).to_bytes(_WORD_BYTES, "little"))
            if self._interrupt in select.select([self._interrupt, self._wake], [], [], timeout)[0]:
                os.read(self._interrupt, _WORD_BYTES)
        except OSError as error:
            raise TransportError(f"the DMA engine's interrupt: {error.strerror}") from None

    def end(self) -> None:
        """Wake who waits, now and later."""
        os.close(self._woken)


def _number(path: Path) -> int:
    """What a device tells by a file of one line."""
    try:
        text = path.read_text(encoding="ascii").strip()
        return int(text, 0)
    except OSError:
        raise TransportError(f"{path} cannot be read: is its driver loaded?") from None
    except ValueError:
        raise TransportError(f"{path} holds '{text}', which is not a number") from None
