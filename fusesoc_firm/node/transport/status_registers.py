"""The registers of a status with AXI4-Lite under Linux, as a transport for the frames that access them."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

from fusesoc_firm.node.transport.dma_device import MappedRegisters, Registers, number_in
from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError
from fusesoc_firm.system.boards.overlay import STATUS_NAME
from fusesoc_firm.system.status_frames import WRITE, answered, status_answer

# The kind of the addresses of such registers.
AXI = "axi"
# Beyond the registers of the channel with the highest number.
_MAP_BYTES = 2**16
_DEVICES = "sys/class/uio"


class StatusRegisters(Closing):
    """A transport that answers a request of the status at once; all other frames are dropped."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self._answers: deque[bytes] = deque()

    def access(self, request: bytes) -> bytes:
        """Return the answer to a request; any thread may call this method. May raise `TransportError`."""
        asked = answered(request)
        if asked is None:
            raise TransportError("the frame is not a request of the status")
        offset = asked[0] & ~WRITE
        if offset >= _MAP_BYTES:
            raise TransportError(f"the status has no register at {offset:#x}")
        answer = status_answer(asked[0], self._registers.read(offset))
        if asked[0] & WRITE:
            self._registers.write(offset, asked[1])
        return answer

    def send(self, frame: bytes) -> None:
        """Access the register of a request."""
        if answered(frame):
            self._answers.append(self.access(frame))

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


def open_registers(uio: str, root: Path = Path("/")) -> StatusRegisters:
    """Open the status in the first map of a UIO device, such as /dev/uio1; all paths begin with `root`.

    May raise `TransportError`.
    """
    try:
        file = os.open(root / uio.lstrip("/"), os.O_RDWR | os.O_SYNC)
        try:
            size = number_in(root / _DEVICES / Path(uio).name / "maps/map0/size")
            if size < _MAP_BYTES:
                raise TransportError(f"{uio} has a map of {size} bytes; a status has {_MAP_BYTES}")
            return StatusRegisters(MappedRegisters(file, size))
        finally:
            os.close(file)
    except (OSError, ValueError) as error:
        raise TransportError(f"cannot use the status at {uio}: {error}") from None


def open_registers_at(address: str, root: Path = Path("/")) -> StatusRegisters:
    """Open the status at an address such as `axi:/dev/uio1`, or, for an empty one, at the UIO device of the overlay.

    All paths begin with `root`. May raise `TransportError`.
    """
    kind, _, device = address.partition(":")
    if address and not (kind == AXI and device):
        raise TransportError(f"the status is '{address}'; legal: {AXI}:UIO, such as {AXI}:/dev/uio1")
    return open_registers(device or _named_device(root), root)


def _named_device(root: Path) -> str:
    """Return the UIO device that the overlay of `firm system bring-up` names. May raise `TransportError`."""
    for name in sorted((root / _DEVICES).glob("*/name")):
        if name.read_text(encoding="utf-8", errors="replace").strip() == STATUS_NAME:
            return f"/dev/{name.parent.name}"
    raise TransportError(f"no UIO device is called {STATUS_NAME}; '--status {AXI}:UIO' names the device of the status")
