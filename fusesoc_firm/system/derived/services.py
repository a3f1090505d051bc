"""Services: a server or client becomes two converters, one for its requests and one for its responses.

The checks of keys and the converters are shared with actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.services import Interface
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
_FORM = "a server or client is a block with 'middleware', 'mode', and 'service' or 'action'"
_PLACES = "add places with 'paths' in the specification or core, or with --path"
# For each kind of interface, the key with its type and the suffix of its files.
_KEYS = {InterfaceKind.SERVICE: "service", InterfaceKind.ACTION: "action"}


def with_services(
    specification: Specification, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Specification:
    """Return the specification with two converters, `<name>_request` and `<name>_response`, for each server and client.

    Connections to a server lead to its response, those to a client to its request. Note the faults in keys of services.
    """
    blocks: list[Block] = []
    entries: dict[str, tuple[str, ...]] = {}
    for block in specification.blocks:
        if block.type is None and block.mode in SERVICE_MODES and block.action is None:
            request, response = _converters(block, _messages_of(block, libraries, faults))
            entries[block.name] = (response.name if block.mode == SERVER else request.name,)
            blocks += [request, response]
        else:
            if block.type is None and block.mode not in SERVICE_MODES:
                _check_no_service_keys(block, faults)
            blocks.append(block)
    return with_entries(specification, blocks, entries)


def services_of(blocks: Mapping[str, Block], parts: Parts, faults: Diagnostics) -> tuple[Service, ...]:
    """Return the services of a system with these blocks; note each service that accelerators in software use."""
    return tuple(map(_service, interface_blocks(blocks, parts, InterfaceKind.SERVICE, faults)))


def interface_blocks(
    blocks: Mapping[str, Block], parts: Parts, kind: InterfaceKind, faults: Diagnostics
) -> Sequence[Block]:
    """Return the blocks of services or actions; note each block that accelerators in software use."""
    found = {}
    in_software = {topic.block for topic in (*parts.software.subscribers, *parts.software.publishers)}
    for name, made in blocks.items():
        block = made.service_block
        # The faults of an unknown interface are already noted.
        if block is None or made.message is None or getattr(block, _KEYS[kind]) is None:
            continue
        if name in in_software and block.name not in found:
            message = f"'{block.name}' is connected to an accelerator in software"
            faults.error(message, block.name.source, f"{_KEYS[kind]}s connect only to accelerators in hardware")
        found[block.name] = block
    return [*found.values()]


def interface_of(
    block: Block, kind: InterfaceKind, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Interface | None:
    """Return the service or action of a block; if the block has a fault, note it and return None."""
    key = _KEYS[kind]
    missing = [name for name in ("middleware", key) if getattr(block, name) is None]
    if missing and block.is_sound:
        words = ", ".join(f"'{name}'" for name in missing)
        faults.error(f"block '{block.name}' needs {words}", block.name.source, _FORM)
    _check_keys(block, key, faults)
    written = getattr(block, key)
    if block.middleware is None or written is None:
        return None
    library = libraries[MIDDLEWARES[block.middleware]]
    try:
        found = library.interface(parse_name(written), kind)
    except InputError as error:
        faults.take(error, written.source)
        return None
    if found is None:
        known = [str(item.name) for item in library.interfaces() if item.kind is kind]
        hint = nearest(written, known) if known else f"no known folder contains a .{kind} file"
        faults.error(f"unknown {key} '{written}'", written.source, f"{hint}; {_PLACES}")
    return found


def ros_name_of(block: Block) -> str:
    """Return the name of the service or action of a block."""
    return str(block.topic or identifier(block.name, avoid=()))


def limit_of(written: Text | None, default: Fraction = _DEFAULT_LIMIT) -> float:
    """Return a legal limit in seconds."""
    return float((written and seconds_of(written)) or default)


def converter(block: Block, name: str, mode: str, message: MessageName | None, topic: str | None = None) -> Block:
    """Return a converter of a server or client; `message` is None if it is unknown.

    `topic` is the messages' topic in bags, if any. The converter copies the block's keys for `mode`. The block's
    `maxLength` limits the messages to the hardware.
    """
    keys: dict[str, Any] = {key: getattr(block, key) for key in keys_only_of(Block, mode)}
    if mode == SUBSCRIBER:
        keys |= {"max_length": block.max_length, "outgoing": block.outgoing}
    written = block.service or block.action
    return Block(
        name=Text(name, block.name.source) if block.name else block.name,
        middleware=block.middleware,
        mode=Text(mode),
        message=Text(str(message), written.source) if message and written else None,
        topic=Text(topic) if topic else None,
        service_block=block,
        source=block.source,
        places=block.places,
        is_sound=block.is_sound and message is not None,
        **keys,
    )


def with_entries(
    specification: Specification, blocks: Iterable[Block], entries: Mapping[str, tuple[str, ...]]
) -> Specification:
    """Return a specification with these blocks, in which connections to servers and clients lead to their `entries`."""
    if not entries:
        return specification
    return replace(specification, blocks=tuple(replace(item, outgoing=_led(item.outgoing, entries)) for item in blocks))


def _led(outgoing: Iterable[Outgoing], entries: Mapping[str, tuple[str, ...]]) -> tuple[Outgoing, ...]:
    def renamed() -> Iterator[Outgoing]:
        for item in outgoing:
            found = [Text(entry, item.name.source) for entry in entries.get(item.name, ())]
            yield from [replace(item, name=name) for name in found or [item.name]]

    return tuple(renamed())


def _service(block: Block) -> Service:
    assert block.middleware and block.mode and block.service
    return Service(
        str(block.name),
        ServiceEnd(str(block.mode)),
        parse_name(block.service),
        MIDDLEWARES[block.middleware],
        ros_name_of(block),
        *_names(block),
        limit_of(block.time_limit),
    )


def _names(block: Block) -> tuple[str, str]:
    return f"{block.name}_request", f"{block.name}_response"


def _messages_of(
    block: Block, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> tuple[MessageName | None, ...]:
    """Return the names of the request and the response; note the faults of the block."""
    if block.accept_limit is not None:
        message = f"'acceptLimit' is legal only for actions, but '{block.name}' belongs to a service"
        faults.error(message, block.accept_limit.source, "'timeLimit' limits the time of a call")
    found = interface_of(block, InterfaceKind.SERVICE, libraries, faults)
    return found.messages[:2] if found else (None, None)


def _converters(block: Block, messages: Iterable[MessageName | None]) -> tuple[Block, Block]:
    modes = (SUBSCRIBER, PUBLISHER) if block.mode == SERVER else (PUBLISHER, SUBSCRIBER)
    request, response = (converter(block, *item) for item in zip(_names(block), modes, messages, strict=True))
    return request, response


def _check_keys(block: Block, kind: str, faults: Diagnostics) -> None:
    for key in sorted(MESSAGE_KEYS):
        if getattr(block, key):
            message = f"'{key}' is legal only for subscribers and publishers, but '{block.name}' is a {block.mode}"
            faults.error(message, block.place(key), f"the {kind} determines the messages, which have no topic")
    if block.topic is not None:
        check_topic_name(block.topic, faults)
    for key, written in (("timeLimit", block.time_limit), ("acceptLimit", block.accept_limit)):
        limit = seconds_of(written) if written else _SHORTEST_LIMIT
        if written and (limit is None or not _SHORTEST_LIMIT <= limit <= _LONGEST_LIMIT):
            message = f"'{key}' cannot be '{written}'"
            faults.error(message, written.source, "legal here: 1 ms to 3600 s, such as 500 ms")


def _check_no_service_keys(block: Block, faults: Diagnostics) -> None:
    for key in sorted(SERVICE_KEYS):
        field_name, _ = keys_of(Block)[key]
        if getattr(block, field_name) is not None:
            message = f"'{key}' is legal only for servers and clients, but '{block.name}' is neither"
            faults.error(message, block.place(field_name), _FORM)
