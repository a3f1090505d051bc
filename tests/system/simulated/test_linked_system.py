"""Systems whose top level has a serial link in place of streams: the same messages, the same answers."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fusesoc_firm.core.request import Request
from tests.hdl import verilog
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


def _request(folder: Path, interconnect: str, width: int, stimuli: str = STIMULI) -> Request:
    project = f"project: {{name: linked, interconnect: {interconnect}, clock: 12 MHz, width: {width}}}"
    (folder / "spec.yaml").write_text(project + BLOCKS)
    (folder / "stimuli.yaml").write_text(stimuli)
    (folder / "model.py").write_text(MODEL)
    return call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py")


def _built(folder: Path, interconnect: str, width: int) -> GeneratedSystem:
    return build(_request(folder, interconnect, width), folder / "system")


@pytest.mark.one_in(7)
@pytest.mark.parametrize("interconnect", ["axi_stream", "uart", "spi"])
@pytest.mark.parametrize("width", [8, 64])
def test_a_system_answers_over_any_interconnect(tmp_path: Path, interconnect: str, width: int) -> None:
    system = _built(tmp_path, interconnect, width)
    assert system.passes(STALL_PERCENT=0)
    assert system.passes(SEED=3, STALL_PERCENT=30)


@pytest.mark.one_in(2)
@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
@pytest.mark.parametrize("interconnect", ["uart", "spi"])
def test_a_linked_system_answers_as_a_netlist(tmp_path: Path, interconnect: str) -> None:
    # A text, a pose, and a text without letters.
    icarus = verilog.build(_request(tmp_path, interconnect, 32, "".join(STIMULI.splitlines(True)[:4])), tmp_path)
    result = icarus.run(tmp_path, SEED=3, STALL_PERCENT=30)
    assert result.output.splitlines()[-1] == "PASS 3/3", result.output


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed")
def test_a_broken_frame_ends_a_simulation_in_verilog(tmp_path: Path) -> None:
    """A system that sends a byte with one wrong bit."""
    top, files = verilog.translated(_request(tmp_path, "uart", 8), tmp_path)
    adapter = next(path for path in files if path.stem == "firm_sim_uart")
    broken = tmp_path / "firm_sim_uart.v"
    right = "received_data[received_bit] = uart_txd;"
    text = adapter.read_text()
    assert right in text
    broken.write_text(text.replace(right, f"{right} received_data[6] = 0;"))
    icarus = verilog.compile_verilog(top, [broken if path == adapter else path for path in files], tmp_path)
    assert "the system sent a frame whose" in icarus.run(tmp_path).output


@pytest.mark.parametrize("interconnect", ["uart", "spi"])
def test_a_linked_system_has_no_latch(tmp_path: Path, interconnect: str) -> None:
    system = _built(tmp_path, interconnect, 32)
    system.use_real_synchronisers()
    assert system.work.latches(system.entity) == []
