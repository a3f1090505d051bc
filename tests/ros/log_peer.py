"""A node of rospy or rclpy that prints each line of /rosout as JSON: name, level, text.

    python log_peer.py 1|2

First it prints that another node has connected its log. The levels are those of Python's `logging`.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from seen import are_known

_TOPIC = "/rosout"


def show(name: str, level: int, text: str) -> None:
    print(json.dumps({"name": name, "level": level, "text": text}), flush=True)


def run_ros1() -> None:
    import rospy
    from rosgraph_msgs.msg import Log

    levels = {Log.INFO: 20, Log.WARN: 30, Log.ERROR: 40}

    def take(line: Any) -> None:
        show(line.name, levels[line.level], line.msg)

    rospy.init_node("log_peer", anonymous=True, disable_signals=True)
    subscriber = rospy.Subscriber(_TOPIC, Log, take)
    # It has a log itself.
    while subscriber.get_num_connections() < 2 or not are_known(rospy.get_name(), [subscriber]):
        time.sleep(0.05)
    print(json.dumps({"connected": True}), flush=True)
    while True:
        time.sleep(1)


def run_ros2() -> None:
    import rclpy
    from rcl_interfaces.msg import Log
    from rclpy.qos import DurabilityPolicy, QoSProfile

    def take(line: Any) -> None:
        show(line.name, line.level, line.msg)

    rclpy.init()
    node = rclpy.create_node("log_peer")
    node.create_subscription(Log, _TOPIC, take, QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    while all(end.node_name == node.get_name() for end in node.get_publishers_info_by_topic(_TOPIC)):
        rclpy.spin_once(node, timeout_sec=0.05)
    print(json.dumps({"connected": True}), flush=True)
    rclpy.spin(node)


if __name__ == "__main__":
    {"1": run_ros1, "2": run_ros2}[sys.argv[1]]()
