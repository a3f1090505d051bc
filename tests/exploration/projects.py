"""Projects with an accelerator in Python, for the tests of this folder."""

from __future__ import annotations

from contextlib import chdir
from pathlib import Path

from fusesoc_firm.cli import main
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem

PID = """
class Pid:
    def __init__(self):
        self.integral = 0.0
        self.before = 0.0

    def __call__(self, message):
        error = message.x - message.y
        self.integral = min(max(self.integral + 0.01 * error, -10.0), 10.0)
        slope = error - self.before
        self.before = error
        return {"data": 1.5 * error + self.integral + 0.2 * slope}


pid = Pid()
"""
FILTER = """
class Filter:
    def __init__(self):
        self.past = [0.0] * 8

    def __call__(self, message):
        self.past = [message.range, *self.past[:7]]
        total = 0.0
        for weight, value in zip((0.01, 0.05, 0.12, 0.32, 0.32, 0.12, 0.05, 0.01), self.past):
            total = total + weight * value
        return {"data": total}


filter_range = Filter()
"""
NEAREST = """
import math


def nearest(scan):
    best = math.inf
    for r in scan.ranges:
        if scan.range_min <= r <= scan.range_max and r < best:
            best = r
    return {"data": best}
"""
_MESSAGES = {
    "pid": ("geometry_msgs/Point", "std_msgs/Float64", PID),
    "filter_range": ("sensor_msgs/Range", "std_msgs/Float32", FILTER),
    "nearest": ("sensor_msgs/LaserScan", "std_msgs/Float32", NEAREST),
}


def project(folder: Path, name: str, text: str = "") -> Path:
    """Write a project with one of the accelerators above, or with another function; return its specification."""
    taken, sent, source = _MESSAGES[name]
    path = folder / name
    with chdir(folder):
        assert main(["init", name, "--in", taken, "--out", sent, "--language", "python"]) == 0
    (path / "python" / f"{name}.py").write_text(text or source, encoding="utf-8")
    return path / f"{name}.yaml"


def loaded(spec: Path) -> tuple[LoadedSystem, AcceleratorType]:
    system = load_beside(spec)
    return system, system.system.accelerator_types[0].own
