"""First versions of accelerators: they are legal VHDL, C++ and Python, copy equal parts and send zeros elsewhere.

Messages of all kinds: of fixed size, of a length that is computed, given or counted, and with elements that are sent
one by one. One accelerator takes none, and one has a pin that is called as a signal of the others.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from tests.system.simulated.first_versions import BOARD, IMAGE_STIMULUS, ZEROS, write_messages
from tests.system.simulated.systems import GeneratedSystem, build, call

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
  - name: tag
    type: VHDL
    sources: tag.vhd
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output:
        - {{middleware: ROS, message: {IMAGE}, length: given}}
        - {{middleware: ROS, message: {BOARD}, length: given}}
    pins: [{{name: done, direction: out}}]
  - name: count
    type: VHDL
    sources: count.vhd
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {BOARD}}}]
  - name: listen
    type: VHDL
    sources: listen.vhd
    interface:
      output: [{{middleware: ROS, message: {POINT}}}]
    pins: [{{name: is_there, direction: in}}]
  - name: describe
    type: ROS-SW
    sources: describe.py
    interface:
      input: [{{middleware: ROS, message: {POINT}}}]
      output: [{{middleware: ROS, message: {BOARD}}}]
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
  - name: again
    middleware: ROS
    mode: subscriber
    message: {POINT}
    outgoing: [{{name: l}}, {{name: c}}, {{name: d}}]
  - {{name: l, type: tag, outgoing: [{{name: labelled}}, {{name: given}}]}}
  - {{name: c, type: count, outgoing: [{{name: counted}}]}}
  - {{name: d, type: describe, outgoing: [{{name: described}}]}}
  - {{name: e, type: listen, outgoing: [{{name: heard}}]}}
  - {{name: m, type: mix, outgoing: [{{name: image_out}}, {{name: pose_out}}]}}
  - {{name: t, type: turn, outgoing: [{{name: turned}}, {{name: p}}]}}
  - {{name: p, type: plan, outgoing: [{{name: planned}}]}}
  - {{name: image_out, middleware: ROS, mode: publisher, message: {IMAGE}}}
  - {{name: pose_out, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: turned, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: planned, middleware: ROS, mode: publisher, message: {POSE}}}
  - {{name: labelled, middleware: ROS, mode: publisher, message: {IMAGE}}}
  - {{name: given, middleware: ROS, mode: publisher, message: {BOARD}}}
  - {{name: counted, middleware: ROS, mode: publisher, message: {BOARD}, buffer: 256}}
  - {{name: described, middleware: ROS, mode: publisher, message: {BOARD}}}
  - {{name: heard, middleware: ROS, mode: publisher, message: {POINT}}}
"""
STIMULI = (
    IMAGE_STIMULUS
    + """\
- other: {x: 1.0, y: 2.0, z: 3.0}
- point: {x: 1.0, y: 2.0, z: 3.0}
- again: {x: 1.0, y: 2.0, z: 3.0}
"""
)
# Two outputs of one input get its fields, but only one output could get its strings and arrays.
MODEL = (
    ZEROS
    + """


def respond(subscriber, message):
    return {
        "image": [],
        "other": [("turned", POSE), ("p_in", POSE), ("planned", POSE)],
        "point": [("image_out", FIELDS), ("pose_out", POSE)],
        "again": [("labelled", IMAGE), ("given", BOARD), ("counted", BOARD), ("described", BOARD)],
    }[subscriber]
"""
)


def system(folder: Path) -> GeneratedSystem:
    for name, text in (("stimuli.yaml", STIMULI * 5), ("model.py", MODEL)):
        (folder / name).write_text(text, encoding="utf-8")
    request = call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py", paths=["demo_msgs"])
    return build(request, folder / "system")


def test_a_system_of_first_versions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    paths = ["--path", str(write_messages(tmp_path))]
    assert main(["system", "check", str(spec), *paths]) == 1
    assert "'firm system skeleton' writes a first version" in capsys.readouterr().err
    assert main(["system", "skeleton", str(spec), *paths]) == 0
    names = ["rtl/mix.vhd", "tag.vhd", "count.vhd", "listen.vhd", "turn.cpp", "plan.py", "describe.py"]
    assert sorted(capsys.readouterr().out.splitlines()) == sorted(str(tmp_path / name) for name in names)
    made = system(tmp_path)
    assert made.passes(STALL_PERCENT=0)
    assert made.passes(SEED=3, STALL_PERCENT=60)
    for entity in ("mix", "tag", "count", "listen"):
        assert made.work.latches(entity) == []


def test_what_is_there_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec, source = tmp_path / "spec.yaml", tmp_path / "rtl" / "mix.vhd"
    spec.write_text(SPECIFICATION, encoding="utf-8")
    source.parent.mkdir()
    source.write_text("-- mine\n", encoding="utf-8")
    command = ["system", "skeleton", str(spec), "--path", str(write_messages(tmp_path))]
    assert main(command) == 0
    written = capsys.readouterr().out.splitlines()
    assert str(tmp_path / "turn.cpp") in written and str(source) not in written
    assert source.read_text(encoding="utf-8") == "-- mine\n"
    assert main(command) == 0
    assert capsys.readouterr().out == "every accelerator has a source\n"
