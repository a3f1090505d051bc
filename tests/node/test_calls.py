"""Calls of services: each answer goes to its call, whatever the hardware does with requests and responses."""

from __future__ import annotations

import random
import re
import shutil
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.node.engine.calls import MOST_WAITING, CallLine
from fusesoc_firm.node.engine.carrier import Answer, Call
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.node.node import HardwareListener, NodeSettings
from fusesoc_firm.node.package.python_node import python_node
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.system.system_core import load_system
from tests.node.fake_node import FakeHardware, Run, until

CAMERA = Path(__file__).resolve().parents[1] / "ros/camera/camera.yaml"
LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
DESCRIPTION = describe(load_system(CAMERA, LIBRARIES))


def description(limit: float = 30.0, **changes: Any) -> NodeDescription:
    """The node of the service, with another time limit in s."""
    (service,) = DESCRIPTION.services
    return replace(DESCRIPTION, services=(replace(service, time_limit=limit, **changes),))


def started(work: Callable[[], None]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


class Server:
    """Hardware with a service. The first byte of a request says what becomes of it; a response is reversed."""

    def __init__(self) -> None:
        self.hardware: FakeHardware | None = None
        self.late: list[bytes] = []

    def open(self, listener: HardwareListener) -> FakeHardware:
        self.listener = listener
        self.hardware = FakeHardware(self.answers, listener)
        return self.hardware

    def answers(self, _: int, payload: bytes) -> list[Burst]:
        late = [Burst(pack_frame(0, item)) for item in self.late]
        self.late = []
        frame = pack_frame(0, payload[::-1])
        match payload[:1]:
            case b"s":  # in silence
                return late
            case b"l":  # late
                self.late.append(payload[::-1])
                return late
            case b"a":  # aborted
                return [*late, Burst(frame[:8], is_aborted=True)]
            case b"r":  # refused, and with it the response
                self.listener.refused(0)
                return [*late, Burst(frame[:8], is_aborted=True)]
            case b"n":  # refused, without any response
                self.listener.refused(0)
                return late
            case b"t":  # twice
                return [*late, Burst(frame), Burst(frame)]
        return [*late, Burst(frame)]


def test_many_clients_are_answered_each_with_its_own() -> None:
    run = Run(description(), Server().open)
    calls = [Call(number, b"c%d" % number) for number in range(200)]
    for call in calls:
        run.carrier.ask(0, call)
    run.stop()
    assert run.is_complete
    expected = [(0, call.number, Answer(call.payload[::-1])) for call in calls]
    assert run.carrier.answers == expected
    assert re.search(r"^set_camera_info +200 +200 +0 +0$", run.node.statistics.text(), re.MULTILINE)


@pytest.mark.parametrize("knows_rest", [True, False])
def test_failures_meet_only_the_call_that_they_concern(knows_rest: bool) -> None:
    """Calls of all kinds in random order; hardware that does not know whether it is at rest takes longer."""
    seed = random.randrange(2**32)
    print(f"seed {seed}")
    source = random.Random(seed)
    kinds = "cccarn" if knows_rest else "cca"
    server = Server()
    run = Run(description(), server.open)
    assert server.hardware
    server.hardware.knows_rest = knows_rest
    calls = [Call(number, f"{source.choice(kinds)}{number}".encode()) for number in range(60)]
    for call in calls:
        run.carrier.ask(0, call)
    run.stop()
    assert len(run.carrier.answers) == len(calls)
    for call, (_, number, answer) in zip(calls, run.carrier.answers, strict=True):
        assert number == call.number
        if call.payload.startswith(b"c"):
            assert answer == Answer(call.payload[::-1])
        else:
            reason = "aborted the response" if call.payload.startswith(b"a") else "rejected the request"
            assert (answer.payload, answer.reason) == (None, f"the hardware {reason}")
    failed = sum(not call.payload.startswith(b"c") for call in calls)
    (counts,) = run.node.statistics.services.values()
    assert (counts.called, counts.answered, counts.failed, counts.unasked) == (60, 60 - failed, failed, 0)


@pytest.mark.parametrize("knows_rest", [True, False])
def test_a_call_without_an_answer_fails_in_time(knows_rest: bool) -> None:
    server = Server()
    run = Run(description(0.1), server.open)
    assert server.hardware
    server.hardware.knows_rest = knows_rest
    for number, payload in enumerate((b"s", b"c1", b"s", b"c2")):
        run.carrier.ask(0, Call(number, payload))
    run.stop()
    assert [answer for _, _, answer in run.carrier.answers] == [
        Answer(reason="no answer within 0.1 s"),
        Answer(b"1c"),
        Answer(reason="no answer within 0.1 s"),
        Answer(b"2c"),
    ]


def test_a_late_answer_is_nobody_elses() -> None:
    """The next call waits for it, because a response does not tell to whom it belongs."""
    given: list[tuple[int, Answer]] = []
    handed: list[int] = []
    line = CallLine(
        0.05,
        lambda call: handed.append(call.number),
        lambda call, answer: given.append((call.number, answer)),
        started,
        from_hardware=False,
    )
    line.put(Call(0, b""))
    line.put(Call(1, b""))
    until(lambda: given)
    assert handed == [0]
    assert line.settle(Answer(b"of the first"))
    until(lambda: handed == [0, 1])
    assert line.settle(Answer(b"of the second"))
    until(lambda: len(given) == 2)
    line.close()
    assert given == [(0, Answer(reason="no answer within 0.05 s")), (1, Answer(b"of the second"))]


def test_a_response_to_no_call_is_counted() -> None:
    run = Run(description(), Server().open)
    run.carrier.ask(0, Call(7, b"t"))
    until(lambda: run.node.statistics.services["set_camera_info"].unasked)
    run.stop()
    assert run.carrier.answers == [(0, 7, Answer(b"t"))]
    assert "the hardware sent a response of 'set_camera_info' to no call" in run.reports


def test_calls_fail_when_the_node_ends_and_when_too_many_wait() -> None:
    gate = threading.Event()
    given: list[tuple[int, str]] = []
    line = CallLine(
        60,
        lambda _: gate.set(),
        lambda call, answer: given.append((call.number, answer.reason)),
        started,
        from_hardware=False,
    )
    line.put(Call(0, b""))
    gate.wait()
    for number in range(1, MOST_WAITING + 2):
        line.put(Call(number, b""))
    assert given == [(MOST_WAITING + 1, "too many calls wait, or the node ends")]
    line.close()
    assert sorted(number for number, _ in given) == [*range(MOST_WAITING + 2)]
    line.put(Call(9999, b""))
    assert given[-1][0] == 9999


def test_calls_of_hardware_that_are_refused_wait_for_their_turn() -> None:
    """The thread that receives from the hardware does not send answers to it, also while the node ends."""
    gate, begun = threading.Event(), threading.Event()
    given: list[tuple[int, bytes | None]] = []
    answering: set[threading.Thread] = set()

    def hand_over(call: Call) -> None:
        begun.set()
        gate.wait()
        line.settle(Answer(b"%d" % call.number), call.number)

    def answer(call: Call, found: Answer) -> None:
        answering.add(threading.current_thread())
        given.append((call.number, found.payload))

    line = CallLine(60, hand_over, answer, started, from_hardware=True)
    line.put(Call(0, b""))
    begun.wait()
    for number in range(1, MOST_WAITING + 3):
        line.put(Call(number, b""))
    assert given == []
    gate.set()
    until(lambda: len(given) == MOST_WAITING + 3)
    assert given == [(number, b"%d" % number if number <= MOST_WAITING else None) for number in range(MOST_WAITING + 3)]
    assert threading.current_thread() not in answering
    line.close()
    line.put(Call(9999, b""))
    assert given[-1] == (9999, None)


def test_calls_in_hardware_that_is_restarted_fail() -> None:
    server = Server()
    run = Run(description(), server.open, NodeSettings(restarts=True))
    run.carrier.ask(0, Call(0, b"s"))
    first = server.hardware
    assert first
    until(lambda: first.sent)
    first.close()
    until(lambda: run.carrier.answers)
    run.carrier.ask(0, Call(1, b"c"))
    run.stop()
    assert run.carrier.answers == [(0, 0, Answer(reason="the hardware was restarted")), (0, 1, Answer(b"c"))]


def test_ros2_answers_a_failure_in_the_response() -> None:
    """ROS 2 has no answer to a call that fails, except for a response with the field `success`."""
    payload = b"\0\1\0\0failed"
    run = Run(description(0.05, ros=2, failure=payload), Server().open)
    # The carrier of the test is that of ROS 1.
    run.node._carriers = run.node._calls._carriers = {2: run.carrier}
    run.carrier.ask(0, Call(0, b"s"))
    run.stop()
    assert run.carrier.answers == [(0, 0, Answer(payload, "no answer within 0.05 s"))]
    assert "a call of 'set_camera_info' failed: no answer within 0.05 s" in run.reports


class Asking(Server):
    """Hardware that calls a service; its subscriber takes the responses."""

    def answers(self, _: int, payload: bytes) -> list[Burst]:
        return []


def asking(limit: float = 30.0, **changes: Any) -> NodeDescription:
    """A node whose hardware is the client."""
    (service,) = DESCRIPTION.services
    client = replace(
        service, is_server=False, request=service.response, response=service.request, time_limit=limit, **changes
    )
    return replace(DESCRIPTION, services=(client,))


def test_hardware_calls_a_service() -> None:
    """One call after the other; an answer that comes too late is ignored."""
    server = Asking()
    run = Run(asking(0.2, failure=b"no"), server.open)
    hardware = server.hardware
    assert hardware
    for payload in (b"one", b"two", b"three"):
        hardware._bursts.put(Burst(pack_frame(0, payload)))
    until(lambda: run.carrier.calls)
    (_, first) = run.carrier.calls[0]
    run.carrier.reply(0, first.number, Answer(b"ONE"))
    until(lambda: len(run.carrier.calls) == 2)
    (_, second) = run.carrier.calls[1]
    run.carrier.reply(0, second.number, Answer(None, "there is no server"))
    until(lambda: len(run.carrier.calls) == 3)
    (_, third) = run.carrier.calls[2]
    run.carrier.reply(0, second.number, Answer(b"late"))
    until(lambda: len(hardware.sent) == 3)
    run.carrier.reply(0, third.number, Answer(b"too late"))
    run.stop()
    assert [call.payload for _, call in run.carrier.calls] == [b"one", b"two", b"three"]
    assert hardware.sent == [(0, b"ONE"), (0, b"no"), (0, b"no")]
    (counts,) = run.node.statistics.services.values()
    assert (counts.called, counts.answered, counts.failed) == (3, 1, 2)


def test_the_generated_file_has_the_services() -> None:
    system = load_system(CAMERA, LIBRARIES)
    source = python_node(system, ROS1, CAMERA, CAMERA.parent)[f"{DESCRIPTION.name}_node.py"]
    names: dict[str, object] = {"__name__": "generated"}
    exec(compile(source, "camera_node.py", "exec"), names)
    assert names["NODE"] == DESCRIPTION


def test_bytes_after_a_request_are_removed(tmp_path: Path) -> None:
    text = (CAMERA.parent / "camera.yaml").read_text(encoding="utf-8")
    copy = shutil.copytree(CAMERA.parent, tmp_path / "camera") / "camera.yaml"
    copy.write_text(re.sub(r"\bROS\b", "ROS2", re.sub(r"Info(?=Re)", "Info_", text)), encoding="utf-8")
    system = load_system(copy, LIBRARIES)
    request = encode_used(with_names_in_use(system.system.subscribers[0].frame, ()), {})
    server = Server()
    run = Run(describe(system), server.open)
    run.carrier.ask(0, Call(1, request + b"\xee" * 92))
    until(lambda: server.hardware and server.hardware.sent)
    run.stop()
    assert server.hardware and server.hardware.sent == [(0, request)]
