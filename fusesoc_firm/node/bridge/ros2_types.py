"""The installed types of ROS 2."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from .ros import BridgeError

# The capacity of the queues of services, in messages. Each client of ROS 2 receives the responses to all clients, so
# the default of 10 is too few on a busy machine.
SERVICE_DEPTH = 1000
# The names of the parts of an action in rclpy.
_ACTION_PARTS = {
    "SendGoal": "SendGoalService",
    "GetResult": "GetResultService",
    "FeedbackMessage": "FeedbackMessage",
}


def message_class(name: str, word: str = "message") -> Any:
    """Return the class of an installed type, such as `std_msgs/msg/Empty`. May raise `BridgeError`."""
    import importlib

    package, kind, message = name.split("/")
    try:
        found = importlib.import_module(f"{package}.{kind}")
        if kind != "action":
            return getattr(found, message)
        action, _, part = message.rpartition("_")
        return getattr(getattr(found, action).Impl, _ACTION_PARTS[part])
    except (ImportError, AttributeError):
        raise BridgeError(
            f"the {word} '{name}' is not installed for {sys.executable}; 'firm ros install {package}' or"
            f" 'apt-get install ros-$ROS_DISTRO-{package.replace('_', '-')}' installs a released package;"
            " build and source a package of your own"
        ) from None


def service_class(service: dict[str, Any]) -> Any:
    """Return the class of a service, whose definition must be that of the hardware if ROS 2 provides its hash."""
    found = message_class(service["type"], "service")
    known = _installed_hash(service["type"])
    if known and service["signature"] and known != service["signature"]:
        raise BridgeError(
            "the installed definition of '{}' ({}) differs from the system's definition ({})".format(
                service["type"], known, service["signature"]
            )
        )
    return found


def _installed_hash(name: str) -> str:
    """Return the hash of an installed type, or nothing; older ROS 2 releases have none."""
    from ament_index_python.packages import (  # type: ignore[import-not-found, unused-ignore]
        get_package_share_directory,
    )

    package, kind, word = name.split("/")
    try:
        file = word.partition("_")[0] if kind == "action" else word
        text = Path(get_package_share_directory(package), kind, f"{file}.json").read_text(encoding="utf-8")
        hashes = json.loads(text)["type_hashes"]
    except (OSError, LookupError, ValueError):
        return ""
    return next((str(item["hash_string"]) for item in hashes if item["type_name"] == name), "")
