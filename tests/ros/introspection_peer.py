"""A server and a client of rclpy whose calls of sensor_msgs/SetCameraInfo are recorded by service introspection.

    python introspection_peer.py END CALLS

END is `server`, `client` or `both`, whose introspection is on. It prints as JSON the hash of the events and what came,
in base64. The response to a call is its text, and whether its width is odd. It needs nothing but ROS.
"""

from __future__ import annotations

import base64
import json
import sys
from typing import Any

import rclpy
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState
from sensor_msgs.srv import SetCameraInfo

SERVICE = "/set_camera_info"
TOPIC = f"{SERVICE}/_service_event"


def serve(request: Any, response: Any) -> Any:
    response.success = request.camera_info.width % 2 == 1
    response.status_message = request.camera_info.distortion_model
    return response


def main(end: str, calls: int) -> None:
    rclpy.init()
    node = rclpy.create_node("recorded")
    quality = QoSProfile(depth=1000)
    server = node.create_service(SetCameraInfo, SERVICE, serve, qos_profile=quality)
    client = node.create_client(SetCameraInfo, SERVICE, qos_profile=quality)
    told = {"server": [server], "client": [client], "both": [server, client]}[end]
    for item in told:
        item.configure_introspection(node.get_clock(), quality, ServiceIntrospectionState.CONTENTS)
    found: list[bytes] = []
    recorder = node.create_subscription(SetCameraInfo.Event, TOPIC, found.append, quality, raw=True)
    # In one process, both sides know each other as soon as one does.
    while not (client.service_is_ready() and node.count_publishers(TOPIC) == len(told)):
        rclpy.spin_once(node, timeout_sec=0.02)
    for number in range(calls):
        request = SetCameraInfo.Request()
        request.camera_info.width, request.camera_info.distortion_model = number, f"call {number}"
        rclpy.spin_until_future_complete(node, client.call_async(request))
    while len(found) < 2 * calls * len(told):
        rclpy.spin_once(node, timeout_sec=0.1)
    (hash_,) = {str(item.topic_type_hash) for item in node.get_publishers_info_by_topic(recorder.topic_name)}
    print(json.dumps([hash_, [base64.b64encode(item).decode() for item in found]]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
