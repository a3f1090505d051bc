"""Kernels of the dissertation in C++ for HLS: in simulation, they give what the models of specs/ give, bit by bit."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from tests.applications.applications import SPECS
from tests.system.simulated.systems import build, call

DATA = Path(__file__).parent / "data"
SEED = 20240902
STATE = {"q": (7, 4.0), "q_d": (7, 16.5), "o_t_ee": (16, 1.5), "o_t_ee_d": (16, 4.02)}


def in_cpp(name: str, source: str, folder: Path, **changes: Any) -> Path:
    """The specification of an application in specs/ whose accelerator is written in C++."""
    specification = yaml.safe_load((SPECS / name / f"{name}.yaml").read_text(encoding="utf-8"))
    (accelerator,) = specification["accelerators"]
    accelerator |= {"type": "HLS", "sources": source, **changes}
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(specification, sort_keys=False), encoding="utf-8")
    (folder / source).write_text((DATA / source).read_text(encoding="utf-8"), encoding="utf-8")
    return path


@pytest.mark.parametrize("stalls", [0, 40])
def test_the_kinematics_of_the_arm(tmp_path: Path, stalls: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    states = yaml.safe_load((SPECS / "robotic_arm" / "stimuli.yaml").read_text(encoding="utf-8"))
    states += [
        {"state": {name: [source.uniform(-far, far) for _ in range(size)] for name, (size, far) in STATE.items()}}
        for _ in range(20)
    ]
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump(states), encoding="utf-8")
    specification = in_cpp("robotic_arm", "RoboticArm.cpp", tmp_path)
    paths = [str(SPECS / "robotic_arm" / "msg")]
    request = call(specification, tmp_path / "stimuli.yaml", SPECS / "robotic_arm" / "model.py", paths=paths)
    result = build(request, tmp_path / "system").run(SEED=SEED, STALL_PERCENT=stalls)
    assert result.output.splitlines()[-1] == f"PASS {len(states)}/{len(states)}", result.output


PASS_THROUGH = """\
project: {name: pass}
accelerators:
  - name: forward
    type: HLS
    sources: forward.cpp
    interface:
      input: [{middleware: ROS2, message: geometry_msgs/PoseWithCovariance}]
      output: [{middleware: ROS2, message: geometry_msgs/PoseWithCovariance}]
blocks:
  - {name: sub, middleware: ROS2, mode: subscriber, message: geometry_msgs/PoseWithCovariance, outgoing: [{name: acc}]}
  - {name: acc, type: forward, outgoing: [{name: pub}]}
  - {name: pub, middleware: ROS2, mode: publisher, message: geometry_msgs/PoseWithCovariance}
"""


def test_the_first_version_copies_arrays(tmp_path: Path) -> None:
    specification = tmp_path / "pass.yaml"
    specification.write_text(PASS_THROUGH, encoding="utf-8")
    assert main(["system", "skeleton", str(specification)]) == 0
    assert "double pose_position_x_in" in (text := (tmp_path / "forward.cpp").read_text(encoding="utf-8"))
    assert "double covariance_out[36]" in text
    pose = {"position": {"x": 1.5, "y": -2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    message = {"pose": pose, "covariance": [k / 8 for k in range(36)]}
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump([{"sub": message}]), encoding="utf-8")
    (tmp_path / "model.py").write_text("def respond(_, message):\n    return [('pub', message)]\n", encoding="utf-8")
    request = call(specification, tmp_path / "stimuli.yaml", tmp_path / "model.py")
    assert build(request, tmp_path / "system").passes()
