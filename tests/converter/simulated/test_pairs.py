"""Messages with arrays of messages use the channel: an element is read while the one before it is being sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from tests.converter.simulated.pairs import WiredPair, filled_message
from tests.converter.simulated.samples import ORACLES
from tests.hdl.ghdl import Library, core_files

FRAMES = 5


@pytest.mark.parametrize(
    ("name", "width", "least"),
    [
        ("tf2_msgs/TFMessage", 8, 95),
        ("tf2_msgs/TFMessage", 64, 72),
        ("geometry_msgs/PoseArray", 8, 92),
        ("diagnostic_msgs/DiagnosticArray", 8, 90),
    ],
)
def test_elements_overlap(tmp_path: Path, name: str, width: int, least: int) -> None:
    """Beats in percent of cycles, without stalls; the frames that come back are those that were sent."""
    oracle = ORACLES[ROS2]
    Library("firm", tmp_path).analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    pair = WiredPair(Library("pair", tmp_path), oracle.frame(name), width)
    pair.analyse()
    payload = oracle.serialise(name, filled_message(parse_name(name), oracle.closure(name)))
    payloads, cycles = pair.run(tmp_path, [payload] * FRAMES)
    assert payloads == [payload] * FRAMES
    assert 100 * FRAMES * pair.beats_of(payload) / cycles >= least
