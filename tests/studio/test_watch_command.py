"""`firm replay --watch`: the page of a replay, from its begin until Ctrl-C."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from urllib.request import Request, urlopen

import aiohttp
import pytest

from tests.runs.replay.replays import passing, points, read, specification, write


@pytest.mark.check
def test_a_replay_is_watched(tmp_path: Path) -> None:
    spec = specification(tmp_path, passing("p", "geometry_msgs/Point"))
    bag = write(tmp_path / "in.bag", "ros1", points("ros1", 5))
    command = [sys.executable, "-m", "fusesoc_firm.cli", "replay", spec, "--in", bag, "--out", tmp_path / "out.bag"]
    command += ["--watch", "--no-browser", "--build-root", tmp_path / "build"]
    with subprocess.Popen(
        [*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as process:
        assert process.stderr
        printed = ""
        while not (address := re.search(r"http://127\.0\.0\.1:\d+/\S+/\n", printed)):
            line = process.stderr.readline()
            assert line, printed
            printed += line
        base = address[0].strip()

        def ask(path: str) -> object:
            with urlopen(f"{base}api/{path}", timeout=60) as answer:
                return json.load(answer)

        async def until_ended() -> None:
            async with aiohttp.ClientSession() as session, session.ws_connect(f"{base}api/watch") as socket:
                state = ""
                while state != "ended":
                    report = await socket.receive_json(timeout=300)
                    state = report["run"]["state"] if "run" in report else state
                    await socket.send_str("1")

        body = Request(f"{base}api/control", b'{"do": "resume"}', {"Content-Type": "application/json"})
        with urlopen(body, timeout=60) as answer:
            assert answer.status == 200
        asyncio.run(until_ended())
        rows = ask("record?before=99")
        assert isinstance(rows, dict)
        assert [(row[0], row[1], row[2]) for row in rows["messages"]] == [
            (2 * number + place, block, number / 100)
            for number in range(5)
            for place, block in enumerate(["p", "p_out"])
        ]
        assert len({row[5] for row in rows["messages"][3::2]}) == 1
        timeline = ask("timeline")
        assert isinstance(timeline, dict)
        assert [block for block, _, _ in timeline["grants"]] == ["p_out"] * 5
        # Each response is one burst.
        for number, (_, *cycles) in enumerate(timeline["grants"]):
            wave = ask(f"wave?number={2 * number + 1}")
            assert isinstance(wave, dict)
            assert wave["cycles"] == cycles
        process.send_signal(signal.SIGINT)
        printed = process.communicate(timeout=60)[0]
        assert process.returncode == 0
    assert "5 in, 5 out" in printed
    assert len(read(tmp_path / "out.bag")) == 5
