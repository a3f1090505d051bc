"""The generator `firm`, which generates a core with message converters and the packages of the messages' constants."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.constants import (
    CONSTANTS_TEMPLATE,
    constants_configuration,
    constants_package,
)
from fusesoc_firm.converter.interfaces import INTERFACE_TEMPLATE, interface_configuration
from fusesoc_firm.converter.order import ENTITIES, Order, Selection, order_of_config, order_of_message
from fusesoc_firm.converter.pipeline import pipeline_of
from fusesoc_firm.converter.sources import ConverterSource, publisher_source, subscriber_source
from fusesoc_firm.core.request import GeneratedCore, GeneratedFile, LoadedRequest, Request
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import Definitions, middleware_of
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.render import Context, render

VHDL = "vhdlSource-93"


def library_sources(request: Request) -> tuple[list[Path], Mapping[str, str], str | None]:
    """Return the sources of a request's messages as arguments for `MessageLibrary`."""
    paths = request.parameters.get("paths") or []
    distro = request.parameters.get("distro")
    assert isinstance(paths, list)
    folders = [*(request.files_root / path for path in paths), *request.message_folders.of(request.listed("messages"))]
    return folders, os.environ, None if distro is None else str(distro)


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
    files = constants_files([(wanted.message, wanted.definitions) for wanted in order.messages], order.prefix)
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


def constants_files(messages: Sequence[tuple[MessageName, Definitions]], prefix: str = "") -> dict[str, GeneratedFile]:
    """Return the package files of the messages, each once, by name; the definitions include nested messages."""
    return {
        path: GeneratedFile(render(CONSTANTS_TEMPLATE, configuration), VHDL)
        for path, configuration in constants_configurations(messages, prefix)
    }


def constants_configurations(
    messages: Sequence[tuple[MessageName, Definitions]], prefix: str = ""
) -> Iterator[tuple[str, Context]]:
    """Yield the file name of each message's package, with the configuration to render it."""
    counts = Counter(name for name, _ in messages)
    for name, definitions in messages:
        package = constants_package(name, definitions[name].ros if counts[name] > 1 else None, prefix)
        yield f"{package}.vhd", constants_configuration(name, definitions, package)


def subscriber_files(
    frames: Iterable[Frame], width: int, prefix: str = "", pipeline: str | None = None
) -> dict[str, GeneratedFile]:
    """Return `<prefix>_axis_to_<pkg>_<type>.vhd` for each frame; for `pipeline`, see `pipeline_of`."""
    entities = {subscriber_entity(frame, prefix=prefix): frame for frame in frames}
    return {
        f"{entity}.vhd": _file(subscriber_source(frame, width, entity, pipeline_of(frame, pipeline)))
        for entity, frame in entities.items()
    }


def publisher_files(frames: Iterable[Frame], width: int, prefix: str = "") -> dict[str, GeneratedFile]:
    """Return `<prefix>_<pkg>_<type>_to_axis.vhd` for each frame."""
    entities = {publisher_entity(frame, prefix=prefix): frame for frame in frames}
    return {f"{entity}.vhd": _file(publisher_source(frame, width, entity)) for entity, frame in entities.items()}


def _file(source: ConverterSource) -> GeneratedFile:
    return GeneratedFile(render(source.template, source.configuration), VHDL)


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
