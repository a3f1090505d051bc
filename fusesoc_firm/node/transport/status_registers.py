"""The registers of a status with AXI4-Lite under Linux, as a transport for the frames that access them."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path
from types import TracebackType

from fusesoc_firm.node.transport.dma_device import MappedRegisters, Registers, number_in
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.system.status_frames import WRITE, answered, status_answer

# Beyond the registers of the channel with the highest number.
_MAP_BYTES = 2**16


class StatusRegisters:
    """A transport that answers a request of the status at once; all other frames are dropped."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self._answers: deque[bytes] = deque()

    def send(self, frame: bytes) -> None:
        """Access the register of a request."""
        if request := answered(frame):
            offset = request[0] & ~WRITE
            if offset >= _MAP_BYTES:
                raise TransportError(f"the status has no register at {offset:#x}")
            self._answers.append(status_answer(request[0], self._registers.read(offset)))
            if request[0] & WRITE:
                self._registers.write(offset, request[1])

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next answer, or None without one."""
        return Burst(self._answers.popleft()) if self._answers else None

    def is_ready(self) -> bool:
        """Return True, since registers answer at once."""
        return True

    def is_at_rest(self) -> bool:
        """Return True, since registers answer at once."""
        return True

    def close(self) -> None:
        """Do nothing, since the memory is unmapped with its last reference."""

    def __enter__(self) -> StatusRegisters:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_registers(uio: str, root: Path = Path("/")) -> StatusRegisters:
    """Open the status in the first map of a UIO device, such as /dev/uio1; all paths begin with `root`.

    May raise `TransportError`.
    """
    try:
        file = os.open(root / uio.lstrip("/"), os.O_RDWR | os.O_SYNC)
        try:
            size = number_in(root / "sys/class/uio" / Path(uio).name / "maps/map0/size")
            if size < _MAP_BYTES:
                raise TransportError(f"{uio} has a map of {size} bytes; a status has {_MAP_BYTES}")
            return StatusRegisters(MappedRegisters(file, size))
        finally:
            os.close(file)
    except (OSError, ValueError) as error:
        raise TransportError(f"cannot use the status at {uio}: {error}") from None
