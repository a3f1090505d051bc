"""The engine of a node, between a carrier and a transport that are none: what is sent, joined, lost, and said."""

from __future__ import annotations

import argparse
import csv
import random
import re
import struct
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.node.engine.bursts import split_frame
from fusesoc_firm.node.engine.carrier import CarrierError, ros_arguments
from fusesoc_firm.node.engine.cpp_trace import are_steps, write_ways
from fusesoc_firm.node.engine.player import Player
from fusesoc_firm.node.engine.queues import Overflow
from fusesoc_firm.node.engine.software import node_software
from fusesoc_firm.node.engine.trace import COLUMNS, CYCLES, WALL_TIMES, Trace
from fusesoc_firm.node.engine.trace_picture import draw_trace
from fusesoc_firm.node.engine.watch import Control, Latency, Load, Watch
from fusesoc_firm.node.interface.description import describe
from fusesoc_firm.node.interface.options import add_node_options, remappings
from fusesoc_firm.node.live_run import run_options
from fusesoc_firm.node.node import HardwareListener, Node, NodeSettings
from fusesoc_firm.node.package.python_node import python_node
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import InputError
from tests.node.fake_node import Answers, FakeHardware, Run, echo, loaded, pairs, until
from tests.system.systems import accelerator, converter, instance, specification


def point(x: float) -> bytes:
    return struct.pack("<ddd", x, 0.0, 0.0)


POINTS = [point(number) for number in range(40)]


class Bench:
    """Hardware that a node opens, perhaps several times."""

    def __init__(self, answers: object = echo, gate: threading.Event | None = None) -> None:
        self.opened: list[FakeHardware] = []
        self._answers = answers
        self._gate = gate

    def open(self, listener: HardwareListener) -> FakeHardware:
        self.opened.append(FakeHardware(self._answers, listener, self._gate))  # type: ignore[arg-type]
        return self.opened[-1]

    @property
    def hardware(self) -> FakeHardware:
        return self.opened[-1]


def test_messages_come_back_whole_and_in_order(tmp_path: Path) -> None:
    run = Run(describe(pairs(tmp_path)), Bench().open, NodeSettings(depth=100))
    run.carrier.give(0, *POINTS)
    run.carrier.give(1, *POINTS)
    run.stop()
    assert run.is_complete
    for topic in (0, 1):
        assert [payload for number, payload in run.carrier.published if number == topic] == POINTS
    counts = run.node.statistics
    assert (counts.inputs["a0"].received, counts.inputs["a0"].sent, counts.outputs["z1"].published) == (40, 40, 40)


def test_bytes_after_a_message_of_ros_2_are_removed(tmp_path: Path) -> None:
    blocks = converter("a0", "subscriber", "std_msgs/String", "z0", ros="ROS2")
    blocks += converter("z0", "publisher", "std_msgs/String", ros="ROS2")
    bench = Bench()
    run = Run(describe(loaded(tmp_path, specification(blocks))), bench.open)
    text = bytes.fromhex("00010000 02000000 6100")
    run.carrier.give(0, *(text + b"\xee" * more for more in (0, 3, 4, 200)), text[:-1])
    run.stop()
    assert bench.hardware.sent == [*[(0, text)] * 4, (0, text[:-1])]


def test_a_message_that_nothing_delays_is_sent_at_once(tmp_path: Path) -> None:
    """The thread that takes it sends it; while the hardware is not ready, messages wait in queues, in order."""
    gate = threading.Event()
    gate.set()
    senders: list[str] = []

    def noted(identifier: int, payload: bytes) -> list[Burst]:
        senders.append(threading.current_thread().name)
        return echo(identifier, payload)

    bench = Bench(noted, gate)
    run = Run(describe(pairs(tmp_path)), bench.open)
    run.carrier.give(0, POINTS[0])
    until(lambda: len(run.carrier.published) == 1)
    gate.clear()
    run.carrier.give(0, *POINTS[1:10])
    until(lambda: run.node.statistics.inputs["a0"].received == 10)
    gate.set()
    until(lambda: len(run.carrier.published) == 10)
    run.carrier.give(1, POINTS[10])
    until(lambda: len(run.carrier.published) == 11)
    run.stop()
    assert run.carrier.published == [*((0, item) for item in POINTS[:10]), (1, POINTS[10])]
    assert senders[0] == senders[-1] and {*senders[1:10]} == {senders[1]} and senders[0] != senders[1]
    assert run.is_complete and run.node.statistics.inputs["a0"].sent == 10


def test_the_least_recently_used_subscriber_is_next(tmp_path: Path) -> None:
    """Section 6.3.3: behind three messages of another one, a message waits for one of them at most."""
    gate = threading.Event()
    bench = Bench(gate=gate)
    run = Run(describe(pairs(tmp_path)), bench.open)
    run.carrier.give(0, *POINTS[:4])
    run.carrier.give(1, POINTS[9])
    until(lambda: run.node.statistics.inputs["a1"].received)
    gate.set()
    run.stop()
    # The first one was on its way already.
    assert [number for number, _ in bench.hardware.sent] == [0, 1, 0, 0, 0]


def test_bursts_are_joined(tmp_path: Path) -> None:
    """Two frames, sent in turns of as many beats as a seed says."""
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    kept: list[bytes] = []

    def answers(identifier: int, payload: bytes) -> list[Burst]:
        kept.append(pack_frame(identifier, payload))
        if len(kept) < 2:
            return []
        runs = [split_frame(frame, 8, [source.randint(1, 6) for _ in range(source.randint(0, 4))]) for frame in kept]
        turns = [number for number, bursts in enumerate(runs) for _ in bursts]
        source.shuffle(turns)
        return [Burst(runs[number].pop(0)) for number in turns]

    run = Run(describe(pairs(tmp_path)), Bench(answers).open)
    run.carrier.give(0, POINTS[1])
    run.carrier.give(1, POINTS[2])
    run.stop()
    assert run.is_complete
    assert sorted(run.carrier.published) == [(0, POINTS[1]), (1, POINTS[2])]


@pytest.mark.parametrize("knows_rest", [True, False])
def test_the_end_loses_nothing(tmp_path: Path, knows_rest: bool) -> None:
    """What was received before the end is sent, and what it leads to is published; the hardware needs its time."""
    gate = threading.Event()
    bench = Bench(gate=gate)
    run = Run(describe(pairs(tmp_path)), bench.open, NodeSettings(depth=100), settle=0.2)
    bench.hardware.knows_rest = knows_rest
    run.carrier.give(0, *POINTS)
    until(lambda: run.node.statistics.inputs["a0"].received == len(POINTS))
    threading.Timer(0.3, gate.set).start()
    run.stop()
    assert run.is_complete
    assert [payload for _, payload in run.carrier.published] == POINTS


def test_the_end_comes_in_time(tmp_path: Path) -> None:
    run = Run(describe(pairs(tmp_path)), Bench(gate=threading.Event()).open, NodeSettings(drain=0.3))
    run.carrier.give(0, *POINTS[:5])
    until(lambda: run.node.statistics.inputs["a0"].received == 5)
    run.stop()
    assert run.is_complete is False
    assert run.node.statistics.unfinished == 5
    assert "messages unfinished at the end: 5" in run.node.statistics.text()


def test_a_frame_of_which_a_part_came_is_unfinished(tmp_path: Path) -> None:
    def answers(identifier: int, payload: bytes) -> list[Burst]:
        return [Burst(pack_frame(identifier, payload)[:7])]

    run = Run(describe(pairs(tmp_path)), Bench(answers).open, NodeSettings(drain=0.3))
    run.carrier.give(0, POINTS[0])
    until(lambda: run.node.statistics.inputs["a0"].sent)
    run.stop()
    assert (run.is_complete, run.node.statistics.unfinished) == (False, 1)


@pytest.mark.parametrize(("overflow", "left"), [(Overflow.DROP_OLDEST, [0, 8, 9]), (Overflow.DROP_NEWEST, [0, 1, 2])])
def test_a_full_queue_drops_and_counts(tmp_path: Path, overflow: Overflow, left: list[int]) -> None:
    gate = threading.Event()
    run = Run(describe(pairs(tmp_path)), Bench(gate=gate).open, NodeSettings(2, overflow))
    run.carrier.give(0, POINTS[0])
    until(lambda: run.node._waiting() == 1 and not any(run.node._queues._queues))
    run.carrier.give(0, *POINTS[1:10])
    until(lambda: run.node.statistics.inputs["a0"].received == 10)
    gate.set()
    run.stop()
    assert run.is_complete
    assert [payload for _, payload in run.carrier.published] == [POINTS[number] for number in left]
    assert run.node.statistics.inputs["a0"].dropped == 7


def test_a_full_queue_that_blocks_loses_nothing(tmp_path: Path) -> None:
    run = Run(describe(pairs(tmp_path)), Bench().open, NodeSettings(1, Overflow.BLOCK))
    run.carrier.give(0, *POINTS)
    run.carrier.give(1, *POINTS)
    run.stop()
    assert run.is_complete
    assert [payload for number, payload in run.carrier.published if number == 1] == POINTS


def test_hardware_that_is_gone_ends_the_node(tmp_path: Path) -> None:
    bench = Bench()
    run = Run(describe(pairs(tmp_path)), bench.open)
    bench.hardware.error = TransportError("the simulator was killed")
    run.wait()
    assert isinstance(run.error, TransportError)
    assert str(run.error) == "the simulator was killed"


@pytest.mark.parametrize("fault", ["the simulator was killed", ""], ids=["failure", "close"])
def test_a_carrier_that_waits_for_room_does_not_hold_up_the_end(tmp_path: Path, fault: str) -> None:
    """One message is being sent, one waits in the queue, and the third waits for room in it."""
    bench = Bench(gate=threading.Event())
    settings = NodeSettings(1, Overflow.BLOCK, drain=600, report=lambda _: None)
    description = describe(pairs(tmp_path))
    node = Node(description, bench.open, settings)
    player = Player([(0, item) for item in POINTS], Control())
    with ThreadPoolExecutor() as pool:
        ended = pool.submit(node.run, dict.fromkeys(description.versions, player))
        until(lambda: node.statistics.inputs["a0"].received == 3)
        if fault:
            bench.hardware.error = TransportError(fault)
        else:
            node.stop()
            node.close()
        error = ended.exception(60)
    assert str(error or "") == fault
    assert player.wait_until_stopped(0)
    assert node.statistics.unfinished == 3


def test_hardware_that_is_gone_is_started_anew(tmp_path: Path) -> None:
    bench, watch = Bench(), Watch()
    run = Run(describe(pairs(tmp_path)), bench.open, NodeSettings(restarts=True, watch=watch))
    run.node.waited(0, 1000, [5])
    run.carrier.give(0, POINTS[0])
    until(lambda: run.carrier.published)
    bench.hardware.error = TransportError("the simulator was killed")
    until(lambda: len(bench.opened) == 2)
    run.carrier.give(0, POINTS[1])
    run.stop()
    assert run.is_complete
    assert [payload for _, payload in run.carrier.published] == POINTS[:2]
    assert run.reports == ["the simulator was killed; the hardware is restarted, and the messages in it are lost"]
    assert run.node.statistics.restarts == 1
    # The cycles of the record are those of the hardware that runs.
    assert watch.waits(10) == []


def test_hardware_that_never_works_is_given_up(tmp_path: Path) -> None:
    bench = Bench()

    def open_transport(listener: HardwareListener) -> FakeHardware:
        hardware = bench.open(listener)
        hardware.error = TransportError("it crashed at once")
        return hardware

    run = Run(describe(pairs(tmp_path)), open_transport, NodeSettings(restarts=True))
    run.wait()
    assert isinstance(run.error, TransportError)
    assert len(bench.opened) == 6


@pytest.mark.parametrize("garbage", [b"", b"\x07\x00", b"\x00" + struct.pack("<I", 2**31) + b"x", b"\x00" * 6])
def test_garbage_from_the_hardware_is_reported_and_the_rest_goes_on(tmp_path: Path, garbage: bytes) -> None:
    def answers(identifier: int, payload: bytes) -> list[Burst]:
        return [Burst(garbage), *echo(identifier, payload)]

    run = Run(describe(pairs(tmp_path)), Bench(answers).open, NodeSettings(depth=100))
    run.carrier.give(0, *POINTS)
    run.stop()
    assert run.is_complete
    assert [payload for _, payload in run.carrier.published] == POINTS
    assert run.node.statistics.faults == 40
    # A link that is broken for hours does not fill the disk.
    assert len(run.reports) == 21
    assert run.reports[0].startswith("the hardware sent an invalid burst: ")
    assert run.reports[20] == "further reports of this kind are counted, but not printed"


def test_a_message_that_the_hardware_refuses_is_counted(tmp_path: Path) -> None:
    bench = Bench()
    run = Run(describe(pairs(tmp_path)), bench.open, NodeSettings(depth=100))
    run.carrier.give(1, *POINTS)
    run.stop()
    for converter_, code in ((1, 7), (1, 0), (None, 0)):
        run.node.refused(converter_, code)
    assert (run.node.statistics.inputs["a1"].refused, run.node.statistics.faults) == (2, 1)
    said, size = "the hardware rejected a message from 'a1': ", f": the longest message had {len(POINTS[0])} bytes"
    assert run.reports[:2] == [
        f"{said}the payload is longer than maxLength (code 7); give the block a larger 'maxLength'{size}",
        f"{said}it is malformed, or longer than 'maxLength'",
    ]


def test_a_carrier_that_is_gone_ends_the_node(tmp_path: Path) -> None:
    run = Run(describe(pairs(tmp_path)), Bench().open)
    run.carrier.end(CarrierError("the process for ROS 1 has ended"))
    run.wait()
    assert isinstance(run.error, CarrierError)


class BrokenTransport(FakeHardware):
    """Hardware whose transport has a fault in its code, in one method."""

    broken = ""

    def send(self, frame: bytes) -> None:
        if self.broken == "send":
            raise KeyError("send")
        super().send(frame)

    def receive(self, timeout: float | None = None) -> Burst | None:
        if self.broken == "receive":
            raise KeyError("receive")
        return super().receive(timeout)


@pytest.mark.parametrize("method", ["send", "receive"])
def test_an_unexpected_exception_ends_the_node(tmp_path: Path, method: str) -> None:
    """Whichever thread it ends: the run ends with it, and does not wait for what the thread no longer does."""
    hardware: list[BrokenTransport] = []

    def opened(listener: HardwareListener) -> FakeHardware:
        hardware.append(BrokenTransport(echo, listener))
        return hardware[0]

    run = Run(describe(pairs(tmp_path)), opened)
    hardware[0].broken = method
    run.carrier.give(0, POINTS[0])
    run.wait()
    assert isinstance(run.error, KeyError)
    assert run.error.args == (method,)


def test_an_unexpected_exception_of_a_carrier_ends_the_node(tmp_path: Path) -> None:
    """It tells of messages of a topic that the node does not have."""
    run = Run(describe(pairs(tmp_path)), Bench().open)
    run.carrier.lose(99, 1)
    run.wait()
    assert isinstance(run.error, IndexError)


def test_a_carrier_that_ends_stops_the_node(tmp_path: Path) -> None:
    """Such as by `rosnode kill`."""
    run = Run(describe(pairs(tmp_path)), Bench().open)
    run.carrier.give(0, *POINTS[:5])
    run.carrier.end()
    run.wait()
    assert run.is_complete
    assert len(run.carrier.published) == 5


# --- software --------------------------------------------------------------------------------------------------------

DOUBLE = """def soft(message):
    if message["x"] == 3.0:
        raise ValueError("three")
    return {**message, "x": 2 * message["x"]}
"""


def crossed(identifier: int, payload: bytes) -> list[Burst]:
    """Where software stands between two accelerators: subscriber 0 leads to it, it leads to publisher 0."""
    return echo(1 - identifier, payload)


def with_software(folder: Path, *kinds: str, code: str = DOUBLE) -> LoadedSystem:
    """Blocks `b0`, `b1`, ... in a row between `sub` and `pub`."""
    names = [f"b{number}" for number in range(len(kinds))]
    blocks = converter("sub", "subscriber", "Point", names[0])
    blocks += "".join(instance(*item) for item in zip(names, kinds, [*names[1:], "pub"], strict=True))
    blocks += converter("pub", "publisher", "Point")
    types = accelerator("hard", "Point", "Point") + accelerator("soft", "Point", "Point", "ROS-SW", "soft.py")
    (folder / "soft.py").write_text(code, encoding="utf-8")
    return loaded(folder, specification(blocks, types))


@pytest.mark.parametrize(
    ("kinds", "factor"),
    [(("hard", "soft"), 2), (("soft", "hard"), 2), (("hard", "soft", "hard"), 2), (("soft", "hard", "soft"), 4)],
)
def test_software_takes_part(tmp_path: Path, kinds: tuple[str, ...], factor: int) -> None:
    """Between hardware and topics, in the order of the messages; a fault is shown at its line, and its message lost."""
    system = with_software(tmp_path, *kinds)
    faults: list[InputError] = []
    with node_software(system, faults.append) as software:
        bench = Bench(crossed if kinds == ("hard", "soft", "hard") else echo)
        run = Run(describe(system), bench.open, NodeSettings(depth=100), software)
        run.carrier.give(0, *POINTS)
        run.stop()
    assert run.is_complete
    left = [number for number in range(40) if number != 3]
    assert [payload for _, payload in run.carrier.published] == [point(factor * number) for number in left]
    assert software and software.faults == len(faults) == 1
    assert f"{tmp_path / 'soft.py'}:3:" in str(faults[0])
    assert "raised ValueError for message 3 to" in str(faults[0])


def test_software_that_gives_more_than_fits_never_waits_for_itself(tmp_path: Path) -> None:
    """A function that answers while its queue to the hardware is full loses messages, and the node goes on."""
    system = with_software(tmp_path, "hard", "soft", "hard", code=DOUBLE)
    with node_software(system, lambda error: None) as software:

        def answers(identifier: int, payload: bytes) -> list[Burst]:
            # Each message to the software comes eightfold.
            return crossed(identifier, payload) * (8 if identifier == 0 else 1)

        run = Run(describe(system), Bench(answers).open, NodeSettings(2, Overflow.BLOCK), software)
        run.carrier.give(0, *POINTS)
        run.stop()
    assert run.is_complete
    counts = run.node.statistics.inputs["b1_out"]
    assert counts.received == 8 * 39
    assert len(run.carrier.published) == counts.sent == counts.received - counts.dropped


class LingeringHardware(FakeHardware):
    """Answers one frame and fails at the next one; its bursts are received when the test says so, even after that."""

    def __init__(self, answers: Answers, listener: HardwareListener) -> None:
        super().__init__(answers, listener)
        self.is_received = threading.Event()

    def is_ready(self) -> bool:
        return False

    def send(self, frame: bytes) -> None:
        if self.sent:
            raise TransportError("it is gone")
        super().send(frame)

    def receive(self, timeout: float | None = None) -> Burst | None:
        return super().receive(timeout) if self.is_received.wait(timeout) else None

    def _check(self) -> None:
        """Give what is left."""


def test_bursts_that_arrived_before_a_failure_are_published(tmp_path: Path) -> None:
    """Software takes the first one and answers; without hardware to take it, the answer is dropped."""
    blocks = converter("sub", "subscriber", "Point", "hard") + instance("hard", "hard", "soft", "pub")
    blocks += instance("soft", "soft", "end") + instance("end", "hard", "other")
    blocks += converter("pub", "publisher", "Point") + converter("other", "publisher", "Point")
    types = accelerator("hard", "Point", "Point") + accelerator("soft", "Point", "Point", "ROS-SW", "soft.py")
    (tmp_path / "soft.py").write_text("def soft(message):\n    return message\n", encoding="utf-8")
    system = loaded(tmp_path, specification(blocks, types))
    publishers = {item.block: item.id for item in system.system.publishers}
    opened: list[LingeringHardware] = []

    def open_hardware(listener: HardwareListener) -> LingeringHardware:
        ends = (publishers["soft_in"], publishers["pub"])
        opened.append(LingeringHardware(lambda _, payload: [Burst(pack_frame(end, payload)) for end in ends], listener))
        return opened[-1]

    with node_software(system, lambda error: None) as software:
        run = Run(describe(system), open_hardware, NodeSettings(drain=600), software)
        run.carrier.give(0, *POINTS[1:3])
        # The node closes its queues before it stops its carriers.
        until(lambda: run.carrier.wait_until_stopped(0))
        opened[-1].is_received.set()
        run.wait()
    assert str(run.error) == "it is gone"
    assert run.carrier.published == [(publishers["pub"], POINTS[1])]
    answers = run.node.statistics.inputs["soft_out"]
    assert (answers.received, answers.dropped, answers.sent) == (1, 1, 0)


def test_a_fault_of_software_holds_up_nobody_else(tmp_path: Path) -> None:
    """Two blocks take a message, and one of them fails at it: the other one's answer comes all the same."""
    (tmp_path / "soft.py").write_text(DOUBLE, encoding="utf-8")
    (tmp_path / "same.py").write_text("def same(message):\n    return message\n", encoding="utf-8")
    blocks = converter("sub", "subscriber", "Point", "bad", "good") + instance("bad", "soft", "b0")
    blocks += instance("b0", "hard", "z0") + converter("z0", "publisher", "Point")
    blocks += instance("good", "same", "z1") + converter("z1", "publisher", "Point")
    types = accelerator("hard", "Point", "Point") + accelerator("soft", "Point", "Point", "ROS-SW", "soft.py")
    types += accelerator("same", "Point", "Point", "ROS-SW", "same.py")
    system = loaded(tmp_path, specification(blocks, types))
    with node_software(system, lambda error: None) as software:
        run = Run(describe(system), Bench().open, software=software)
        run.carrier.give(0, point(3.0))
        run.stop()
    assert run.carrier.published == [(1, point(3.0))]
    assert software and software.faults == 1


def test_a_message_that_is_none_is_reported(tmp_path: Path) -> None:
    system = with_software(tmp_path, "soft", "hard")
    faults: list[InputError] = []
    with node_software(system, faults.append) as software:
        run = Run(describe(system), Bench().open, software=software)
        run.carrier.give(0, b"short", POINTS[1])
        run.stop()
    assert [payload for _, payload in run.carrier.published] == [point(2.0)]
    assert "a message from 'sub' is not a valid geometry_msgs/Point" in str(faults[0])


# --- the trace -------------------------------------------------------------------------------------------------------


def test_the_trace_has_each_message_and_both_times(tmp_path: Path) -> None:
    system = pairs(tmp_path, project="{name: robot, width: 8, clock: 100 MHz}")
    description = describe(system)
    trace = Trace(tmp_path / "trace.csv", description)
    run = Run(description, Bench().open, NodeSettings(depth=100), trace=trace)
    run.carrier.give(0, *POINTS[:3])
    run.carrier.give(1, POINTS[3])
    until(lambda: len(run.carrier.published) == 4)
    run.stop()
    trace.close()
    rows = [*csv.DictReader((tmp_path / "trace.csv").read_text().split("\n"))]
    assert sorted((row["subscriber"], row["publisher"]) for row in rows) == [("a0", "z0")] * 3 + [("a1", "z1")]
    for row in rows:
        times = [int(row[name]) for name in ("received_ns", "queued_ns", "sent_ns", "published_ns")]
        assert times == sorted(times)
        assert int(row["came_ns"]) <= int(row["published_ns"])
        # 29 bytes, a beat each; the answer begins in the cycle behind.
        assert [int(row[name]) for name in ("input_cycles", "accelerator_cycles", "output_cycles")] == [28, 1, 28]
        assert float(row["hardware_ns"]) == 570.0


def test_a_watch_has_each_message_with_its_cause_and_latency(tmp_path: Path) -> None:
    watch = Watch()
    run = Run(
        describe(pairs(tmp_path)), Bench().open, NodeSettings(depth=2, overflow=Overflow.DROP_NEWEST, watch=watch)
    )
    run.carrier.give(0, *POINTS[:1])
    run.carrier.give(1, POINTS[1])
    until(lambda: watch.since(-1, 9).last == 3)
    run.stop()
    seen = watch.since(-1, 9).messages
    assert sorted((item.block, item.payload) for item in seen) == sorted(
        [("a0", POINTS[0]), ("z0", POINTS[0]), ("a1", POINTS[1]), ("z1", POINTS[1])]
    )
    for item in seen:
        if item.block.startswith("z"):
            cause = watch.find(item.latency.cause or 0)
            assert cause
            assert cause.block == item.block.replace("z", "a")
            # 29 bytes, a beat each; the answer begins in the cycle behind.
            assert item.latency.cycles == 57
            assert item.latency.wall_ns is not None
            assert 0 <= item.latency.wall_ns <= item.time_ns
        else:
            assert item.latency == Latency()


def test_a_watch_tells_how_full_the_queues_are(tmp_path: Path) -> None:
    watch, gate = Watch(), threading.Event()
    settings = NodeSettings(depth=3, overflow=Overflow.DROP_OLDEST, drain=60, watch=watch)
    run = Run(describe(pairs(tmp_path)), Bench(gate=gate).open, settings)
    run.carrier.give(0, POINTS[0])
    until(lambda: run.node._waiting() == 1 and not any(run.node._queues._queues))
    run.carrier.give(0, *POINTS[:9])
    until(lambda: watch.since(-1, 0).last == 9)
    # One message waits for the hardware outside the queue.
    until(lambda: watch.loads()["a0"] == Load(3, 3, 6, 0, 0))
    gate.set()
    until(lambda: watch.loads()["a0"].waiting == 0)
    run.stop()
    assert watch.loads()["a0"] == Load(0, 3, 6, 0, 0)
    assert run.node.statistics.inputs["a0"].dropped == 6


def test_a_full_disk_ends_the_trace_but_not_the_node(tmp_path: Path) -> None:
    """As many messages as fill the buffer of the file, twice."""
    description, reports = describe(pairs(tmp_path)), list[str]()
    trace = Trace(Path("/dev/full"), description, report=reports.append)
    run = Run(description, Bench().open, NodeSettings(depth=1000), trace=trace)
    for _ in range(10):
        run.carrier.give(0, *POINTS)
    run.stop()
    trace.close()
    assert run.is_complete and run.error is None
    assert run.node.statistics.outputs["z0"].published == 400
    assert reports == ["the trace ends, since /dev/full cannot be written: No space left on device"]


def test_the_trace_knows_what_got_no_answer(tmp_path: Path) -> None:
    """A refused message has none, and those behind it keep theirs."""
    description = describe(pairs(tmp_path))
    trace = Trace(tmp_path / "trace.csv", description)
    bench = Bench()

    def open_transport(listener: HardwareListener) -> FakeHardware:
        def answers(identifier: int, payload: bytes) -> list[Burst]:
            if payload == POINTS[1]:
                listener.refused(identifier)
                return []
            return [] if payload == POINTS[4] else echo(identifier, payload)

        bench.opened.append(FakeHardware(answers, listener))
        return bench.opened[-1]

    run = Run(description, open_transport, NodeSettings(depth=100), trace=trace)
    run.carrier.give(0, *POINTS[:5])
    until(lambda: len(run.carrier.published) == 3)
    run.stop()
    trace.close()
    rows = {
        int(row["message"]): row["publisher"]
        for row in csv.DictReader((tmp_path / "trace.csv").read_text().split("\n"))
    }
    assert rows == {0: "z0", 2: "z0", 3: "z0", 4: ""}


# What a node in C++ writes of two messages whose answers come in turn, the first one in two bursts; a third gets none.
STEPS = """\
wall_ns,event,converter,message,bytes,first_cycle,last_cycle
1000,received,0,0,24,,
1100,queued,0,0,24,,
1200,received,1,1,24,,
1250,queued,1,1,24,,
1300,taken,0,0,24,10,38
1350,sent,0,0,24,,
1400,sent,1,1,24,,
1500,taken,1,1,24,40,68
1600,burst,0,0,16,39,54
1700,burst,1,0,29,69,97
1750,received,0,2,24,,
1800,burst,0,0,14,98,111
1900,published,1,0,24,,
2000,published,0,1,24,,
2100,sent,0,2,24,,
"""


def test_the_steps_of_a_node_in_cpp_become_ways(tmp_path: Path) -> None:
    steps, ways = tmp_path / "steps.csv", tmp_path / "ways.csv"
    steps.write_text(STEPS)
    assert are_steps(steps)
    write_ways(steps, ways, describe(pairs(tmp_path)))
    assert not are_steps(ways)
    rows = [*csv.DictReader(ways.read_text().split("\n"))]
    names = ("subscriber", "publisher", "bytes_out", *WALL_TIMES, *CYCLES)
    assert [",".join(row[name] for name in names) for row in rows] == [
        "a1,z1,24,200,250,400,700,900,40,68,69,97",
        "a0,z0,24,0,100,350,800,1000,10,38,39,111",
        "a0,,,750,750,1100,,,,,,",
    ]
    draw_trace(ways, tmp_path / "ways.svg")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1,received,0,zero,24,,", "steps.csv:2 is not a step in a node's trace"),
        ("1,received,0", "steps.csv:2 is not a step in a node's trace"),
        ("1,lost,0,0,24,,", "steps.csv:2: unknown step 'lost'"),
        ("1,received,2,0,24,,", "steps.csv:2: 'robot' has no topic for converter 2 and step 'received'"),
    ],
)
def test_steps_that_are_none_are_told(tmp_path: Path, line: str, message: str) -> None:
    (tmp_path / "steps.csv").write_text(f"{STEPS.splitlines()[0]}\n{line}\n")
    with pytest.raises(InputError) as raised:
        write_ways(tmp_path / "steps.csv", tmp_path / "ways.csv", describe(pairs(tmp_path)))
    assert message in str(raised.value)


def test_a_trace_is_drawn(tmp_path: Path) -> None:
    description = describe(pairs(tmp_path))
    trace = Trace(tmp_path / "trace.csv", description)
    run = Run(description, Bench().open, trace=trace)
    run.carrier.give(0, *POINTS[:3])
    run.stop()
    trace.close()
    for name in ("one.svg", "two.svg", "picture.png"):
        draw_trace(tmp_path / "trace.csv", tmp_path / name)
    drawn = (tmp_path / "one.svg").read_text(encoding="utf-8")
    assert drawn == (tmp_path / "two.svg").read_text(encoding="utf-8")
    for text in ("a0 to z0, wall time", "a0 to z0, simulated time", "accelerator: p50 1, p95 1, p99 1 cycles"):
        assert f"<!-- {text}" in drawn


def test_a_picture_of_a_trace_has_units(tmp_path: Path) -> None:
    """Of 100 messages, the n-th takes n ms by the wall clock; a cycle is 10 ns."""
    rows = [",".join(COLUMNS)]
    rows += [
        f"{n},a,z,8,8,0,0,0,{n * 10**6},{n * 10**6},0,10,10,{10 + n},10,0,{n},{(10 + n) * 10}" for n in range(1, 101)
    ]
    (tmp_path / "t.csv").write_text("\n".join(rows), encoding="utf-8")
    draw_trace(tmp_path / "t.csv", tmp_path / "t.svg")
    drawn = (tmp_path / "t.svg").read_text(encoding="utf-8")
    for text in ("whole way: p50 50, p95 95, p99 99 ms", "hardware: p50 50, p95 95", "p50 0.6, p95 1.05, p99 1.09 us"):
        assert text in drawn, text


@pytest.mark.parametrize(
    ("table", "picture", "message"),
    [
        ("trace.csv", "ways.gif", "ways.gif: unknown file extension"),
        ("none.csv", "ways.svg", "cannot read "),
        ("other.csv", "ways.svg", "is not a node's trace"),
        ("trace.csv", "ways.svg", "contains no messages with a response"),
        ("broken.csv", "ways.svg", "broken.csv:2 is not a valid row of a trace"),
        ("good.csv", "no/ways.svg", "/no/ways.svg: there is no folder "),
    ],
)
def test_what_cannot_be_drawn_is_told(tmp_path: Path, table: str, picture: str, message: str) -> None:
    Trace(tmp_path / "trace.csv", describe(pairs(tmp_path))).close()
    head = (tmp_path / "trace.csv").read_text(encoding="utf-8")
    (tmp_path / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    (tmp_path / "broken.csv").write_text(f"{head}0,a0,z0,many{',' * 14}\n", encoding="utf-8")
    (tmp_path / "good.csv").write_text(f"{head}0,a0,z0{',' * 15}\n", encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(message)):
        draw_trace(tmp_path / table, tmp_path / picture)


# --- the description, as a file and on a command line ----------------------------------------------------------------


@pytest.mark.parametrize("kinds", [("hard", "soft", "hard"), ("hard",)])
def test_the_generated_file_has_the_table(tmp_path: Path, kinds: tuple[str, ...]) -> None:
    system = with_software(tmp_path, *kinds)
    spec = tmp_path / "spec.yaml"
    source = python_node(system, ROS1, spec, tmp_path / "nodes" / "robot")["robot_node.py"]
    names: dict[str, object] = {"__name__": "generated"}
    exec(compile(source, "robot_node.py", "exec"), names)
    assert names["NODE"] == describe(system)
    call = 'main(NODE, __file__, "../../spec.yaml", [])' if "soft" in kinds else "main(NODE)"
    assert source.endswith(f'if __name__ == "__main__":\n    {call}\n')


def test_a_generated_file_of_another_version_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="system 'robot' has no ROS 2 topics"):
        python_node(pairs(tmp_path), ROS2, tmp_path / "spec.yaml", tmp_path)


def parsed(line: str) -> tuple[argparse.Namespace, tuple[str, ...]]:
    parser = argparse.ArgumentParser()
    add_node_options(parser)
    arguments, rest = parser.parse_known_args(line.split())
    return arguments, remappings(rest, parser.error)


def test_what_is_for_ros_goes_to_ros(tmp_path: Path) -> None:
    description = describe(pairs(tmp_path))
    options = run_options(*parsed("a0:=/b --queue 3 __ns:=/left --name eye --qos best_effort"), description)
    assert options.ros.arguments == ("a0:=/b", "__ns:=/left")
    assert (options.ros.name, options.ros.depth, options.ros.is_reliable) == ("eye", 3, False)
    assert (options.versions, options.settings.depth) == ((1,), 3)
    both = replace(description, publishers=(replace(description.publishers[0], ros=2),))
    options = run_options(*parsed("a:=b --ros-args -r __ns:=/left --log-level debug"), both)
    assert options.versions == (1, 2)
    assert [*ros_arguments(2, options.ros.arguments)] == "--ros-args -r a:=b -r __ns:=/left --log-level debug".split()
    assert [*ros_arguments(1, options.ros.arguments)] == ["a:=b"]
    assert run_options(*parsed(""), both, ros=2).versions == (2,)


@pytest.mark.parametrize("line", ["--bogus", "word", "--queue 0", "--queue x", "--drain -1", "--drain nan"])
def test_a_wrong_command_line_is_refused(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        parsed(line)
    assert line.rsplit(maxsplit=1)[-1] in capsys.readouterr().err


def test_what_no_version_knows_is_refused(tmp_path: Path) -> None:
    description = describe(pairs(tmp_path))
    with pytest.raises(InputError, match="has no ROS 2 topics, only topics of ROS 1"):
        run_options(*parsed(""), description, ros=2)
    with pytest.raises(InputError, match="'--ros-args' is for ROS 2"):
        run_options(*parsed("--ros-args -r a:=b"), description)


@pytest.mark.parametrize("topic", ["/arm/left", "arm/left"])
def test_a_relative_topic_moves_with_the_namespace(tmp_path: Path, topic: str) -> None:
    blocks = converter("a", "subscriber", "Point", "out").replace("}\n", f", topic: {topic}}}\n")
    found = describe(loaded(tmp_path, specification(blocks + converter("out", "publisher", "Point"))))
    assert [topic.name for topic in (*found.subscribers, *found.publishers)] == [topic, "out"]
    assert replace(found.publishers[0], block="a", name=topic) == found.subscribers[0]


def test_a_topic_has_the_quality_of_its_block(tmp_path: Path) -> None:
    """A profile, its keys overridden, and the defaults."""
    blocks = (
        "  - {name: a, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: z}],"
        " qos: {profile: sensor_data, durability: transient_local}}\n"
        "  - {name: z, middleware: ROS2, mode: publisher, message: geometry_msgs/Point, qos: {depth: 7}}\n"
        "  - {name: b, middleware: ROS, mode: subscriber, message: std_msgs/Header, outgoing: [{name: y}]}\n"
        "  - {name: y, middleware: ROS, mode: publisher, message: std_msgs/Header}\n"
    )
    description = describe(loaded(tmp_path, f"project: {{name: robot}}\nblocks:\n{blocks}"))
    found = [
        (topic.is_reliable, topic.is_transient_local, topic.depth)
        for topic in (*description.subscribers, *description.publishers)
    ]
    assert found == [(False, True, 5), (True, False, 100), (True, False, 7), (True, False, 100)]


def test_messages_that_the_carrier_has_lost_are_counted_and_reported(tmp_path: Path) -> None:
    bench = Bench()
    run = Run(describe(pairs(tmp_path)), bench.open)
    run.carrier.lose(1, 3)
    run.carrier.give(1, POINTS[0])
    until(lambda: any(report.is_warning for report in run.carrier.reports))
    until(lambda: not run.carrier.reports[-1].is_warning)
    counts = run.carrier.reports[-1].counts
    assert [counts[f"a1 {name}"] for name in ("received", "dropped", "sent", "lost")] == [1, 0, 1, 3]
    run.stop()
    assert run.node.statistics.inputs["a1"].lost == 3
