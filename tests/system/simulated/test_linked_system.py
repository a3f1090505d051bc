"""Systems whose top level has a serial link in place of streams: the same messages, the same answers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.simulated.systems import GeneratedSystem, build, call

BLOCKS = """
blocks:
  - {name: pose_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Pose, outgoing: [{name: pose}]}
  - {name: pose, middleware: ROS2, mode: publisher, message: geometry_msgs/Pose}
  - {name: text_in, middleware: ROS2, mode: subscriber, message: std_msgs/String, outgoing: [{name: text}]}
  - {name: text, middleware: ROS2, mode: publisher, message: std_msgs/String}
"""
STIMULI = """
- text_in: {data: from board to board}
- pose_in: {position: {x: 1.0, y: -2.5, z: 3.0}, orientation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}
- text_in: {data: ''}
- pose_in: {position: {x: 4.0, y: 5.0, z: 6.0}, orientation: {x: 0.5, y: 0.5, z: 0.5, w: 0.5}}
- text_in: {data: 0123456789012345678901234567890123456789012345678901234567890123456789}
"""
MODEL = """
def respond(subscriber, message):
    return [(subscriber.removesuffix("_in"), message)]
"""


def _built(folder: Path, interconnect: str, width: int) -> GeneratedSystem:
    project = f"project: {{name: linked, interconnect: {interconnect}, clock: 12 MHz, width: {width}}}"
    (folder / "spec.yaml").write_text(project + BLOCKS)
    (folder / "stimuli.yaml").write_text(STIMULI)
    (folder / "model.py").write_text(MODEL)
    request = call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py")
    return build(request, folder / "system")


@pytest.mark.one_in(7)
@pytest.mark.parametrize("interconnect", ["axi_stream", "uart", "spi"])
@pytest.mark.parametrize("width", [8, 64])
def test_a_system_answers_over_any_interconnect(tmp_path: Path, interconnect: str, width: int) -> None:
    system = _built(tmp_path, interconnect, width)
    assert system.passes(STALL_PERCENT=0)
    assert system.passes(SEED=3, STALL_PERCENT=30)


@pytest.mark.parametrize("interconnect", ["uart", "spi"])
def test_a_linked_system_has_no_latch(tmp_path: Path, interconnect: str) -> None:
    system = _built(tmp_path, interconnect, 32)
    system.use_real_synchronisers()
    assert system.work.latches(system.entity) == []
