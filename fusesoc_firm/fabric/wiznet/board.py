"""A simulated board with a chip: bytes of its SPI on one side, sockets of the kernel on the other.

A simulator with `firm_sim_chip` (cores/sim) requests the chip's bytes through a pipe.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Sequence
from ipaddress import IPv4Address
from pathlib import Path
from socket import SO_REUSEADDR, SOL_SOCKET, socket

from fusesoc_firm.fabric.simulated_board import SimulatedBoard
from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500
from fusesoc_firm.text.diagnostics import fail

_CYCLES_BYTES = 4


class Board(SimulatedBoard):
    """A running board. `frames` counts the frames of its SPI."""

    def __init__(self, command: Sequence[str], folder: Path, chip: W5200 | W5500, hertz: int) -> None:
        """Start the simulator `command` in `folder`; its clock has `hertz`. Raise `OSError` if that is impossible."""
        super().__init__(command, folder, hertz)
        self.frames = 0
        self._chip = chip

    def run(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Exchange bytes until the condition holds before a frame. Raise `InputError` if the simulator ends."""
        chip = self._chip
        actions = {b"a": self._answer, b"t": self._take, b"d": chip.deselect, b"r": chip.reset}
        while True:
            report = self.read(1)
            if report == b"s":
                if is_over():
                    return
                self._select(int.from_bytes(self.read(_CYCLES_BYTES), "little"))
            elif report in actions:
                actions[report]()
            else:
                self.fail()

    def close(self) -> None:
        """End the simulator and all connections."""
        super().close()
        self._chip.close()

    def _select(self, cycles: int) -> None:
        """Begin a frame when the board's time is reached, or earlier at an event on its network."""
        if early := self.early(cycles):
            self._chip.poll(early)
            self.go_on()
        self._chip.select()
        self.frames += 1
        self.write(b"\0")

    def _answer(self) -> None:
        self.write(bytes([self._chip.answer()]))

    def _take(self) -> None:
        self._chip.take(self.read(1)[0])


def check_address(address: IPv4Address, port: int) -> None:
    """Raise `InputError` if this machine does not have the address, or if the port is in use there."""
    with socket() as probe:
        probe.setsockopt(SOL_SOCKET, SO_REUSEADDR, 1)
        try:
            probe.bind((str(address), port))
            probe.listen()
        except OSError as error:
            if error.errno == errno.EADDRNOTAVAIL:
                fail(
                    f"this machine does not have the board's address {address}",
                    hint=f"'sudo ip address add {address}/32 dev lo' gives it the address until the next start",
                )
            fail(f"the board cannot listen at {address}, port {port}: {error.strerror}")
