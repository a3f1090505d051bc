"""The process of a simulated board: a simulator that exchanges bytes on file descriptors 3 and 4."""

from __future__ import annotations

import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.tools import piped

_PIECE_BYTES = 65536
# A board that lags further behind does not catch up: its peers would receive seconds of traffic at once.
_MOST_LATE = 0.05
_SHOWN_BYTES = 4000


class SimulatedBoard(ABC):
    """A running simulator, and the time of its board."""

    def __init__(self, command: Sequence[str], folder: Path, hertz: int) -> None:
        """Start the simulator `command` in `folder`; its clock has `hertz`. Raise `OSError` if that is impossible."""
        self._hertz = hertz
        self._data = b""
        self._due = time.monotonic()
        self._process, self._answers, self._reports, self._printed = piped.start(command, folder)

    @abstractmethod
    def run(self, is_over: Callable[[], bool] = ...) -> None:
        """Exchange bytes until the condition holds. Raise `InputError` if the simulator ends."""

    def close(self) -> None:
        """End the simulator."""
        self._process.kill()
        self._process.wait()
        self._printed.close()
        for end in (self._answers, self._reports):
            with suppress(OSError):
                os.close(end)

    def read(self, size: int) -> bytes:
        """Return bytes of the simulator. Raise `InputError` if it has ended."""
        while len(self._data) < size:
            piece = os.read(self._reports, _PIECE_BYTES)
            if not piece:
                self.fail()
            self._data += piece
        data, self._data = self._data[:size], self._data[size:]
        return data

    def write(self, data: bytes) -> None:
        """Send bytes to the simulator. Raise `InputError` if it has ended."""
        try:
            os.write(self._answers, data)
        except BrokenPipeError:
            self.fail()

    def early(self, cycles: int) -> float:
        """Advance the board's time by `cycles`; return the seconds by which it is ahead of real time, or 0."""
        self._due += cycles / self._hertz
        early = self._due - time.monotonic()
        if early < -_MOST_LATE:
            self._due = time.monotonic() - _MOST_LATE
        return max(0.0, early)

    def go_on(self) -> None:
        """Set the board's time to real time, if it is ahead."""
        self._due = min(self._due, time.monotonic())

    def fail(self) -> NoReturn:
        """Raise `InputError` with the simulator's output."""
        self._process.kill()
        self._process.wait()
        size = os.fstat(self._printed.fileno()).st_size
        printed = os.pread(self._printed.fileno(), _SHOWN_BYTES, max(0, size - _SHOWN_BYTES)).decode(errors="replace")
        fail(f"the simulator of the board ended:\n{printed}")
