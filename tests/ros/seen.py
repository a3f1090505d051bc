"""Whether nodes have found the ends of a peer: an end that a peer has connected may be unknown at the other side.

It needs nothing but ROS.
"""

from __future__ import annotations

import xmlrpc.client
from collections.abc import Iterable
from typing import Any

_TOPIC = "/diagnostics"
_PROCESS_OF_FABRIC = 1


def are_known(name: str, subscribers: Iterable[Any]) -> bool:
    """Whether all publishers of ROS 1 have the node `name` among their connections: they answer before they add it.

    rospy counts a connection before it is made, and again while it repeats an attempt that a node in fabric, which
    lists no connections, has refused. Only the other side's header tells that it stands.
    """
    links = [(end.resolved_name, link) for end in subscribers for link in [*end.impl.connections]]
    try:
        return all(link.header and _is_known(name, topic, link.endpoint_id) for topic, link in links)
    except OSError:
        return False


def _is_known(name: str, topic: str, uri: str) -> bool:
    """Whether the publisher at an address has a node among the connections of a topic, or is in fabric."""
    publisher: Any = xmlrpc.client.ServerProxy(uri)
    links = publisher.getBusInfo(name)[2]
    if not links and publisher.getPid(name)[2] == _PROCESS_OF_FABRIC:
        return True
    return any([*link[1:3], link[4]] == [name, "o", topic] for link in links)


class Finders:
    """The nodes of ROS 2 that publish their counts and have found the readers that a peer created before this object.

    A process announces its readers in the order of their creation. A node that sends to the last one has found all.
    """

    def __init__(self, node: Any) -> None:
        from diagnostic_msgs.msg import DiagnosticArray

        self._node = node
        self._names: set[str] = set()
        node.create_subscription(DiagnosticArray, _TOPIC, self._take, 10)

    def _take(self, message: Any) -> None:
        self._names |= {status.name for status in message.status if status.name.endswith(": node")}

    def are_all(self) -> bool:
        """Whether each node with counts has found the peer; the node of the peer must spin."""
        return 0 < int(self._node.count_publishers(_TOPIC)) <= len(self._names)


class Counts:
    """Counts of a node of ROS 2 that has none of its own, for `Finders`."""

    def __init__(self, node: Any) -> None:
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

        self._publisher = node.create_publisher(DiagnosticArray, _TOPIC, 10)
        self._message = DiagnosticArray(status=[DiagnosticStatus(name=f"{node.get_name()}: node")])

    def publish(self) -> None:
        self._publisher.publish(self._message)
