"""A node that real ROS brings along, rospy's or rclpy's, for a test that speaks to it by lines of JSON.

    python payload_peer.py 1|2 '{"topic": "package/Type", ...}' '{"topic": "package/Type", ...}'

The first topics are subscribed to, the others published. Words may follow a type: `latched`, of a topic that need not
find somebody, and `depth=3`. A line `{"topic": ..., "payload": base64}` on its input is parsed by the message's own
class and published, or in ROS 2 with `"raw": true` published as it is; one like it on its output is a message that
came, as that class serialises it. The first line on its output says that every topic has found somebody. A line
`{"sync": ...}` comes back when all before it is published, and in ROS 2, `{"acked": true}` when every subscriber has
received it. It needs nothing but ROS.
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

from seen import Finders, are_known

_output = threading.Lock()


def say(line: dict[str, Any]) -> None:
    with _output:
        print(json.dumps(line), flush=True)


def say_message(topic: str, payload: bytes) -> None:
    say({"topic": topic, "payload": base64.b64encode(payload).decode()})


def commands(wait_until_acked: Callable[[], None] | None = None) -> Iterator[tuple[str, bytes, bool]]:
    """The messages to publish, and whether as they are, until the input ends."""
    for line in sys.stdin:
        command = json.loads(line)
        if "sync" in command:
            say(command)
        elif "acked" in command and wait_until_acked:
            wait_until_acked()
            say(command)
        else:
            yield command["topic"], base64.b64decode(command["payload"]), "raw" in command


class Wish:
    """A topic's type, and what is wanted of it."""

    def __init__(self, text: str) -> None:
        self.type, *words = text.split()
        self.is_latched = "latched" in words
        self.depth = int(next((word[len("depth=") :] for word in words if word.startswith("depth=")), 1000))


class Ros1Peer:
    def __init__(self, subscribed: dict[str, str], published: dict[str, str]) -> None:
        import rospy
        from roslib.message import get_message_class

        rospy.init_node("peer", anonymous=True, disable_signals=True)
        self.name = rospy.get_name()
        self.publishers = {}
        self.sought = []
        self.heard = []
        for topic, text in published.items():
            wish = Wish(text)
            message = get_message_class(wish.type)
            end = rospy.Publisher(topic, message, queue_size=wish.depth, latch=wish.is_latched, tcp_nodelay=True)
            self.publishers[topic] = end, message
            self.sought += [] if wish.is_latched else [end]
        for topic, text in subscribed.items():
            wish = Wish(text)
            subscriber = rospy.Subscriber(topic, get_message_class(wish.type), self.take, topic, tcp_nodelay=True)
            self.sought += [] if wish.is_latched else [subscriber]
            self.heard.append(subscriber)

    def take(self, message: Any, topic: str) -> None:
        buffer = io.BytesIO()
        message.serialize(buffer)
        say_message(topic, buffer.getvalue())

    def is_connected(self) -> bool:
        return all(end.get_num_connections() for end in self.sought) and are_known(self.name, self.heard)

    def run(self) -> None:
        while not self.is_connected():
            time.sleep(0.02)
        say({"connected": True})
        for topic, payload, _ in commands():
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
        self.wishes = {topic: Wish(text) for topic, text in {**subscribed, **published}.items()}
        self.types = {topic: message_class(wish.type) for topic, wish in self.wishes.items()}
        self.subscribed = list(subscribed)
        self.publishers = {
            topic: self.node.create_publisher(self.types[topic], topic, self.quality(topic)) for topic in published
        }
        for topic in subscribed:
            self.node.create_subscription(self.types[topic], topic, self.taker(topic), self.quality(topic))
        self.sought = [topic for topic, wish in self.wishes.items() if not wish.is_latched]
        self.finders = Finders(self.node)

    def quality(self, topic: str) -> Any:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        wish = self.wishes[topic]
        durability = DurabilityPolicy.TRANSIENT_LOCAL if wish.is_latched else DurabilityPolicy.VOLATILE
        return QoSProfile(depth=wish.depth, durability=durability)

    def taker(self, topic: str) -> Callable[[Any], None]:
        from rclpy.serialization import serialize_message

        return lambda message: say_message(topic, serialize_message(message))

    def is_connected(self) -> bool:
        """Whether every topic that is not latched has found a node, and been found."""
        are_there = all(
            self.node.count_publishers(topic)
            if topic in self.subscribed
            else self.publishers[topic].get_subscription_count()
            for topic in self.sought
        )
        return are_there and (not self.sought or self.finders.are_all())

    def wait_until_acked(self) -> None:
        from rclpy.duration import Duration

        for publisher in self.publishers.values():
            assert publisher.wait_for_all_acked(Duration(seconds=60))

    def publish_all(self) -> None:
        from rclpy.serialization import deserialize_message

        for topic, payload, is_raw in commands(self.wait_until_acked):
            self.publishers[topic].publish(payload if is_raw else deserialize_message(payload, self.types[topic]))
        self.rclpy.shutdown()

    def run(self) -> None:
        while not self.is_connected():
            self.rclpy.spin_once(self.node, timeout_sec=0.02)
        say({"connected": True})
        threading.Thread(target=self.publish_all, daemon=True).start()
        while self.rclpy.ok():
            self.rclpy.spin_once(self.node, timeout_sec=0.1)


if __name__ == "__main__":
    topics = json.loads(sys.argv[2]), json.loads(sys.argv[3])
    peer: Ros1Peer | Ros2Peer = Ros1Peer(*topics) if sys.argv[1] == "1" else Ros2Peer(*topics)
    peer.run()
