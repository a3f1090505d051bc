"""Services: the converters of servers and clients, and where their keys and connections lead."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.runs.simulation.stimuli import read_stimuli
from fusesoc_firm.system.derived.model import DerivedSystem, Service, ServiceEnd
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from fusesoc_firm.system.views.show import derived_description
from tests.system.systems import LIBRARIES, connections

SPECIFICATION = """
project: {name: robot}
paths: msg
accelerators:
  - name: motor
    type: VHDL
    sources: [motor.vhd]
    interface:
      input:
        - {middleware: ROS, message: demo/SetGainREQUEST}
        - {middleware: ROS, message: demo/GetPoseRESPONSE}
      output:
        - {middleware: ROS, message: demo/SetGainRESPONSE}
        - {middleware: ROS, message: demo/GetPoseREQUEST}
blocks:
  - {name: set_gain, middleware: ROS, mode: server, service: demo/SetGain, topic: /arm/gain, timeLimit: 250 ms,
     queue: 3, period: 1000, outgoing: [{name: motor1}]}
  - {name: pose, middleware: ROS, mode: client, service: demo/GetPose, maxLength: 300, outgoing: [{name: motor1}]}
  - {name: motor1, type: motor, outgoing: [{name: set_gain}, {name: pose}]}
"""
SERVICES = {
    "SetGain": "float64 gain\n---\nbool success\nstring message\n",
    "GetPose": "string frame\n---\nfloat64 x\nstring frame\n",
}


def load(folder: Path, version: int) -> LoadedSystem:
    """The system in a version of ROS."""
    messages = folder / "msg/demo/srv"
    messages.mkdir(parents=True)
    for name, text in SERVICES.items():
        (messages / f"{name}.srv").write_text(text, encoding="utf-8")
    (folder / "motor.vhd").touch()
    joint = "" if version == 1 else "_"
    text = SPECIFICATION if version == 1 else SPECIFICATION.replace("middleware: ROS", "middleware: ROS2")
    text = text.replace("REQUEST", f"{joint}Request").replace("RESPONSE", f"{joint}Response")
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return load_system(folder / "robot.yaml", LIBRARIES)


@pytest.mark.parametrize("version", [1, 2])
def test_a_service_is_two_converters(tmp_path: Path, version: int) -> None:
    system: DerivedSystem = load(tmp_path, version).system
    ros = {1: ROS1, 2: ROS2}[version]
    assert connections(system) == [
        "set_gain_request. -> motor1.in0_",
        "pose_response. -> motor1.in1_",
        "motor1.out0_ -> set_gain_response.",
        "motor1.out1_ -> pose_request.",
    ]
    assert [item.block for item in system.subscribers] == ["set_gain_request", "pose_response"]
    assert [item.block for item in system.publishers] == ["set_gain_response", "pose_request"]
    gain, pose = system.subscribers
    assert gain.queue and gain.queue.frames == 3
    assert pose.max_length == 300
    assert [times.period for times in system.scheduling.times] == [1000, None]
    assert system.services == (
        Service(
            "set_gain",
            ServiceEnd.SERVER,
            MessageName("demo", "SetGain"),
            ros,
            "/arm/gain",
            "set_gain_request",
            "set_gain_response",
            0.25,
        ),
        Service(
            "pose",
            ServiceEnd.CLIENT,
            MessageName("demo", "GetPose"),
            ros,
            "pose",
            "pose_request",
            "pose_response",
            5.0,
        ),
    )
    shown = derived_description(system)["Converters"]
    assert [item.get("service") for item in shown["AXIS_to_msg"]] == ["set_gain", "pose"]


def test_the_node_has_services_instead_of_topics(tmp_path: Path) -> None:
    found: NodeDescription = describe(load(tmp_path, 2))
    assert not found.subscribers
    assert not found.publishers
    assert found.versions == (2,)
    gain, pose = found.services
    assert (gain.name, gain.type, gain.is_server) == ("/arm/gain", "demo/srv/SetGain", True)
    assert (pose.request_type, pose.response_type) == ("demo/srv/GetPose_Request", "demo/srv/GetPose_Response")
    # CDR: false, three bytes of padding, the length of the text with its NUL.
    text = b"the hardware did not answer\0"
    assert gain.failure == b"\0\1\0\0" + bytes(4) + len(text).to_bytes(4, "little") + text
    assert pose.failure == b""


def test_stimuli_are_requests_and_responses(tmp_path: Path) -> None:
    system = load(tmp_path, 1).system
    path = tmp_path / "stimuli.yaml"
    path.write_text('- set_gain_request: {gain: 2.0}\n- pose_response: {x: 1.0, frame: "map"}\n', encoding="utf-8")
    stimuli = read_stimuli(path, system.subscribers)
    assert [item.subscriber.block for item in stimuli] == ["set_gain_request", "pose_response"]
    assert stimuli[1].payload == b"\0\0\0\0\0\0\xf0?\3\0\0\0map"
