"""A node of rospy or rclpy that prints each status on /diagnostics as a line of JSON: name, level, values.

    python diagnostics_peer.py 1|2

ROS 1 makes the message's class of the definition that the publisher announces, as `rostopic echo` does.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any


def show(array: Any) -> None:
    for status in array.status:
        level = status.level if isinstance(status.level, int) else status.level[0]
        values = {item.key: item.value for item in status.values}
        print(json.dumps({"name": status.name, "level": level, "values": values}), flush=True)


def run_ros1() -> None:
    import genpy.dynamic
    import rospy

    def take(message: Any) -> None:
        header = message._connection_header
        types = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])
        array = types[header["type"]]()
        assert array._md5sum == header["md5sum"]
        show(array.deserialize(message._buff))

    rospy.init_node("diagnostics_peer", anonymous=True, disable_signals=True)
    subscriber = rospy.Subscriber("/diagnostics", rospy.AnyMsg, take)
    while subscriber:
        time.sleep(1)


def run_ros2() -> None:
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray

    rclpy.init()
    node = rclpy.create_node("diagnostics_peer")
    node.create_subscription(DiagnosticArray, "/diagnostics", show, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    {"1": run_ros1, "2": run_ros2}[sys.argv[1]]()
