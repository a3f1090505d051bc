"""The register stages of a system's subscribers: the key `pipeline`, or what the clock and the messages need."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.system.system_core import artifacts, load_system
from tests.system.systems import LIBRARIES, converter, specification

SCAN, JOINTS, ODOMETRY = "sensor_msgs/LaserScan", "sensor_msgs/JointState", "nav_msgs/Odometry"
NONE, BORDERS, FULL = (False, False), (True, False), (True, True)


@pytest.mark.parametrize(
    ("project", "message", "stages"),
    [
        ("width: 64", SCAN, NONE),
        ("width: 64, clock: 100 MHz", SCAN, NONE),
        ("width: 64, clock: 101 MHz", SCAN, FULL),
        ("width: 8, clock: 100 MHz", SCAN, NONE),
        ("width: 8, clock: 101 MHz", SCAN, BORDERS),
        ("width: 16, clock: 101 MHz", SCAN, FULL),
        ("width: 64, clock: 200 MHz, pipeline: none", SCAN, NONE),
        ("width: 64, pipeline: borders", SCAN, BORDERS),
        ("width: 64, pipeline: full", SCAN, FULL),
        # The queue of a message with an array of strings is such a register.
        ("width: 64, pipeline: borders", JOINTS, NONE),
        ("width: 64, pipeline: full", JOINTS, (False, True)),
        ("width: 64", ODOMETRY, FULL),
        ("width: 8, clock: 200 MHz", ODOMETRY, FULL),
        ("width: 64, pipeline: none", ODOMETRY, NONE),
    ],
)
def test_stages(tmp_path: Path, project: str, message: str, stages: tuple[bool, bool]) -> None:
    """A slice at the streams, and fields that are stored a cycle late."""
    blocks = converter("heard", "subscriber", message, "said") + converter("said", "publisher", message)
    path = tmp_path / "system.yaml"
    path.write_text(specification(blocks, project=f"{{name: robot, {project}}}"), encoding="utf-8")
    texts = {item.path: item.text for item in artifacts(load_system(path, LIBRARIES))}
    (subscriber,) = (text for name, text in texts.items() if name.startswith("axis_to_"))
    assert ("u_out :" in subscriber, "stored_bytes_r" in subscriber) == stages
