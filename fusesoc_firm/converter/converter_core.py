"""The generator `firm`, which generates a core with message converters and the packages of the messages' constants."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.interfaces import INTERFACE_TEMPLATE, interface_configuration
from fusesoc_firm.converter.order import ENTITIES, Order, Selection, order_of_config, order_of_message
from fusesoc_firm.converter.pipeline import pipeline_of
from fusesoc_firm.converter.sources import Artifact, constants_sources, publisher_source, subscriber_source
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.text.render import render

VHDL = "vhdlSource-93"


def library_sources(request: Request) -> tuple[list[Path], Mapping[str, str], str | None]:
    """Return the sources of a request's messages as arguments for `MessageLibrary`."""
    distro = request.parameters.get("distro")
    return request.definition_folders(), os.environ, None if distro is None else str(distro)


def load(request: Request) -> LoadedRequest:
    """Load the order of a request; may raise `InputError`."""
    order = order_of_request(request)
    return LoadedRequest(
        request,
        order.files,
        lambda: converters_core(order),
        lambda: [(order.libraries[wanted.ros], wanted.definitions) for wanted in order.messages],
    )


def converters_core(order: Order) -> GeneratedCore:
    """Return the core of an order, with its files in compilation order; may raise `InputError`."""
    files = files_of(
        constants_sources([(wanted.message, wanted.definitions) for wanted in order.messages], order.prefix)
    )
    interfaces: dict[str, GeneratedFile] = {}
    for wanted in order.messages:
        frames = [wanted.frame]
        if "subscriber" in wanted.interfaces:
            files |= subscriber_files(frames, order.width, order.prefix, order.pipeline)
        if "publisher" in wanted.interfaces:
            files |= publisher_files(frames, order.width, order.prefix)
        for direction in ENTITIES:
            if direction in wanted.interfaces:
                converter = order.entity(wanted.frame, direction)
                vhdl = str(files[f"{converter}.vhd"].content)
                interfaces |= _interface_files(wanted.interfaces[direction], converter, vhdl, wanted.frame)
    return GeneratedCore(f"Converters of {order.title}", files | interfaces)


def files_of(artifacts: Iterable[Artifact]) -> dict[str, GeneratedFile]:
    """Return VHDL files, each once, by name."""
    return {item.path: GeneratedFile(item.text, VHDL) for item in artifacts}


def subscriber_files(
    frames: Iterable[Frame], width: int, prefix: str = "", pipeline: str | None = None
) -> dict[str, GeneratedFile]:
    """Return `<prefix>_axis_to_<pkg>_<type>.vhd` for each frame; for `pipeline`, see `pipeline_of`."""
    return files_of(
        subscriber_source(frame, width, subscriber_entity(frame, prefix=prefix), pipeline_of(frame, pipeline))
        for frame in frames
    )


def publisher_files(frames: Iterable[Frame], width: int, prefix: str = "") -> dict[str, GeneratedFile]:
    """Return `<prefix>_<pkg>_<type>_to_axis.vhd` for each frame."""
    return files_of(publisher_source(frame, width, publisher_entity(frame, prefix=prefix)) for frame in frames)


def order_of_request(request: Request) -> Order:
    """Return the order of a request, which names either a message or a configuration file."""
    config, ros, width, pipeline = (request.parameters.get(name) for name in ("config", "ros", "width", "pipeline"))
    chosen = None if pipeline is None else str(pipeline)
    if config is not None:
        order = order_of_config(request.files_root / str(config), libraries(*library_sources(request)))
        return replace(order, pipeline=chosen)
    assert isinstance(ros, int) and isinstance(width, int)
    library = MessageLibrary(middleware_of(ros), *library_sources(request))
    message, direction = str(request.parameters["message"]), str(request.parameters["direction"])
    selection = Selection(request.listed("include"), request.listed("exclude"))
    order = order_of_message(message, direction, width, library, selection)
    return replace(order, prefix=str(request.parameters.get("name") or ""), pipeline=chosen)


def _interface_files(names: Sequence[str], converter: str, vhdl: str, frame: Frame) -> dict[str, GeneratedFile]:
    """Return `<name>.vhd` for each additional name of a converter; `vhdl` is the converter's text."""
    message = f"{frame.message} ({frame.ros.title})"
    return {
        f"{name}.vhd": GeneratedFile(
            render(INTERFACE_TEMPLATE, interface_configuration(name, converter, vhdl, message)), VHDL
        )
        for name in names
        if name.lower() != converter
    }
