"""Services: a server or client becomes two converters, one for its requests and one for its responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived.model import Service, ServiceEnd
from fusesoc_firm.system.derived.partition import Parts
from fusesoc_firm.system.derived.timing import seconds_of
from fusesoc_firm.system.derived.topics import check_topic_name
from fusesoc_firm.system.written.specification import (
    MESSAGE_KEYS,
    PUBLISHER,
    SERVER,
    SERVICE_KEYS,
    SERVICE_MODES,
    SUBSCRIBER,
    Block,
    Outgoing,
    Specification,
)
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, nearest
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_sections import keys_of, keys_only_of
from fusesoc_firm.text.yaml_text import Text

_DEFAULT_LIMIT = Fraction(5)
_SHORTEST_LIMIT, _LONGEST_LIMIT = Fraction(1, 1000), Fraction(3600)
_REQUIRED = ("middleware", "service")
_FORM = "a server or client is a block with 'middleware', 'mode' and 'service'"


def with_services(
    specification: Specification, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Specification:
    """Return the specification with two converters, `<name>_request` and `<name>_response`, for each server and client.

    Connections to a server lead to its response, those to a client to its request. Note the faults in keys of services.
    """
    blocks: list[Block] = []
    entries: dict[str, str] = {}
    for block in specification.blocks:
        if block.type is None and block.mode in SERVICE_MODES:
            request, response = _converters(block, _type_of(block, libraries, faults), faults)
            entries[block.name] = response.name if block.mode == SERVER else request.name
            blocks += [request, response]
        else:
            if block.type is None:
                _check_no_service_keys(block, faults)
            blocks.append(block)
    if not entries:
        return specification
    return replace(specification, blocks=tuple(replace(item, outgoing=_led(item.outgoing, entries)) for item in blocks))


def services_of(blocks: Mapping[str, Block], parts: Parts, faults: Diagnostics) -> tuple[Service, ...]:
    """Return the services of a system with these blocks; note each service that accelerators in software use."""
    found = {}
    in_software = {topic.block for topic in (*parts.software.subscribers, *parts.software.publishers)}
    for name, converter in blocks.items():
        block = converter.service_block
        # The faults of an unknown service are already noted.
        if block is None or converter.message is None:
            continue
        if name in in_software:
            message = f"'{block.name}' is connected to an accelerator in software"
            faults.error(message, block.name.source, "services connect only to accelerators in hardware")
        found[block.name] = _service(block)
    return tuple(found.values())


def _service(block: Block) -> Service:
    assert block.middleware and block.mode and block.service
    limit = (block.time_limit and seconds_of(block.time_limit)) or _DEFAULT_LIMIT
    return Service(
        str(block.name),
        ServiceEnd(str(block.mode)),
        parse_name(block.service),
        MIDDLEWARES[block.middleware],
        str(block.topic or identifier(block.name, avoid=())),
        *_names(block),
        float(limit),
    )


def _names(block: Block) -> tuple[str, str]:
    return f"{block.name}_request", f"{block.name}_response"


def _type_of(
    block: Block, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> tuple[MessageName, ...]:
    """Return the names of the messages of a block's service; if the block has a fault, note it and return nothing."""
    missing = [key for key in _REQUIRED if getattr(block, key) is None]
    if missing and block.is_sound:
        words = ", ".join(f"'{key}'" for key in missing)
        faults.error(f"block '{block.name}' needs {words}", block.name.source, _FORM)
    _check_keys(block, faults)
    if block.middleware is None or block.service is None:
        return ()
    library = libraries[MIDDLEWARES[block.middleware]]
    try:
        found = library.interface(parse_name(block.service), InterfaceKind.SERVICE)
    except InputError as error:
        faults.take(error, block.service.source)
        return ()
    if found is None:
        known = [str(item.name) for item in library.interfaces() if item.kind is InterfaceKind.SERVICE]
        hint = nearest(block.service, known) if known else "no known folder contains a .srv file"
        faults.error(f"unknown service '{block.service}'", block.service.source, f"{hint}; {_PLACES}")
        return ()
    return found.messages[:2]


_PLACES = "add places with 'paths' in the specification or core, or with --path"


def _check_keys(block: Block, faults: Diagnostics) -> None:
    for key in sorted(MESSAGE_KEYS):
        if getattr(block, key):
            message = f"'{key}' is legal only for subscribers and publishers, but '{block.name}' is a {block.mode}"
            faults.error(message, block.place(key), "the service determines the messages, which have no topic")
    if block.topic is not None:
        check_topic_name(block.topic, faults)
    if block.time_limit is not None:
        limit = seconds_of(block.time_limit)
        if limit is None or not _SHORTEST_LIMIT <= limit <= _LONGEST_LIMIT:
            message = f"'timeLimit' cannot be '{block.time_limit}'"
            faults.error(message, block.time_limit.source, "legal here: 1 ms to 3600 s, such as 500 ms")


def _check_no_service_keys(block: Block, faults: Diagnostics) -> None:
    for key in sorted(SERVICE_KEYS):
        field_name, _ = keys_of(Block)[key]
        if getattr(block, field_name) is not None:
            message = f"'{key}' is legal only for servers and clients, but '{block.name}' is neither"
            faults.error(message, block.place(field_name), _FORM)


def _converters(block: Block, messages: tuple[MessageName, ...], faults: Diagnostics) -> tuple[Block, Block]:
    """Return the converters of the requests and the responses; without `messages`, their messages are unknown."""
    names = [Text(name, block.name.source) if block.name else block.name for name in _names(block)]
    modes = (SUBSCRIBER, PUBLISHER) if block.mode == SERVER else (PUBLISHER, SUBSCRIBER)
    request, response = (
        Block(
            name=name,
            middleware=block.middleware,
            mode=Text(mode),
            message=Text(str(messages[number]), block.service.source) if messages and block.service else None,
            outgoing=block.outgoing if mode == SUBSCRIBER else (),
            service_block=block,
            source=block.source,
            places=block.places,
            is_sound=block.is_sound and bool(messages),
            **_keys_of(block, mode),
        )
        for number, (name, mode) in enumerate(zip(names, modes, strict=True))
    )
    return request, response


def _keys_of(block: Block, mode: str) -> dict[str, Any]:
    """Return the keys that concern one of the converters; `maxLength` limits the messages to the hardware."""
    keys = {key: getattr(block, key) for key in keys_only_of(Block, mode)}
    return {**keys, "max_length": block.max_length} if mode == SUBSCRIBER else keys


def _led(outgoing: Iterable[Outgoing], entries: Mapping[str, str]) -> tuple[Outgoing, ...]:
    """Return connections in which a converter takes the place of a server or client."""

    def renamed() -> Iterator[Outgoing]:
        for item in outgoing:
            entry = entries.get(item.name)
            yield replace(item, name=Text(entry, item.name.source)) if entry else item

    return tuple(renamed())
