"""The generator `firm`: the converters of one message as a core."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from fusesoc_firm.converter.configuration import (
    PUBLISHER_TEMPLATE,
    SUBSCRIBER_TEMPLATE,
    publisher_configuration,
    publisher_entity,
    subscriber_configuration,
    subscriber_entity,
)
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.generation import GeneratedCore, GeneratedFile, Request
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName, RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.render import render

VHDL = "vhdlSource-93"


def library_sources(request: Request) -> tuple[list[Path], Mapping[str, str], str | None]:
    """Where a request's messages come from, as `MessageLibrary` takes it: folders, environment, distribution."""
    paths = request.parameters.get("paths") or []
    distro = request.parameters.get("distro")
    assert isinstance(paths, list)
    return [request.files_root / path for path in paths], os.environ, None if distro is None else str(distro)


def inputs(request: Request) -> list[Path]:
    """The files that hold the message and those below it; none for a definition of a type store."""
    library, name = _message(request)
    return library.files(library.closure(name))


def generate(request: Request) -> GeneratedCore:
    """The converters in the direction that the request names. Raises `InputError`."""
    library, name = _message(request)
    definitions = library.closure(name)
    frame = select(frame_of(name, definitions), request.listed("include"), request.listed("exclude"))
    direction, width = request.parameters["direction"], request.parameters["width"]
    assert isinstance(width, int)
    directions = ("subscriber", "publisher") if direction == "both" else (direction,)
    files: dict[str, GeneratedFile] = {}
    if "subscriber" in directions:
        files |= subscriber_files([frame], width)
    if "publisher" in directions:
        files |= publisher_files([frame], width)
    return GeneratedCore(f"Converters of {name} (ROS {int(library.ros)}, {signature(name, definitions)})", files)


def subscriber_files(frames: Iterable[Frame], width: int, suffix: str = "") -> dict[str, GeneratedFile]:
    """`axis_to_<pkg>_<type><suffix>.vhd` of each frame."""
    return {
        f"{subscriber_entity(frame, suffix)}.vhd": GeneratedFile(
            render(SUBSCRIBER_TEMPLATE, subscriber_configuration(frame, width, suffix)), VHDL
        )
        for frame in frames
    }


def publisher_files(frames: Iterable[Frame], width: int, suffix: str = "") -> dict[str, GeneratedFile]:
    """`<pkg>_<type>_to_axis<suffix>.vhd` of each frame."""
    return {
        f"{publisher_entity(frame, suffix)}.vhd": GeneratedFile(
            render(PUBLISHER_TEMPLATE, publisher_configuration(frame, width, suffix)), VHDL
        )
        for frame in frames
    }


def _message(request: Request) -> tuple[MessageLibrary, MessageName]:
    ros = request.parameters["ros"]
    assert isinstance(ros, int)
    return MessageLibrary(RosVersion(ros), *library_sources(request)), parse_name(str(request.parameters["message"]))
