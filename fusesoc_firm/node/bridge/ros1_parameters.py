"""The parameters of the hardware as private parameters of a node of ROS 1."""

from __future__ import annotations

import contextlib
import threading
from typing import Any

from .ros import Ros

# The interval in s at which the values are compared; rospy's cache follows the master.
_LOOK_SECONDS = 0.1


class Watch(threading.Thread):
    """A thread that lets `ros` set the values that change in the master.

    The master gets back the value that is in effect if a new one is refused.
    """

    def __init__(self, rospy: Any, parameters: list[dict[str, Any]], ros: Ros, ended: threading.Event) -> None:
        super().__init__(daemon=True)
        self._rospy = rospy
        self._ros = ros
        self._ended = ended
        self._values = {item["name"]: item["value"] for item in parameters}
        for name, value in self._values.items():
            rospy.set_param(_private(name), value)

    def run(self) -> None:
        """Follow the master until the node ends."""
        while not self._ended.wait(_LOOK_SECONDS):
            for name, value in self._values.items():
                # The master does not answer, or has no value; rospy has several types of errors.
                with contextlib.suppress(Exception):
                    found = self._rospy.get_param_cached(_private(name))
                    if found != value or type(found) is not type(value):
                        self._change(name, found)

    def _change(self, name: str, wanted: Any) -> None:
        reason = self._ros.set_parameters({name: wanted})
        if not reason:
            self._values[name] = wanted
            return
        self._ros.refused([_private(name)], reason)
        self._rospy.set_param(_private(name), self._values[name])


def _private(name: str) -> str:
    return f"~{name.replace('.', '/')}"
