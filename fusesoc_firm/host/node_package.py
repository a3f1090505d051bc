"""The software node of a system: a package of its middleware that carries messages between topics and the hardware.

It is a table of the system's topics in C++, beside the headers that do the work (`host/cpp`), so that it is built where
nothing but the middleware is installed, on the robot's own computer as here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.diagnostics import fail
from fusesoc_firm.generation import GeneratedFile
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName, RosVersion
from fusesoc_firm.message.printer import closure_text
from fusesoc_firm.naming import identifier
from fusesoc_firm.render import render
from fusesoc_firm.system.derived import Converter, DerivedSystem, Topic
from fusesoc_firm.system.generator import LoadedSystem

HEADERS = Path(__file__).resolve().parent / "cpp"
# Messages in the queue of each subscriber, and in ROS' own.
_QUEUE_DEPTH = 10
_SOURCE_TEMPLATE = "node/node.cpp"
_PACKAGE_TEMPLATE = "node/package.xml"


@dataclass(frozen=True)
class _Dialect:
    """How the package of a version of ROS is written.

    `header` and `middleware` are the carrier of bytes in C++; `build_tool`, `library` and `cmake` build it. Only ROS 1
    tells who connects the text of a message's definition; only ROS 2 asks an installed package for a message's type.
    """

    header: str
    middleware: str
    signature: str
    build_tool: str
    library: str
    cmake: str
    has_definitions: bool


_DIALECTS = {
    RosVersion.ROS1: _Dialect("ros1.hpp", "Ros1", "MD5 sum", "catkin", "roscpp", "node/catkin.cmake", True),
    RosVersion.ROS2: _Dialect("ros2.hpp", "Ros2", "hash", "ament_cmake", "rcl", "node/ament.cmake", False),
}


def headers() -> list[Path]:
    """The headers of nodes."""
    return sorted(HEADERS.rglob("*.hpp"))


def spoken(system: DerivedSystem) -> set[RosVersion]:
    """The middlewares of a system's topics."""
    return {topic.frame.ros for topic in _topics(system)}


def cpp_package(loaded: LoadedSystem, ros: RosVersion | None = None) -> dict[str, str]:
    """The files of the node in C++, by path within the package.

    Raises `InputError` if the system's topics are not those of one version of ROS, or not of `ros` where it is given.
    """
    system = loaded.system
    dialect = _DIALECTS[_only(system, ros)]
    package = f"{system.name}_node"
    messages = {topic.frame.message: topic.frame.ros for topic in _topics(system)}
    build = {
        "package": package,
        "name": system.name,
        "build_tool": dialect.build_tool,
        "library": dialect.library,
        "message_packages": [] if dialect.has_definitions else sorted({message.package for message in messages}),
        "has_build_type": not dialect.has_definitions,
    }
    return {
        "package.xml": render(_PACKAGE_TEMPLATE, build),
        "CMakeLists.txt": render(dialect.cmake, {"package": package}),
        f"src/{package}.cpp": render(_SOURCE_TEMPLATE, _source(loaded, dialect)),
        **_headers(dialect),
    }


def generated_files(loaded: LoadedSystem) -> dict[str, GeneratedFile]:
    """The node as a part of the generated system; nothing for a system that no one node can serve."""
    if len(spoken(loaded.system)) != 1 or not spoken(loaded.system) <= {*_DIALECTS}:
        return {}
    return {f"node/{path}": GeneratedFile(text, "user") for path, text in cpp_package(loaded).items()}


def _only(system: DerivedSystem, ros: RosVersion | None) -> RosVersion:
    """The version of ROS that all topics have. Raises `InputError`."""
    found = sorted(spoken(system))
    if len(found) > 1:
        titles = " and ".join(item.title for item in found)
        fail(f"the topics of {system.name} are of {titles}, but a node speaks one of them")
    if found[0] not in _DIALECTS:
        fail(f"the topics of {system.name} are of {found[0].title}; nodes are for ROS 1 and ROS 2")
    if ros not in (None, found[0]):
        assert ros is not None
        hint = "the hardware is made for one wire format; 'middleware' in the specification says which"
        fail(f"the topics of {system.name} are of {found[0].title}, not of {ros.title}", hint=hint)
    return found[0]


def _headers(dialect: _Dialect) -> dict[str, str]:
    """All but those for other versions of ROS."""
    others = {item.header for item in _DIALECTS.values()} - {dialect.header}
    return {
        f"include/{path.relative_to(HEADERS)}": path.read_text(encoding="utf-8")
        for path in headers()
        if path.name not in others
    }


def _source(loaded: LoadedSystem, dialect: _Dialect) -> dict[str, Any]:
    """The table."""
    system = loaded.system
    return {
        "name": system.name,
        "ros": next(iter(spoken(system))).title,
        "header": dialect.header,
        "middleware": dialect.middleware,
        "signature": dialect.signature,
        "width": system.width,
        "queue_depth": _QUEUE_DEPTH,
        "subscriber_count": len(system.subscribers),
        "publisher_count": len(system.publishers),
        "definitions": [*_definitions(loaded)] if dialect.has_definitions else [],
        "subscribers": [_topic(item, loaded, dialect) for item in _in_hardware(system.subscribers)],
        "publishers": [_topic(item, loaded, dialect) for item in _in_hardware(system.publishers)],
    }


def _topics(system: DerivedSystem) -> list[Topic]:
    """All topics between the hardware and others."""
    return [*_in_hardware(system.subscribers), *_in_hardware(system.publishers)]


def _in_hardware(converters: tuple[Converter, ...]) -> list[Converter]:
    """Those whose messages have a topic: not those between the hardware and its own software."""
    return [item for item in converters if item.software is None]


def _definitions(loaded: LoadedSystem) -> Iterator[dict[str, Any]]:
    for message, ros in dict.fromkeys((item.frame.message, item.frame.ros) for item in _topics(loaded.system)):
        text = closure_text(message, loaded.libraries[ros].closure(message))
        yield {
            "message": str(message),
            "constant": _constant(message),
            "text": text,
            "delimiter": _delimiter(text),
        }


def _constant(message: MessageName) -> str:
    """The name of a definition's text: `kGeometryMsgsQuaternion`."""
    words = re.split("_+", identifier(message.package, message.name))
    return "k" + "".join(f"{word[0].upper()}{word[1:]}" for word in words)


def _delimiter(text: str) -> str:
    """What ends a raw string, and is not in `text`."""
    delimiter = "msg"
    while f'){delimiter}"' in text:
        delimiter += "_"
    return delimiter


def _topic(converter: Converter, loaded: LoadedSystem, dialect: _Dialect) -> Mapping[str, Any]:
    frame = converter.frame
    definitions = loaded.libraries[frame.ros].closure(frame.message)
    kind = definitions[frame.message].kind
    message = frame.message
    return {
        "id": converter.id,
        # A relative name moves with the node's namespace.
        "topic": converter.given_name or identifier(converter.block),
        "type": str(message) if dialect.has_definitions else f"{message.package}/{kind}/{message.name}",
        "signature": middleware_of(frame.ros).signature(message, definitions),
        "definition": {"constant": _constant(message)} if dialect.has_definitions else None,
    }
