"""The applications in specs/, built as their cores build them, also for the other version of ROS."""

from __future__ import annotations

import shutil
from pathlib import Path

import yaml

from fusesoc_firm.core.request import Plain
from tests.hdl.ghdl import REPOSITORY
from tests.system.simulated.systems import GeneratedSystem, build, call

SPECS = REPOSITORY / "specs"


def for_ros2(name: str, folder: Path) -> Path:
    """A copy of an application in which every `middleware: ROS` is `middleware: ROS2`, and no other word differs."""
    copy = folder / name
    shutil.copytree(SPECS / name, copy)
    specification = copy / f"{name}.yaml"
    text = specification.read_text(encoding="utf-8")
    assert "middleware: ROS\n" in text
    specification.write_text(text.replace("middleware: ROS\n", "middleware: ROS2\n"), encoding="utf-8")
    return copy


def simulation(application: Path, folder: Path, *cores: str, **changes: Plain) -> GeneratedSystem:
    """An application with the parameters of its core's simulation, but for `changes`; it depends on `cores`."""
    core = yaml.safe_load((application / f"{application.name}.core").read_text(encoding="utf-8"))
    parameters = {**core["generate"]["simulation"]["parameters"], **changes}
    spec, stimuli, model = (application / parameters.pop(name) for name in ("spec", "stimuli", "model"))
    return build(call(spec, stimuli, model, **parameters), folder, *cores)
