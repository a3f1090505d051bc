"""A system that the page simulates with a model of its hardware: what a subscriber takes, its publisher sends."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import yaml

from fusesoc_firm.node.transport.built_simulator import BuiltSimulator
from fusesoc_firm.text.diagnostics import fail
from tests.node import model_simulator

HOSTILE = "<img src=x onerror=window.broken=1><script>window.broken=1</script>"
IMAGE = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": HOSTILE},
    "is_bigendian": 0,
    "height": 2,
    "width": 3,
    "encoding": "bgr8",
    "step": 10,
    "data": [0, 0, 255, 0, 255, 0, 255, 0, 0, 7, 1, 2, 3, 4, 5, 6, 7, 8, 9, 7],
}
STIMULI = [
    {"point": {"x": 1.5, "y": -2.0, "z": 1e300}},
    {"text": {"data": HOSTILE}},
    {"image": IMAGE},
]
# The percentage of the cycles in which each wire waits: from and to the host, from the Manager, to the publishers, and
# from them. The point waits for the Manager, and the text for its publisher.
WAITS = (0, 0, 40, 25, 0, 50, 30, 0, 60, 0, 0)
# A service in hardware.
SERVICE = """\
project: {name: robot, width: 64, clock: 100 MHz}
paths: [messages]
accelerators:
  - name: switch
    type: VHDL
    sources: [switch.vhd]
    interface:
      input: [{middleware: ROS2, message: demo_msgs/Enable_Request}]
      output: [{middleware: ROS2, message: demo_msgs/Enable_Response}]
blocks:
  - {name: enable, middleware: ROS2, mode: server, service: demo_msgs/Enable, outgoing: [{name: switch}]}
  - {name: switch, type: switch, outgoing: [{name: enable}]}
"""
TYPES = {"point": "geometry_msgs/Point", "text": "std_msgs/String", "image": "sensor_msgs/Image"}


def write_system(folder: Path, stimuli: Sequence[object] = STIMULI, types: Mapping[str, str] = TYPES) -> Path:
    """Write a specification, the core beside it and the stimuli that it names."""
    blocks: list[dict[str, object]] = []
    for name, message in types.items():
        common = {"middleware": "ROS2", "message": message}
        blocks.append({"name": name, "mode": "subscriber", **common, "outgoing": [{"name": f"{name}_out"}]})
        blocks.append({"name": f"{name}_out", "mode": "publisher", **common})
    spec = folder / "robot.yaml"
    project = {"name": "robot", "width": 64, "clock": "100 MHz"}
    spec.write_text(yaml.safe_dump({"project": project, "blocks": blocks}, sort_keys=False), encoding="utf-8")
    write_core(spec)
    (folder / "stimuli.yaml").write_text(yaml.safe_dump([*stimuli], sort_keys=False), encoding="utf-8")
    return spec


def write_service(spec: Path) -> None:
    """Write the specification of a service, and its files beside it."""
    spec.write_text(SERVICE, encoding="utf-8")
    spec.with_name("switch.vhd").touch()
    package = spec.parent / "messages" / "demo_msgs" / "srv"
    package.mkdir(parents=True)
    (package / "Enable.srv").write_text("bool data\n---\nbool success\n", encoding="utf-8")


def write_core(spec: Path) -> None:
    """Write the core of a specification that has `stimuli.yaml` beside it."""
    generate = {
        "system": {"generator": "far", "parameters": {"spec": spec.name}},
        "simulation": {"generator": "far", "parameters": {"spec": spec.name, "stimuli": "stimuli.yaml"}},
    }
    core = {"name": f"robot:sys:{spec.stem}:0", "generate": generate}
    spec.with_suffix(".core").write_text(f"CAPI=2:\n{yaml.safe_dump(core)}", encoding="utf-8")


def modelled(*options: str, width: int = 64, waits: Sequence[int] = WAITS) -> Callable[[Path, str], BuiltSimulator]:
    """What builds the model in the place of a simulator; `waits` are percentages of the cycles for each wire."""

    def build(spec: Path, tool: str) -> BuiltSimulator:
        if tool == "verilator":
            fail(f"cannot build the simulator for {spec}", hint=HOSTILE)
        settings = (f"--width={width}", "--waits", *map(str, waits), *options)
        return BuiltSimulator(tool, spec.parent, (sys.executable, model_simulator.__file__, *settings))

    return build
