"""The software node of a system in C++: a ROS package that carries messages between topics and the hardware.

The package consists of a table of the system's topics and the headers that do the work (`node/cpp`). It therefore
builds wherever ROS is installed, such as on the robot's computer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path
from typing import Any

from fusesoc_firm.core.request import GeneratedFile
from fusesoc_firm.frame.model import ID_BYTES
from fusesoc_firm.message.middleware import Middleware, middleware_of
from fusesoc_firm.node.interface.action_types import NodeAction
from fusesoc_firm.node.interface.description import NodeDescription, channel_names, describe
from fusesoc_firm.node.interface.diagnostics import diagnostics_topic
from fusesoc_firm.node.interface.services import NodeService
from fusesoc_firm.node.interface.topics import DEFAULT_DEPTH, NodeTopic
from fusesoc_firm.node.package.launch import LAUNCHERS, launch_file, package_name
from fusesoc_firm.node.software_process import software_ports
from fusesoc_firm.system.derived.model import BlockParameter
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.quoting import lines_of
from fusesoc_firm.text.render import render

HEADERS = Path(__file__).resolve().parents[1] / "cpp"
_SOURCE_TEMPLATE = "node/node.cpp"
_PACKAGE_TEMPLATE = "node/package.xml"


@dataclass(frozen=True)
class _Dialect:
    """The parts of a package that depend on the version of ROS.

    The first of `headers` and `middleware` name the C++ class that carries bytes; `build_tool`, `libraries` and `cmake`
    describe the package's build. Only ROS 2 looks up a message's type in an installed package.
    """

    headers: tuple[str, ...]
    middleware: str
    signature: str
    build_tool: str
    libraries: tuple[str, ...]
    cmake: str
    needs_messages: bool


_DIALECTS = {
    1: _Dialect(
        ("ros1.hpp", "ros1_services.hpp"),
        "Ros1",
        "MD5 sum",
        "catkin",
        ("roscpp",),
        "node/catkin.cmake",
        needs_messages=False,
    ),
    2: _Dialect(
        ("ros2.hpp", "rcl.hpp", "ros2_lifecycle.hpp", "ros2_parameters.hpp", "ros2_services.hpp"),
        "Ros2",
        "hash",
        "ament_cmake",
        ("rcl", "rcl_lifecycle", "lifecycle_msgs"),
        "node/ament.cmake",
        needs_messages=True,
    ),
}


def headers() -> list[Path]:
    """Return the paths of the C++ headers that all nodes use."""
    return sorted(HEADERS.rglob("*.hpp"))


def cpp_package(loaded: LoadedSystem, ros: Middleware | None = None) -> dict[str, str]:
    """Return the files of the C++ node by path within the package.

    Raise `InputError` if the system's topics do not share one version of ROS, or if `ros` is given and the topics do
    not belong to it.
    """
    description = describe(loaded)
    version = _only_version(description, ros)
    dialect = _DIALECTS[version]
    package = package_name(description)
    types = [topic.type for topic in (*description.taken_topics, *description.given_topics)]
    types += [service.type for service in description.all_services]
    packages = {"diagnostic_msgs"} | {name.partition("/")[0] for name in types}
    build = {
        "package": package,
        "name": description.name,
        "build_tool": dialect.build_tool,
        "libraries": [*dialect.libraries],
        "launcher": LAUNCHERS[version],
        "message_packages": sorted(packages - {*dialect.libraries}) if dialect.needs_messages else [],
        "has_build_type": dialect.needs_messages,
    }
    return {
        "package.xml": render(_PACKAGE_TEMPLATE, build),
        "CMakeLists.txt": render(dialect.cmake, {"package": package}),
        **launch_file(description, version, package),
        f"src/{package}.cpp": render(_SOURCE_TEMPLATE, _source(loaded, description, dialect)),
        **_headers(dialect),
    }


def generated_files(loaded: LoadedSystem) -> dict[str, GeneratedFile]:
    """Return the node's files as part of the generated system.

    The result is empty if no single C++ node can serve the system.
    """
    system = loaded.system
    topics = (*system.subscribers, *system.publishers, *system.software.subscribers, *system.software.publishers)
    spoken = {item.frame.ros.number for item in topics}
    if system.id_bytes > ID_BYTES or len(spoken) != 1 or not spoken <= {*_DIALECTS}:
        return {}
    return {f"node/{path}": GeneratedFile(text, "user") for path, text in cpp_package(loaded).items()}


def _only_version(description: NodeDescription, ros: Middleware | None) -> int:
    """Return the version of ROS that all topics share. May raise `InputError`."""
    found = description.versions
    if len(found) > 1:
        titles = " and ".join(middleware_of(version).title for version in found)
        fail(f"the topics of '{description.name}' use {titles}, but a C++ node supports only one ROS version")
    if ros is not None and ros.number != found[0]:
        title = middleware_of(found[0]).title
        hint = "the hardware supports one ROS version; select the version with 'middleware' in blocks and interfaces"
        fail(f"the topics of '{description.name}' use {title}, not {ros.title}", hint=hint)
    return found[0]


def _headers(dialect: _Dialect) -> dict[str, str]:
    """Return all headers except headers for other versions of ROS."""
    others = {name for item in _DIALECTS.values() if item is not dialect for name in item.headers}
    return {
        f"include/{path.relative_to(HEADERS)}": path.read_text(encoding="utf-8")
        for path in headers()
        if path.name not in others
    }


def _source(loaded: LoadedSystem, description: NodeDescription, dialect: _Dialect) -> dict[str, Any]:
    """Return the template configuration of the table."""
    return {
        "name": description.name,
        "ros": middleware_of(description.versions[0]).title,
        "header": dialect.headers[0],
        "middleware": dialect.middleware,
        "signature": dialect.signature,
        "width": description.width,
        "subscriber_count": len(loaded.system.subscribers),
        "publisher_count": len(loaded.system.publishers),
        "queue_depth": DEFAULT_DEPTH,
        "digest": description.digest,
        "has_status_registers": _word(description.has_status_registers),
        "definitions": [*_definitions(description)],
        "subscribers": [_row(topic) for topic in description.subscribers],
        "publishers": [_row(topic) for topic in description.publishers],
        "diagnostics": _row(diagnostics_topic(description.versions[0])),
        "channels": channel_names(description) if description.digest else [],
        "contents": [", ".join(map(str, description.contents[item.block])) for item in loaded.system.subscribers],
        "software": _software(loaded, description),
        "has_services": bool(description.services or description.actions or description.parameters),
        "has_actions": bool(description.actions or description.parameters),
        "parameters": [*map(_parameter, description.parameters)],
        "services": [*map(partial(_service, description), description.services)],
        "actions": [*map(partial(_action, description), description.actions)],
    }


def _software(loaded: LoadedSystem, description: NodeDescription) -> dict[str, Any] | None:
    """Return the ends of messages to and from blocks in software, or None if no such block runs on this host."""
    ports = software_ports(loaded.system)
    if not ports.inputs:
        # The services, actions and parameters of the table are after the software.
        has_more = description.services or description.actions or description.parameters
        return {"inputs": [], "outputs": []} if has_more else None
    topics = {topic.block: topic.name for topic in (*description.subscribers, *description.publishers)}
    leaving = {crossing.block: crossing.id for crossing in description.leaving}
    entering = {crossing.block: crossing.id for crossing in description.entering}
    return {
        "inputs": [_port(topic.block, leaving, topics) for topic in ports.inputs],
        "outputs": [_port(topic.block, entering, topics) for topic in ports.outputs],
    }


def _parameter(item: BlockParameter) -> dict[str, str]:
    """Return the row of a parameter, whose numbers are literals."""
    found = item.parameter
    numbers = (float(value) for value in (found.default, found.least, found.most))
    return {"name": item.name, "type": found.type.name, "numbers": ", ".join(map(repr, numbers))}


def _service(description: NodeDescription, item: NodeService) -> dict[str, Any]:
    """Return the row of a service; a failure is a list of bytes."""
    ids = _ids(description)
    return {
        "block": item.block,
        "is_server": _word(item.is_server),
        "request": ids[item.request],
        "response": ids[item.response],
        "name": item.name,
        "type": item.type,
        "signature": item.signature,
        "request_type": item.request_type,
        "response_type": item.response_type,
        "milliseconds": _milliseconds(item.time_limit),
        "failure": _bytes(item.failure),
    }


def _action(description: NodeDescription, item: NodeAction) -> dict[str, Any]:
    """Return the row of an action."""
    ids = _ids(description)
    return {
        "block": item.block,
        "is_server": _word(item.is_server),
        **{end: ids[getattr(item, end)] for end in ("goal", "cancel", "feedback", "result")},
        "name": item.name,
        "subscribers": [*map(_row, item.subscribers)],
        "publishers": [*map(_row, item.publishers)],
        "services": [*map(partial(_service, description), item.services)],
        "limit": _milliseconds(item.time_limit),
        "accept_limit": _milliseconds(item.accept_limit),
        "no_result": _bytes(item.no_result),
    }


def _ids(description: NodeDescription) -> dict[str, int]:
    return {item.block: item.id for item in (*description.entering, *description.leaving)}


def _milliseconds(seconds: float) -> int:
    return ceil(seconds * 1000)


def _bytes(payload: bytes) -> str:
    return ", ".join(map(str, payload))


def _port(block: str, converters: Mapping[str, int], topics: Mapping[str, str]) -> dict[str, str]:
    if block in converters:
        return {"topic": "", "converter": str(converters[block])}
    return {"topic": topics[block], "converter": "{}"}


def _definitions(description: NodeDescription) -> Iterator[dict[str, Any]]:
    """Yield the definition text of each message once; a ROS 2 message has no text."""
    topics = (*description.taken_topics, *description.given_topics, diagnostics_topic(description.versions[0]))
    texts = {topic.type: topic.definition for topic in topics}
    for name, text in texts.items():
        if text:
            lines = lines_of(text)
            yield {
                "message": name,
                "constant": _constant(name),
                "lines": [
                    {"text": line, "end": ";" if number == len(lines) else ""}
                    for number, line in enumerate(lines, start=1)
                ],
            }


def _constant(message: str) -> str:
    """Return the name of the constant with a definition's text, such as `kGeometryMsgsQuaternion`."""
    words = re.split("_+", identifier(message))
    return "k" + "".join(f"{word[0].upper()}{word[1:]}" for word in words)


def _row(topic: NodeTopic) -> dict[str, Any]:
    return {
        "id": "{}" if topic.id is None else str(topic.id),
        "topic": topic.name,
        "type": topic.type,
        "signature": topic.signature,
        "is_reliable": _word(topic.is_reliable),
        "is_transient_local": _word(topic.is_transient_local),
        "depth": topic.depth,
        "is_numbered": _word(topic.is_numbered),
        "definition": {"constant": _constant(topic.type)} if topic.definition else None,
    }


def _word(value: bool) -> str:
    return "true" if value else "false"
