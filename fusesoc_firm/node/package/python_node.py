"""The software node of a system in Python: a ROS package with one file, a table and a call of fusesoc-firm's node."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.node.interface.action_types import NodeAction
from fusesoc_firm.node.interface.description import NodeDescription, describe
from fusesoc_firm.node.interface.services import NodeService
from fusesoc_firm.node.interface.topics import NodeTopic
from fusesoc_firm.node.package.launch import LAUNCHERS, launch_file, package_name
from fusesoc_firm.system.derived.model import BlockParameter
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.quoting import lines_of, python_string
from fusesoc_firm.text.render import render

_TEMPLATE = "node/node.py"
# For each version of ROS: the tool that builds the package, the library of the node, and the template of the build.
_BUILDS = {
    1: ("catkin", "rospy", "node/script_catkin.cmake"),
    2: ("ament_cmake", "rclpy", "node/script_ament.cmake"),
}


def python_node(
    loaded: LoadedSystem, ros: Middleware | None, specification: Path, folder: Path, paths: Sequence[Path] = ()
) -> dict[str, str]:
    """Return the files of the node's package by path within `folder`.

    If the topics use both versions of ROS, only the node itself is returned, since a package belongs to one version. If
    the system has software, the node finds the functions through the specification, and the messages in `paths`. All
    paths are relative to the folder. Raise `InputError` if the system has no topic of `ros`.
    """
    description = describe(loaded)
    if ros is not None and ros.number not in description.versions:
        fail(f"system '{description.name}' has no {ros.title} topics")
    has_software = any(block.type.accelerator.sources for block in loaded.system.software.blocks)
    name = f"{description.name}_node.py"
    call = "main(NODE)"
    if has_software:
        others = [os.path.relpath(path, folder) for path in paths]
        call = f"main(NODE, __file__, {python_string(os.path.relpath(specification, folder))}, {others!r})"
    configuration = {"file": name, "specification": shlex.quote(specification.name), "call": call}
    files = {name: render(_TEMPLATE, {**_table(description), **configuration})}
    versions = description.versions if ros is None else (ros.number,)
    return (
        {**files, **_package(description, versions[0], name, is_linked=has_software)} if len(versions) == 1 else files
    )


def _package(description: NodeDescription, ros: int, script: str, *, is_linked: bool) -> dict[str, str]:
    """Return the files that make the node a package; `is_linked` if the node must stay beside other files."""
    build_tool, library, cmake = _BUILDS[ros]
    package = package_name(description)
    types = [topic.type for topic in (*description.taken_topics, *description.given_topics) if topic.ros == ros]
    types += [service.type for service in description.all_services if service.ros == ros]
    messages = {"diagnostic_msgs", *(name.partition("/")[0] for name in types)} if ros == 2 else set()
    build = {
        "package": package,
        "name": description.name,
        "build_tool": build_tool,
        "libraries": [library],
        "launcher": LAUNCHERS[ros],
        "message_packages": sorted(messages),
        "has_build_type": ros == 2,
    }
    return {
        "package.xml": render("node/package.xml", build),
        "CMakeLists.txt": render(cmake, {"package": package, "script": script, "is_linked": is_linked}),
        **launch_file(description, ros, script),
    }


def _table(description: NodeDescription) -> dict[str, Any]:
    topics = (*description.taken_topics, *description.given_topics)
    definitions = {topic.type: topic.definition for topic in topics if topic.definition}
    return {
        "name": description.name,
        "width": description.width,
        "definitions": [
            {"message": name, "constant": _constant(name), "lines": lines_of(text)}
            for name, text in definitions.items()
        ],
        "subscribers": [*map(_topic, description.subscribers)],
        "publishers": [*map(_topic, description.publishers)],
        "sources": repr(description.sources),
        "entering": [{"block": str(item.block), "id": item.id} for item in description.entering],
        "leaving": [{"block": str(item.block), "id": item.id} for item in description.leaving],
        "contents": [{"block": block, "numbers": repr(content)} for block, content in description.contents.items()],
        "longest_payload": repr(description.longest_payload),
        "clock_hz": repr(description.clock_hz),
        "digest": description.digest,
        "has_status_registers": description.has_status_registers,
        "parameters": [*map(_parameter, description.parameters)],
        "services": [*map(_service, description.services)],
        "has_services": bool(description.all_services),
        "actions": [*map(_action, description.actions)],
    }


def _parameter(item: BlockParameter) -> dict[str, str]:
    found = item.parameter
    values = (found.type.name, found.default, found.least, found.most)
    return {"block": item.block, "name": found.name, "values": ", ".join(map(repr, values))}


def _topic(topic: NodeTopic) -> dict[str, Any]:
    return {
        "block": str(topic.block),
        "topic": topic.name,
        "type": topic.type,
        "ros": topic.ros,
        "signature": topic.signature,
        "id": repr(topic.id),
        "is_reliable": repr(topic.is_reliable),
        "is_transient_local": repr(topic.is_transient_local),
        "depth": repr(topic.depth),
        "is_numbered": repr(topic.is_numbered),
        "definition": {"constant": _constant(topic.type)} if topic.definition else None,
    }


def _service(service: NodeService) -> dict[str, Any]:
    values = ("ros", "is_server", "time_limit", "failure")
    return {name: repr(value) if name in values else str(value) for name, value in asdict(service).items()}


def _action(action: NodeAction) -> dict[str, Any]:
    return {
        **{name: str(getattr(action, name)) for name in ("block", "name", "goal", "cancel", "feedback", "result")},
        **{
            name: repr(getattr(action, name))
            for name in ("ros", "is_server", "time_limit", "accept_limit", "no_result")
        },
        "subscribers": [*map(_topic, action.subscribers)],
        "publishers": [*map(_topic, action.publishers)],
        "services": [*map(_service, action.services)],
    }


def _constant(message: str) -> str:
    """Return the name of the constant with a definition's text, such as `GEOMETRY_MSGS_QUATERNION`."""
    return identifier(*message.split("/")).upper()
