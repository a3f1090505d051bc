"""Messages out of a recorded bag: ROS 1, and ROS 2 as sqlite3 or MCAP.

A message goes to the subscriber whose name is that of its topic (`/` as `_`), else to the only one of its type. Topics
that fit no subscriber are left out. The payload is what was recorded: nothing is decoded and encoded again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag1 import ReaderError as Rosbag1Error
from rosbags.rosbag2 import ReaderError as Rosbag2Error
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.diagnostics import Diagnostics, InputError, fail
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived import Converter

Recorded = tuple[Converter, bytes, dict[str, Any]]


def read_bag(path: Path, subscribers: Sequence[Converter]) -> Iterator[Recorded]:
    """Subscriber, payload and decoded message of all messages, by time. Raises `InputError`."""
    store = get_typestore(Stores.LATEST)
    try:
        with AnyReader([path], default_typestore=store) as reader:
            ros = RosVersion.ROS2 if reader.is2 else RosVersion.ROS1
            routes = _routes(reader.connections, ros, subscribers, path)
            for connection, _, data in reader.messages(connections=list(routes)):
                subscriber, payload = routes[connection], bytes(data)
                yield subscriber, payload, _decoded(subscriber, payload, f"{path}, topic {connection.topic}")
    except (AnyReaderError, Rosbag1Error, Rosbag2Error) as error:
        fail(f"{path} is no bag that can be read: {error}", hint="stimuli are YAML (.yaml, .yml) or a bag")


def _decoded(subscriber: Converter, payload: bytes, where: str) -> dict[str, Any]:
    try:
        return decode(subscriber.frame, payload)
    except CodecError as error:
        fail(f"{where}: {error}")


def _routes(
    connections: Sequence[Connection], ros: RosVersion, subscribers: Sequence[Converter], path: Path
) -> dict[Connection, Converter]:
    """The subscriber of each connection that has one. Raises `InputError` with every topic that does not fit."""
    faults = Diagnostics()
    routes = {}
    for connection in connections:
        try:
            message = parse_name(connection.msgtype)
        except InputError:
            continue  # no message that a specification can name
        fitting = [item for item in subscribers if item.frame.message == message]
        speaking = [item for item in fitting if item.frame.ros == ros]
        if fitting and not speaking:
            block, spoken = fitting[0].block, int(fitting[0].frame.ros)
            faults.error(f"topic {connection.topic} of {path} is of ROS {int(ros)}, but '{block}' speaks ROS {spoken}")
            continue
        named = [item for item in speaking if item.block == connection.topic.strip("/").replace("/", "_")]
        chosen = named or speaking
        if len(chosen) > 1:
            names = ", ".join(item.block for item in chosen)
            hint = "name the topic like one of them"
            faults.error(f"topic {connection.topic} of {path} could go to {names}", hint=hint)
        elif chosen:
            routes[connection] = chosen[0]
    faults.raise_if_any()
    return routes
