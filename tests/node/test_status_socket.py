"""The status of hardware that a node uses, asked by other processes and published on /diagnostics."""

from __future__ import annotations

import csv
import json
import os
import threading
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from uuid import uuid4

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.engine.queues import Overflow
from fusesoc_firm.node.engine.trace import Trace
from fusesoc_firm.node.interface.description import NodeDescription, describe, hardware_parameters
from fusesoc_firm.node.node import NodeSettings
from fusesoc_firm.node.status import status_socket
from fusesoc_firm.node.status.status import read_status, read_word, write_word
from fusesoc_firm.node.status.status_socket import NodeTransport, StatusServer, open_status, served_names
from fusesoc_firm.node.transport.transport import Burst, TransportError
from fusesoc_firm.system.derived.status import STATUS_ID
from fusesoc_firm.system.hardware.status import status_map
from fusesoc_firm.system.status_frames import answered, read_request, status_answer
from tests.node.fake_node import Run, echo, pairs, until
from tests.node.strangers import reply_to_stranger
from tests.node.test_node import POINTS, Bench

MAP = {register.address: register for register in status_map("robot", 2, 2).registers}
COUNTED = {"id_errors": 3, "subscriber[1].frames": 17, "publisher[0].faults[8]": 2, "last_fault": 0x29}
WRITE = 1 << 31
REQUEST = read_request(0)


class Counters:
    """The answers of hardware with a status, and of its channels."""

    def __init__(self) -> None:
        self.words = dict(COUNTED)
        self.is_stalled = False

    def __call__(self, identifier: int, payload: bytes) -> list[Burst]:
        if identifier != STATUS_ID:
            return echo(identifier, payload)
        request = answered(pack_frame(identifier, payload))
        assert request
        if self.is_stalled:
            return []
        register = MAP[request[0] & ~WRITE]
        word = self.words.get(register.name, sum(field.reset << field.low for field in register.fields))
        if request[0] & WRITE:
            self.words[register.name] = request[1]
        return [Burst(status_answer(request[0], word))]


@pytest.fixture
def description(tmp_path: Path) -> NodeDescription:
    # All processes on a computer share the names of sockets.
    return replace(describe(pairs(tmp_path)), name=f"robot_{uuid4().hex[:8]}", digest="0" * 32)


class Served:
    """A node with hardware that has a status, and its server."""

    def __init__(self, description: NodeDescription, trace: Trace | None = None) -> None:
        self.counters = Counters()
        self.run = Run(description, Bench(self.counters).open, trace=trace)
        self.reports: list[str] = []
        self.name = f"node:{description.name}"
        self.server = StatusServer([self.name], partial(self.run.node.access_status, seconds=0.5), self.reports.append)

    def close(self) -> None:
        self.server.close()
        self.run.stop()


@pytest.fixture
def served(description: NodeDescription) -> Iterator[Served]:
    made = Served(description)
    yield made
    made.close()


def test_the_node_is_asked_while_messages_pass(served: Served) -> None:
    stopped = threading.Event()

    def talk() -> None:
        while not stopped.wait(0.001):
            served.run.carrier.give(0, POINTS[1])

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        with open_status(served.name) as transport:
            status = read_status(transport)
            write_word(transport, 0x10, 5)
            assert read_word(transport, 0x10) == 5
    finally:
        stopped.set()
        talker.join()
    assert {name: word for name, word in status.words.items() if name in COUNTED} == COUNTED
    served.run.stop()
    assert served.run.is_complete
    # No answer is taken for a message, and no message is lost.
    counts = served.run.node.statistics
    assert counts.faults == 0
    assert len(served.run.carrier.published) == counts.inputs["a0"].received - counts.inputs["a0"].dropped


def test_the_command_asks_the_node(served: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", served.name]) == 0
    printed = capsys.readouterr().out
    assert "last fault: code 9 of publisher[0]; unknown ids 3," in printed
    assert "2 of code 9" in printed
    assert main(["status", "node:nobody_has_this_name"]) == 1
    assert "no node of the system 'nobody_has_this_name'" in capsys.readouterr().err


def test_the_command_shows_the_parameters_that_the_node_knows(
    description: NodeDescription, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hardware has the values; the first block holds a message, so a wanted value is not in effect yet."""
    parameters = hardware_parameters(
        ("block", "gain", "int8", 1, -4, 100),
        ("block", "offset", "float32", 0.0, -1.5, 1e10),
        ("other", "invert", "bool", False, 0, 1),
    )
    gain, offset, invert = ({"wanted": 0xFFFFFFFD, "value": 5}, {"value": 0x3FA00000}, {"wanted": 1, "value": 1})
    words = {0x100: gain["wanted"], 0x104: gain["value"], 0x108: offset["value"], 0x10C: offset["value"]}
    words |= {0x110: invert["wanted"], 0x114: invert["value"]}

    def access(request: bytes) -> bytes:
        address, _ = answered(request) or (0, 0)
        resets = sum(field.reset << field.low for field in MAP[address].fields) if address in MAP else 0
        return status_answer(address, words.get(address, resets))

    name = f"node:{description.name}"
    with StatusServer([name], access, print, parameters):
        assert main(["status", name]) == 0
        printed = capsys.readouterr().out
        assert printed.splitlines()[-4:] == [
            "parameter     value             type     range",
            "block.gain    5 (-3 is wanted)  int8     -4 to 100",
            "block.offset  1.25              float32  -1.5 to 1e+10",
            "other.invert  true              bool     true, false",
        ]
        assert main(["status", name, "--json"]) == 0
        data = json.loads(capsys.readouterr().out)
    assert [(item["name"], item["type"], item["value"], item["wanted"]) for item in data["parameters"]] == [
        ("block.gain", "int8", 5, -3),
        ("block.offset", "float32", 1.25, 1.25),
        ("other.invert", "bool", True, True),
    ]
    assert [(item["default"], item["range"]) for item in data["parameters"]] == [
        (1, [-4, 100]),
        (0.0, [-1.5, 1e10]),
        (False, [0, 1]),
    ]


def test_the_status_of_a_node_is_json(served: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", served.name, "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["last_fault"] == {"code": 9, "channel": "publisher[0]"}
    assert (data["id_errors"], data["link_errors"], data["lost"]) == (3, 0, 0)
    frames = {item["name"]: (item["frames"], item["faults"]) for item in data["channels"]}
    assert frames == {
        "subscriber[0]": (0, {}),
        "subscriber[1]": (17, {}),
        "publisher[0]": (0, {"9": 2}),
        "publisher[1]": (0, {}),
    }
    assert (data["digest"], data["endpoints"], data["parameters"]) == ("0" * 32, [], [])


def test_a_node_without_descriptions_of_parameters_is_asked(
    description: NodeDescription, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of an earlier version replies that this is not a request of the status."""
    made = Served(description)
    monkeypatch.setattr(made.server, "_reply", lambda _: b"the frame is not a request of the status")
    with open_status(made.name) as transport:
        assert isinstance(transport, NodeTransport)
        assert [*transport.parameters()] == []
    made.close()


def test_hardware_that_does_not_answer_is_reported(served: Served) -> None:
    served.counters.is_stalled = True
    with open_status(served.name) as transport, pytest.raises(TransportError, match="the hardware did not answer"):
        read_status(transport)
    served.counters.is_stalled = False
    with open_status(served.name) as transport:
        assert read_status(transport).words["id_errors"] == 3


@pytest.mark.parametrize("overflow", Overflow)
def test_hardware_that_takes_nothing_is_reported(description: NodeDescription, overflow: Overflow) -> None:
    gate = threading.Event()
    run = Run(description, Bench(Counters(), gate).open, NodeSettings(overflow=overflow))
    for _ in range(3):
        with pytest.raises(TransportError, match="the hardware did not answer"):
            run.node.access_status(REQUEST, 0.05)
    gate.set()

    def is_answered() -> bool:
        try:
            return answered(run.node.access_status(REQUEST, 20)) == answered(status_answer(0, 0x4D524946))
        except TransportError:
            # The earlier requests have not left yet.
            return False

    until(is_answered)
    run.stop()
    with pytest.raises(TransportError, match="the node is ending"):
        run.node.access_status(REQUEST)


def test_a_frame_that_is_not_a_request_does_not_reach_the_hardware(served: Served) -> None:
    with open_status(served.name) as transport:
        for frame in (pack_frame(0, POINTS[0]), b"x", pack_frame(STATUS_ID, bytes(9))):
            transport.send(frame)
            with pytest.raises(TransportError, match="not a request of the status"):
                transport.receive(20)


def test_a_silent_peer_does_not_keep_others_out(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(status_socket, "_SILENCE_SECONDS", 0.05)
    with open_status(served.name), open_status(served.name) as second:
        assert read_word(second, 0) == 0x4D524946


def test_a_node_of_root_answers_no_other_user(served: Served) -> None:
    assert reply_to_stranger(served.name) == ""
    with open_status(served.name) as transport:
        assert read_word(transport, 0) == 0x4D524946


def test_another_node_with_the_name_is_reported(served: Served) -> None:
    with StatusServer([served.name, f"node:{'x' * 100}"], bytes, served.reports.append):
        pass
    assert served.reports[0] == f"'firm status {served.name}' cannot ask this node: Address already in use"
    assert "longer than 90 bytes" in served.reports[1]


def test_a_device_has_one_name(tmp_path: Path) -> None:
    link = tmp_path / "line"
    link.symlink_to(tmp_path / "ttyUSB1")
    for address in (f"uart:{link}:9600", f"uart:{tmp_path}/ttyUSB1:1000000:rtscts"):
        assert served_names("robot", address) == ("node:robot", f"uart:{os.path.realpath(tmp_path)}/ttyUSB1")
    assert served_names("robot", "dma:/dev/uio0:udmabuf0:poll") == ("node:robot", "dma:/dev/uio0")
    assert served_names("robot", "pipe:run it") == ("node:robot",)


@pytest.mark.check
def test_the_status_is_part_of_the_diagnostics(served: Served) -> None:
    name = f"{served.name.removeprefix('node:')}: hardware"
    reports = served.run.carrier.reports

    def counts() -> dict[str, int]:
        return next((dict(report.counts) for report in reversed(reports) if report.name == name), {})

    zeros = [f"{block} {text}" for block in ("a0", "a1", "z0", "z1") for text in ("frames", "longest wait in cycles")]
    faults = {"unknown ids": 3, "link errors": 0, "uncounted faults": 0, "z0: the watchdog ended the frame": 2}
    expected = {**dict.fromkeys(zeros, 0), **faults, "a1 frames": 17, "accesses without an answer": 0}
    until(lambda: counts() == expected)
    until(lambda: not any(report.is_warning for report in reports[-2:]))
    served.counters.words["id_errors"] = 4
    until(lambda: counts()["unknown ids"] == 4)
    assert any(report.is_warning for report in reports[-2:] if report.name == name)


def test_requests_are_not_part_of_the_trace(tmp_path: Path, description: NodeDescription) -> None:
    trace = Trace(tmp_path / "ways.csv", description)
    made = Served(description, trace)
    with open_status(made.name) as transport:
        read_status(transport)
        made.run.carrier.give(0, POINTS[0])
        until(lambda: made.run.carrier.published)
    made.close()
    trace.close()
    with (tmp_path / "ways.csv").open() as table:
        (row,) = csv.DictReader(table)
    # In simulated time, a beat has a byte.
    assert int(row["last_beat_in_cycle"]) - int(row["first_beat_in_cycle"]) == len(POINTS[0]) + 4
    assert int(row["first_beat_out_cycle"]) == int(row["last_beat_in_cycle"]) + 1
