"""Messages to send to a system, out of a YAML file or a recorded bag.

A YAML file is a list; each item names the subscriber's block and gives its message:

    - QuaternionToEuler_sub: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}

Of a bag, every message goes to the subscriber whose name is that of its topic, else to the only one of its type.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.diagnostics import Diagnostics, InputError, fail, nearest
from fusesoc_firm.frame.codec import CodecError, decode, encode
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived import Converter
from fusesoc_firm.yaml_text import YamlText, is_null, read_yaml

_YAML_SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class Stimulus:
    """A message for a subscriber: its payload as the middleware serialises it, and the same decoded."""

    subscriber: Converter
    payload: bytes
    message: dict[str, Any]


def read_stimuli(path: Path, subscribers: Sequence[Converter]) -> list[Stimulus]:
    """All messages of a file or bag, in its order. Raises `InputError`; a file without a message is one, too."""
    if not path.exists():
        fail(f"there are no stimuli at {path}")
    stimuli = _from_yaml(path, subscribers) if path.suffix in _YAML_SUFFIXES else list(_from_bag(path, subscribers))
    if not stimuli:
        names = ", ".join(subscriber.block for subscriber in subscribers)
        fail(f"{path} holds no message for {names}")
    return stimuli


def _from_yaml(path: Path, subscribers: Sequence[Converter]) -> list[Stimulus]:
    text = read_yaml(path)
    if text.root is None or is_null(text.root):
        return []
    if not isinstance(text.root, yaml.SequenceNode):
        fail("stimuli are a list, '- <subscriber>: {<field>: <value>, ...}' an item", text.source(text.root))
    faults = Diagnostics()
    values = yaml.safe_load("\n".join(text.lines))
    known = {subscriber.block: subscriber for subscriber in subscribers}
    stimuli = [_item(text, node, value, known, faults) for node, value in zip(text.root.value, values, strict=True)]
    faults.raise_if_any()
    return [stimulus for stimulus in stimuli if stimulus is not None]


def _item(
    text: YamlText, node: yaml.Node, value: Any, known: dict[str, Converter], faults: Diagnostics
) -> Stimulus | None:
    """One item of the list; None, with its fault noted, if it is no message."""
    if not isinstance(value, dict) or len(value) != 1:
        faults.error("a stimulus is one block with its message: '- <subscriber>: {...}'", text.source(node))
        return None
    (block, message), (key_node, value_node) = next(iter(value.items())), node.value[0]
    subscriber = known.get(block)
    if subscriber is None:
        faults.error(f"no subscriber is called '{block}'", text.source(key_node), nearest(str(block), known))
        return None
    message = {} if message is None else message
    if not isinstance(message, dict):
        faults.error(f"a {subscriber.frame.message} is a mapping of its fields", text.source(value_node))
        return None
    try:
        payload = encode(subscriber.frame, message)
    except CodecError as error:
        faults.error(str(error), text.source(value_node))
        return None
    return Stimulus(subscriber, payload, decode(subscriber.frame, payload))


def _from_bag(path: Path, subscribers: Sequence[Converter]) -> Iterator[Stimulus]:
    """The messages of a bag as they were serialised: nothing is decoded and encoded again on the way to the frame."""
    store = get_typestore(Stores.LATEST)
    try:
        with AnyReader([path], default_typestore=store) as reader:
            ros = RosVersion.ROS2 if reader.is2 else RosVersion.ROS1
            routes = _routes(reader.connections, ros, subscribers, path)
            for connection, _, payload in reader.messages(connections=list(routes)):
                subscriber = routes[connection]
                try:
                    message = decode(subscriber.frame, bytes(payload))
                except CodecError as error:
                    fail(f"{path}, topic {connection.topic}: {error}")
                yield Stimulus(subscriber, bytes(payload), message)
    except AnyReaderError as error:
        fail(f"{path} is neither YAML ({', '.join(_YAML_SUFFIXES)}) nor a bag: {error}")


def _routes(
    connections: Sequence[Connection], ros: RosVersion, subscribers: Sequence[Converter], path: Path
) -> dict[Connection, Converter]:
    """The subscriber of each connection that has one. Raises `InputError` where two could be meant."""
    routes = {}
    for connection in connections:
        try:
            message = parse_name(connection.msgtype)
        except InputError:
            continue
        fitting = [item for item in subscribers if item.frame.message == message]
        speaking = [item for item in fitting if item.frame.ros == ros]
        if fitting and not speaking:
            fail(f"{path} is a bag of ROS {int(ros)}, but '{fitting[0].block}' speaks ROS {int(fitting[0].frame.ros)}")
        named = [item for item in speaking if item.block == connection.topic.strip("/").replace("/", "_")]
        chosen = named or speaking
        if len(chosen) > 1:
            names = ", ".join(item.block for item in chosen)
            fail(f"topic {connection.topic} of {path} could go to {names}; name it like one of them")
        if chosen:
            routes[connection] = chosen[0]
    return routes
