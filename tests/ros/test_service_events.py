"""Calls that rclpy's service introspection records are replayed."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ros.cpp_nodes import missing_ros, ros2
from tests.runs.replay.test_calls import HASH, TOPIC, replay_calls, write_events

CALLS = 20


@pytest.mark.check
@pytest.mark.parametrize("end", ["server", "client", "both"])
def test_calls_that_rclpy_records_are_replayed(
    tmp_path: Path, end: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if reason := missing_ros(2):
        pytest.skip(reason)
    ros = ros2(tmp_path)
    command = [ros.python, str(Path(__file__).with_name("introspection_peer.py")), end, str(CALLS)]
    done = subprocess.run(command, env=dict(ros.environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    signature, events = json.loads(done.stdout)
    assert signature == HASH
    source = write_events(tmp_path / "calls", TOPIC, signature, map(base64.b64decode, events))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    replay_calls(tmp_path, source)
    said = json.loads(capsys.readouterr().out)
    assert [row["count"] for row in (*said["in"], *said["out"])] == [CALLS, CALLS]
    (counts,) = said["responses"]
    assert (counts["as_recorded"], counts["different"], counts["missing"]) == (CALLS, 0, 0)
