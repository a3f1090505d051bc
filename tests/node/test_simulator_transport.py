"""The two ways to use a simulator at the end of a pipe, with scripts in its place that say what it must not."""

from __future__ import annotations

import os
import shlex
import sys
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.simulator import Event, Pace, Simulator, SimulatorTransport, Taken, Waits
from fusesoc_firm.node.transport.transport import Burst, Transport, TransportError, TransportResetError

# An echo: a frame is taken and comes back at once, or 1,000 cycles later; of the bytes of a frame, some are orders.
_MODEL = """
import os, struct, sys, time
requests, reports = open(3, "rb"), open(4, "wb")
cycle = quiet = counted = 0
frames, late = [], []
reports.write(b"V\\5")
def say(*parts):
    reports.write(b"".join(parts))
while kind := requests.read(1):
    if kind == b"F":
        frames.append(requests.read(int.from_bytes(requests.read(4), "little")))
        if b"die" in frames[-1]:
            print("the model dies", file=sys.stderr)
            sys.exit(3)
        if b"hang" in frames[-1]:
            time.sleep(1000)
        if b"garbage" in frames[-1]:
            say(b"!!!!")
        if b"half" in frames[-1]:
            say(b"B\\0\\0\\0", bytes(16), (100).to_bytes(4, "little"), b"half a burst")
            reports.flush()
            os.kill(os.getpid(), 9)
    elif kind == b"R":
        left = int.from_bytes(requests.read(4), "little")
        if late:
            ran = min(left, late[0])
            cycle, quiet, late[0] = cycle + ran, quiet + ran, late[0] - ran
            if not late[0]:
                frame = late.pop()
                late.clear()
                say(b"B\\7\\0\\0", struct.pack("<QQI", cycle, cycle, len(frame)), frame)
                cycle, quiet = cycle + 1, 0
        elif frames and frames[0].endswith(b"late"):
            late = [1000, frames.pop(0)]
            say(b"T", struct.pack("<QQ", cycle, cycle))
            cycle, quiet = cycle + 1, 0
        elif frames and frames[0].endswith(b"wait"):
            cycle, quiet = cycle + left, quiet + left
        elif frames and left:
            frame = frames.pop(0)
            say(b"T", struct.pack("<QQ", cycle, cycle))
            say(b"B\\7\\0\\0", struct.pack("<QQI", cycle, cycle, len(frame)), frame)
            cycle, quiet = cycle + 1, 0
        else:
            cycle, quiet = cycle + left, quiet + left
        say(b"S", struct.pack("<QI", cycle, min(quiet, 2**31 - 1)))
    elif kind == b"W":
        say(b"W", struct.pack("<QHIII", cycle, 3, cycle - counted, 0, (cycle - counted) // 4))
        counted = cycle
    elif kind == b"Q":
        say(b"S", struct.pack("<QI", cycle, quiet))
        reports.flush()
        sys.exit(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    reports.flush()
"""


@pytest.fixture
def model(tmp_path: Path) -> list[str]:
    path = tmp_path / "a model.py"
    path.write_text(_MODEL)
    return [sys.executable, str(path)]


def received(transport: Transport) -> bytes:
    """The next burst."""
    burst = transport.receive(60)
    assert burst
    return burst.data


def wait_until(condition: object) -> None:
    assert callable(condition)
    while not condition():
        time.sleep(0.01)


def test_step_by_step(model: list[str]) -> None:
    with Simulator(model) as simulator:
        simulator.request(b"one")
        simulator.request(b"two")
        assert simulator.run(10) == [Taken(0, 0), Burst(b"one", 7, 0, 0)]
        assert (simulator.cycle, simulator.quiet) == (1, 0)
        assert simulator.run(10) == [Taken(1, 1), Burst(b"two", 7, 1, 1)]
        assert simulator.run(10) == []
        assert (simulator.cycle, simulator.quiet) == (12, 10)
        simulator.quit()
    with pytest.raises(TransportError):
        simulator.run(1)


def test_what_cannot_be_requested(model: list[str]) -> None:
    with Simulator(model) as simulator:
        with pytest.raises(ValueError, match="the frame has 0 bytes"):
            simulator.request(b"")
        with pytest.raises(ValueError, match="cycles is 2147483648; legal: 0 to 2147483647"):
            simulator.run(2**31)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (b"die", "the simulator ended with status 3; it printed:\nthe model dies"),
        (b"garbage", "the simulator sent 0x21 instead of the start of a report"),
        (b"half", "the simulator was killed by signal 9"),
    ],
)
def test_a_simulator_that_ends_unasked(model: list[str], frame: bytes, message: str) -> None:
    with Simulator(model) as simulator:
        simulator.request(frame)
        with pytest.raises(TransportError) as caught:
            simulator.run(10)
        assert str(caught.value) == message


def test_a_second_close_closes_no_other_file(model: list[str]) -> None:
    with Simulator(model) as simulator:
        simulator.request(b"garbage")
        with pytest.raises(TransportError):
            simulator.run(10)
        # These get the numbers that the simulator's pipes had.
        numbers = [number for _ in range(4) for number in os.pipe()]
    for number in numbers:
        os.close(number)


def test_a_simulator_that_does_not_end_well_or_start(model: list[str], tmp_path: Path) -> None:
    with Simulator([*model, "5"]) as simulator, pytest.raises(TransportError, match="ended with status 5"):
        simulator.quit()
    with Simulator(["/none/there"]) as simulator, pytest.raises(TransportError, match="/none/there"):
        simulator.run(1)
    with pytest.raises(TransportError, match="cannot be started in"):
        Simulator(model, tmp_path / "none")


@pytest.fixture
def transport(model: list[str]) -> Iterator[Transport]:
    with open_transport(f"pipe:{shlex.join(model)}") as opened:
        yield opened


def test_the_shell_runs_the_command(model: list[str]) -> None:
    """As the node in C++ does: with variables, several commands, and processes that end with the transport."""
    with open_transport(f"pipe:cd / && NONE= {shlex.join(model)}; exit 3") as opened:
        opened.send(b"frame")
        burst = opened.receive(60)
    assert burst is not None and burst.data == b"frame"
    with open_transport("pipe:echo 'never closed") as opened, pytest.raises(TransportError, match="with status 2"):
        opened.receive(60)


def test_one_thread_sends_and_another_receives(transport: Transport) -> None:
    frames = [bytes([number]) * (number + 1) for number in range(200)]

    def send() -> None:
        for frame in frames:
            transport.send(frame)

    sender = threading.Thread(target=send)
    sender.start()
    received = [transport.receive(60) for _ in frames]
    sender.join()
    assert [burst and burst.data for burst in received] == frames
    assert transport.receive(0.01) is None


def test_at_rest_it_sleeps_and_is_woken(model: list[str]) -> None:
    events: list[Event] = []
    with Simulator(model) as simulator, SimulatorTransport(lambda: simulator, observe=events.append) as transport:
        wait_until(lambda: transport.receive(0.01) is None and transport.is_at_rest())
        cycle = simulator.cycle
        assert transport.receive(0.2) is None
        assert simulator.cycle == cycle
        transport.send(b"wake")
        burst = transport.receive(60)
        assert burst
        assert burst.data == b"wake"
        assert events == [Taken(cycle, cycle), burst]


def test_idle_stepping(model: list[str]) -> None:
    with (
        Simulator(model) as simulator,
        SimulatorTransport(lambda: simulator, Pace(rest_cycles=1, idle_seconds=0.01)) as transport,
    ):
        wait_until(lambda: transport.receive(0.01) is None and simulator.quiet >= 10)
        cycle = simulator.cycle
        wait_until(lambda: transport.receive(0.01) is None and simulator.cycle > cycle)


def test_it_rests_later_if_the_system_pauses(model: list[str]) -> None:
    """Four times as late as the answer to the first frame, for which it was woken."""
    with (
        Simulator(model) as simulator,
        SimulatorTransport(lambda: simulator, Pace(rest_cycles=100, idle_seconds=0.01)) as transport,
    ):
        wait_until(lambda: transport.receive(0.01) is None and transport.is_at_rest())
        transport.send(b"late")
        assert received(transport) == b"late"
        wait_until(lambda: transport.receive(0.01) is None and transport.is_at_rest())
        assert simulator.quiet >= 4_000


def test_a_sender_without_a_receiver_runs_it(transport: Transport) -> None:
    """More frames than may wait for the system."""
    frames = [bytes([number]) * 10 for number in range(20)]
    for frame in frames:
        transport.send(frame)
    assert [received(transport) for _ in frames] == frames


def test_a_simulator_that_hangs_keeps_nobody(transport: Transport) -> None:
    transport.send(b"hang")
    start = time.monotonic()
    assert transport.receive(0.2) is None
    assert time.monotonic() - start >= 0.2
    found: list[Burst | None] = []
    receiver = threading.Thread(target=lambda: found.append(transport.receive()))
    receiver.start()
    assert transport.receive(0.2) is None
    transport.close()
    receiver.join()
    assert found == [None]


def test_a_frame_begins_the_run_that_brings_its_answer(model: list[str]) -> None:
    """`send` starts the simulator; the receiver only collects, and the runs after a burst begin short."""
    begun: list[tuple[int, int]] = []

    class Noted(Simulator):
        def begin(self, cycles: int, runs: int = 1) -> None:
            begun.append((cycles, runs))
            super().begin(cycles, runs)

    with SimulatorTransport(lambda: Noted(model), Pace(rest_cycles=2**22)) as transport:
        wait_until(lambda: transport.receive(0.01) is None and transport.is_at_rest())
        begun.clear()
        transport.send(b"frame")
        assert [runs for _, runs in begun] == [2]
        assert received(transport) == b"frame"
        assert len(begun) == 1
        wait_until(lambda: transport.receive(0.01) is None and transport.is_at_rest())
        # The second run may have ended without a burst, which doubles the next one.
        assert begun[1] in [(64, 1), (128, 1)]
        assert all(runs == 1 for _, runs in begun[1:])


def test_waits_are_requested_only_while_they_are_wanted(model: list[str]) -> None:
    seen: list[Event] = []
    is_wanted = False

    def waits(rounds: int) -> list[Waits]:
        for _ in range(rounds):
            opened.send(b"\0" * 80)
            assert opened.receive(60) is not None
            time.sleep(0.012)
        found = [event for event in seen if isinstance(event, Waits)]
        seen.clear()
        return found

    with SimulatorTransport(lambda: Simulator(model), None, seen.append, lambda: is_wanted) as opened:
        assert waits(5) == []
        is_wanted = True
        found = waits(5)
        assert len(found) >= 3
        assert all(before.cycle < after.cycle for before, after in pairwise(found))
        for before, after in pairwise(found):
            cycles = after.cycle - before.cycle
            assert after.counts == (cycles, 0, cycles // 4)
        is_wanted = False
        waits(1)
        assert waits(5) == []


def test_frames_that_are_not_taken_hold_the_sender(transport: Transport) -> None:
    sent: list[int | str] = []

    def send() -> None:
        try:
            for number in range(5):
                transport.send(b"wait")
                sent.append(number)
        except TransportError as error:
            sent.append(str(error))

    sender = threading.Thread(target=send)
    sender.start()
    wait_until(lambda: len(sent) == 2)
    time.sleep(0.1)
    assert sent == [0, 1]
    transport.close()
    sender.join()
    assert sent == [0, 1, "the transport is closed"]


def test_bursts_that_nobody_takes_hold_the_simulator(model: list[str]) -> None:
    with SimulatorTransport(lambda: Simulator(model), Pace(most_bytes=1000, most_frames=100)) as transport:

        def send() -> None:
            for number in range(120):
                transport.send(bytes([number]) * 300)

        sender = threading.Thread(target=send)
        sender.start()
        wait_until(lambda: transport.waiting_bytes == 1200)
        time.sleep(0.1)
        assert transport.waiting_bytes == 1200
        assert [received(transport)[0] for _ in range(120)] == list(range(120))
        sender.join()


def test_closing_wakes_who_waits(transport: Transport) -> None:
    found: list[Burst | None] = []
    receiver = threading.Thread(target=lambda: found.append(transport.receive()))
    receiver.start()
    time.sleep(0.05)
    transport.close()
    transport.close()
    receiver.join()
    assert found == [None]
    with pytest.raises(TransportError, match="the transport is closed"):
        transport.send(b"late")


def test_the_end_of_the_simulator_is_told_to_both_sides(model: list[str]) -> None:
    transport = SimulatorTransport(lambda: Simulator(model))
    transport.send(b"right")
    transport.send(b"die")
    # What came before is there before it.
    assert received(transport) == b"right"
    with pytest.raises(TransportError, match="status 3; it printed:\nthe model dies"):
        transport.receive(60)
    with pytest.raises(TransportError, match="status 3"):
        transport.send(b"more")
    with pytest.raises(TransportError, match="status 3"):
        transport.receive(60)
    transport.close()


def test_another_simulator_takes_its_place_on_request(model: list[str]) -> None:
    with SimulatorTransport(lambda: Simulator(model), Pace(restarts=1)) as transport:
        transport.send(b"half")
        with pytest.raises(TransportResetError, match="killed by signal 9"):
            transport.receive(60)
        transport.send(b"whole")
        assert received(transport) == b"whole"
        transport.send(b"die")
        with pytest.raises(TransportError, match="status 3") as caught:
            transport.receive(60)
        assert not isinstance(caught.value, TransportResetError)


class _TimedSimulator:
    """A simulator in the time of a test: a beat in each cycle, and a burst at the end of the frame."""

    def __init__(self, cycle_seconds: float, frame_cycles: int) -> None:
        self.now = 0.0
        self.cycle = self.quiet = self.begun = 0
        self.runs: list[tuple[float, float]] = []
        self.counts: list[tuple[float, bool]] = []
        self._cycle_seconds = cycle_seconds
        self._left = self._frame_cycles = frame_cycles
        self._cycles = 0
        self._end = 0.0

    def request(self, frame: bytes) -> None:
        self._left = self._frame_cycles
        self._end = self.now

    def begin(self, cycles: int, runs: int = 1) -> None:
        self._cycles, self.begun = cycles, self.begun + runs

    def request_waits(self) -> None:
        self.counts.append((self.now, True))

    def end_waits(self) -> None:
        self.counts.append((self.now, False))

    def has_report(self, seconds: float) -> bool:
        return True

    def finish(self) -> list[Event]:
        cycles = min(self._cycles, self._left)
        self.begun -= 1
        self.runs.append((cycles * self._cycle_seconds, self.now - self._end))
        self.cycle += cycles
        self.now += cycles * self._cycle_seconds
        self._left -= cycles
        return [] if self._left or not cycles else [Taken(0, self.cycle), Burst(b"x")]

    def kill(self) -> None:
        """Nothing is left to do."""

    close = kill


def test_waits_are_counted_while_they_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The counts are at least 10 ms apart."""
    simulator, wanted = _TimedSimulator(1e-6, 50_000), [False]
    monkeypatch.setattr("fusesoc_firm.node.transport.simulator.time.monotonic", lambda: simulator.now)
    transport = SimulatorTransport(lambda: simulator, wants_waits=lambda: wanted[0])  # type: ignore[arg-type, return-value]
    for is_wanted in (False, True, False, True):
        wanted[0] = is_wanted
        simulator.now += 10.0
        simulator.counts.clear()
        transport.send(b"frame")
        assert transport.receive(10.0)
        assert {wants for _, wants in simulator.counts} == {is_wanted}
        assert 2 <= len(simulator.counts) <= 6
        assert all(after - before >= 0.01 for (before, _), (after, _) in pairwise(simulator.counts))
    transport.close()


@pytest.mark.check
def test_a_long_frame_takes_few_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame of 100 ms needed a hundred runs of 1 ms; no run takes much longer than an eighth of the time before."""
    simulator = _TimedSimulator(1e-6, 100_000)
    monkeypatch.setattr("fusesoc_firm.node.transport.simulator.time.monotonic", lambda: simulator.now)
    transport = SimulatorTransport(lambda: simulator)  # type: ignore[arg-type, return-value]
    for _ in range(3):
        simulator.runs.clear()
        transport.send(b"frame")
        assert transport.receive(10.0)
        assert 10 < len(simulator.runs) < 50
        late = [(took, since) for took, since in simulator.runs if took > 0.003 + since / 3]
        assert not late, late
        # The time at rest does not count.
        simulator.now += 10.0
    transport.close()
