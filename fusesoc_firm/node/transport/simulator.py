"""A simulated system at the end of a pipe (docs/reference/transports.md, 'A simulator's pipe').

    with Simulator(command, folder) as simulator:               # step by step: equal requests give equal reports
        simulator.request(pack_frame(0, payload))
        for event in simulator.run(1000):
            ...

    with SimulatorTransport(lambda: Simulator(command, folder)) as transport:   # it runs while someone waits for it
        transport.send(pack_frame(0, payload))
        burst = transport.receive()

The simulator is a separate process. If it ends unexpectedly, its output is shown.
"""

from __future__ import annotations

import os
import select
import signal
import struct
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NoReturn

from fusesoc_firm.node.transport.transport import Burst, Closing, TransportError, TransportResetError
from fusesoc_firm.tools import piped

MOST_CYCLES = 2**31 - 1
"""The maximum number of cycles in one run, and of bytes in a frame."""

PIPE_VERSION = 5
"""The version of requests and reports."""
WAITS_SECONDS = 0.01
"""The minimum time between two requests of waits, and until the end of their count."""

_SHOWN_LINES = 20
# A simulator normally ends immediately on request, or when its pipes close.
_END_SECONDS = 10.0

# The simulator runs for this time before new frames are checked for, within the limits on cycles; while beats move,
# also for this share of the time since the last frame or event. Each run has an overhead, especially on a busy machine.
_STEP_SECONDS = 0.001
_STEP_SHARE = 1 / 8
_FEWEST_CYCLES, _MOST_CYCLES = 64, 2**20
# The system's pauses after which the simulator rests; more cycles would use the processor time of an arriving message.
_PAUSES_TO_REST, _MOST_REST_CYCLES = 4, 100_000
_PIECE_BYTES = 2**16
# The longest wait of `poll`, in ms.
_MOST_POLLED = 2**31 - 1


@dataclass(frozen=True)
class Taken:
    """The event that the system accepted a frame: the cycles of the frame's first and last beat."""

    first_cycle: int
    last_cycle: int


@dataclass(frozen=True)
class ErrorPulse:
    """A pulse of a converter's bit in `frame_error` with its fault's code, or of `id_error` without a converter."""

    converter: int | None
    cycle: int
    code: int = 0


@dataclass(frozen=True)
class Waits:
    """The cycles in which beats have waited on each wire, from the cycle `first` to the one before `cycle`.

    `first` is `cycle` if the count begins. The first two wires are those from and to the host, the others are within
    the system (`system/hardware/waits.py`).
    """

    first: int
    cycle: int
    counts: tuple[int, ...]


Event = Taken | Burst | ErrorPulse | Waits


class _Reports:
    """The reading end of a pipe, which can be polled for data."""

    def __init__(self, descriptor: int) -> None:
        # A file, since it can be closed twice; a number may belong to another file by then.
        self._file = open(descriptor, "rb", buffering=0)  # noqa: SIM115
        self._data = bytearray()
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    def read(self, size: int) -> bytes:
        """Return this many bytes, or fewer at the end of the stream."""
        while len(self._data) < size and (piece := self._file.read(_PIECE_BYTES)):
            self._data += piece
        data = bytes(self._data[:size])
        del self._data[:size]
        return data

    def has_data(self, seconds: float) -> bool:
        """Return whether bytes or the end of the stream have arrived, after `seconds` at most."""
        return bool(self._data or self._poll.poll(min(1000 * seconds, _MOST_POLLED)))

    def close(self) -> None:
        self._file.close()


class Simulator(Closing):
    """A simulator in lock-step, which runs only on request and may be used by only one thread at a time.

    `cycle` is the number of cycles run so far; the last `quiet` of these cycles had no beat in either direction.
    `begun` is the number of runs that have begun and are not finished.
    """

    def __init__(self, command: Sequence[str], folder: Path | None = None) -> None:
        """Start `command` in `folder`. May raise `TransportError`."""
        self.cycle = 0
        self.quiet = 0
        self.begun = 0
        self._has_version = False
        self._is_counting = False
        self._counted_to: int | None = None  # by the last `Waits`
        try:
            self._process, requests, reports, self._printed = piped.start(command, folder)
        except OSError as error:
            raise TransportError(f"the simulator cannot be started in {folder}: {error.strerror}") from None
        # The simulator ends when this file closes.
        self._requests = open(requests, "wb")  # noqa: PTH123, SIM115
        self._reports = _Reports(reports)

    @property
    def pid(self) -> int:
        """The id of the simulator's process."""
        return self._process.pid

    def request(self, frame: bytes, *, is_aborted: bool = False, hole: int | None = None) -> None:
        """Append a frame to the frames that wait for the system. May raise `TransportError`.

        If `is_aborted`, the last beat aborts the frame. Otherwise, `tkeep` is 0 for the byte at the place `hole`.
        """
        if not 1 <= len(frame) <= MOST_CYCLES:
            raise ValueError(f"the frame has {len(frame)} bytes; legal: 1 to {MOST_CYCLES}")
        kind = b"A" if is_aborted else b"F" if hole is None else b"H" + hole.to_bytes(4, "little")
        self._write(kind + len(frame).to_bytes(4, "little"))
        self._write(frame)

    def request_waits(self) -> None:
        """Request `Waits`, which the next run returns; the simulator counts from the first request on.

        May raise `TransportError`.
        """
        self._is_counting = True
        self._write(b"W")

    def end_waits(self) -> None:
        """End the count of waits, if any; counting takes time in each cycle. May raise `TransportError`."""
        if self._is_counting:
            self._is_counting, self._counted_to = False, None
            self._write(b"N")

    def run(self, cycles: int) -> list[Event]:
        """Run for `cycles`, or until the end of the first cycle with an event. May raise `TransportError`."""
        self.begin(cycles)
        return self.finish()

    def begin(self, cycles: int, runs: int = 1) -> None:
        """Begin consecutive runs, which the simulator does not interrupt to wait for this process.

        `finish` must be called for each run before the next request. May raise `TransportError`.
        """
        if not 0 <= cycles <= MOST_CYCLES:
            raise ValueError(f"cycles is {cycles}; legal: 0 to {MOST_CYCLES}")
        self._write((b"R" + cycles.to_bytes(4, "little")) * runs, is_last=True)
        self.begun += runs

    def finish(self) -> list[Event]:
        """Return the events of the first run that is not finished. May raise `TransportError`."""
        events = self._events()
        self.begun -= 1
        return events

    def has_report(self, seconds: float) -> bool:
        """Return whether a run has ended, or begun to report events, after `seconds` at most."""
        return self._reports.has_data(seconds)

    def quit(self) -> None:
        """End the simulation. Raise `TransportError` if it does not end normally."""
        self._write(b"Q", is_last=True)
        self._events()
        status = self._wait()
        if status:
            self._fail(f"the simulator ended with status {status}")
        self.close()

    def kill(self) -> None:
        """Kill the simulator immediately, with all processes that it has started; any thread may call this method.

        In the thread that uses the simulator, a `TransportError` is raised.
        """
        if self._process.poll() is None:
            # It leads a session, so this number is also that of its group. It may have ended meanwhile.
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def close(self) -> None:
        """Kill the simulator if it still runs. A second call does nothing."""
        self.kill()
        self._process.wait()
        for file in (self._requests, self._reports, self._printed):
            try:
                file.close()
            except OSError:
                # Unwritten data has no reader, or the file is closed.
                continue

    def printed(self) -> str:
        """Return the last lines of the simulator's output."""
        if self._printed.closed:
            return ""
        text = os.pread(self._printed.fileno(), os.fstat(self._printed.fileno()).st_size, 0)
        return "\n".join(text.decode(errors="replace").splitlines()[-_SHOWN_LINES:])

    def _write(self, data: bytes, *, is_last: bool = False) -> None:
        try:
            self._requests.write(data)
            if is_last:
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
        """Return all events up to the report at which the simulation stops."""
        if not self._has_version:
            self._check_version()
        events: list[Event] = []
        while (kind := self._read(1)) != b"S":
            events.append(self._event(kind))
        self.cycle = self._number(8)
        self.quiet = self._number(4)
        return events

    def _check_version(self) -> None:
        found = self._read(2)
        if found[:1] != b"V" or found[1] != PIPE_VERSION:
            says = f"version {found[1]}" if found[:1] == b"V" else f"0x{found.hex()} instead of its version"
            self._fail(f"the simulator sent {says}; version {PIPE_VERSION} is needed, so build the simulator again")
        self._has_version = True

    def _event(self, kind: bytes) -> Event:
        if kind == b"T":
            return Taken(self._number(8), self._number(8))
        if kind == b"B":
            tid, end, first, last = self._number(2), self._number(1), self._number(8), self._number(8)
            return Burst(self._read(self._number(4)), tid, first, last, is_aborted=bool(end))
        if kind == b"E":
            converter, code = self._number(2), self._number(1)
            return ErrorPulse(converter, self._number(8), code)
        if kind == b"I":
            return ErrorPulse(None, self._number(8))
        if kind == b"W":
            return self._waits(self._number(8), self._number(2))
        return self._fail(f"the simulator sent 0x{kind.hex()} instead of the start of a report")

    def _waits(self, cycle: int, wires: int) -> Waits:
        counts = struct.unpack(f"<{wires}I", self._read(4 * wires))
        first, self._counted_to = cycle if self._counted_to is None else self._counted_to, cycle
        return Waits(first, cycle, counts)

    def _wait(self) -> int | None:
        """Return the simulator's exit status, or None if the simulator does not end."""
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
    """The settings with which a `SimulatorTransport` runs its simulator.

    `send` waits while the system has not yet accepted `most_frames` earlier frames. The simulator rests after
    `rest_cycles` without a beat, or after four of the system's own longest pauses if they are longer. At rest, the
    simulator still runs briefly every `idle_seconds`, for accelerators that send spontaneously (None: never). Like
    hardware whose output is not read, the simulator stops while unreceived bursts contain `most_bytes`. If the
    simulator ends unexpectedly, another one is started, up to `restarts` times.
    """

    most_frames: int = 2
    rest_cycles: int = 100_000
    idle_seconds: float | None = None
    most_bytes: int = 2**24
    restarts: int = 0


class SimulatorTransport(Closing):
    """A transport to a simulator, which runs while a thread waits in `receive` or `send`.

    `send` starts a simulator at rest; the thread in `receive` runs it further. Without such a thread, one that waits in
    `send` runs it.
    """

    def __init__(
        self,
        start: Callable[[], Simulator],
        pace: Pace | None = None,
        observe: Callable[[Event], None] | None = None,
        wants_waits: Callable[[], bool] = lambda: False,
    ) -> None:
        """Start the simulator with `start`; `observe` is called with every event, and must not raise or call this.

        `Waits` are requested while `wants_waits` returns True, and not counted otherwise. Raise `TransportError` if the
        simulator cannot be started.
        """
        self._start = start
        self._pace = pace or Pace()
        self._restarts = self._pace.restarts
        self._observe, self._wants_waits = observe, wants_waits
        self._changed = threading.Condition()
        self._sent: deque[bytes] = deque()
        self._frames = 0  # not yet accepted by the system, including those in `_sent`
        self._received: deque[Burst | TransportResetError] = deque()
        self._bytes = 0  # in `_received`
        self._error: TransportError | None = None
        self._is_closed = False
        self._receivers = 0
        self._is_used = False  # the simulator, by a thread that does not hold the lock
        # The cycles of the next run, of one that takes about _STEP_SECONDS, and of one after a burst.
        self._step = self._short_step = self._quiet_step = _FEWEST_CYCLES
        self._began = self._changed_at = self._wakes_at = self._counted_at = 0.0
        self._passes_frames = False  # the run
        self._rest_cycles = self._pace.rest_cycles
        self._simulator = start()

    def send(self, frame: bytes) -> None:
        """Send a whole frame; wait while the system is not ready. May raise `TransportError`."""
        with self._changed:
            self._work_until(self._has_room, None, lambda: not self._receivers and self._bytes < self._pace.most_bytes)
            if self._is_closed:
                raise TransportError("the transport is closed")
            if self._error:
                raise self._error
            self._frames += 1
            self._sent.append(frame)
            if not self._is_used and not self._simulator.begun:
                self._use(self._begin)
            self._changed.notify_all()

    def is_ready(self) -> bool:
        """Return whether `send` does not wait for the system."""
        return not self._is_over and self._has_room()

    def receive(self, timeout: float | None = None) -> Burst | None:
        """Return the next burst, as `Transport.receive` does; all bursts that arrived before an error precede it."""
        with self._changed:
            self._receivers += 1
            self._work_until(lambda: bool(self._received), timeout, lambda: True)
            self._receivers -= 1
            self._changed.notify_all()
            if not self._received:
                if self._error and not self._is_closed:
                    raise self._error
                return None
            item = self._received.popleft()
            if isinstance(item, TransportResetError):
                raise item
            self._bytes -= len(item.data)
            return item

    def is_at_rest(self) -> bool:
        """Return whether the system has accepted all frames, and then had no beat for long enough."""
        with self._changed:
            is_busy = self._frames or self._received or self._simulator.begun
            return not is_busy and self._simulator.quiet >= self._rest_cycles

    def close(self) -> None:
        """Close the transport and kill the simulator. A second call does nothing."""
        with self._changed:
            self._is_closed = True
            self._simulator.kill()
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._is_used)
            self._simulator.close()

    @property
    def waiting_bytes(self) -> int:
        """The number of bytes in the bursts that wait to be received."""
        return self._bytes

    @property
    def _is_over(self) -> bool:
        return self._is_closed or self._error is not None

    def _has_room(self) -> bool:
        return self._frames < self._pace.most_frames

    def _work_until(self, is_done: Callable[[], bool], timeout: float | None, may_run: Callable[[], bool]) -> None:
        """Wait for a condition, the end, or `timeout` seconds; run the simulator meanwhile if this thread may."""
        latest = time.monotonic() + (threading.TIMEOUT_MAX if timeout is None else timeout)
        while not (is_done() or self._is_over):
            left = latest - time.monotonic()
            rest = self._rest_seconds() if may_run() and not self._is_used else threading.TIMEOUT_MAX
            if rest <= 0:
                self._use(partial(self._run, max(0.0, left)))
            else:
                self._changed.wait(max(0.0, min(left, rest)))
            if left <= 0:
                return

    def _rest_seconds(self) -> float:
        """Return the seconds for which there is no work."""
        if self._simulator.begun or self._sent or self._simulator.quiet < self._rest_cycles:
            return 0.0
        return self._wakes_at - time.monotonic()

    def _use(self, work: Callable[[], Sequence[Event]]) -> None:
        """Call a method that uses the simulator, without the lock, which the caller holds."""
        self._is_used = True
        self._changed.release()
        events: Sequence[Event] = ()
        try:
            events = work()
        except TransportError as error:
            self._recover(error)
        finally:
            self._changed.acquire()
            self._is_used = False
            for event in events:
                self._note(event)
            self._changed.notify_all()

    def _begin(self) -> Sequence[Event]:
        """Pass on the frames, and run until they are accepted and the first of them is answered."""
        frames = 0
        while self._sent:
            self._simulator.request(self._sent.popleft())
            frames += 1
        self._began = time.monotonic()
        if self._began >= self._counted_at + WAITS_SECONDS:
            self._counted_at = self._began
            if self._wants_waits():
                self._simulator.request_waits()
            else:
                self._simulator.end_waits()
        self._passes_frames = frames > 0
        if frames:
            self._changed_at = self._began
        # A run ends when a frame is accepted. Waiting for this process then would take longer than the simulation.
        self._simulator.begin(self._step if frames else self._quiet_step, frames + 1)
        return ()

    def _run(self, seconds: float) -> Sequence[Event]:
        """Return the events of a run if it ends within `seconds`."""
        if not self._simulator.begun:
            self._begin()
        if not self._simulator.has_report(seconds):
            return ()
        first, quiet = self._simulator.cycle, self._simulator.quiet
        events = self._simulator.finish()
        self._note_pause(quiet, self._simulator.cycle - first)
        now = time.monotonic()
        self._adapt(self._simulator.cycle - first, now)
        if any(not isinstance(event, Waits) for event in events):
            self._changed_at = now
            self._step = self._short_step
        # After a burst, its receivers need the processor more than possibly idle hardware.
        has_burst = any(isinstance(event, Burst) for event in events)
        self._quiet_step = _FEWEST_CYCLES if has_burst else min(2 * self._quiet_step, self._step)
        self._began = now
        self._wakes_at = now + (threading.TIMEOUT_MAX if self._pace.idle_seconds is None else self._pace.idle_seconds)
        if self._observe:
            for event in events:
                self._observe(event)
        return events

    def _note_pause(self, quiet: int, cycles: int) -> None:
        """Note a pause of the system itself, which a beat has ended in a run of `cycles` without new frames."""
        if not self._passes_frames and self._simulator.quiet < cycles:
            pause = quiet + cycles - self._simulator.quiet
            self._rest_cycles = max(self._rest_cycles, min(_PAUSES_TO_REST * pause, _MOST_REST_CYCLES))

    def _adapt(self, cycles: int, now: float) -> None:
        """Adapt the number of cycles in a step to the simulator's speed, after a run of `cycles`."""
        is_moving = self._simulator.quiet < cycles
        longest = max(_STEP_SECONDS, _STEP_SHARE * (now - self._changed_at) if is_moving else 0.0)
        seconds = now - self._began
        if cycles == self._step and seconds < longest / 2:
            self._step = min(2 * self._step, _MOST_CYCLES)
        elif seconds > 2 * longest and not self._passes_frames:
            self._step = max(self._step // 2, _FEWEST_CYCLES)
        if longest == _STEP_SECONDS:
            self._short_step = self._step

    def _note(self, event: Event) -> None:
        if isinstance(event, Taken):
            self._frames -= 1
        elif isinstance(event, Burst):
            self._received.append(event)
            self._bytes += len(event.data)

    def _recover(self, error: TransportError) -> None:
        """Start another simulator with the frames that were not passed on; without remaining restarts, end."""
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

    def _end(self, error: TransportError) -> None:
        """End the transport with an error; only the first error counts."""
        with self._changed:
            self._error = self._error or error
