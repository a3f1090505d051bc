"""Sets parameters of a node, and sends numbers to it, as other nodes of ROS do. The Python of ROS runs it.

The arguments are the version of ROS, the node's name and steps in JSON, the methods of the peers with their arguments:
["set", NAME, VALUE], ["get", NAME], ["ask", NUMBER] and others. It prints the list of results in JSON: of `set`, the
reason of a refusal.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from queue import Empty, Queue
from typing import Any

_SECONDS = 30.0


class Peer1:
    """A node of ROS 1."""

    def __init__(self, node: str) -> None:
        import rospy
        from std_msgs.msg import Int32

        self._rospy, self._node, self._message = rospy, node, Int32
        self._answers: Queue[Any] = Queue()
        rospy.init_node("peer", anonymous=True)
        self._publisher = rospy.Publisher("sub", Int32, queue_size=10)
        rospy.Subscriber("pub", Int32, self._answers.put)
        while not self._publisher.get_num_connections():
            time.sleep(0.01)
        time.sleep(0.5)

    def set(self, name: str, value: Any) -> str:
        """Set a parameter in the master; the node puts back a value that it refuses."""
        key = f"{self._node}/{name.replace('.', '/')}"
        self._rospy.set_param(key, value)
        time.sleep(1.5)
        return "" if self._rospy.get_param(key) == value else "put back"

    def get(self, name: str) -> Any:
        """Return a parameter in the master."""
        return self._rospy.get_param(f"{self._node}/{name.replace('.', '/')}")

    def ask(self, number: int) -> Any:
        """Send a number; return the answer."""
        self._publisher.publish(self._message(number))
        return self._answers.get(timeout=_SECONDS).data


class Peer2:
    """A node of ROS 2."""

    def __init__(self, node: str) -> None:
        import rclpy
        from rclpy.parameter import Parameter
        from rclpy.parameter_client import AsyncParameterClient
        from std_msgs.msg import Int32

        self._rclpy, self._node, self._message, self._parameter = rclpy, node, Int32, Parameter
        self._answers: Queue[Any] = Queue()
        rclpy.init()
        self._own = rclpy.create_node("peer")
        self._publisher = self._own.create_publisher(Int32, "sub", 10)
        self._own.create_subscription(Int32, "pub", self._answers.put, 10)
        self._events: Queue[Any] = Queue()
        self._client = AsyncParameterClient(self._own, node)
        self._client.on_parameter_event(self._keep_event)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        assert self._client.wait_for_services(_SECONDS)
        while not self._publisher.get_subscription_count():
            time.sleep(0.01)
        time.sleep(0.5)

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        with contextlib.suppress(ExternalShutdownException):
            self._rclpy.spin(self._own)

    def _done(self, future: Any) -> Any:
        end = time.monotonic() + _SECONDS
        while not future.done() and time.monotonic() < end:
            time.sleep(0.005)
        return future.result()

    def set(self, name: str, value: Any) -> str:
        """Set a parameter; return the reason of a refusal."""
        answer = self._done(self._client.set_parameters([self._parameter(name, value=value)]))
        return answer.results[0].reason if not answer.results[0].successful else ""

    def get(self, name: str) -> Any:
        """Return a parameter."""
        from rclpy.parameter import parameter_value_to_python

        return parameter_value_to_python(self._done(self._client.get_parameters([name])).values[0])

    def list(self, prefix: str) -> Any:
        """Return the names of the parameters with a prefix."""
        return [*self._done(self._client.list_parameters([prefix], 10)).result.names]

    def describe(self, name: str) -> Any:
        """Return type and range of a parameter."""
        (found,) = self._done(self._client.describe_parameters([name])).descriptors
        (type_,) = self._done(self._client.get_parameter_types([name])).types
        ranges = [*found.integer_range, *found.floating_point_range]
        return [found.name, found.type, type_, [[each.from_value, each.to_value] for each in ranges]]

    def _keep_event(self, event: Any) -> None:
        if event.node == self._node:
            self._events.put(event)

    def event(self) -> Any:
        """Return the next change of the node: its new, changed and deleted parameters.

        Events about its first values come only to listeners that it has found before.
        """
        from rclpy.parameter import parameter_value_to_python

        while not (event := self._events.get(timeout=_SECONDS)).changed_parameters:
            pass
        assert 0 <= time.time() - event.stamp.sec < _SECONDS
        return [
            {item.name: parameter_value_to_python(item.value) for item in items}
            for items in (event.new_parameters, event.changed_parameters, event.deleted_parameters)
        ]

    def set_all(self, values: dict[str, Any]) -> str:
        """Set several parameters, all or none; return the reason of a refusal."""
        wanted = [self._parameter(name, value=value) for name, value in values.items()]
        result = self._done(self._client.set_parameters_atomically(wanted)).result
        return "" if result.successful else result.reason

    def ask(self, number: int) -> Any:
        """Send a number; return the answer."""
        self._publisher.publish(self._message(data=number))
        return self._answers.get(timeout=_SECONDS).data


def main() -> None:
    """Carry out the steps."""
    peer = (Peer1 if sys.argv[1] == "1" else Peer2)(sys.argv[2])
    found = []
    for verb, *values in json.loads(sys.argv[3]):
        try:
            found.append(getattr(peer, verb)(*values))
        except Empty:
            found.append("no answer")
    print(json.dumps(found), flush=True)
    # Threads of ROS may still wait.
    os._exit(0)


main()
