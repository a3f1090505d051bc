"""How much of the channel messages with arrays use: a subscriber is wired to a publisher, and neither side stalls."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from statistics import median

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from tests.converter.simulated.pairs import ELEMENTS, INNER_ELEMENTS, TEXT, WiredPair, filled_message
from tests.frame.oracle import Oracle
from tests.hdl.ghdl import Library, core_files
from tools.bench.tables import FAILED, MET, MISSED, Table, Tell

TITLE = "Cycles for each beat of messages with arrays of messages or strings"
MESSAGES = tuple(
    """tf2_msgs/TFMessage diagnostic_msgs/DiagnosticArray trajectory_msgs/JointTrajectory
    trajectory_msgs/MultiDOFJointTrajectory sensor_msgs/PointCloud2 sensor_msgs/PointCloud sensor_msgs/JointState
    sensor_msgs/MultiDOFJointState sensor_msgs/MultiEchoLaserScan sensor_msgs/JoyFeedbackArray
    visualization_msgs/MarkerArray geometry_msgs/PoseArray geometry_msgs/PolygonStamped nav_msgs/Path
    nav_msgs/GridCells rcl_interfaces/ParameterEvent rcl_interfaces/ListParametersResult shape_msgs/Mesh
    std_msgs/Float64MultiArray action_msgs/GoalStatusArray""".split()
)
WIDTHS = (8, 32, 64, 512)
# The least shares of the channel in percent, by the width: of each message, and the median of all.
BARS = {8: (80, 95), 64: (60, 85)}
# Equal frames in a row.
FRAMES = 5
_MEDIAN = "median"

_BAR = ", ".join(f"{width} bits: >= {least} %" for width, (least, _) in BARS.items())
_MEDIAN_BAR = ", ".join(f"{width} bits: >= {least} %" for width, (_, least) in BARS.items())
_COLUMNS = ("message", *(f"{width} bits" for width in WIDTHS), "bar", "result")
_NOTE = f"""
    The cells are cycles for each beat, and beats in percent of cycles. The cycles are counted in GHDL's simulation from
    the first beat at the subscriber to the last one at the publisher, for {FRAMES} frames in a row. Every array of the
    message has {ELEMENTS} elements, every array in an element {INNER_ELEMENTS}, and every string {len(TEXT)} bytes,
    unless a bound is smaller. The frames that come back are compared with those that were sent.
    """


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(name,) for name in (*MESSAGES, _MEDIAN)]}


def measure(tell: Tell) -> list[Table]:
    """Simulate all messages at all widths; `tell` hears of each."""
    oracle = Oracle(ROS2)
    shares: dict[int, list[float]] = {width: [] for width in WIDTHS}
    lines = []
    for name in MESSAGES:
        found = {width: share_of(oracle, name, width) for width in WIDTHS}
        for width, share in found.items():
            shares[width].append(share)
        lines.append(_cells(name, found, _BAR, {width: least for width, (least, _) in BARS.items()}))
        tell(" ".join(lines[-1]))
    middle = {width: median(found) for width, found in shares.items()}
    lines.append(_cells(_MEDIAN, middle, _MEDIAN_BAR, {width: least for width, (_, least) in BARS.items()}))
    return [Table(TITLE, _COLUMNS, tuple(lines), _NOTE)]


def share_of(oracle: Oracle, name: str, width: int) -> float:
    """Beats in percent of cycles; 0 if another frame came back."""
    payload = oracle.serialise(name, filled_message(parse_name(name), oracle.closure(name)))
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory)
        Library("firm", folder).analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
        pair = WiredPair(Library("pair", folder), oracle.frame(name), width)
        pair.analyse()
        payloads, cycles = pair.run(folder, [payload] * FRAMES)
    return 100 * FRAMES * pair.beats_of(payload) / cycles if payloads == [payload] * FRAMES else 0


def _cells(label: str, shares: Mapping[int, float], bar: str, least: Mapping[int, int]) -> tuple[str, ...]:
    if not all(shares.values()):
        return (label, *("" for _ in shares), bar, FAILED)
    result = MET if all(shares[width] >= wanted for width, wanted in least.items()) else MISSED
    return (label, *(f"{100 / share:.2f}, {share:.0f} %" for share in shares.values()), bar, result)
