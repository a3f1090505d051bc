"""A simulated system as a node of real ROS, compared with a plain node that echoes messages.

Peers, node and echo run at the same time on one machine: the figures depend on the machine; their ratio does not.
"""

from __future__ import annotations

import csv
import math
import re
import statistics
import subprocess
import tempfile
from bisect import bisect_left
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.ros.cpp_nodes import DEBIAN_PYTHON, ROS2, Ros, missing_ros, running_ros
from tests.ros.live_nodes import PACED_PEER, LiveNode, paced, specification
from tools.bench.tables import FAILED, MET, MISSED, NOT_MEASURED, Table, Tell, known_rows

TITLE = "A minute of messages at 100 Hz"
IMAGES_TITLE = "Images of 1 MB"
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
_IMAGE_BYTES = 1_000_000
_IMAGE_RATE, _IMAGE_SECONDS = 2, 20.0
_IMAGE_COLUMNS = ("node", "sent", "median, ms", "simulator, ms", "rest to echo", "bar", "result")
_IMAGES_NOTE = f"""
    The peer and the echo exchange sensor_msgs/Image with {_IMAGE_BYTES:,} bytes of data at {_IMAGE_RATE} Hz. The system
    forwards them at 64 bits; Verilator needs about 125,000 cycles for each. 'simulator' is the median of the time from
    a frame's entry into the simulator's pipe to the return of its response, by the node's trace. 'rest to echo' is
    what the node and ROS take beside it, as a multiple of the echo's median. To pass, all images must return unchanged
    and in order.
    """
_IMAGES_SPECIFICATION = """\
project: {{name: images, width: 64}}
blocks:
  - {{name: image_in, middleware: {ros}, mode: subscriber, message: sensor_msgs/Image,
     maxLength: 2000000, outgoing: [{{name: image_out}}]}}
  - {{name: image_out, middleware: {ros}, mode: publisher, message: sensor_msgs/Image}}
"""
TOPICS_TITLE = "Topics between eight accelerators"
_TOPICS_NAMES = ("within the FPGA", "by the host")
_TOPICS_RATE, _TOPICS_SECONDS = 20, 30.0
_TOPICS_COLUMNS = ("topics", "sent", "lost", "median, ms", "99 %, ms", "worst - median, ms", "quotients")
_TOPICS_NOTE = f"""
    A peer of rclpy publishes images of 32 by 8 pixels at {_TOPICS_RATE} Hz for {_TOPICS_SECONDS:g} s and receives
    commands of robot:sys:perception, which Verilator simulates at 32 bits. Times are measured from the publishing call
    to the callback. Within the FPGA, one message enters and two leave; by the host, each of the seven topics passes ROS
    ('deliver: host'). 'quotients' are those of the medians and of 'worst - median'.
    """
_WAY = ("/QuaternionToEuler_sub", "/QuaternionToEuler_pub")
_IMAGE_WAY, _ECHO_WAY = ("/image_in", "/image_out"), ("/echo_sub", "/echo_pub")
_TRACE = "trace.csv"
# Angles are right to this, in rad.
_TOLERANCE = 1e-9


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cell of every row, by table."""
    rows: list[tuple[str, ...]] = [(name,) for names in _NODES.values() for name in names]
    return {TITLE: rows, IMAGES_TITLE: rows, TOPICS_TITLE: [(name,) for name in _TOPICS_NAMES]}


def versions() -> list[str]:
    """The versions of both ROS."""
    packages = {"rospy": (DEBIAN_PYTHON, "rospy"), "rclpy": (str(ROS2 / "bin/python"), "ros-jazzy-rclpy")}
    found = []
    for name, (python, package) in packages.items():
        program = f"from importlib.metadata import version; print(version({package!r}))"
        done = subprocess.run([python, "-c", program], capture_output=True, text=True, check=True)
        found.append(f"{name} {done.stdout.strip()}")
    return found


def measure(tell: Tell, written: str = "", pattern: str = "") -> list[Table]:
    """Run both versions of ROS for each table whose title matches; the other rows are those of the written page."""
    measured = (
        (TITLE, _COLUMNS, _NOTE, _angles),
        (IMAGES_TITLE, _IMAGE_COLUMNS, _IMAGES_NOTE, _images),
    )
    tables = []
    for title, columns, note, rows_of in measured:
        known = known_rows(written, title, columns, keys=1)
        for version, names in _NODES.items():
            if re.search(pattern, title):
                known |= {row[:1]: row for row in _rows(version, len(columns), rows_of, tell)}
            for name in names:
                known.setdefault((name,), (name, *[""] * (len(columns) - 2), NOT_MEASURED))
        tables.append(Table(title, columns, tuple(known[key] for key in keys()[title]), note))
    known = known_rows(written, TOPICS_TITLE, _TOPICS_COLUMNS, keys=1)
    if re.search(pattern, TOPICS_TITLE):
        known |= {row[:1]: row for row in _topics(tell)}
    rows = tuple(known.get(key, (*key, *[""] * 5, NOT_MEASURED)) for key in keys()[TOPICS_TITLE])
    return [*tables, Table(TOPICS_TITLE, _TOPICS_COLUMNS, rows, _TOPICS_NOTE)]


def _topics(tell: Tell) -> list[tuple[str, ...]]:
    """The rows of topics within the FPGA and by the host."""
    if reason := missing_ros(2):
        tell(f"ROS 2: {reason}")
        return []
    found = {}
    with tempfile.TemporaryDirectory() as name, running_ros(2, Path(name)) as ros:
        for way in _TOPICS_NAMES:
            folder = Path(name) / way.replace(" ", "_")
            folder.mkdir()
            spec = specification("perception", 2, folder)
            if way == "by the host":
                text = spec.read_text(encoding="utf-8").replace("deliver: fabric", "deliver: host")
                text = text.replace("topic: command}", "topic: command, deliver: host}")
                # Images that leave need a buffer, and a limit where they enter.
                text = text.replace("topic: edges, deliver: host}", "topic: edges, deliver: host, buffer: 1024}")
                spec.write_text(
                    text.replace("topic: edges, out", "topic: edges, maxLength: 1024, out"), encoding="utf-8"
                )
            found[way] = _commands(ros, folder, spec)
    rows = []
    inner = found[_TOPICS_NAMES[0]]
    for way, result in found.items():
        middle, worst = _spread(result)
        quotients = (
            "" if way == _TOPICS_NAMES[0] else f"{middle / _spread(inner)[0]:.1f}, {worst / _spread(inner)[1]:.1f}"
        )
        late = sorted(result["seconds"])[int(0.99 * len(result["seconds"]))]
        times = [f"{1000 * seconds:.2f}" for seconds in (middle, late, worst)]
        rows.append((way, str(result["sent"]), str(result["sent"] - len(result["z"])), *times, quotients))
        tell("  ".join(rows[-1]))
    return rows


def _spread(result: dict[str, Any]) -> tuple[float, float]:
    """The median of the times, and the difference between it and the longest one, in seconds."""
    middle = statistics.median(result["seconds"])
    return middle, max(result["seconds"]) - middle


def _commands(ros: Ros, folder: Path, spec: Path) -> dict[str, Any]:
    """The commands that answer squares."""
    command = ["live", str(spec), "--tool", "verilator", "--build-root", str(folder / "simulators")]
    with LiveNode(ros, folder / "node.log", command) as node:
        node.wait_until_ready()
        (found,) = paced(ros, _TOPICS_RATE, _TOPICS_SECONDS, [("/image", "/command")], "squares")
        assert node.stop() == 0, node.said()
    return found


def _rows(
    version: int, cells: int, rows_of: Callable[[int], list[tuple[str, ...]]], tell: Tell
) -> list[tuple[str, ...]]:
    """The rows of a version of ROS."""
    reason = missing_ros(version)
    if not reason:
        try:
            rows = rows_of(version)
        except (AssertionError, subprocess.TimeoutExpired) as error:
            reason = str(error)
    if reason:
        tell(f"ROS {version}: {reason}")
        return [(name, *[""] * (cells - 2), FAILED) for name in _NODES[version]]
    for row in rows:
        tell("  ".join(row))
    return rows


def _angles(version: int) -> list[tuple[str, ...]]:
    with tempfile.TemporaryDirectory() as name, running_ros(version, Path(name)) as ros:
        folder = Path(name)
        found = _run(ros, folder, specification("quat2euler", version, folder), 1000, RATE, SECONDS)
    echo = statistics.median(found[1]["seconds"])
    expectations: tuple[Callable[[float], float], ...] = (float, _half_sine)
    ways = zip(_NODES[version], found, expectations, strict=True)
    return [_row(name, way, expected, echo) for name, way, expected in ways]


def _images(version: int) -> list[tuple[str, ...]]:
    with tempfile.TemporaryDirectory() as name, running_ros(version, Path(name)) as ros:
        folder = Path(name)
        spec = folder / "images.yaml"
        spec.write_text(_IMAGES_SPECIFICATION.format(ros="ROS" if version == 1 else "ROS2"), encoding="utf-8")
        live, echo = _run(ros, folder, spec, 10, _IMAGE_RATE, _IMAGE_SECONDS, "images")
        simulated = _seconds_of_simulator(folder / _TRACE)
    middle, plain = (statistics.median(way["seconds"]) for way in (live, echo))
    rest = (middle - simulated) / plain
    most = _MOST_ECHOES[_NODES[version][0]]
    is_right = all(way["z"] == [float(number) for number in range(way["sent"])] for way in (live, echo))
    result = MET if is_right and rest <= most else MISSED
    texts = [f"{1000 * seconds:.1f}" for seconds in (middle, plain, simulated)]
    return [
        (_NODES[version][0], str(live["sent"]), texts[0], texts[2], f"{rest:.1f}", f"{most:g}", result),
        (_NODES[version][1], str(echo["sent"]), texts[1], "", "", "", ""),
    ]


def _run(ros: Ros, folder: Path, spec: Path, depth: int, rate: int, seconds: float, *kind: str) -> list[dict[str, Any]]:
    """The responses of the node of a system and of the echo."""
    command = ["live", str(spec), "--tool", "verilator", "--queue", str(depth)]
    command += ["--build-root", str(folder / "simulators")]
    if kind:
        command += ["--trace", str(folder / _TRACE)]
    ways = [_IMAGE_WAY if kind else _WAY, _ECHO_WAY]
    with LiveNode(ros, folder / "node.log", command) as node:
        node.wait_until_ready()
        words = [ros.python, PACED_PEER, str(ros.version), "echo", *_ECHO_WAY, *kind]
        echo = subprocess.Popen(words, env=dict(ros.environment))
        try:
            found = paced(ros, rate, seconds, ways, *kind)
        finally:
            echo.kill()
            echo.wait()
        assert node.stop() == 0, node.said()
    return found


def _seconds_of_simulator(trace: Path) -> float:
    """The median time of a frame in the simulator and its pipe, by the trace of a node."""
    with trace.open(encoding="utf-8", newline="") as rows:
        ways = [int(row["came_ns"]) - int(row["sent_ns"]) for row in csv.DictReader(rows)]
    return statistics.median(ways) / 1e9


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
