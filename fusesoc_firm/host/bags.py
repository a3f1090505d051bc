"""Messages out of a recorded bag: ROS 1, and ROS 2 as sqlite3 or MCAP.

A message goes to the subscriber whose name is that of its topic (`/` as `_`), else to the only one of its type. Topics
that fit no subscriber are left out. The payload is what was recorded: nothing is decoded and encoded again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.diagnostics import Diagnostics, InputError, fail
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived import Topic

Recorded = tuple[Topic, bytes, dict[str, Any]]
Stream = tuple[str, str]
"""Topic and type."""


def read_bag(path: Path, subscribers: Sequence[Topic]) -> Iterator[Recorded]:
    """Subscriber, payload and decoded message of all messages, by time. Raises `InputError`."""
    ros, connections, messages = _read(path)
    routes = _routes(connections, ros, subscribers, path)
    for connection, payload in messages:
        if subscriber := routes.get(_stream(connection)):
            try:
                message = decode(subscriber.frame, payload)
            except CodecError as error:
                fail(f"{path}, topic {connection.topic}: {error}")
            yield subscriber, payload, message


def _read(path: Path) -> tuple[RosVersion, list[Connection], list[tuple[Connection, bytes]]]:
    """All that a bag holds, messages by time."""
    store = get_typestore(Stores.LATEST)
    try:
        with AnyReader([path], default_typestore=store) as reader:
            messages = [(connection, bytes(payload)) for connection, _, payload in reader.messages()]
            # A closed reader forgets its connections.
            return RosVersion.ROS2 if reader.is2 else RosVersion.ROS1, list(reader.connections), messages
    except Exception as error:  # noqa: BLE001 - a damaged file makes rosbags and what it uses raise anything
        hint = "stimuli are YAML (.yaml, .yml), a bag of ROS 1 (.bag) or the folder of a bag of ROS 2"
        fail(f"{path} is not a bag that can be read: {error}", hint=hint)


def _stream(connection: Connection) -> Stream:
    # rosbags' connections of ROS 2 cannot be keys themselves.
    return connection.topic, connection.msgtype


def _routes(
    connections: Sequence[Connection], ros: RosVersion, subscribers: Sequence[Topic], path: Path
) -> dict[Stream, Topic]:
    """The subscriber of each topic that has one. Raises `InputError` with every topic that does not fit."""
    faults = Diagnostics()
    routes: dict[Stream, Topic] = {}
    for connection in connections:
        try:
            message = parse_name(connection.msgtype)
        except InputError:
            continue  # no message that a specification can name
        fitting = [item for item in subscribers if item.frame.message == message]
        speaking = [item for item in fitting if item.frame.ros == ros]
        named = [item for item in speaking if item.block == connection.topic.strip("/").replace("/", "_")]
        chosen = named or speaking
        if fitting and not speaking:
            block, spoken = fitting[0].block, fitting[0].frame.ros.title
            faults.error(f"topic {connection.topic} of {path} is of {ros.title}, but '{block}' speaks {spoken}")
        elif len(chosen) > 1:
            names = ", ".join(item.block for item in chosen)
            faults.error(
                f"topic {connection.topic} of {path} could go to {names}", hint="name the topic like one of them"
            )
        elif chosen:
            routes[_stream(connection)] = chosen[0]
    faults.raise_if_any()
    return routes
