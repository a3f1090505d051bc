"""A simulated board with a chip: bytes of its SPI on one side, sockets of the kernel on the other.

A simulator with `firm_sim_chip` (cores/sim) asks for the chip's bytes through a pipe.
"""

from __future__ import annotations

import errno
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from ipaddress import IPv4Address
from pathlib import Path
from socket import SO_REUSEADDR, SOL_SOCKET, socket

from fusesoc_firm.fabric.wiznet.w5200 import W5200
from fusesoc_firm.fabric.wiznet.w5500 import W5500
from fusesoc_firm.text.diagnostics import fail

_SHELL = 'exec 3<"$1" 4>"$2"; shift 2; exec "$@"'
_PIECE_BYTES = 65536
_CYCLES_BYTES = 4
# A board that is later than this does not catch up: its peers would see seconds of it at once.
_MOST_LATE = 0.05
_SHOWN_BYTES = 4000


class Board:
    """A running board. `frames` counts the frames of its SPI."""

    def __init__(self, command: Sequence[str], folder: Path, chip: W5200 | W5500, hertz: int) -> None:
        """Start the simulator `command` in `folder`; its clock has `hertz`. Raise `OSError` if that is impossible."""
        self.frames = 0
        self._chip, self._hertz = chip, hertz
        self._data = b""
        self._due = time.monotonic()
        from_us, to_simulator = os.pipe()
        from_simulator, to_us = os.pipe()
        self._answers, self._reports = to_simulator, from_simulator
        self._printed = tempfile.TemporaryFile()  # noqa: SIM115
        try:
            self._process = subprocess.Popen(
                ["/bin/sh", "-c", _SHELL, "sh", f"/dev/fd/{from_us}", f"/dev/fd/{to_us}", *command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=self._printed,
                stderr=subprocess.STDOUT,
                pass_fds=(from_us, to_us),
                # Ctrl-C reaches only this process.
                start_new_session=True,
            )
        finally:
            os.close(from_us)
            os.close(to_us)

    def run(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Exchange bytes until the condition holds before a frame. Raise `InputError` if the simulator ends."""
        chip = self._chip
        actions = {b"a": self._answer, b"t": self._take, b"d": chip.deselect, b"r": chip.reset}
        while True:
            report = self._read(1)
            if report == b"s":
                if is_over():
                    return
                self._select(int.from_bytes(self._read(_CYCLES_BYTES), "little"))
            elif report in actions:
                actions[report]()
            else:
                self._fail()

    def close(self) -> None:
        """End the simulator and all connections."""
        self._process.kill()
        self._process.wait()
        self._printed.close()
        for end in (self._answers, self._reports):
            with suppress(OSError):
                os.close(end)
        self._chip.close()

    def _select(self, cycles: int) -> None:
        """Begin a frame when the time of the board has come, or earlier if its network has news."""
        self._due += cycles / self._hertz
        early = self._due - time.monotonic()
        if early > 0:
            self._chip.poll(early)
            self._due = min(self._due, time.monotonic() + early)
        elif early < -_MOST_LATE:
            self._due = time.monotonic() - _MOST_LATE
        self._chip.select()
        self.frames += 1
        self._write(b"\0")

    def _answer(self) -> None:
        self._write(bytes([self._chip.answer()]))

    def _take(self) -> None:
        self._chip.take(self._read(1)[0])

    def _read(self, size: int) -> bytes:
        while len(self._data) < size:
            piece = os.read(self._reports, _PIECE_BYTES)
            if not piece:
                self._fail()
            self._data += piece
        data, self._data = self._data[:size], self._data[size:]
        return data

    def _write(self, data: bytes) -> None:
        try:
            os.write(self._answers, data)
        except BrokenPipeError:
            self._fail()

    def _fail(self) -> None:
        self._process.kill()
        self._process.wait()
        size = os.fstat(self._printed.fileno()).st_size
        printed = os.pread(self._printed.fileno(), _SHOWN_BYTES, max(0, size - _SHOWN_BYTES)).decode(errors="replace")
        fail(f"the simulator of the board ended:\n{printed}")


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
