"""A simulated system as a node of real ROS, for a minute at 100 Hz, compared with a plain node that echoes messages.

Peers, node and echo run at the same time on one machine: the figures depend on the machine; their ratio does not.
"""

from __future__ import annotations

import math
import statistics
import subprocess
import tempfile
from bisect import bisect_left
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.bench.tables import FAILED, MET, MISSED, Table, Tell
from tests.ros.cpp_nodes import DEBIAN_PYTHON, ROS2, missing_ros, running_ros
from tests.ros.live_nodes import LiveNode, paced, specification

TITLE = "A minute of messages at 100 Hz"
RATE, SECONDS = 100, 60.0
_NODES = {1: ("firm live, ROS 1", "rospy's echo"), 2: ("firm live, ROS 2", "rclpy's echo")}
# The bar on the median, as a multiple of the echo's.
_MOST_ECHOES = {"firm live, ROS 1": 3.0, "firm live, ROS 2": 2.0}
_COLUMNS = ("node", "sent", "lost", "out of order", "median, ms", "99 %, ms", "to echo", "bar", "result")
_NOTE = f"""
    A peer of rospy or rclpy publishes geometry_msgs/Quaternion at {RATE} Hz for {SECONDS:g} s and receives
    geometry_msgs/Point. Times are measured from the publishing call to the callback. Verilator simulates quat2euler at
    8 bits. All queues have a capacity of 1,000 messages. The echo is a node of a few lines that publishes its response
    in its callback. The same peer sends alternately to both nodes. 'to echo' is the quotient of the medians. 'out of
    order' includes wrong values. To pass, no message may be lost or out of order, and 'to echo' may not exceed the
    third number.
    """
_WAYS = [("/QuaternionToEuler_sub", "/QuaternionToEuler_pub"), ("/echo_sub", "/echo_pub")]
# Angles are right to this, in rad.
_TOLERANCE = 1e-9


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cell of every row, by table."""
    return {TITLE: [(name,) for names in _NODES.values() for name in names]}


def versions() -> list[str]:
    """The versions of both ROS."""
    packages = {"rospy": (DEBIAN_PYTHON, "rospy"), "rclpy": (str(ROS2 / "bin/python"), "ros-jazzy-rclpy")}
    found = []
    for name, (python, package) in packages.items():
        program = f"from importlib.metadata import version; print(version({package!r}))"
        done = subprocess.run([python, "-c", program], capture_output=True, text=True, check=True)
        found.append(f"{name} {done.stdout.strip()}")
    return found


def measure(tell: Tell) -> list[Table]:
    """Run both versions of ROS, one after the other; `tell` hears of each."""
    rows = []
    for version, names in _NODES.items():
        reason = missing_ros(version)
        found: list[dict[str, Any]] = []
        if not reason:
            try:
                found = _run(version)
            except (AssertionError, subprocess.TimeoutExpired) as error:
                reason = str(error)
        if reason:
            tell(f"ROS {version}: {reason}")
            rows += [(name, *[""] * (len(_COLUMNS) - 2), FAILED) for name in names]
            continue
        echo = statistics.median(found[1]["seconds"])
        expectations: tuple[Callable[[float], float], ...] = (float, _half_sine)
        for name, way, expected in zip(names, found, expectations, strict=True):
            rows.append(_row(name, way, expected, echo))
            tell(f"{name}: {rows[-1][4]} ms")
    return [Table(TITLE, _COLUMNS, tuple(rows), _NOTE)]


def _run(version: int) -> list[dict[str, Any]]:
    """The responses of the node and of the echo."""
    with tempfile.TemporaryDirectory() as name, running_ros(version, Path(name)) as ros:
        folder = Path(name)
        spec = specification("quat2euler", version, folder)
        command = ["live", str(spec), "--tool", "verilator", "--queue", "1000"]
        command += ["--build-root", str(folder / "simulators")]
        with LiveNode(ros, folder / "node.log", command) as node:
            node.wait_until_ready()
            script = str(Path(__file__).parents[1] / "ros" / "paced_peer.py")
            echo = subprocess.Popen([ros.python, script, str(version), "echo", *_WAYS[1]], env=dict(ros.environment))
            try:
                found = paced(ros, RATE, SECONDS, _WAYS)
            finally:
                echo.kill()
                echo.wait()
            assert node.stop() == 0, node.said()
        return found


def _is_among(value: float, ascending: list[float]) -> bool:
    """Whether it is one of these, as far as the hardware is right."""
    place = bisect_left(ascending, value - _TOLERANCE)
    return place < len(ascending) and ascending[place] <= value + _TOLERANCE


def _half_sine(angle: float) -> float:
    """The z of a quaternion that turns by an angle about z."""
    return math.sin(angle / 2)


def _row(name: str, way: dict[str, Any], expected: Callable[[float], float], echo: float) -> tuple[str, ...]:
    lost = way["sent"] - len(way["z"])
    pairs = zip(way["z"], way["z"][1:], strict=False)
    sent = [expected(number / 1000 - 3) for number in range(way["sent"])]
    wrong = sum(later <= earlier for earlier, later in pairs) + sum(not _is_among(z, sent) for z in way["z"])
    middle = statistics.median(way["seconds"])
    most = _MOST_ECHOES.get(name)
    is_met = not (lost or wrong) and (most is None or middle <= most * echo)
    return (
        name,
        f"{way['sent']:,}",
        str(lost),
        str(wrong),
        f"{1000 * middle:.2f}",
        f"{1000 * sorted(way['seconds'])[int(0.99 * len(way['seconds']))]:.2f}",
        f"{middle / echo:.1f}" if most else "",
        f"0, 0, {most:g}" if most else "",
        "" if not most else MET if is_met else MISSED,
    )
