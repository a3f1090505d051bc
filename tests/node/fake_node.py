"""What stands at both ends of a node in tests: a carrier without ROS, and hardware without a simulator."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.carrier import Answer, Answered, Call, Called, CarrierError, Event, Lost, Published, Taken
from fusesoc_firm.node.engine.software import NodeSoftware
from fusesoc_firm.node.engine.trace import Trace
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.interface.diagnostics import Report
from fusesoc_firm.node.node import HardwareListener, Node, NodeSettings, OpenTransport
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from tests.system.systems import LIBRARIES, accelerator, converter, instance, specification

# What a frame leads to.
Answers = Callable[[int, bytes], list[Burst]]


class FakeCarrier:
    """Gives what `give` is told, keeps what is published."""

    def __init__(self) -> None:
        self.published: list[tuple[int, bytes]] = []
        self.reports: list[Report] = []
        self.answers: list[tuple[int, int, Answer]] = []
        self.calls: list[tuple[int, Call]] = []
        self._events: SimpleQueue[Event | CarrierError | None] = SimpleQueue()
        self._stopped = threading.Event()

    def give(self, topic: int, *payloads: bytes) -> None:
        for payload in payloads:
            self._events.put(Taken(topic, payload, time.monotonic_ns()))

    def lose(self, topic: int, count: int) -> None:
        self._events.put(Lost(topic, count))

    def end(self, error: CarrierError | None = None) -> None:
        self._events.put(error)

    def receive(self) -> Iterator[Event]:
        while True:
            event = self._events.get()
            if event is None:
                self._stopped.set()
                return
            if isinstance(event, CarrierError):
                self._stopped.set()
                raise event
            yield event

    def publish(self, topic: int, payload: bytes) -> None:
        self.published.append((topic, payload))
        self._events.put(Published(topic, time.monotonic_ns()))

    def ask(self, service: int, call: Call) -> None:
        """A call from ROS."""
        self._events.put(Called(service, call))

    def reply(self, service: int, number: int, answer: Answer) -> None:
        """ROS's answer to a call by the hardware."""
        self._events.put(Answered(service, number, answer))

    def call(self, service: int, call: Call) -> None:
        self.calls.append((service, call))

    def answer(self, service: int, number: int, answer: Answer) -> None:
        self.answers.append((service, number, answer))

    def diagnose(self, report: Report) -> None:
        self.reports.append(report)

    def stop(self) -> None:
        self._events.put(None)

    def wait_until_stopped(self, timeout: float) -> bool:
        return self._stopped.wait(timeout)

    def close(self) -> None:
        """Nothing is left to do."""


class FakeHardware:
    """Answers every frame by `answers`; takes none before `gate` is open. In simulated time a beat has a byte."""

    def __init__(self, answers: Answers, listener: HardwareListener, gate: threading.Event | None = None) -> None:
        self.sent: list[tuple[int, bytes]] = []
        self.error: TransportError | None = None
        self.knows_rest = True
        self.holds = 0
        self._answers = answers
        self._listener = listener
        self._gate = gate
        self._cycle = 0
        self._bursts: SimpleQueue[Burst] = SimpleQueue()
        self._is_closed = threading.Event()

    def send(self, frame: bytes) -> None:
        while self._gate and not self._gate.wait(0.01):
            self._check()
        self._check()
        identifier, payload = frame[0], frame[5:]
        assert len(payload) == struct.unpack_from("<I", frame, 1)[0]
        self.sent.append((identifier, payload))
        self._listener.taken(self._cycle, self._cycle + len(frame) - 1)
        self._cycle += len(frame)
        for burst in self._answers(identifier, payload):
            first, self._cycle = self._cycle, self._cycle + len(burst.data)
            self._bursts.put(replace(burst, first_cycle=first, last_cycle=self._cycle - 1))

    def is_ready(self) -> bool:
        return not self._gate or self._gate.is_set()

    def receive(self, timeout: float | None = None) -> Burst | None:
        self._check()
        try:
            return self._bursts.get(timeout=timeout)
        except Empty:
            return None

    def is_at_rest(self) -> bool | None:
        return self._bursts.empty() if self.knows_rest else None

    def close(self) -> None:
        self._is_closed.set()

    def __enter__(self) -> FakeHardware:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check(self) -> None:
        if self.error or self._is_closed.is_set():
            raise self.error or TransportError("it is closed")


def echo(identifier: int, payload: bytes) -> list[Burst]:
    """Publisher n sends what came to subscriber n."""
    return [Burst(pack_frame(identifier, payload))]


class Run:
    """A node between the two, working in a thread of its own."""

    def __init__(
        self,
        description: NodeDescription,
        open_transport: OpenTransport,
        settings: NodeSettings | None = None,
        software: NodeSoftware | None = None,
        trace: Trace | None = None,
        settle: float = 0.0,
    ) -> None:
        """`FakeHardware` answers while it takes a frame, so no silence is needed to know that it has answered all."""
        self.carrier = FakeCarrier()
        self.reports: list[str] = []
        self.error: Exception | None = None
        self.is_complete: bool | None = None
        given = settings or NodeSettings()
        parts = {name: getattr(given, name) for name in ("depth", "overflow", "drain", "restarts", "watch")}
        settings = NodeSettings(**parts, settle=settle, report=self.reports.append)
        self.node = Node(description, open_transport, settings, software, trace)
        self._ros = min(description.versions, default=1)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.is_complete = self.node.run({self._ros: self.carrier})
        except Exception as error:  # noqa: BLE001 - it is the test's
            self.error = error

    def stop(self) -> None:
        self.node.stop()
        self.wait()

    def wait(self) -> None:
        self._thread.join()


def until(condition: Callable[[], object]) -> None:
    """Wait for what other threads do."""
    while not condition():
        time.sleep(0.002)


def loaded(folder: Path, text: str) -> LoadedSystem:
    """The system of a specification."""
    path = folder / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    (folder / "acc.vhd").touch()
    return load_system(path, LIBRARIES)


def pairs(folder: Path, count: int = 2, project: str = "{name: robot, width: 8}") -> LoadedSystem:
    """A system of subscribers `a0`, `a1`, ..., each before an accelerator and a publisher `z0`, `z1`, ..."""
    blocks = "".join(
        converter(f"a{number}", "subscriber", "Point", f"b{number}")
        + instance(f"b{number}", "hard", f"z{number}")
        + converter(f"z{number}", "publisher", "Point")
        for number in range(count)
    )
    return loaded(folder, specification(blocks, accelerator("hard", "Point", "Point"), project))
