"""AXI DMA for a driver in user space under Linux: registers, an interrupt, and memory shared with the engine.

UIO provides registers and interrupt, u-dma-buf (https://github.com/ikwzm/udmabuf) the memory.
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
# A mode of u-dma-buf: neither cached nor mapped as device memory, which allows only aligned accesses.
_WRITE_COMBINE = "2"


class DmaDevice(Protocol):
    """The engine as its driver sees it; a test may provide its own."""

    @property
    def memory(self) -> memoryview:
        """The memory that processor and engine share."""

    @property
    def address(self) -> int:
        """The address of its first byte as the engine sees it."""

    def read(self, offset: int) -> int:
        """Read a register, by its offset in bytes."""

    def write(self, offset: int, value: int) -> None:
        """Set a register."""

    def wait(self, timeout: float | None) -> None:
        """Sleep until an unacknowledged interrupt, until the timeout, or until `end`."""

    def end(self) -> None:
        """Wake all threads that wait, now and later."""


class LinuxDmaDevice:
    """The engine of a board that runs Linux."""

    def __init__(self, uio: str, buffer: str, *, has_interrupt: bool, root: Path = Path("/")) -> None:
        """`uio` is a device such as /dev/uio0, whose first map holds the registers; `buffer` a name such as udmabuf0.

        Without an interrupt, the registers are polled every 50 us. All paths begin with `root`. Raises
        `TransportError`.
        """
        self._has_interrupt = has_interrupt
        about = root / "sys/class/u-dma-buf" / buffer
        if not about.is_dir():
            # The path in older releases.
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
            raise TransportError(f"cannot use the DMA devices {uio} and {buffer}: {error}") from None
        self._wake, self._woken = os.pipe()

    @property
    def memory(self) -> memoryview:
        """The memory that processor and engine share."""
        return self._memory

    @property
    def address(self) -> int:
        """The address of its first byte as the engine sees it."""
        return self._address

    def read(self, offset: int) -> int:
        """Read a register, by its offset in bytes."""
        return self._registers[offset // _WORD_BYTES]

    def write(self, offset: int, value: int) -> None:
        """Set a register."""
        self._registers[offset // _WORD_BYTES] = value

    def wait(self, timeout: float | None) -> None:
        """Sleep until an unacknowledged interrupt, until the timeout, or until `end`."""
        if not self._has_interrupt:
            time.sleep(_POLL_SECONDS)
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


def _number(path: Path) -> int:
    """Return the number in a device's one-line file."""
    try:
        text = path.read_text(encoding="ascii").strip()
        return int(text, 0)
    except OSError:
        raise TransportError(f"cannot read {path}; check whether the driver is loaded") from None
    except ValueError:
        raise TransportError(f"{path} contains '{text}', which is not a number") from None
