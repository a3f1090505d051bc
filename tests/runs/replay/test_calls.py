"""Bags with the service events of ROS 2 are replayed: the requests go to the hardware, its responses are compared."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import get_types_from_idl
from rosbags.typesys.store import Typestore

from fusesoc_firm.message.bag_reader import open_bag
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.bags import calls
from fusesoc_firm.runs.bags.events import Events
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.runs.simulation.software_run import system_stimuli
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import InputError
from tests.ros.service_simulator import HERE
from tests.runs.replay.replays import STRING, load, read, store_of

SERVICE = "sensor_msgs/srv/SetCameraInfo"
REQUEST, RESPONSE, EVENT = (f"{SERVICE}_{end}" for end in ("Request", "Response", "Event"))
TOPIC = "/set_camera_info/_service_event"
# The values of event_type.
SENT, RECEIVED, ANSWERED, TAKEN = range(4)
SERVER, CLIENT = 7, 9


# rclpy tells it of the topic of the events.
HASH = "RIHS01_e3b4e21ddd26871166e6ae7f342856dfcd3ac033c7eac99db6bfe515fba3d693"
IDL = """
module sensor_msgs { module srv {
  struct SetCameraInfo_Request { sensor_msgs::msg::CameraInfo camera_info; };
  struct SetCameraInfo_Response { boolean success; string status_message; };
  struct SetCameraInfo_Event {
    service_msgs::msg::ServiceEventInfo info;
    sequence<sensor_msgs::srv::SetCameraInfo_Request, 1> request;
    sequence<sensor_msgs::srv::SetCameraInfo_Response, 1> response;
  };
}; };
"""


@pytest.fixture
def store() -> Typestore:
    """The types of the service's events, as rosbags makes them."""
    found = store_of("mcap")
    found.register(get_types_from_idl(IDL))
    return found


def write_events(path: Path, topic: str, signature: str, events: Iterable[bytes]) -> Path:
    """Write a bag with events; rosbags does not write the definitions of services."""
    with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(topic, EVENT, msgdef="", rihs01=signature)
        for number, payload in enumerate(events):
            writer.write(connection, 10**18 + 10**6 * number, payload)
    return path


class Recorder:
    """Events of calls; a call's number is also its width."""

    def __init__(self, store: Typestore, topic: str = TOPIC) -> None:
        self.store, self.topic = store, topic
        self.events: list[bytes] = []

    def add(self, kind: int, call: int, text: str, gid: int = SERVER, *, has_contents: bool = True) -> None:
        """Add an event; `text` is that of the request, or of the response."""
        types = self.store.types
        time = types["builtin_interfaces/msg/Time"](call, 0)
        info = types["service_msgs/msg/ServiceEventInfo"](kind, time, np.full(16, gid, np.uint8), call)
        is_request = kind in (SENT, RECEIVED)
        parts = [self.request(call, text)] if is_request else [types[RESPONSE](call % 2 == 1, text)]
        parts = parts if has_contents else []
        message = types[EVENT](info, parts if is_request else [], [] if is_request else parts)
        self.events.append(bytes(self.store.serialize_cdr(message, EVENT)))

    def written(self, path: Path, signature: str) -> Path:
        """Write the events to a bag."""
        return write_events(path, self.topic, signature, self.events)

    def responses(self, path: Path) -> list[tuple[str, bool, str]]:
        """The responses in a bag."""
        items = [(topic, data) for topic, _, _, data in read(path)]
        found: list[tuple[str, Any]] = [(topic, self.store.deserialize_cdr(data, RESPONSE)) for topic, data in items]
        return [(topic, message.success, message.status_message) for topic, message in found]

    def request(self, width: int, text: str) -> Any:
        types = self.store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "camera")
        region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        k, r, p = np.zeros(9), np.zeros(9), np.zeros(12)
        info = types["sensor_msgs/msg/CameraInfo"](header, 3, width, text, np.zeros(5), k, r, p, 0, 0, region)
        return types[REQUEST](info)


def system(folder: Path, name: str) -> LoadedSystem:
    """A system of tests/ros/camera for ROS 2."""
    text = (HERE / f"camera/{name}.yaml").read_text(encoding="utf-8").replace("paths: msg", f"paths: {HERE}/camera/msg")
    text = text.replace("middleware: ROS", "middleware: ROS2").replace("SetCameraInfoRe", "SetCameraInfo_Re")
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    for source in ("store_settings.vhd", "ask.vhd"):
        (folder / source).touch()
    return load(folder / f"{name}.yaml")


def replay_calls(
    folder: Path,
    source: Path | Source,
    names: Mapping[str, str] | None = None,
    name: str = "camera",
    *,
    is_json: bool = True,
) -> Path:
    """Replay a bag through the model of a service in hardware, or of hardware that calls one; what is written."""
    source = source if isinstance(source, Source) else Source(source)
    command = [sys.executable, str(HERE / "service_simulator.py"), name, "2", str(folder / "gate"), "--width", "32"]
    target, settings = folder / "out.mcap", Settings(names or {}, 1000, is_json=is_json)
    replay(system(folder, name), source, Target(target), settings, lambda: Simulator(command))
    return target


def replayed(
    folder: Path, recorder: Recorder, names: Mapping[str, str] | None = None, signature: str = HASH
) -> list[tuple[str, bool, str]]:
    """Replay events; the responses in the bag that is written."""
    return recorder.responses(replay_calls(folder, recorder.written(folder / "in", signature), names))


@pytest.fixture(autouse=True)
def path(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model's simulator needs this repository."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


@pytest.mark.parametrize("ends", [[SERVER], [CLIENT], [SERVER, CLIENT]])
def test_each_call_is_replayed_once(
    tmp_path: Path, store: Typestore, ends: Sequence[int], capsys: pytest.CaptureFixture[str]
) -> None:
    """Server and client number their calls differently; each call in the bag is one to the hardware."""
    recorder = Recorder(store)
    texts = ["call", "refused", "other", "silent"]
    for call, text in enumerate(texts):
        # The server's response to `other` was another one; the hardware refuses `refused` and does not answer `silent`.
        answer = "changed" if text == "other" else text
        for kind, told, end in (
            (SENT, text, CLIENT), (RECEIVED, text, SERVER), (ANSWERED, answer, SERVER), (TAKEN, answer, CLIENT)
        ):  # fmt: skip
            if end in ends:
                recorder.add(kind, call, told, end)
    with pytest.raises(InputError, match="1 of 4 messages had errors"):
        replayed(tmp_path, recorder)
    said = json.loads(capsys.readouterr().out)
    names = {"topic": "/set_camera_info_request", "type": REQUEST}
    assert said["in"] == [{**names, "count": 4, "blocks": ["set_camera_info_request"]}]
    assert said["responses"] == [{**names, "as_recorded": 1, "different": 1, "missing": 2, "not_recorded": 0}]
    assert said["dropped"] == []
    answers = [(0, "call"), (2, "other")]
    expected = [("/set_camera_info_response", call % 2 == 1, text) for call, text in answers]
    assert recorder.responses(tmp_path / "out.mcap") == expected


def test_calls_of_another_name_are_mapped(tmp_path: Path, store: Typestore) -> None:
    """The only events of the service's type belong to it, also if `--map` names them."""
    for number, names in enumerate(({}, {"set_camera_info_request": "/left/_service_event"})):
        recorder = Recorder(store, "/left/_service_event")
        recorder.add(RECEIVED, 3, "call")
        folder = tmp_path / str(number)
        folder.mkdir()
        assert replayed(folder, recorder, names) == [("/set_camera_info_response", True, "call")]


def test_a_call_that_began_before_the_bag_has_no_request(
    tmp_path: Path, store: Typestore, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = Recorder(store)
    recorder.add(ANSWERED, 1, "before")
    recorder.add(RECEIVED, 2, "after")
    assert [text for *_, text in replayed(tmp_path, recorder)] == ["after"]
    (counts,) = json.loads(capsys.readouterr().out)["responses"]
    assert [counts[kind] for kind in ("as_recorded", "different", "missing", "not_recorded")] == [0, 0, 0, 1]


def test_an_invalid_event_is_dropped_and_counted(
    tmp_path: Path, store: Typestore, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = Recorder(store)
    recorder.add(RECEIVED, 1, "first")
    recorder.events.append(recorder.events[0][:-1])
    recorder.add(RECEIVED, 2, "second")
    assert [text for *_, text in replayed(tmp_path, recorder)] == ["first", "second"]
    said = json.loads(capsys.readouterr().out)
    assert said["dropped"] == [{"topic": TOPIC, "type": EVENT, "count": 1}]


def test_events_without_contents_are_no_calls(tmp_path: Path, store: Typestore) -> None:
    recorder = Recorder(store)
    recorder.add(RECEIVED, 1, "call", has_contents=False)
    with pytest.raises(InputError, match="contains no topic for the system"):
        replayed(tmp_path, recorder)


def test_events_of_another_definition_are_refused(tmp_path: Path, store: Typestore) -> None:
    recorder = Recorder(store)
    recorder.add(RECEIVED, 1, "call")
    with pytest.raises(InputError, match=r"its definition of .* differs from the system's: RIHS01_"):
        replayed(tmp_path, recorder, signature=f"RIHS01_{64 * '0'}")


class Asked(Recorder):
    """Recorded calls of hardware that sends nothing but a text in each request (camera/asking.yaml)."""

    def request(self, width: int, text: str) -> Any:
        types = self.store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")
        region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        k, r, p = np.zeros(9), np.zeros(9), np.zeros(12)
        info = types["sensor_msgs/msg/CameraInfo"](header, 0, 0, text, np.zeros(0), k, r, p, 0, 0, region)
        return types[REQUEST](info)

    def written_with_names(self, path: Path, names: Iterable[str], apart_ns: int = 1) -> Path:
        """Write a bag with the names that lead to the calls, and with an event in each ms from the first one on."""
        with Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection("/name_in", STRING, typestore=self.store)
            for number, name in enumerate(names):
                message = self.store.types[STRING](name)
                writer.write(connection, 10**18 + number * apart_ns, bytes(self.store.serialize_cdr(message, STRING)))
            connection = writer.add_connection(self.topic, EVENT, msgdef="", rihs01=HASH)
            for number, payload in enumerate(self.events):
                writer.write(connection, 10**18 + 10**6 * (number + 1), payload)
        return path

    def told(self, path: Path) -> list[str]:
        """What the hardware has told of the responses."""
        items = [data for topic, _, _, data in read(path) if topic == "/name_out"]
        found: list[Any] = [self.store.deserialize_cdr(data, STRING) for data in items]
        return [message.data for message in found]


LEFT = "/left/_service_event"


@pytest.mark.parametrize(("topic", "names"), [(TOPIC, {}), (LEFT, {}), (LEFT, {"set_camera_info_response": LEFT})])
def test_hardware_gets_the_recorded_responses_to_its_calls(
    tmp_path: Path, store: Typestore, topic: str, names: Mapping[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Its requests are compared; one had no response, and for one nothing is recorded."""
    recorder = Asked(store, topic)
    for call, (request, response) in enumerate([("one", "eno"), ("other", "owt"), ("three", "")]):
        recorder.add(SENT, call, request, CLIENT)
        recorder.add(RECEIVED, 9 - call, request, SERVER)
        if response:
            recorder.add(ANSWERED, 9 - call, response, SERVER)
            recorder.add(TAKEN, call, response, CLIENT)
    source = recorder.written_with_names(tmp_path / "in", ["one", "two", "three", "four"])
    target = replay_calls(tmp_path, source, names, "asking")
    assert recorder.told(target) == ["eno", "owt"]
    said = json.loads(capsys.readouterr().out)
    row = {"topic": "/set_camera_info_request", "type": REQUEST}
    assert said["requests"] == [{**row, "as_recorded": 2, "different": 1, "missing": 0, "not_recorded": 1}]
    assert said["dropped"] == []


def test_recorded_requests_that_the_hardware_does_not_make_are_missing(
    tmp_path: Path, store: Typestore, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = Asked(store)
    for call in range(3):
        recorder.add(SENT, call, "one", CLIENT)
        recorder.add(TAKEN, call, "eno", CLIENT)
    source = recorder.written_with_names(tmp_path / "in", ["one"])
    replay_calls(tmp_path, source, {}, "asking", is_json=False)
    text = "requests on /set_camera_info_request: 1 as recorded, 0 different, 2 missing, 0 not recorded"
    assert text in capsys.readouterr().out


@pytest.mark.parametrize(
    ("part", "told", "counts"),
    [
        # Each name precedes its request and response by 1 ms and 2 ms; the last call has no name.
        ({}, ["eno", "owt", "eerht"], [3, 0, 1, 0]),
        ({"start": 0.0025}, ["owt", "eerht"], [2, 0, 1, 0]),
        ({"start": 0.0025, "duration": 0.003}, ["owt"], [1, 0, 0, 0]),
        ({"limit": 2}, ["eno", "owt"], [2, 0, 0, 0]),
        ({"start": 0.0025, "limit": 1}, ["owt"], [1, 0, 0, 0]),
        ({"limit": 1, "start": 0.001}, ["eno"], [0, 1, 0, 0]),
    ],
)
def test_calls_of_hardware_in_a_part_of_a_bag(
    tmp_path: Path,
    store: Typestore,
    part: Mapping[str, Any],
    told: Sequence[str],
    counts: Sequence[int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The hardware's first request is compared with the first one of the part, and none after it is missing."""
    recorder = Asked(store)
    for call, name in enumerate(["one", "two", "three", "four"]):
        recorder.add(SENT, call, name, CLIENT)
        recorder.add(TAKEN, call, name[::-1], CLIENT)
        recorder.events.append(b"")
    source = recorder.written_with_names(tmp_path / "in", ["one", "two", "three"], 3 * 10**6)
    assert recorder.told(replay_calls(tmp_path, Source(source, **part), name="asking")) == told
    (row,) = json.loads(capsys.readouterr().out)["requests"]
    assert [row[kind] for kind in ("as_recorded", "different", "missing", "not_recorded")] == counts


def test_requests_that_are_missing_before_the_last_message(
    tmp_path: Path, store: Typestore, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three requests were recorded between the messages, and one after them."""
    recorder = Asked(store)
    for call, name in enumerate(["one", "two", "three", "four", "five"]):
        recorder.add(SENT, call, name, CLIENT)
    source = recorder.written_with_names(tmp_path / "in", ["one", "two", "end"], 4_500_000)
    replay_calls(tmp_path, Source(source, limit=2), name="asking")
    (row,) = json.loads(capsys.readouterr().out)["requests"]
    assert [row[kind] for kind in ("as_recorded", "different", "missing", "not_recorded")] == [2, 0, 2, 0]


def rewritten(source: Path, target: Path, **options: Any) -> Path:
    """Write the messages of an MCAP bag again, with options of another writer."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = McapWriter(new, compression=CompressionType.NONE, **options)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(old).iter_messages():
            if channel.topic not in channels:
                assert schema
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.log_time)
        writer.finish()  # type: ignore[no-untyped-call]
    return target


def test_a_request_without_a_response_does_not_hold_up_others(
    tmp_path: Path, store: Typestore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bounded part of the bag is read ahead; two requests are answered in the other order."""
    recorder = Asked(store)
    for call in range(300):
        recorder.add(SENT, call, f"call {call}", CLIENT)
        if call % 10 != 1 and call > 0:
            recorder.add(TAKEN, call, str(call), CLIENT)
        if call % 10 == 2:
            recorder.add(TAKEN, call - 1, str(call - 1), CLIENT)
    source = recorder.written_with_names(tmp_path / "in", ["one"])
    loaded = system(tmp_path, "asking")
    names = {item.block: item.name for item in loaded.system.subscribers}
    read_ahead: list[Any] = []
    part_of = Events.part_of

    def counted(*given: Any) -> Any:
        read_ahead.append(given)
        return part_of(*given)

    monkeypatch.setattr(Events, "part_of", counted)
    with open_bag(source) as opened:
        bag = calls.with_calls(opened, loaded.system.services, loaded.libraries, names, plays_responses=False)
        exchanges = bag.exchanges("set_camera_info_request", 0, None)
        first = next(exchanges)
        assert len(read_ahead) < 250
        found = [exchange.response for exchange in (first, *exchanges)]
    responses = [store.types[RESPONSE](call % 2 == 1, str(call)) for call in range(1, 300)]
    expected = [bytes(store.serialize_cdr(response, RESPONSE)) for response in responses]
    assert found == [None, *expected]


def test_the_exchanges_are_read_beside_the_messages(tmp_path: Path, store: Typestore) -> None:
    """A reader of rosbags has one place in an MCAP file without chunks."""
    recorder = Asked(store)
    texts = [f"name {number}" for number in range(20)]
    for call, name in enumerate(texts):
        recorder.add(SENT, call, name, CLIENT)
        recorder.add(TAKEN, call, name[::-1], CLIENT)
    recorder.written_with_names(tmp_path / "in", texts, 2 * 10**6)
    source = rewritten(tmp_path / "in" / "in.mcap", tmp_path / "plain.mcap", use_chunking=False)
    assert recorder.told(replay_calls(tmp_path, source, name="asking")) == [text[::-1] for text in texts]


def test_calls_are_stimuli_of_a_simulation(tmp_path: Path, store: Typestore) -> None:
    """Requests of a service that the hardware serves, and responses of one that it calls."""
    served = Recorder(store)
    for call, text in enumerate(("first", "second")):
        served.add(RECEIVED, call, text)
        served.add(ANSWERED, call, text)
    found = system_stimuli(served.written(tmp_path / "served", HASH), system(tmp_path, "camera"))
    told = [(item.subscriber.block, item.message["camera_info"]["distortion_model"]) for item in found]
    assert told == [("set_camera_info_request", "first"), ("set_camera_info_request", "second")]
    asked = Asked(store)
    for call, text in enumerate(("one", "two")):
        asked.add(SENT, call, text, CLIENT)
        asked.add(TAKEN, call, text[::-1], CLIENT)
    source = asked.written_with_names(tmp_path / "asked", ["one"])
    found = system_stimuli(source, system(tmp_path, "asking"))
    expected: list[tuple[str, dict[str, Any]]] = [("name_in", {"data": "one"})]
    expected += [
        ("set_camera_info_response", {"success": n % 2 == 1, "status_message": text})
        for n, text in enumerate(("eno", "owt"))
    ]
    assert [(item.subscriber.block, item.message) for item in found] == expected
