"""The messages of a run over Foxglove's WebSocket protocol, for Foxglove, Lichtblick, PlotJuggler and other programs.

Source: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md. `foxglove-sdk` is unsuitable: without a secret
in the address, every page in the browser could read the messages, and it rejects clients of the protocol's first
version.
"""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from aiohttp import WSMsgType, web

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.joint import encoding_of, joint_text
from fusesoc_firm.studio.page_run import Run
from fusesoc_firm.system.derived.model import absolute_name
from fusesoc_firm.text.json_text import json_text

FOXGLOVE = "foxglove"
"""The last part of the address."""
PROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""The names of the protocol that clients may offer; both contain the messages used here."""
_SECONDS = 0.02
# The limits of messages sent at once, and of a client's subscriptions.
_MOST_NEW, _MOST_SUBSCRIPTIONS = 1000, 10_000
_MESSAGE_DATA = 1
_WARNING = 1


@dataclass
class _Client:
    """A connected program: its known channels by block, and its subscriptions by channel id."""

    socket: web.WebSocketResponse
    numbers: Iterator[int] = field(default_factory=count)
    channels: dict[str, int] = field(default_factory=dict)
    subscriptions: dict[int, list[int]] = field(default_factory=dict)


async def serve_foxglove(socket: web.WebSocketResponse, current: Callable[[], Run | None]) -> None:
    """Send the messages of the current run to a client until it leaves.

    For a slow client, messages are dropped and their number is reported; the run never waits.
    """
    client = _Client(socket)
    await socket.send_json({"op": "serverInfo", "name": "firm studio", "capabilities": [], "metadata": {}})
    sender = asyncio.create_task(_send(client, current))
    try:
        async for message in socket:
            if message.type != WSMsgType.TEXT:
                continue
            # `int` raises the first two, for NaN and for infinity.
            with suppress(ValueError, OverflowError, RecursionError, TypeError, KeyError):
                _take(client, json.loads(message.data))
    finally:
        sender.cancel()
        with suppress(asyncio.CancelledError, ConnectionError):
            await sender


def _take(client: _Client, wish: Mapping[str, Any]) -> None:
    """Record a client's subscriptions; other requests are for capabilities that are not offered."""
    if wish["op"] == "subscribe":
        for item in wish["subscriptions"]:
            number, channel = int(item["id"]), int(item["channelId"])
            if 0 <= number < 2**32 and sum(map(len, client.subscriptions.values())) < _MOST_SUBSCRIPTIONS:
                client.subscriptions.setdefault(channel, []).append(number)
    elif wish["op"] == "unsubscribe":
        gone = {int(number) for number in wish["subscriptionIds"]}
        for numbers in client.subscriptions.values():
            numbers[:] = [number for number in numbers if number not in gone]


async def _send(client: _Client, current: Callable[[], Run | None]) -> None:
    run: Run | None = None
    last, skipped = -1, 0
    while True:
        if current() is not run:
            run = current()
            last = -1
            if run:
                await _advertise(client, run)
        if run:
            news = run.watch.since(last, _MOST_NEW)
            last = news.last
            for seen in news.messages:
                for number in client.subscriptions.get(client.channels.get(seen.block, -1), ()):
                    head = struct.pack("<BIQ", _MESSAGE_DATA, number, run.watch.epoch_ns + seen.time_ns)
                    await client.socket.send_bytes(head + seen.payload)
            if news.skipped and client.subscriptions:
                skipped += news.skipped
                text = f"{skipped} messages came faster than they could be sent"
                await client.socket.send_json({"op": "status", "level": _WARNING, "message": text, "id": "skipped"})
        await asyncio.sleep(_SECONDS)


async def _advertise(client: _Client, run: Run) -> None:
    """Advertise the topics of a run instead of those of the previous run."""
    if client.channels:
        await client.socket.send_json({"op": "unadvertise", "channelIds": [*client.channels.values()]})
    client.subscriptions.clear()
    client.channels = {block: next(client.numbers) for block in run.topics}
    channels = [_channel(run, block, number) for block, number in client.channels.items()]
    await client.socket.send_json({"op": "advertise", "channels": channels}, dumps=json_text)


def _channel(run: Run, block: str, number: int) -> dict[str, object]:
    topic = run.topics[block]
    name, ros = topic.frame.message, topic.frame.ros
    definitions = run.libraries[ros].closure(name)
    is_first, text = ros is ROS1, joint_text(name, definitions)
    return {
        "id": number,
        "topic": absolute_name(topic.name),
        "encoding": "ros1" if is_first else "cdr",
        "schemaName": str(name) if is_first else definitions[name].full_name,
        "schemaEncoding": encoding_of(text, ros),
        "schema": text,
    }
