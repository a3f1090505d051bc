"""The constant payloads of a node: names and hashes as ROS 2 has them, and lists that a reader of RTPS understands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Node, node_of
from fusesoc_firm.fabric.rtps import Parameter
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.written.specification import Draft, read_specification
from fusesoc_firm.text.diagnostics import Diagnostics
from tests.fabric.messages import Address, ParameterList
from tests.ros.cpp_nodes import ROS2 as WHEELS

MAC = bytes.fromhex("020000000002")
SPECIFICATION = """\
project:
  name: turtle
  width: 64
  clock: CLOCK
  interconnect: ethernet
  network: {mac: "02:00:00:00:00:02", address: 192.0.2.9, namespace: NAMESPACE, domain: 3}
blocks:
  - {name: turn, middleware: ROS2, mode: subscriber, message: geometry_msgs/Quaternion, topic: arm/turn,
     qos: {profile: sensor_data}, outgoing: [{name: turned}]}
  - {name: turned, middleware: ROS2, mode: publisher, message: geometry_msgs/Quaternion, topic: /turned,
     qos: {durability: transient_local, depth: 7}}
"""


def node(distribution: str | None = None, namespace: str = "/lab", clock: str = "125 MHz") -> Node:
    """The node of the specification."""
    faults, known = Diagnostics(), libraries((), None, distribution)
    text = SPECIFICATION.replace("NAMESPACE", namespace).replace("CLOCK", clock)
    draft = Draft(Path("turtle.yaml"), text)
    system = derive(read_specification(draft, "turtle.yaml", faults), Path(), known, faults)
    return node_of(system, known)


def test_relative_topics_are_in_the_namespace() -> None:
    assert [item.topic for item in node().endpoints] == ["ros_discovery_info", "rt/lab/arm/turn", "rt/turned"]
    assert node(namespace="/").readers[0].topic == "rt/arm/turn"
    assert node().readers[0].type == "geometry_msgs::msg::dds_::Quaternion_"


def test_endpoints_differ_and_tell_their_kind() -> None:
    entities = [item.entity for item in node().endpoints]
    assert len(set(entities)) == 3
    assert [item.entity[3] for item in node().readers] == [rtps.USER_READER]
    assert [item.entity[3] for item in node().writers] == [rtps.USER_WRITER] * 2


def test_the_participant_names_its_ports() -> None:
    facts = ParameterList.of(node().participant_data)
    assert facts.address(Parameter.METATRAFFIC_UNICAST_LOCATOR) == Address("192.0.2.9", 8160)
    assert facts.address(Parameter.DEFAULT_UNICAST_LOCATOR) == Address("192.0.2.9", 8161)
    assert facts.all(Parameter.PARTICIPANT_GUID) == [bytes(2) + MAC + bytes(4) + rtps.PARTICIPANT]
    assert facts.octets(Parameter.USER_DATA) == b"enclave=/;"


def test_a_simulated_board_has_a_longer_lease() -> None:
    """Its clock is that of the target of `firm live`."""
    leases = [
        ParameterList.of(node(clock=clock).participant_data).integers(Parameter.LEASE_DURATION, "iI")
        for clock in ("25 MHz", "0.25 MHz")
    ]
    assert leases == [(20, 0), (100, 0)]


def test_an_endpoint_tells_its_quality() -> None:
    made = node()
    found = [ParameterList.of(made.endpoint_data(item)) for item in made.endpoints]
    assert [facts.integers(Parameter.RELIABILITY, "I") for facts in found] == [(2,), (1,), (2,)]
    assert [facts.integers(Parameter.DURABILITY, "I") for facts in found] == [(1,), (0,), (1,)]


def test_an_endpoint_names_its_owner() -> None:
    """Fast DDS 3 shows other endpoints as those of an unknown program."""
    made = node()
    for item in made.endpoints:
        facts = ParameterList.of(made.endpoint_data(item))
        assert [*facts.all(Parameter.PARTICIPANT_GUID)] == [made.prefix + rtps.PARTICIPANT]


@pytest.mark.parametrize(("distribution", "size"), [("jazzy", 16), ("humble", 24)])
def test_the_graph_lists_readers_and_writers(distribution: str, size: int) -> None:
    """Written again by rosbags, from the distribution's own definition."""
    from rosbags.typesys import Stores, get_typestore

    made = node(distribution)
    store = get_typestore(Stores(f"ros2_{distribution}"))
    told: Any = store.deserialize_cdr(made.graph, "rmw_dds_common/msg/ParticipantEntitiesInfo")
    (entities,) = told.node_entities_info_seq

    def guid(entity: bytes) -> list[int]:
        return list((made.prefix + entity).ljust(size, b"\0"))

    assert list(told.gid.data) == guid(rtps.PARTICIPANT)
    assert (entities.node_namespace, entities.node_name) == ("/lab", "turtle")
    assert [list(item.data) for item in entities.reader_gid_seq] == [guid(made.readers[0].entity)]
    assert [list(item.data) for item in entities.writer_gid_seq] == [guid(made.writers[1].entity)]
    assert bytes(store.serialize_cdr(told, "rmw_dds_common/msg/ParticipantEntitiesInfo")) == made.graph


def test_the_farewell_names_the_node_twice() -> None:
    inline, key = node().farewell
    guid = node().prefix + rtps.PARTICIPANT
    assert inline == {0x71: bytes([0, 0, 0, 3]), 0x70: guid}
    assert ParameterList.of(key).items == ((Parameter.PARTICIPANT_GUID, guid),)


@pytest.mark.skipif(not WHEELS.is_dir(), reason="ROS 2 is not installed in .venv/ros2")
def test_hashes_are_those_of_ros_2() -> None:
    """All messages of the wheels, as rosidl has described them."""
    library = MessageLibrary(ROS2)
    compared = 0
    for path in sorted(WHEELS.glob("share/*/msg/*.json")):
        name = MessageName(path.parts[-3], path.stem)
        hashes = json.loads(path.read_text(encoding="utf-8"))["type_hashes"]
        wanted = next(item["hash_string"] for item in hashes if item["type_name"] == f"{name.package}/msg/{name.name}")
        if name in library.names():
            assert signature(name, library.closure(name)) == wanted, name
            compared += 1
    assert compared > 100
