"""A simulated system at the end of a pipe (docs/reference/transports.md, 'A simulator's pipe').

    with Simulator(command, folder) as simulator:               # step by step: the same requests, the same reports
        simulator.request(pack_frame(0, payload))
        for event in simulator.run(1000):
            ...

    with SimulatorTransport(lambda: Simulator(command, folder)) as transport:   # a thread runs it while there is work
        transport.send(pack_frame(0, payload))
        burst = transport.receive()

The simulator is a process of its own. What it prints is kept, and shown when it ends unasked.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from fusesoc_firm.node.transport.transport import Burst, TransportError, TransportResetError

MOST_CYCLES = 2**31 - 1
"""Of one run; a frame has at most so many bytes, too."""

# Puts the pipes where a simulator finds them. A shell copies no descriptor of two digits, but opens it by its name.
_SHELL = 'exec 3<"$1" 4>"$2"; shift 2; exec "$@"'
_ID_ERROR = 65535
_SHOWN_LINES = 20
# One that has been asked to end, or whose pipes are closed, does so at once.
_END_SECONDS = 10.0

# A thread runs so long before it looks for frames again, and never fewer or more cycles.
_STEP_SECONDS = 0.001
_FEWEST_CYCLES, _MOST_CYCLES = 64, 2**20


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
            self._close_files()
            raise TransportError(f"the simulator cannot be started in {folder}: {error.strerror}") from None
        finally:
            os.close(from_us)
            os.close(to_us)

    @property
    def pid(self) -> int:
        """The simulator's process."""
        return self._process.pid

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

    def kill(self) -> None:
        """End the simulator at once. Another thread may do so; the one that uses it gets a `TransportError`."""
        self._process.kill()

    def close(self) -> None:
        """Kill the simulator if it still runs. A second call does nothing."""
        self.kill()
        self._process.wait()
        self._close_files()

    def _close_files(self) -> None:
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


@dataclass(frozen=True)
class Pace:
    """How a `SimulatorTransport` runs its simulator.

    `send` waits while the system has not taken `most_frames` of those before. The simulator rests when `rest_cycles`
    had no beat; every `idle_seconds` it runs some more then, for accelerators that send without being asked (None: it
    does not). It stands while what nobody has received yet holds `most_bytes`, as hardware does that is not read. When
    it ends unasked, another one is started, up to `restarts` times.
    """

    most_frames: int = 2
    rest_cycles: int = 100_000
    idle_seconds: float | None = None
    most_bytes: int = 2**24
    restarts: int = 0


class SimulatorTransport:
    """A transport to a simulator that a thread of its own runs."""

    def __init__(
        self,
        start: Callable[[], Simulator],
        pace: Pace | None = None,
        observe: Callable[[Event], None] | None = None,
    ) -> None:
        """`start` makes the simulator; `observe` is called in the thread with every event, and must not raise.

        Raises `TransportError` if it cannot be started.
        """
        self._start = start
        self._pace = pace or Pace()
        self._restarts = self._pace.restarts
        self._observe = observe
        self._changed = threading.Condition()
        self._sent: deque[bytes] = deque()
        self._frames = 0  # that the system has not taken, those in `_sent` among them
        self._received: deque[Burst | TransportResetError] = deque()
        self._bytes = 0  # in `_received`
        self._error: TransportError | None = None
        self._is_closed = False
        self._step = _FEWEST_CYCLES
        self._simulator = start()
        self._thread = threading.Thread(target=self._serve, name="simulator", daemon=True)
        self._thread.start()

    def send(self, frame: bytes) -> None:
        """Send a whole frame; waits while the system takes none. Raises `TransportError`."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_over or self._frames < self._pace.most_frames)
            if self._is_closed:
                raise TransportError("the transport is closed")
            if self._error:
                raise self._error
            self._frames += 1
            self._sent.append(frame)
            self._changed.notify_all()

    def receive(self, timeout: float | None = None) -> Burst | None:
        """The next burst, as `Transport.receive` has it; what came before an error is there before it."""
        with self._changed:
            self._changed.wait_for(lambda: self._received or self._is_over, timeout)
            if not self._received:
                if self._error and not self._is_closed:
                    raise self._error
                return None
            item = self._received.popleft()
            if isinstance(item, TransportResetError):
                raise item
            self._bytes -= len(item.data)
            self._changed.notify_all()
            return item

    def is_at_rest(self) -> bool:
        """Whether the system has taken all that was sent, and has had no beat since `rest_cycles`."""
        with self._changed:
            is_busy = self._frames or self._received
            return not is_busy and self._simulator.quiet >= self._pace.rest_cycles

    def close(self) -> None:
        """Stop, and kill the simulator. A second call does nothing."""
        with self._changed:
            self._is_closed = True
            self._simulator.kill()
            self._changed.notify_all()
        self._thread.join()

    def __enter__(self) -> SimulatorTransport:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def waiting_bytes(self) -> int:
        """The bytes of the bursts that have come and that nobody has received."""
        return self._bytes

    @property
    def _is_over(self) -> bool:
        return self._is_closed or self._error is not None

    def _serve(self) -> None:
        """The thread: run the simulator, and start another one when it ends and may be followed."""
        try:
            while not self._is_over:
                try:
                    self._run(self._wait_for_work())
                except TransportError as error:
                    self._recover(error)
        finally:
            self._simulator.close()
            self._end(TransportError("the thread that runs the simulator has ended"))

    def _wait_for_work(self) -> list[bytes]:
        """Sleep while there is nothing to do; the frames to be sent next."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_over or self._bytes < self._pace.most_bytes)
            if self._simulator.quiet >= self._pace.rest_cycles:
                self._changed.wait_for(lambda: self._is_over or self._sent, self._pace.idle_seconds)
            frames = list(self._sent)
            self._sent.clear()
            return frames

    def _run(self, frames: Sequence[bytes]) -> None:
        for frame in frames:
            self._simulator.request(frame)
        start, first = time.monotonic(), self._simulator.cycle
        events = self._simulator.run(self._step)
        self._adapt(self._simulator.cycle - first, time.monotonic() - start)
        if self._observe:
            for event in events:
                self._observe(event)
        with self._changed:
            for event in events:
                self._note(event)
            self._changed.notify_all()

    def _adapt(self, cycles: int, seconds: float) -> None:
        """Step about so far as the simulator gets in a while."""
        if cycles == self._step and seconds < _STEP_SECONDS / 2:
            self._step = min(2 * self._step, _MOST_CYCLES)
        elif seconds > 2 * _STEP_SECONDS:
            self._step = max(self._step // 2, _FEWEST_CYCLES)

    def _note(self, event: Event) -> None:
        if isinstance(event, Taken):
            self._frames -= 1
        elif isinstance(event, Burst):
            self._received.append(event)
            self._bytes += len(event.data)

    def _recover(self, error: TransportError) -> None:
        """Begin anew, with the frames that the simulator was not given yet, or end."""
        if self._is_closed or not self._restarts:
            self._end(error)
            return
        self._restarts -= 1
        try:
            simulator = self._start()
        except TransportError as failure:
            self._end(failure)
            return
        with self._changed:
            self._simulator = simulator
            self._frames = len(self._sent)
            self._received.append(TransportResetError(str(error)))
            if self._is_closed:
                simulator.kill()
            self._changed.notify_all()

    def _end(self, error: TransportError) -> None:
        """Only the first error counts."""
        with self._changed:
            self._error = self._error or error
            self._changed.notify_all()
