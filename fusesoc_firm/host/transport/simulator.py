"""A simulated system at the end of a pipe (docs/transport.md, 'A simulator's pipe').

    with Simulator(command, folder) as simulator:               # step by step: the same requests, the same reports
        simulator.request(pack_frame(0, payload))
        for event in simulator.run(1000):
            ...

The simulator is a process of its own. What it prints is kept, and shown when it ends unasked.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from fusesoc_firm.host.transport.transport import Burst, TransportError

MOST_CYCLES = 2**31 - 1
"""Of one run; a frame has at most so many bytes, too."""

# Puts the pipes where a simulator finds them. A shell copies no descriptor of two digits, but opens it by its name.
_SHELL = 'exec 3<"$1" 4>"$2"; shift 2; exec "$@"'
_ID_ERROR = 65535
_SHOWN_LINES = 20
# One that has been asked to end, or whose pipes are closed, does so at once.
_END_SECONDS = 10.0


@dataclass(frozen=True)
class Taken:
    """The system took a frame: the cycles of its first and of its last beat."""

    first_cycle: int
    last_cycle: int


@dataclass(frozen=True)
class ErrorPulse:
    """A pulse of a converter's bit of `frame_error`, or of `id_error` where there is no converter."""

    converter: int | None
    cycle: int


Event = Taken | Burst | ErrorPulse


class Simulator:
    """A simulator in lock-step: it does what is requested and nothing else. One thread uses it.

    `cycle` is the number of cycles that have run; the last `quiet` of them had no beat in either direction.
    """

    def __init__(self, command: Sequence[str], folder: Path | None = None) -> None:
        """Start `command` in `folder`. Raises `TransportError`."""
        self.cycle = 0
        self.quiet = 0
        self._printed = tempfile.TemporaryFile()  # noqa: SIM115
        from_us, to_simulator = os.pipe()
        from_simulator, to_us = os.pipe()
        self._requests = open(to_simulator, "wb")  # noqa: PTH123, SIM115
        self._reports = open(from_simulator, "rb")  # noqa: PTH123, SIM115
        try:
            self._process = subprocess.Popen(
                ["/bin/sh", "-c", _SHELL, "sh", f"/dev/fd/{from_us}", f"/dev/fd/{to_us}", *command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=self._printed,
                stderr=subprocess.STDOUT,
                pass_fds=(from_us, to_us),
                # Ctrl-C is for us; the simulator ends with its requests.
                start_new_session=True,
            )
        except OSError as error:
            raise TransportError(f"the simulator cannot be started in {folder}: {error.strerror}") from None
        finally:
            os.close(from_us)
            os.close(to_us)

    def request(self, frame: bytes) -> None:
        """Put a frame behind those that are to be sent to the system. Raises `TransportError`."""
        if not 1 <= len(frame) <= MOST_CYCLES:
            raise ValueError(f"a frame of {len(frame)} bytes; legal: 1 to {MOST_CYCLES}")
        self._write(b"F" + len(frame).to_bytes(4, "little"), frame)

    def run(self, cycles: int) -> list[Event]:
        """Run for so many cycles, or until the end of one in which something happens. Raises `TransportError`."""
        if not 0 <= cycles <= MOST_CYCLES:
            raise ValueError(f"{cycles} cycles; legal: 0 to {MOST_CYCLES}")
        self._write(b"R" + cycles.to_bytes(4, "little"))
        return self._events()

    def quit(self) -> None:
        """End the simulation. Raises `TransportError` if it does not end well."""
        self._write(b"Q")
        self._events()
        status = self._wait()
        if status:
            self._fail(f"the simulator ended with status {status}")
        self.close()

    def close(self) -> None:
        """Kill the simulator if it still runs. A second call does nothing."""
        self._process.kill()
        self._process.wait()
        for file in (self._requests, self._reports, self._printed):
            try:
                file.close()
            except OSError:
                # What was still to be written has no reader.
                continue

    def printed(self) -> str:
        """The last lines that the simulator printed."""
        if self._printed.closed:
            return ""
        text = os.pread(self._printed.fileno(), os.fstat(self._printed.fileno()).st_size, 0)
        return "\n".join(text.decode(errors="replace").splitlines()[-_SHOWN_LINES:])

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, *parts: bytes) -> None:
        try:
            for part in parts:
                self._requests.write(part)
            self._requests.flush()
        except (OSError, ValueError):
            self._end_unasked()

    def _read(self, size: int) -> bytes:
        data = self._reports.read(size)
        if len(data) < size:
            self._end_unasked()
        return data

    def _number(self, size: int) -> int:
        return int.from_bytes(self._read(size), "little")

    def _events(self) -> list[Event]:
        """All reports up to that which says that the simulation stands."""
        events: list[Event] = []
        while (kind := self._read(1)) != b"S":
            events.append(self._event(kind))
        self.cycle = self._number(8)
        self.quiet = self._number(4)
        return events

    def _event(self, kind: bytes) -> Event:
        if kind == b"T":
            return Taken(self._number(8), self._number(8))
        if kind == b"B":
            tid, first, last = self._number(1), self._number(8), self._number(8)
            return Burst(self._read(self._number(4)), tid, first, last)
        if kind == b"E":
            converter = self._number(2)
            return ErrorPulse(None if converter == _ID_ERROR else converter, self._number(8))
        return self._fail(f"the simulator sent 0x{kind.hex()} where a report begins")

    def _wait(self) -> int | None:
        """The status with which the simulator ends; None if it does not."""
        try:
            return self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            return None

    def _end_unasked(self) -> NoReturn:
        status = self._wait()
        if status is None:
            self._fail("the simulator closed its pipe")
        elif status < 0:
            self._fail(f"the simulator was killed by signal {-status}")
        self._fail(f"the simulator ended with status {status}")

    def _fail(self, what: str) -> NoReturn:
        printed = self.printed()
        self.close()
        raise TransportError(f"{what}; it printed:\n{printed}" if printed else what)
