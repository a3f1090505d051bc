"""A server of actionlib or rclpy.action, to which the hardware of planner/planner.yaml sends goals.

    python action_server_peer.py 1|2 ACTION [--simple]

A goal g leads to g % 4 messages of feedback, g + 1, g + 2 and so on, and to the result g. If bits 4 to 6 of g are set,
there is one message of feedback, and the result follows a cancellation. The upper bits are one of `Kind`. For each goal
that has ended, it prints as JSON the goal and the word of its state. `--simple` is SimpleActionServer, which cannot
reject goals. It needs nothing but ROS.
"""

from __future__ import annotations

import argparse
import json
import os
import threading
import time
from collections.abc import Callable
from enum import IntEnum
from typing import Any

HELD = 0x70


class Kind(IntEnum):
    """The upper bits of a goal, if they are not 0.

    It is rejected; after feedback, it is aborted with the result 7, kills the server, or waits for a cancellation; in
    ROS 2, it is accepted late, and waits for a cancellation.
    """

    REJECTED = 1
    ABORTED = 2
    DEADLY = 3
    WAITING = 4
    LATE = 5


# s; a time limit is shorter.
LATE_SECONDS = 3


def say(goal: int, state: str) -> None:
    print(json.dumps([goal, state]), flush=True)


def pursue(goal: int, feed: Callable[[int], None], is_canceled: Callable[[], bool]) -> tuple[str, int]:
    """The word of the state, and the number of the result."""
    kind = goal >> 20
    is_held = goal & HELD == HELD or kind in (Kind.WAITING, Kind.LATE)
    for step in range(1, (1 if kind or is_held else goal % 4) + 1):
        feed(goal + step)
    if kind == Kind.DEADLY:
        # What was published has to leave, and then nothing.
        time.sleep(0.5)
        os._exit(0)
    if kind == Kind.ABORTED:
        return "ABORTED", 7
    while is_held and not is_canceled():
        time.sleep(0.01)
    return ("CANCELED" if is_held else "SUCCEEDED"), goal


class Ros1Server:
    """A server of actionlib, which pursues each goal in a thread."""

    def __init__(self, action: str) -> None:
        import actionlib
        from actionlib.msg import TestAction, TestFeedback, TestResult
        from actionlib_msgs.msg import GoalStatus

        self.feedback, self.result, self.preempting = TestFeedback, TestResult, GoalStatus.PREEMPTING
        self.server = actionlib.ActionServer(action, TestAction, self.take, lambda _: None, auto_start=False)
        self.server.start()

    def take(self, handle: Any) -> None:
        if handle.get_goal().goal >> 20 == Kind.REJECTED:
            handle.set_rejected()
            say(handle.get_goal().goal, "REJECTED")
        else:
            handle.set_accepted()
            threading.Thread(target=self.run, args=(handle,), daemon=True).start()

    def run(self, handle: Any) -> None:
        goal = handle.get_goal().goal

        def is_canceled() -> bool:
            return bool(handle.get_goal_status().status == self.preempting)

        state, number = pursue(goal, lambda value: handle.publish_feedback(self.feedback(value)), is_canceled)
        end = {"SUCCEEDED": handle.set_succeeded, "CANCELED": handle.set_canceled, "ABORTED": handle.set_aborted}
        end[state](self.result(number))
        say(goal, state)


class SimpleServer:
    """A SimpleActionServer."""

    def __init__(self, action: str) -> None:
        import actionlib
        from actionlib.msg import TestAction, TestFeedback, TestResult

        self.feedback, self.result = TestFeedback, TestResult
        self.server = actionlib.SimpleActionServer(action, TestAction, self.run, auto_start=False)
        self.server.start()

    def run(self, message: Any) -> None:
        state, number = pursue(
            message.goal,
            lambda value: self.server.publish_feedback(self.feedback(value)),
            self.server.is_preempt_requested,
        )
        server = self.server
        end = {"SUCCEEDED": server.set_succeeded, "CANCELED": server.set_preempted, "ABORTED": server.set_aborted}
        end[state](self.result(number))
        say(message.goal, state)


def ros1(action: str, *, is_simple: bool) -> None:
    import rospy

    rospy.init_node("server", anonymous=True, disable_signals=True)
    _server = (SimpleServer if is_simple else Ros1Server)(action)
    print("ready", flush=True)
    threading.Event().wait()


def ros2(action: str) -> None:
    import rclpy
    from rclpy.action import ActionServer, CancelResponse, GoalResponse
    from rclpy.callback_groups import ReentrantCallbackGroup
    from rclpy.executors import MultiThreadedExecutor
    from rclpy.node import Node
    from test_msgs.action import Fibonacci

    rclpy.init()
    node: Any = Node(f"server_{os.getpid()}")

    def accept(request: Any) -> Any:
        if request.order >> 20 == Kind.REJECTED:
            say(request.order, "REJECTED")
            return GoalResponse.REJECT
        if request.order >> 20 == Kind.LATE:
            time.sleep(LATE_SECONDS)
        return GoalResponse.ACCEPT

    def run(handle: Any) -> Any:
        goal = handle.request.order

        def feed(value: int) -> None:
            handle.publish_feedback(Fibonacci.Feedback(sequence=[value]))

        state, number = pursue(goal, feed, lambda: handle.is_cancel_requested)
        {"SUCCEEDED": handle.succeed, "CANCELED": handle.canceled, "ABORTED": handle.abort}[state]()
        say(goal, state)
        return Fibonacci.Result(sequence=[number])

    _server = ActionServer(
        node,
        Fibonacci,
        action,
        run,
        goal_callback=accept,
        cancel_callback=lambda _: CancelResponse.ACCEPT,
        callback_group=ReentrantCallbackGroup(),
    )
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    print("ready", flush=True)
    executor.spin()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("version", type=int)
    parser.add_argument("action")
    parser.add_argument("--simple", action="store_true")
    arguments = parser.parse_args()
    if arguments.version == 1:
        ros1(arguments.action, is_simple=arguments.simple)
    else:
        ros2(arguments.action)


if __name__ == "__main__":
    main()
