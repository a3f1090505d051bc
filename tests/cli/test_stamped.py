"""One field of a stamped message, changed by two lines in the accelerator of a new project, in three simulators.

One line is in the accelerator and one in the model; Header, strings and arrays pass by the skeleton.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from fusesoc_firm.cli import main

# Each message, with two fields of the same type: the first one takes the other's value.
FIELDS = {
    "geometry_msgs/PoseStamped": ("pose.position.z", "pose.position.x"),
    "geometry_msgs/TwistStamped": ("twist.angular.z", "twist.linear.x"),
    "geometry_msgs/PointStamped": ("point.y", "point.x"),
    "geometry_msgs/TransformStamped": ("transform.rotation.w", "transform.translation.x"),
    "geometry_msgs/WrenchStamped": ("wrench.force.x", "wrench.torque.x"),
    "sensor_msgs/Imu": ("angular_velocity.z", "orientation.x"),
    "sensor_msgs/Range": ("max_range", "min_range"),
    "sensor_msgs/LaserScan": ("range_max", "range_min"),
    "sensor_msgs/NavSatFix": ("altitude", "latitude"),
    "sensor_msgs/Image": ("height", "width"),
}


@pytest.mark.one_in(30, 30)
@pytest.mark.parametrize("is_part", [False, True], ids=["whole", "part"])
@pytest.mark.parametrize("tool", ["ghdl", "icarus", "verilator"])
@pytest.mark.parametrize("message", FIELDS)
def test_one_field_is_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, message: str, tool: str, is_part: bool
) -> None:
    """The accelerator has all fields, or only the two; the others then pass by."""
    if not shutil.which({"icarus": "iverilog"}.get(tool, tool)):
        pytest.skip(f"no {tool}")
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("FUSESOC_CORES", "")
    changed, source = FIELDS[message]
    options = ["--include", changed, "--include", source] if is_part else ["--out", message]
    assert main(["init", "change", "--in", message, *options]) == 0
    # One line of the skeleton is changed, and one is added to the model.
    _edit("change/rtl/change.vhd", rf"out_{_port(changed)} <= .*", f"out_{_port(changed)} <= in_{_port(source)};")
    _edit("change/model.py", r"    return ", f"    answer{_place(changed)} = message{_place(source)}\n    return ")
    assert main(["sim", "change/change.yaml", "--quiet", "--tool", tool]) == 0


def _edit(path: str, pattern: str, text: str) -> None:
    file = Path(path)
    edited, count = re.subn(pattern, text, file.read_text(encoding="utf-8"))
    assert count == 1, path
    file.write_text(edited, encoding="utf-8")


def _port(field: str) -> str:
    return field.replace(".", "_")


def _place(field: str) -> str:
    return "".join(f'["{name}"]' for name in field.split("."))
