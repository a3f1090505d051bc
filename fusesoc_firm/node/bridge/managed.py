"""A node of ROS 2 with lifecycle states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def managed_node(name: str, change: Callable[[bool], None], end: Callable[[], None]) -> Any:
    """Return a node in the state `unconfigured`.

    `change` is called when the node becomes active or inactive, and `end` when it is shut down.
    """
    from rclpy._rclpy_pybind11 import RCLError
    from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

    class ManagedNode(LifecycleNode):  # type: ignore[misc]
        # rclpy ends the process if a client requests a transition that the state does not permit.
        def _LifecycleNodeMixin__change_state(self, transition: int) -> Any:  # noqa: N802
            try:
                return super()._LifecycleNodeMixin__change_state(transition)
            except RCLError:
                return TransitionCallbackReturn.FAILURE

        def on_activate(self, state: Any) -> Any:
            change(True)
            return super().on_activate(state)

        def on_deactivate(self, state: Any) -> Any:
            change(False)
            return super().on_deactivate(state)

        def on_shutdown(self, state: Any) -> Any:
            change(False)
            end()
            return TransitionCallbackReturn.SUCCESS

    return ManagedNode(name)


def waiting_group(is_active: Callable[[], bool]) -> Any:
    """Return a callback group for `transient_local` subscriptions, whose messages wait in ROS until the node is active.

    Their publishers do not repeat them.
    """
    from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

    class WaitingGroup(MutuallyExclusiveCallbackGroup):  # type: ignore[misc]
        def can_execute(self, entity: Any) -> bool:
            return is_active() and bool(super().can_execute(entity))

    return WaitingGroup()
