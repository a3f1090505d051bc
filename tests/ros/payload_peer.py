"""A node that real ROS brings along, rospy's or rclpy's, for a test that speaks to it by lines of JSON.

    python payload_peer.py 1|2 '{"topic": "package/Type", ...}' '{"topic": "package/Type", ...}'

The first topics are subscribed to, the others published. A line `{"topic": ..., "payload": base64}` on its input is
parsed by the message's own class and published; one like it on its output is a message that came, as that class
serialises it. The first line on its output says that every topic has found somebody. It needs nothing but ROS.
"""

from __future__ import annotations

import base64
import importlib
import io
import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

_output = threading.Lock()


def say(line: dict[str, Any]) -> None:
    with _output:
        print(json.dumps(line), flush=True)


def say_message(topic: str, payload: bytes) -> None:
    say({"topic": topic, "payload": base64.b64encode(payload).decode()})


def commands() -> Iterator[tuple[str, bytes]]:
    """The messages to publish, until the input ends."""
    for line in sys.stdin:
        command = json.loads(line)
        yield command["topic"], base64.b64decode(command["payload"])


class Ros1Peer:
    def __init__(self, subscribed: dict[str, str], published: dict[str, str]) -> None:
        import rospy
        from roslib.message import get_message_class

        rospy.init_node("peer", anonymous=True, disable_signals=True)
        self.publishers = {}
        for topic, name in published.items():
            message = get_message_class(name)
            self.publishers[topic] = rospy.Publisher(topic, message, queue_size=1000, tcp_nodelay=True), message
        self.subscribers = [
            rospy.Subscriber(topic, get_message_class(name), self.take, topic, tcp_nodelay=True)
            for topic, name in subscribed.items()
        ]

    def take(self, message: Any, topic: str) -> None:
        buffer = io.BytesIO()
        message.serialize(buffer)
        say_message(topic, buffer.getvalue())

    def is_connected(self) -> bool:
        ends = [*self.subscribers, *(publisher for publisher, _ in self.publishers.values())]
        return all(end.get_num_connections() for end in ends)

    def run(self) -> None:
        while not self.is_connected():
            time.sleep(0.02)
        say({"connected": True})
        for topic, payload in commands():
            publisher, message = self.publishers[topic]
            publisher.publish(message().deserialize(payload))


def message_class(name: str) -> Any:
    """The class of `package/msg/Type`."""
    package, _, message = name.partition("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), message)


class Ros2Peer:
    def __init__(self, subscribed: dict[str, str], published: dict[str, str]) -> None:
        import rclpy

        self.rclpy = rclpy
        rclpy.init()
        self.node = rclpy.create_node("peer")
        self.types = {topic: message_class(name) for topic, name in (subscribed | published).items()}
        self.subscribed = list(subscribed)
        self.publishers = {topic: self.node.create_publisher(self.types[topic], topic, 1000) for topic in published}
        for topic in subscribed:
            self.node.create_subscription(self.types[topic], topic, self.taker(topic), 1000)

    def taker(self, topic: str) -> Callable[[Any], None]:
        from rclpy.serialization import serialize_message

        return lambda message: say_message(topic, serialize_message(message))

    def is_connected(self) -> bool:
        return all(publisher.get_subscription_count() for publisher in self.publishers.values()) and all(
            self.node.count_publishers(topic) for topic in self.subscribed
        )

    def publish_all(self) -> None:
        from rclpy.serialization import deserialize_message

        for topic, payload in commands():
            self.publishers[topic].publish(deserialize_message(payload, self.types[topic]))
        self.rclpy.shutdown()

    def run(self) -> None:
        while not self.is_connected():
            time.sleep(0.02)
        # Who is seen may not see us yet.
        time.sleep(0.5)
        say({"connected": True})
        threading.Thread(target=self.publish_all, daemon=True).start()
        while self.rclpy.ok():
            self.rclpy.spin_once(self.node, timeout_sec=0.1)


if __name__ == "__main__":
    topics = json.loads(sys.argv[2]), json.loads(sys.argv[3])
    peer: Ros1Peer | Ros2Peer = Ros1Peer(*topics) if sys.argv[1] == "1" else Ros2Peer(*topics)
    peer.run()
