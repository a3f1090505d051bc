"""A client of the lifecycle of a node, in rclpy.

    python lifecycle_peer.py NODE SERVICE

For each line on its input, the name of a transition or an empty line, it prints as JSON whether the transition was
successful, and the node's state after it unless that ends the node. A line `+` or `-` waits until SERVICE is there, or
is not. It needs nothing but ROS.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState

# In s; longer than any call takes here, even on a busy machine.
LONGEST = 60.0


class LifecycleClient:
    def __init__(self, name: str) -> None:
        rclpy.init()
        self.node = rclpy.create_node("lifecycle_client")
        self.change = self.node.create_client(ChangeState, f"{name}/change_state")
        self.state = self.node.create_client(GetState, f"{name}/get_state")
        for client in (self.change, self.state):
            while not client.wait_for_service(timeout_sec=1):
                pass
        # Who is seen may not see us yet: a request or its response may be lost.
        while not self.tried(self.state, GetState.Request(), 1):
            pass

    def tried(self, client: Any, request: Any, seconds: float) -> Any:
        """The response, or nothing when it has not come in time."""
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=seconds)
        return future.result() if future.done() else None

    def call(self, client: Any, request: Any) -> Any:
        response = self.tried(client, request, LONGEST)
        assert response, f"no response for {LONGEST} s"
        return response

    def transit(self, name: str) -> tuple[bool, str]:
        """Whether the transition was successful, and the state after it."""
        is_done = not name
        if name:
            number = getattr(Transition, f"TRANSITION_{name.upper()}")
            is_done = self.call(self.change, ChangeState.Request(transition=Transition(id=number))).success
        has_ended = name.endswith("shutdown")
        return is_done, "" if has_ended else self.call(self.state, GetState.Request()).current_state.label

    def wait_for_service(self, name: str, *, is_wanted: bool) -> bool:
        """Wait until a service is there, or is not; return whether that has come in time."""
        latest = time.monotonic() + LONGEST
        while any(found == name for found, _ in self.node.get_service_names_and_types()) != is_wanted:
            rclpy.spin_once(self.node, timeout_sec=0.05)
            if time.monotonic() > latest:
                return False
        return True


def main() -> None:
    client = LifecycleClient(sys.argv[1])
    for line in map(str.strip, sys.stdin):
        if line in ("+", "-"):
            has_come = client.wait_for_service(sys.argv[2], is_wanted=line == "+")
            print(json.dumps(line if has_come else f"no {line} for {LONGEST} s"), flush=True)
        else:
            print(json.dumps(client.transit(line)), flush=True)


if __name__ == "__main__":
    main()
