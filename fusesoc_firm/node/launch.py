"""The launch file of a node's package, for roslaunch (ROS 1) or ros2 launch."""

from __future__ import annotations

from fusesoc_firm.node.description import NodeDescription
from fusesoc_firm.text.render import render

# The program that reads launch files, as a dependency of the package.
LAUNCHERS = {1: "roslaunch", 2: "launch_ros"}
# For each version of ROS, the template and the ending of the file.
_FORMS = {1: ("node/ros1_launch.xml", "launch"), 2: ("node/ros2_launch.py", "launch.py")}


def launch_file(description: NodeDescription, ros: int, executable: str) -> dict[str, str]:
    """Return the launch file by its path in the package; the package has the node's topics of one version of ROS."""
    template, ending = _FORMS[ros]
    used = [topic for topic in (*description.subscribers, *description.publishers) if topic.ros == ros]
    # Several blocks may use a topic; the first one names it.
    topics = {topic.name: f"{topic.block}_topic" for topic in reversed(used)}
    context = {
        "name": description.name,
        "package": package_name(description),
        "executable": executable,
        "topics": [{"argument": argument, "topic": name} for name, argument in reversed(topics.items())],
    }
    return {f"launch/{description.name}.{ending}": render(template, context)}


def package_name(description: NodeDescription) -> str:
    """Return the name of the node's package."""
    return f"{description.name}_node"
