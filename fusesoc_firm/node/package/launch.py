"""The launch file of a node's package, for roslaunch (ROS 1) or ros2 launch."""

from __future__ import annotations

from collections.abc import Iterator

from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.text.render import render

# The program that reads launch files, as a dependency of the package.
LAUNCHERS = {1: "roslaunch", 2: "launch_ros"}
# For each version of ROS, the template and the ending of the file.
_FORMS = {1: ("node/ros1_launch.xml", "launch"), 2: ("node/ros2_launch.py", "launch.py")}


def launch_file(description: NodeDescription, ros: int, executable: str) -> dict[str, str]:
    """Return the launch file by its path in the package; the package has the node's topics of one version of ROS."""
    template, ending = _FORMS[ros]
    # Several blocks may use a topic; the first one names it.
    names = {name: (argument, endings) for argument, name, endings in reversed([*_names(description, ros)])}
    context = {
        "name": description.name,
        "package": package_name(description),
        "executable": executable,
        "names": [
            {"argument": argument, "default": name, "endings": [{"ending": ending} for ending in endings]}
            for name, (argument, endings) in reversed(names.items())
        ],
    }
    return {f"launch/{description.name}.{ending}": render(template, context)}


def _names(description: NodeDescription, ros: int) -> Iterator[tuple[str, str, list[str]]]:
    """Yield each launch argument that changes a name, the name, and the suffixes of the ROS names below it."""
    for topic in (*description.subscribers, *description.publishers):
        if topic.ros == ros:
            yield f"{topic.block}_topic", topic.name, [""]
    for service in description.services:
        if service.ros == ros:
            yield f"{service.block}_service", service.name, [""]
    for action in description.actions:
        if action.ros == ros:
            topics = (*action.subscribers, *action.publishers)
            ends = [*(topic.name for topic in topics), *(service.name for service in action.services)]
            yield f"{action.block}_action", action.name, [end.removeprefix(action.name) for end in ends]


def package_name(description: NodeDescription) -> str:
    """Return the name of the node's package."""
    return f"{description.name}_node"
