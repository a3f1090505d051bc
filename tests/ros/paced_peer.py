"""A node of rospy or rclpy that sends quaternions at a rate, and takes the time until something comes back.

    python paced_peer.py 1|2 RATE SECONDS '[["in", "out"], ...]' [images|squares]

Quaternion n of a topic turns by n thousandths of a rad about z, from -3 on, and around again behind 3. The result, as
JSON: for each way how many were sent, the z of the points that came, and the seconds that each took, the n-th that came
being the answer to the n-th that was sent. `echo IN OUT` in place of a rate is a node that answers with x, y and z of
what comes. With `images`, images of 1 MB are sent and come back; z is the `step` of one, which is its number. With
`squares`, images of 32 by 8 pixels are sent, each with a square, and commands come back; z is the turn of one.
"""

from __future__ import annotations

import array
import json
import math
import os
import sys
import threading
import time
from typing import Any

from seen import Counts, Finders, are_known

_TURN = 6000
_IMAGE_BYTES = 1_000_000


class Ros1:
    def __init__(self) -> None:
        import rospy

        self.rospy = rospy
        rospy.init_node("paced", anonymous=True, disable_signals=True)

    def publisher(self, topic: str, message: Any) -> Any:
        return self.rospy.Publisher(topic, message, queue_size=1000, tcp_nodelay=True)

    def subscriber(self, topic: str, message: Any, take: Any) -> Any:
        return self.rospy.Subscriber(topic, message, take, tcp_nodelay=True, buff_size=2 * _IMAGE_BYTES)

    def is_connected(self, publisher: Any, subscriber: Any) -> bool:
        return bool(publisher.get_num_connections() and subscriber.get_num_connections())

    def are_known(self, subscribers: list[Any]) -> bool:
        """Whether the other sides know the subscribers."""
        return bool(are_known(self.rospy.get_name(), subscribers))

    def show_counts(self) -> None:
        """ROS 1 does not need it."""


class Ros2:
    def __init__(self) -> None:
        import rclpy

        rclpy.init()
        self.node = rclpy.create_node(f"paced_{os.getpid()}")
        self.finders: Finders | None = None
        self.counts: Counts | None = None
        threading.Thread(target=rclpy.spin, args=(self.node,), daemon=True).start()

    def publisher(self, topic: str, message: Any) -> Any:
        return self.node.create_publisher(message, topic, 1000)

    def subscriber(self, topic: str, message: Any, take: Any) -> Any:
        return self.node.create_subscription(message, topic, take, 1000)

    def is_connected(self, publisher: Any, subscriber: Any) -> bool:
        return bool(publisher.get_subscription_count() and self.node.count_publishers(subscriber.topic_name))

    def are_known(self, _: list[Any]) -> bool:
        """Whether the other sides know all subscribers."""
        self.finders = self.finders or Finders(self.node)
        return bool(self.finders.are_all())

    def show_counts(self) -> None:
        """Publish what tells another peer that it is known."""
        self.counts = self.counts or Counts(self.node)
        self.counts.publish()


class Angles:
    """Quaternions, which points answer."""

    def __init__(self) -> None:
        from geometry_msgs.msg import Point, Quaternion

        self.sent, self.received = Quaternion, Point

    def message(self, number: int) -> Any:
        angle = (number % _TURN) / 1000 - 3
        return self.sent(x=0.0, y=0.0, z=math.sin(angle / 2), w=math.cos(angle / 2))

    def answer(self, quaternion: Any) -> Any:
        return self.received(x=quaternion.x, y=quaternion.y, z=quaternion.z)

    def value(self, point: Any) -> float:
        return float(point.z)


class Images:
    """Images, which the same images answer."""

    def __init__(self, version: int) -> None:
        from sensor_msgs.msg import Image

        self.sent = self.received = Image
        content = bytes(range(250)) * (_IMAGE_BYTES // 250)
        self._data: Any = content if version == 1 else array.array("B", content)

    def message(self, number: int) -> Any:
        image = self.sent()
        image.step, image.data = number, self._data
        return image

    def answer(self, image: Any) -> Any:
        return image

    def value(self, image: Any) -> float:
        return float(image.step) if image.data == self._data else -1.0


class Squares:
    """Small images, which commands answer."""

    def __init__(self) -> None:
        from geometry_msgs.msg import Twist
        from sensor_msgs.msg import Image

        self.sent, self.received = Image, Twist

    def message(self, number: int) -> Any:
        columns = range(number % 28, number % 28 + 4)
        pixels = bytes(200 if column in columns else 10 for _ in range(8) for column in range(32))
        return self.sent(height=8, width=32, step=32, encoding="mono8", data=pixels)

    def value(self, command: Any) -> float:
        return float(command.angular.z)


class Way:
    def __init__(self, ros: Any, kind: Any, sent: str, received: str) -> None:
        self.kind = kind
        self.sent_at: list[float] = []
        self.came: list[tuple[float, float]] = []
        self.publisher = ros.publisher(sent, kind.sent)
        self.subscriber = ros.subscriber(received, kind.received, self.take)

    def take(self, message: Any) -> None:
        self.came.append((time.perf_counter(), self.kind.value(message)))

    def send(self) -> None:
        message = self.kind.message(len(self.sent_at))
        self.sent_at.append(time.perf_counter())
        self.publisher.publish(message)

    def result(self) -> dict[str, Any]:
        seconds = [came - sent for sent, (came, _) in zip(self.sent_at, self.came)]  # noqa: B905 - Python 3.8
        return {"sent": len(self.sent_at), "z": [z for _, z in self.came], "seconds": seconds}


def run(ros: Any, rate: int, seconds: float, ways: list[Way]) -> None:
    while not all(ros.is_connected(way.publisher, way.subscriber) for way in ways):
        time.sleep(0.02)
    while not ros.are_known([way.subscriber for way in ways]):
        time.sleep(0.02)
    start, steps = time.perf_counter(), round(rate * seconds) * len(ways)
    for step in range(steps):
        time.sleep(max(0.0, start + step / rate / len(ways) - time.perf_counter()))
        ways[step % len(ways)].send()
    latest = time.perf_counter() + 60
    while time.perf_counter() < latest and any(len(way.came) < len(way.sent_at) for way in ways):
        time.sleep(0.02)
    print(json.dumps([way.result() for way in ways]), flush=True)


def echo(ros: Any, kind: Any, sent: str, received: str) -> None:
    ros.show_counts()
    publisher = ros.publisher(received, kind.received)
    subscriber = ros.subscriber(sent, kind.sent, lambda message: publisher.publish(kind.answer(message)))
    while subscriber:
        ros.show_counts()
        time.sleep(1)


if __name__ == "__main__":
    middleware: Any = {"1": Ros1, "2": Ros2}[sys.argv[1]]()
    kinds: Any = {"": Angles, "images": lambda: Images(int(sys.argv[1])), "squares": Squares}
    messages: Any = kinds["".join(sys.argv[5:])]()
    if sys.argv[2] == "echo":
        echo(middleware, messages, *sys.argv[3:5])
    else:
        pairs = [Way(middleware, messages, *pair) for pair in json.loads(sys.argv[4])]
        run(middleware, int(sys.argv[2]), float(sys.argv[3]), pairs)
    # rclpy's thread is still at work.
    sys.stdout.flush()
    os._exit(0)
