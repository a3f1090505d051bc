"""The register stages of a system's subscribers: the key `pipeline`, or what the clock and the messages need."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.system.system_core import artifacts, load_system
from tests.system.systems import LIBRARIES, converter, specification

JOINTS, ODOMETRY = "sensor_msgs/JointState", "nav_msgs/Odometry"
NONE, BORDERS, FULL = (False, False), (True, False), (True, True)


@pytest.mark.parametrize(
    ("project", "message", "stages"),
    [
        ("", JOINTS, NONE),
        (", clock: 100 MHz", JOINTS, NONE),
        (", clock: 101 MHz", JOINTS, BORDERS),
        (", clock: 200 MHz, pipeline: none", JOINTS, NONE),
        (", pipeline: borders", JOINTS, BORDERS),
        (", pipeline: full", JOINTS, FULL),
        ("", ODOMETRY, FULL),
        (", clock: 200 MHz", ODOMETRY, FULL),
        (", pipeline: none", ODOMETRY, NONE),
    ],
)
def test_stages(tmp_path: Path, project: str, message: str, stages: tuple[bool, bool]) -> None:
    """A slice at the streams, and fields that are stored a cycle late."""
    blocks = converter("heard", "subscriber", message, "said") + converter("said", "publisher", message)
    path = tmp_path / "system.yaml"
    path.write_text(specification(blocks, project=f"{{name: robot, width: 64{project}}}"), encoding="utf-8")
    texts = {item.path: item.text for item in artifacts(load_system(path, LIBRARIES))}
    (subscriber,) = (text for name, text in texts.items() if name.startswith("axis_to_"))
    assert ("u_out :" in subscriber, "stored_bytes_r" in subscriber) == stages
