"""Two messages of one function that arrive one after the other: nothing of the first one is lost meanwhile."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.compiler.compiled import CORES
from tests.system.simulated.systems import build, call

FUNCTIONS = """
def scaled(scan, factor):
    ranges = [r * factor.pose.position.x for r in scan.ranges]
    return {"header": scan.header, "ranges": ranges, "intensities": scan.intensities}


def chosen(scan, factor):
    parts = {"ranges": scan.ranges, "intensities": scan.intensities}
    return {"header": scan.header, "range_max": factor.pose.position.x, **parts}


def total(scan):
    found = scan.range_max
    for r in scan.ranges:
        found = found + r
    return {"data": found}
"""
SCAN = {"middleware": "ROS2", "message": "sensor_msgs/LaserScan"}
# A message that takes longer than the begin of a scan.
LONG = {"middleware": "ROS2", "message": "geometry_msgs/PoseWithCovariance"}
NUMBER = {"middleware": "ROS2", "message": "std_msgs/Float32"}


def accelerator(name: str, inputs: list[dict[str, str]], output: dict[str, str]) -> dict[str, object]:
    interface = {"input": inputs, "output": [output]}
    return {"name": name, "type": "Python", "sources": "functions.py", "numbers": "float32", "interface": interface}


@pytest.mark.parametrize("name", ["scaled", "chosen"])
@pytest.mark.parametrize("width", [8, pytest.param(64, marks=pytest.mark.check)])
def test_a_message_waits_for_the_other_one(tmp_path: Path, name: str, width: int) -> None:
    """The elements of the scan are there before the number, and its answer is read by a further function."""
    (tmp_path / "functions.py").write_text(FUNCTIONS, encoding="utf-8")
    types = [
        accelerator(name, [SCAN, LONG], {**SCAN, "length": "buffered"}),
        accelerator("total", [SCAN], NUMBER),
    ]
    blocks = [
        {"name": "scan", **SCAN, "mode": "subscriber", "queue": 2, "maxLength": 512, "outgoing": [{"name": "first"}]},
        {"name": "factor", **LONG, "mode": "subscriber", "outgoing": [{"name": "first"}]},
        {"name": "first", "type": name, "outgoing": [{"name": "second"}]},
        {"name": "second", "type": "total", "outgoing": [{"name": "sum"}]},
        {"name": "sum", **NUMBER, "mode": "publisher"},
    ]
    spec = {"project": {"name": "waiting", "width": width}, "accelerators": types, "blocks": blocks}
    (tmp_path / "waiting.yaml").write_text(yaml.safe_dump(spec, sort_keys=False), encoding="utf-8")
    stimuli: list[dict[str, object]] = []
    for count in (3, 0, 1, 20, 2):
        header = {"frame_id": "f" * (count % 3)}
        stimuli.append({"scan": {"header": header, "ranges": [0.5 * n for n in range(count)], "intensities": [1.0]}})
        stimuli.append({"factor": {"pose": {"position": {"x": 1.5 + count}}}})
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump(stimuli), encoding="utf-8")
    request = call(tmp_path / "waiting.yaml", tmp_path / "stimuli.yaml", None)
    system = build(request, tmp_path / "work", "acc/cordic/cordic", *CORES[1:])
    for seed, stalls in ((1, 0), (2, 40)):
        assert system.passes(SEED=seed, STALL_PERCENT=stalls)
