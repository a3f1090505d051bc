"""First versions of accelerators: they are legal VHDL and C++, and a system of them answers with zeros."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.sim.first_versions import IMAGE_STIMULUS, ZEROS
from tests.sim.systems import GeneratedSystem, build, call

POINT, POSE, IMAGE = "geometry_msgs/Point", "geometry_msgs/Pose", "sensor_msgs/Image"
SPECIFICATION = f"""
project: {{name: first}}
accelerators:
  - name: mix
    type: VHDL
    sources: rtl/mix.vhd
    interface:
      input: [{{middleware: ROS, message: {IMAGE}}}, {{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {IMAGE}}}, {{middleware: ROS, message: {POSE}}}]
    pins: [{{name: led, direction: out}}, {{name: switches, direction: in, bits: 4}}]
  - name: turn
    type: HLS
    sources: turn.cpp
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {POSE}}}]
  - name: plan
    type: ROS-SW
    sources: plan.py
    interface:
      input: [{{middleware: ROS, message: {POSE}}}]
      output: [{{middleware: ROS, message: {POSE}}}]
blocks:
  - {{name: image, middleware: ROS, mode: subscriber, message: {IMAGE}, outgoing: [{{name: m}}]}}
  - {{name: point, middleware: ROS, mode: subscriber, message: {POINT}, outgoing: [{{name: m}}]}}
  - {{name: other, middleware: ROS, mode: subscriber, message: {POINT}, outgoing: [{{name: t}}]}}
  - {{name: m, type: mix, outgoing: [{{name: image_out}}, {{name: pose_out}}]}}
  - {{name: t, type: turn, outgoing: [{{name: turned}}, {{name: p}}]}}
  - {{name: p, type: plan, outgoing: [{{name: planned}}]}}
  - {{name: image_out, middleware: ROS, mode: publisher, message: {IMAGE}}}
  - {{name: pose_out, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: turned, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: planned, middleware: ROS, mode: publisher, message: {POSE}}}
"""
STIMULI = (
    IMAGE_STIMULUS
    + """\
- other: {x: 1.0, y: 2.0, z: 3.0}
- point: {x: 1.0, y: 2.0, z: 3.0}
"""
)
MODEL = (
    ZEROS
    + """


def respond(subscriber, message):
    return {
        "image": [],
        "other": [("turned", POSE), ("p_in", POSE), ("planned", POSE)],
        "point": [("image_out", IMAGE), ("pose_out", POSE)],
    }[subscriber]
"""
)


def system(folder: Path) -> GeneratedSystem:
    for name, text in (("stimuli.yaml", STIMULI * 5), ("model.py", MODEL)):
        (folder / name).write_text(text, encoding="utf-8")
    return build(call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "system")


def test_a_system_of_first_versions_answers_with_zeros(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    assert main(["system", "check", str(spec)]) == 1
    assert "'firm system skeleton' writes a first version" in capsys.readouterr().err
    assert main(["system", "skeleton", str(spec)]) == 0
    assert (
        capsys.readouterr().out == f"{tmp_path / 'rtl' / 'mix.vhd'}\n{tmp_path / 'turn.cpp'}\n{tmp_path / 'plan.py'}\n"
    )
    made = system(tmp_path)
    assert made.passes(STALL_PERCENT=0)
    assert made.passes(SEED=3, STALL_PERCENT=60)
    assert made.work.latches("mix") == []


def test_what_is_there_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec, source = tmp_path / "spec.yaml", tmp_path / "rtl" / "mix.vhd"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    source.parent.mkdir()
    source.write_text("-- mine\n", encoding="utf-8")
    assert main(["system", "skeleton", str(spec)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'turn.cpp'}\n{tmp_path / 'plan.py'}\n"
    assert source.read_text(encoding="utf-8") == "-- mine\n"
    assert main(["system", "skeleton", str(spec)]) == 0
    assert capsys.readouterr().out == "every accelerator has a source\n"
