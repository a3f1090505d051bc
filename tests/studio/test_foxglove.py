"""Other programs read the messages of a run by Foxglove's protocol: a client of `@foxglove/ws-protocol` does."""

from __future__ import annotations

import asyncio
import json
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fusesoc_firm.node.engine.watch import Control
from fusesoc_firm.studio.page_run import Run
from tests.runs.replay.replays import load as load_replayed
from tests.runs.replay.replays import passing, payload, specification
from tests.studio.played import HOSTILE, IMAGE, modelled, write_system
from tests.studio.served import load, served
from tests.studio.test_live import begin, until
from tests.studio.test_page import ROOM
from tests.studio.test_server import ask

MODULES = ROOM / "page" / "node_modules"
CLIENT = Path(__file__).with_name("foxglove_client.cjs")
NODE = Path(sys.executable).with_name("node")


def read(address: str, protocol: str, count: int) -> dict[str, Any]:
    """The topics and the first messages that the client reads."""
    command = [NODE, CLIENT, MODULES, address, protocol, count]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.check
@pytest.mark.skipif(not (MODULES / "@foxglove").is_dir(), reason="make studio installs a client of Foxglove's protocol")
@pytest.mark.parametrize("protocol", ["foxglove.websocket.v1", "foxglove.sdk.v1"])
def test_a_client_reads_topics_types_and_messages(tmp_path: Path, protocol: str) -> None:
    with served(write_system(tmp_path), modelled()) as studio:
        begin(studio, rate=100, isEndless=True)
        before = time.time_ns()
        found = read(studio.foxglove, protocol, 60)
    types = {"point": "geometry_msgs/msg/Point", "text": "std_msgs/msg/String", "image": "sensor_msgs/msg/Image"}
    assert sorted(found["topics"], key=lambda item: str(item["topic"])) == [
        {"topic": f"/{name}{end}", "encoding": "cdr", "schemaName": types[name], "schemaEncoding": "ros2msg"}
        for name in ("image", "point", "text")
        for end in ("", "_out")
    ]
    expected = {"point": {"x": 1.5, "y": -2.0, "z": 1e300}, "text": {"data": HOSTILE}, "image": IMAGE}
    for message in found["messages"]:
        assert message["content"] == expected[message["topic"].strip("/").partition("_")[0]]
        # Within an hour of the clock, which a test cannot set.
        assert abs(int(message["timestamp"]) - before) < 3600 * 10**9
    assert len({message["topic"] for message in found["messages"]}) == 6


@pytest.mark.check
@pytest.mark.skipif(not (MODULES / "@foxglove").is_dir(), reason="make studio installs a client of Foxglove's protocol")
def test_messages_of_ros_1_have_their_own_form(tmp_path: Path) -> None:
    spec = specification(tmp_path, passing("p", "geometry_msgs/PointStamped"))
    run = Run(load_replayed(spec), spec, "replay", Control())
    run.watch.epoch_ns = 1_234_000_000_000
    body = (
        b"\7\0\0\0"
        + struct.pack("<II", 5, 6)
        + b"\2\0\0\0ab"
        + payload("ros1", "geometry_msgs/msg/Point", 1.0, 2.0, 3.0)
    )
    with served(spec) as studio:
        studio.live.take(run)
        is_read = threading.Event()

        def report() -> None:
            # A client gets what comes after its subscription.
            while not is_read.wait(0.01):
                run.watch.saw("p", body, 7)

        thread = threading.Thread(target=report)
        thread.start()
        try:
            found = read(studio.foxglove, "foxglove.websocket.v1", 3)
        finally:
            is_read.set()
            thread.join()
    assert found["topics"][0] == {
        "topic": "/p",
        "encoding": "ros1",
        "schemaName": "geometry_msgs/PointStamped",
        "schemaEncoding": "ros1msg",
    }
    assert [message["timestamp"] for message in found["messages"]] == ["1234000000007"] * 3
    content = found["messages"][0]["content"]
    assert content["point"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert content["header"] == {"seq": 7, "stamp": {"sec": 5, "nsec": 6}, "frame_id": "ab"}


def test_a_client_from_another_server_needs_the_secret(tmp_path: Path) -> None:
    """Foxglove's own page comes from elsewhere; other requests from there are refused."""
    spec = write_system(tmp_path)
    origin = "https://app.foxglove.dev"

    async def status(path: str, **headers: str) -> int:
        async with aiohttp.ClientSession() as session:
            try:
                async with session.ws_connect(path, headers=headers, protocols=("foxglove.websocket.v1",)) as socket:
                    assert (await socket.receive_json(timeout=60))["op"] == "serverInfo"
                    return 101
            except aiohttp.WSServerHandshakeError as error:
                return error.status

    with served(spec, modelled()) as studio:
        assert asyncio.run(status(studio.foxglove, Origin=origin)) == 101
        assert asyncio.run(status(studio.foxglove.replace(studio.secret, "x" * 32), Origin=origin)) == 403
        assert asyncio.run(status(studio.foxglove, Host="evil.example")) == 403
        assert asyncio.run(status(studio.foxglove.replace("foxglove", "watch"), Origin=origin)) == 403
        assert asyncio.run(status(studio.foxglove.replace("foxglove", "changes"), Origin=origin)) == 403
        assert ask(studio, "GET", "api/record?before=1&x=/api/foxglove", None, Origin=origin)[0] == 403


@pytest.mark.parametrize(
    "wish",
    [
        "",
        "[",
        "[" * 60_000,
        "1",
        "null",
        "{}",
        '{"op": "subscribe"}',
        '{"op": "subscribe", "subscriptions": [{"id": []}]}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 0}]}',
        '{"op": "unsubscribe", "subscriptionIds": 7}',
        '{"op": "subscribe", "subscriptions": [{"id": NaN, "channelId": 0}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": Infinity}]}',
        '{"op": "unsubscribe", "subscriptionIds": [1e999]}',
        '{"op": "subscribe", "subscriptions": [{"id": %s, "channelId": 0}]}' % ("9" * 5000),
    ],
    ids=range(14),
)
def test_wishes_that_are_none_end_nothing(tmp_path: Path, wish: str) -> None:
    spec = write_system(tmp_path)

    async def steps(address: str) -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(address) as socket:
            await socket.receive_json(timeout=60)
            channels = (await socket.receive_json(timeout=60))["channels"]
            await socket.send_str(wish)
            await socket.send_json({"op": "subscribe", "subscriptions": [{"id": 4, "channelId": channels[0]["id"]}]})
            assert (await socket.receive_bytes(timeout=60))[:5] == b"\1\4\0\0\0"

    with served(spec, modelled()) as studio:
        begin(studio, rate=100, isEndless=True)
        asyncio.run(steps(studio.foxglove))


def test_a_slow_client_misses_messages_and_is_told(tmp_path: Path) -> None:
    spec = write_system(tmp_path)
    run = Run(load(spec, spec.read_text(encoding="utf-8")), spec, "flood")

    async def steps(address: str) -> None:
        async with aiohttp.ClientSession() as session, session.ws_connect(address, max_msg_size=0) as socket:
            await socket.receive_json(timeout=60)
            channels = (await socket.receive_json(timeout=60))["channels"]
            number = next(item["id"] for item in channels if item["topic"] == "/text")
            await socket.send_json({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": number}]})
            sent = received = 0
            # The buffers of the connection may have room for all messages.
            while received == sent:
                # Nobody reads meanwhile.
                for _ in range(3000):
                    run.watch.saw("text", b"x" * 10_000, 0)
                    sent += 1
                message = await socket.receive(timeout=60)
                while message.type == aiohttp.WSMsgType.BINARY:
                    received += 1
                    if received == sent:
                        break
                    message = await socket.receive(timeout=60)
            told = json.loads(message.data)
            assert (told["op"], told["level"]) == ("status", 1)
            assert 0 < int(told["message"].split()[0]) < sent

    with served(spec, modelled()) as studio:
        studio.live.take(run)
        asyncio.run(steps(studio.foxglove))
        assert until(studio, lambda _: True)["last"] >= 2999
