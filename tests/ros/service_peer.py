"""Clients of rospy or rclpy for a service of a node: sensor_msgs/SetCameraInfo, whose answers depend on the requests.

    python service_peer.py 1|2 SERVICE CALLS SEED

It calls the service so many times and prints as JSON what came that was not the answer to its call. Each request has a
text that no other one has. Some texts begin with a word of `--texts`, or all with `--always`; a failure to which they
lead is printed as well.
It needs nothing but ROS.
"""

from __future__ import annotations

import argparse
import json
import os
import random
from typing import Any

from seen import Finders

# In s; longer than any call takes here, even on a busy machine.
LONGEST = 60.0


class Ros1Client:
    def __init__(self, service: str) -> None:
        import rospy
        from sensor_msgs.srv import SetCameraInfo, SetCameraInfoRequest

        # wait_for_service() may have to try again, and would print that it succeeded to the standard output.
        rospy.init_node("client", anonymous=True, disable_signals=True, log_level=rospy.WARN)
        rospy.wait_for_service(service)
        self.errors = rospy.ServiceException
        self.make = SetCameraInfoRequest
        self.proxy = rospy.ServiceProxy(service, SetCameraInfo, persistent=True)

    def distortion(self, request: Any) -> str:
        return "D"

    def call(self, request: Any) -> Any:
        """The response, or the text of the failure."""
        try:
            return self.proxy(request)
        except self.errors as error:
            return str(error)


class Ros2Client:
    def __init__(self, service: str) -> None:
        import rclpy
        from rclpy.qos import QoSProfile
        from sensor_msgs.srv import SetCameraInfo

        self.rclpy = rclpy
        rclpy.init()
        self.node = rclpy.create_node(f"client_{os.getpid()}")
        self.make = SetCameraInfo.Request
        # Responses to all clients reach each client; the 10 of the default are too few for one that has to wait.
        self.client = self.node.create_client(SetCameraInfo, service, qos_profile=QoSProfile(depth=1000))
        finders = Finders(self.node)
        while not (self.client.service_is_ready() and finders.are_all()):
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def distortion(self, request: Any) -> str:
        return "d"

    def call(self, request: Any) -> Any:
        """The response; ROS 2 knows no failure."""
        future = self.client.call_async(request)
        self.rclpy.spin_until_future_complete(self.node, future, timeout_sec=LONGEST)
        return future.result() if future.done() else "no answer"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("version", type=int)
    parser.add_argument("service")
    parser.add_argument("calls", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--texts", nargs="*", default=[])
    parser.add_argument("--always", action="store_true")
    arguments = parser.parse_args()
    source = random.Random(arguments.seed)
    client: Ros1Client | Ros2Client = (Ros1Client if arguments.version == 1 else Ros2Client)(arguments.service)
    print("ready", flush=True)
    input()
    wrong, failed = [], []
    for number in range(arguments.calls):
        request = client.make()
        has_word = arguments.always or (arguments.texts and source.random() < 0.3)
        word = source.choice(arguments.texts) if has_word else "call"
        text = f"{word} {number} of {arguments.seed} {'x' * source.randrange(40)}"
        request.camera_info.distortion_model = text
        request.camera_info.width = source.randrange(1 << 32)
        coefficients = [source.random() for _ in range(source.randrange(9))]
        setattr(request.camera_info, client.distortion(request), coefficients)
        response = client.call(request)
        if isinstance(response, str):
            failed.append([text, response])
        elif word != "call" and not response.success:
            failed.append([text, response.status_message])
        elif (response.success, response.status_message) != (request.camera_info.width % 2 == 1, text):
            wrong.append([text, response.success, response.status_message])
    print(json.dumps({"wrong": wrong, "failed": failed}), flush=True)


if __name__ == "__main__":
    main()
