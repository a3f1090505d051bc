"""A system as a node in the graph of ROS 2, and the constant payloads with which peers discover it.

The payloads follow DDSI-RTPS 2.5, section 8.5 (SPDP and SEDP), and the design of ROS 2 on DDS: the names of topics and
types (`rmw_dds_common`'s `rt/` and `::dds_::`), the type's hash in an endpoint's user data (REP-2016), and
`ros_discovery_info`, a message that assigns endpoints to nodes.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.rtps import Durability, Parameter, Reliability, parameter
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import ArrayType, MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.model import DerivedSystem, Network, Quality, Topic
from fusesoc_firm.system.scaffold.core_file import NETWORK_HERTZ
from fusesoc_firm.system.written.specification import ETHERNET

# Seconds without a packet after which peers remove the node. A simulated board needs more, since its time may be much
# slower than theirs.
LEASE_SECONDS, SIMULATED_LEASE_SECONDS = 20, 100
_GRAPH_TOPIC = "ros_discovery_info"
_GRAPH_TYPE = MessageName("rmw_dds_common", "ParticipantEntitiesInfo")
_GID = MessageName("rmw_dds_common", "Gid")
_BLOCKING_TIME = struct.pack("<iI", 0, 0x19999999)  # 0.1 s, which no reader compares
_LOCATOR_UDP = 1


@dataclass(frozen=True)
class Endpoint:
    """A reader or writer: the names of topic and type on the wire, and the type's hash.

    `entity` is the entity id: its number, which counts a node's endpoints from 1, and its kind.
    """

    topic: str
    type: str
    hash: str
    entity: bytes
    quality: Quality

    @property
    def is_writer(self) -> bool:
        """Whether the node sends the topic."""
        return self.entity[3] == rtps.USER_WRITER


@dataclass(frozen=True)
class Node:
    """A node: all its endpoints, the first of which is the writer of `ros_discovery_info`.

    In that message, a GUID is padded to `gid_bytes`, which differ between distributions of ROS 2.
    """

    network: Network
    endpoints: tuple[Endpoint, ...]
    gid_bytes: int
    lease_seconds: int = LEASE_SECONDS

    @property
    def prefix(self) -> bytes:
        """The first twelve bytes of all its GUIDs, which do not change at a restart."""
        return rtps.VENDOR + self.network.mac + bytes(4)

    @property
    def writers(self) -> tuple[Endpoint, ...]:
        """The endpoints that send, in the order of their sequence numbers in discovery."""
        return tuple(item for item in self.endpoints if item.is_writer)

    @property
    def readers(self) -> tuple[Endpoint, ...]:
        """The endpoints that receive, in the order of their sequence numbers in discovery."""
        return tuple(item for item in self.endpoints if not item.is_writer)

    @property
    def compared(self) -> tuple[Endpoint, ...]:
        """The endpoints in the order of the hardware's comparison with peers: `ros_discovery_info` is the last one."""
        return (*self.readers, *self.writers[1:], self.writers[0])

    @cached_property
    def participant_data(self) -> bytes:
        """The payload that announces the node (SPDP)."""
        metatraffic, user = self.locators
        return rtps.parameter_list(
            parameter(Parameter.PROTOCOL_VERSION, rtps.HEADER[4:]),
            parameter(Parameter.VENDOR_ID, rtps.VENDOR),
            parameter(Parameter.PARTICIPANT_GUID, self.prefix + rtps.PARTICIPANT),
            parameter(Parameter.BUILTIN_ENDPOINT_SET, struct.pack("<I", rtps.BUILTIN_ENDPOINTS)),
            parameter(Parameter.METATRAFFIC_UNICAST_LOCATOR, metatraffic),
            parameter(Parameter.DEFAULT_UNICAST_LOCATOR, user),
            parameter(Parameter.LEASE_DURATION, struct.pack("<iI", self.lease_seconds, 0)),
            parameter(Parameter.USER_DATA, rtps.octets(b"enclave=/;")),
        )

    @property
    def locators(self) -> tuple[bytes, bytes]:
        """The node's locators for discovery and for messages; with DHCP, the address is 0.0.0.0."""
        metatraffic, user = (port(self.network.domain) for port in (rtps.metatraffic_port, rtps.user_port))
        return self._locator(metatraffic), self._locator(user)

    @cached_property
    def farewell(self) -> tuple[dict[Parameter, bytes], bytes]:
        """The inline parameters and the payload that dispose the node: only its key."""
        guid = self.prefix + rtps.PARTICIPANT
        status = bytes([0, 0, 0, rtps.DISPOSED | rtps.UNREGISTERED])
        key = rtps.parameter_list(parameter(Parameter.PARTICIPANT_GUID, guid))
        return {Parameter.STATUS_INFO: status, Parameter.KEY_HASH: guid}, key

    def endpoint_data(self, endpoint: Endpoint) -> bytes:
        """Return the payload that announces an endpoint (SEDP)."""
        reliability = Reliability.RELIABLE if endpoint.quality.is_reliable else Reliability.BEST_EFFORT
        durability = Durability.TRANSIENT_LOCAL if endpoint.quality.is_transient_local else Durability.VOLATILE
        return rtps.parameter_list(
            parameter(Parameter.ENDPOINT_GUID, self.prefix + endpoint.entity),
            # Without it, Fast DDS 3 does not name the owner of the endpoint.
            parameter(Parameter.PARTICIPANT_GUID, self.prefix + rtps.PARTICIPANT),
            parameter(Parameter.TOPIC_NAME, rtps.string(endpoint.topic)),
            parameter(Parameter.TYPE_NAME, rtps.string(endpoint.type)),
            parameter(Parameter.RELIABILITY, struct.pack("<I", reliability) + _BLOCKING_TIME),
            parameter(Parameter.DURABILITY, struct.pack("<I", durability)),
            parameter(Parameter.USER_DATA, rtps.octets(f"typehash={endpoint.hash};".encode())),
        )

    @cached_property
    def graph(self) -> bytes:
        """The message on `ros_discovery_info`: the node with its readers and writers."""
        text = rtps.XCDR1 + self._gid(rtps.PARTICIPANT) + struct.pack("<I", 1)
        for name in (self.network.namespace, self.network.name):
            text += rtps.string(name)
            text += bytes(-len(text) % 4)
        for items in (self.readers, self.writers[1:]):
            text += struct.pack("<I", len(items)) + b"".join(self._gid(item.entity) for item in items)
        return text

    def _gid(self, entity: bytes) -> bytes:
        return (self.prefix + entity).ljust(self.gid_bytes, b"\0")

    def _locator(self, port: int) -> bytes:
        return struct.pack("<iI", _LOCATOR_UDP, port) + bytes(12) + self.network.address.packed


def dds_topic(topic: Topic, namespace: str) -> str:
    """Return the name of a topic on the wire; a relative name is resolved in the node's namespace."""
    name = topic.ros_name if topic.ros_name.startswith("/") else f"{namespace.rstrip('/')}/{topic.ros_name}"
    return f"rt{name}"


def dds_type(message: MessageName) -> str:
    """Return the name of a message's type on the wire."""
    return f"{message.package}::msg::dds_::{message.name}_"


def node_of(system: DerivedSystem, libraries: Mapping[Middleware, MessageLibrary]) -> Node:
    """Return the node of a system with a network: a reader for each subscriber, and a writer for each publisher."""
    library, network = libraries[ROS2], system.network
    assert network is not None

    def endpoint(number: int, kind: int, name: str, message: MessageName, quality: Quality) -> Endpoint:
        entity = number.to_bytes(3, "big") + bytes([kind])
        return Endpoint(name, dds_type(message), signature(message, library.closure(message)), entity, quality)

    def of_topic(number: int, kind: int, topic: Topic) -> Endpoint:
        return endpoint(number, kind, dds_topic(topic, network.namespace), topic.frame.message, topic.quality)

    graph = endpoint(1, rtps.USER_WRITER, _GRAPH_TOPIC, _GRAPH_TYPE, Quality(is_transient_local=True, depth=1))
    readers = [of_topic(2 + item.id, rtps.USER_READER, item) for item in system.subscribers]
    writers = [of_topic(2 + len(readers) + item.id, rtps.USER_WRITER, item) for item in system.publishers]
    data = library.get(_GID).fields[0].type
    assert isinstance(data, ArrayType)
    is_simulated = system.clock == NETWORK_HERTZ[ETHERNET]
    lease = SIMULATED_LEASE_SECONDS if is_simulated else LEASE_SECONDS
    return Node(network, (graph, *readers, *writers), data.length, lease)
