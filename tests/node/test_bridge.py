"""The socket between a node's engine and its process of ROS: what is closed is closed."""

from __future__ import annotations

import os
import socket
import sys
import threading
from pathlib import Path

import pytest

from fusesoc_firm.node.bridge.channel import MESSAGE, Channel
from fusesoc_firm.node.bridge.ros import Ends
from fusesoc_firm.node.engine.carrier import CarrierError, RosCarrier, RosOptions
from fusesoc_firm.node.interface.description import NodeDescription


def test_an_end_is_reported_once_with_the_name_of_its_node() -> None:
    """ROS 2 may find a topic of a node before the node; some ends never have a node."""
    ends = Ends()
    looks = [
        (b"1", "_NODE_NAME_UNKNOWN_"),
        (b"1", "peer"),
        (b"1", "peer"),
        (b"2", "peer"),
        (b"2", "_NODE_NAME_UNKNOWN_"),
    ]
    assert [ends.is_due(*look) for look in looks] == [False, True, False, True, False]
    assert [ends.is_due(b"3", "_NODE_NAME_UNKNOWN_") for _ in range(3)] == [False, True, False]


def test_a_channel_that_is_closed_holds_no_file() -> None:
    mine, its = socket.socketpair()
    number = mine.fileno()
    with its:
        channel = Channel(mine)
        channel.close()
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(number)
        assert its.recv(1) == b""
        assert channel.receive() is None
        channel.close()


def test_closing_ends_a_thread_that_receives() -> None:
    mine, its = socket.socketpair()
    with its:
        channel, received = Channel(mine), []
        Channel(its).send(MESSAGE, 3, b"data", 5)
        first = threading.Event()

        def receive() -> None:
            while parcel := channel.receive():
                received.append(parcel)
                first.set()

        thread = threading.Thread(target=receive)
        thread.start()
        assert first.wait(30)
        channel.close()
        thread.join(30)
        assert not thread.is_alive()
        assert received == [(MESSAGE, 3, 5, b"data")]


def test_a_python_of_ros_that_cannot_be_started(tmp_path: Path) -> None:
    nothing = str(tmp_path / "python")
    before = len([*Path("/proc/self/fd").iterdir()])
    with pytest.raises(CarrierError, match=f"{nothing}, the Python for ROS 1, cannot be started: No such file"):
        RosCarrier(1, NodeDescription("robot", 8, (), (), ()), RosOptions("robot", python=nothing))
    assert len([*Path("/proc/self/fd").iterdir()]) == before


def closed(*_: object, **__: object) -> None:
    """The other end has closed the socket already."""
    raise BrokenPipeError


@pytest.mark.parametrize("has_ended", [False, True], ids=["ends", "has ended"])
@pytest.mark.parametrize(("ros", "module"), [(1, "rospy"), (2, "rclpy")])
def test_a_python_without_ros(
    ros: int, module: str, has_ended: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = ""
    if has_ended:
        begin = "exit 1\n"
        monkeypatch.setattr(Channel, "send", closed)
    # Without its packages and PYTHONPATH, this Python cannot import the modules of ROS.
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\n{begin}exec "{sys.executable}" -E -S "$@"\n', encoding="utf-8")
    python.chmod(0o755)
    with pytest.raises(CarrierError, match=f"python cannot import {module}, which ROS {ros} installs; .* install"):
        RosCarrier(ros, NodeDescription("robot", 8, (), (), ()), RosOptions("robot", python=str(python)))


def test_a_middleware_that_is_not_installed_is_the_cause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # This Python imports rclpy unless a middleware is selected.
    python = tmp_path / "python3"
    python.write_text('#!/bin/sh\n[ "$2" = "import rclpy" ] && [ -z "$RMW_IMPLEMENTATION" ]\n', encoding="utf-8")
    python.chmod(0o755)
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
    message = r"RMW_IMPLEMENTATION=rmw_zenoh_cpp .* is not installed: .*ros-<distribution>-rmw-zenoh-cpp"
    with pytest.raises(CarrierError, match=message):
        RosCarrier(2, NodeDescription("robot", 8, (), (), ()), RosOptions("robot", python=str(python)))
    monkeypatch.setenv("RMW_IMPLEMENTATION", "")
    with pytest.raises(CarrierError) as raised:
        RosCarrier(2, NodeDescription("robot", 8, (), (), ()), RosOptions("robot", python=str(python)))
    assert "RMW_IMPLEMENTATION" not in str(raised.value)
