"""A server of rospy or rclpy for hardware that calls sensor_msgs/SetCameraInfo (camera/asking.yaml).

    python asking_peer.py 1|2 NAME ...

It publishes the names, and prints what comes back as JSON. The response to a name is the name backwards; the call of a
name that begins with `no` fails in ROS 1, and is not successful in ROS 2. It needs nothing but ROS.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Any

from seen import Finders, are_known

SERVICE, NAMES, TEXTS = "/set_camera_info", "/name_in", "/name_out"


def ros1(names: Sequence[str]) -> list[str]:
    import rospy
    from sensor_msgs.srv import SetCameraInfo, SetCameraInfoResponse
    from std_msgs.msg import String

    found: list[str] = []

    def serve(request: Any) -> Any:
        name = request.camera_info.distortion_model
        if name.startswith("no"):
            raise rospy.ServiceException("it is refused")
        return SetCameraInfoResponse(True, name[::-1])

    rospy.init_node("server", disable_signals=True)
    rospy.Service(SERVICE, SetCameraInfo, serve)
    publisher = rospy.Publisher(NAMES, String, queue_size=100)
    subscriber = rospy.Subscriber(TEXTS, String, lambda message: found.append(message.data))
    while not (publisher.get_num_connections() and subscriber.get_num_connections()):
        time.sleep(0.02)
    while not are_known(rospy.get_name(), [subscriber]):
        time.sleep(0.02)
    for name in names:
        publisher.publish(String(name))
    while len(found) < len(names):
        time.sleep(0.02)
    return found


def ros2(names: Sequence[str]) -> list[str]:
    import rclpy
    from sensor_msgs.srv import SetCameraInfo
    from std_msgs.msg import String

    found: list[str] = []

    def serve(request: Any, response: Any) -> Any:
        name = request.camera_info.distortion_model
        response.success = not name.startswith("no")
        response.status_message = name[::-1] if response.success else "it is refused"
        return response

    rclpy.init()
    node = rclpy.create_node("server")
    node.create_service(SetCameraInfo, SERVICE, serve)
    publisher = node.create_publisher(String, NAMES, 100)
    node.create_subscription(String, TEXTS, lambda message: found.append(message.data), 100)
    finders = Finders(node)
    while not (publisher.get_subscription_count() and node.count_publishers(TEXTS) and finders.are_all()):
        rclpy.spin_once(node, timeout_sec=0.02)
    for name in names:
        publisher.publish(String(data=name))
    while len(found) < len(names):
        rclpy.spin_once(node, timeout_sec=0.1)
    return found


if __name__ == "__main__":
    print(json.dumps({"1": ros1, "2": ros2}[sys.argv[1]](sys.argv[2:])), flush=True)
