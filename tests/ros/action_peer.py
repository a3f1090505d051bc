"""A client of actionlib or rclpy.action for the action of a node: actionlib/Test or test_msgs/Fibonacci.

    python action_peer.py 1|2 ACTION [--goals GOAL ... | --random GOALS SEED]

It sends the goals one after another and prints as JSON for each: the goal, the word of its state, its feedback, and its
result. A goal with bits 4 to 6 set is canceled at its first feedback. It needs nothing but ROS.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import threading
from collections.abc import Callable, Sequence
from typing import Any

from seen import Finders

HELD = 0x70
# In s; longer than any goal takes here, even on a busy machine.
LONGEST = 120.0


class Ros1Client:
    """A client of actionlib.

    SimpleActionClient is not sufficient for a fast server: it drops feedback that comes before its `send_goal` returns.
    Both clients give up a goal as lost that was canceled before its first state came.
    """

    def __init__(self, action: str) -> None:
        import actionlib
        import rospy
        from actionlib.msg import TestAction, TestGoal
        from actionlib_msgs.msg import GoalStatus

        rospy.init_node("client", anonymous=True, disable_signals=True)
        self.goal, self.phases = TestGoal, actionlib.CommState
        self.client = actionlib.ActionClient(action, TestAction)
        self.client.wait_for_server()
        self.states = {value: name for name, value in vars(GoalStatus).items() if isinstance(value, int)}

    def run(self, number: int, is_canceled: Callable[[int], bool]) -> Any:
        feedback: list[int] = []
        changed = threading.Condition()

        def note(_: Any) -> None:
            with changed:
                changed.notify_all()

        def take(handle: Any, message: Any) -> None:
            feedback.append(message.feedback)
            note(handle)

        handle = self.client.send_goal(self.goal(number), note, take)

        def has_begun() -> bool:
            return bool(feedback) and handle.get_comm_state() != self.phases.WAITING_FOR_GOAL_ACK

        def has_ended() -> bool:
            return bool(handle.get_comm_state() == self.phases.DONE)

        with changed:
            begun = is_canceled(number) and changed.wait_for(lambda: has_begun() or has_ended(), LONGEST)
        if begun:
            handle.cancel()
        with changed:
            if not changed.wait_for(has_ended, LONGEST):
                return number, "NONE", feedback, None
        result = handle.get_result()
        return number, self.states[handle.get_terminal_state()], feedback, result and result.result


class Ros2Client:
    def __init__(self, action: str) -> None:
        import rclpy
        from action_msgs.msg import GoalStatus
        from rclpy.action import ActionClient
        from rclpy.qos import QoSProfile
        from test_msgs.action import Fibonacci

        rclpy.init()
        self.rclpy, self.goal = rclpy, Fibonacci.Goal
        self.node = rclpy.create_node(f"client_{os.getpid()}")
        # Responses to all clients reach each client.
        deep = QoSProfile(depth=1000)
        self.client = ActionClient(
            self.node,
            Fibonacci,
            action,
            goal_service_qos_profile=deep,
            result_service_qos_profile=deep,
            cancel_service_qos_profile=deep,
            feedback_sub_qos_profile=deep,
        )
        finders = Finders(self.node)
        while not (self.client.server_is_ready() and finders.are_all()):
            rclpy.spin_once(self.node, timeout_sec=0.02)
        words = ("SUCCEEDED", "CANCELED", "ABORTED", "UNKNOWN")
        self.states = {getattr(GoalStatus, f"STATUS_{word}"): word for word in words}

    def wait(self, future: Any) -> Any:
        self.rclpy.spin_until_future_complete(self.node, future, timeout_sec=LONGEST)
        return future.result() if future.done() else None

    def run(self, number: int, is_canceled: Callable[[int], bool]) -> Any:
        feedback: list[int] = []
        came = threading.Event()

        def take(message: Any) -> None:
            feedback.extend(message.feedback.sequence)
            came.set()

        handle = self.wait(self.client.send_goal_async(self.goal(order=number), feedback_callback=take))
        if handle is None or not handle.accepted:
            return number, "REJECTED" if handle else "NONE", feedback, None
        result = handle.get_result_async()
        if is_canceled(number):
            while not came.is_set():
                self.rclpy.spin_once(self.node, timeout_sec=1)
            self.wait(handle.cancel_goal_async())
        found = self.wait(result)
        if found is None:
            return number, "NONE", feedback, None
        return number, self.states[found.status], feedback, next(iter(found.result.sequence), None)


def goals_of(arguments: argparse.Namespace) -> Sequence[int]:
    if arguments.goals:
        return list(arguments.goals)
    count, seed = arguments.random
    source = random.Random(seed)
    return [source.randrange(1 << 30) for _ in range(count)]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("version", type=int)
    parser.add_argument("action")
    parser.add_argument("--goals", nargs="*", type=int)
    parser.add_argument("--random", nargs=2, type=int)
    arguments = parser.parse_args()
    client: Any = (Ros1Client if arguments.version == 1 else Ros2Client)(arguments.action)
    print("ready", flush=True)
    input()
    found = [client.run(number, lambda goal: goal > 0 and goal & HELD == HELD) for number in goals_of(arguments)]
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
