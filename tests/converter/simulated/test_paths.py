"""No path from a `ready` crosses a converter of variable size, and a message that is passed through makes no loop.

Yosys looks at the netlists, bit by bit: a simulation shows neither.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.message_ports import message_ports
from fusesoc_firm.converter.pipeline import BORDERS, FULL, NONE
from fusesoc_firm.converter.variable_publisher import VARIABLE_PUBLISHER_TEMPLATE, variable_publisher_configuration
from fusesoc_firm.converter.variable_subscriber import VARIABLE_SUBSCRIBER_TEMPLATE, variable_subscriber_configuration
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.text.render import render
from tests.converter.simulated.samples import ORACLES
from tests.hdl.ghdl import Library, core_files

# Streams alone, arrays of strings, and arrays of messages with arrays of strings.
NAMES = ["sensor_msgs/JointState", "awkward_msgs/Deep", "sensor_msgs/Image", "diagnostic_msgs/DiagnosticArray"]
CASES = [(ROS2, name, width) for name in NAMES for width in (64, 8)] + [(ROS1, name, 64) for name in NAMES[2:]]

pytestmark = pytest.mark.skipif(not shutil.which("yosys"), reason="yosys is not installed")


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), CASES)
def test_no_ready_reaches_an_output_of_a_subscriber(tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    frame = ORACLES[ros].frame(name)
    ready = [port.name for port in message_ports(frame, width) if port.is_reverse] + ["msg_ready"]
    netlist = _subscriber(frame, width, tmp_path)
    _look(tmp_path, netlist, subscriber_entity(frame), _no_output_behind(ready))


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), CASES)
def test_what_takes_the_frame_reaches_no_output_of_a_publisher(
    tmp_path: Path, ros: Middleware, name: str, width: int
) -> None:
    frame = ORACLES[ros].frame(name)
    netlist = _publisher(frame, width, tmp_path)
    _look(tmp_path, netlist, publisher_entity(frame), _no_output_behind(["m_axis_tready"]))


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize(("ros", "name", "width"), CASES)
def test_a_message_that_is_passed_through_makes_no_loop(tmp_path: Path, ros: Middleware, name: str, width: int) -> None:
    frame = ORACLES[ros].frame(name)
    netlists = [_subscriber(frame, width, tmp_path), _publisher(frame, width, tmp_path), _joined(frame, width)]
    _look(tmp_path, "\n".join(netlists), "top", "scc -expect 0")


@pytest.mark.one_in(4, 3)
@pytest.mark.parametrize("width", [64, 8])
@pytest.mark.parametrize(
    ("name", "kind"), [("sensor_msgs/Image", "_tready"), ("diagnostic_msgs/DiagnosticArray", "_ready")]
)
def test_with_slices_no_ready_reaches_the_window(tmp_path: Path, name: str, kind: str, width: int) -> None:
    """Without them each one of a kind does, so the search finds such paths. Beats of elements wait in a queue."""
    frame = ORACLES[ROS2].frame(name)
    ready = [port.name for port in message_ports(frame, width) if port.is_reverse and port.name.endswith(kind)]
    for pipeline, assertion in (NONE, "-assert-any"), (BORDERS, "-assert-none"), (FULL, "-assert-none"):
        netlist = _subscriber(frame, width, tmp_path / pipeline, pipeline)
        reached = [f"select {assertion} i:{port} %co*:-$_DFF_P_ w:u_window.* %i" for port in ready]
        _look(tmp_path, netlist, subscriber_entity(frame), "; ".join(reached))


def _no_output_behind(inputs: list[str]) -> str:
    """Yosys' commands that fail if inputs reach an output without a register in between, or are not there."""
    found = " ".join(f"i:{port}" for port in inputs) + " %u" * (len(inputs) - 1)
    return f"select -assert-count {len(inputs)} {found}; select -assert-none {found} %co*:-$_DFF_P_ o:* %i"


def _look(directory: Path, netlist: str, top: str, command: str) -> None:
    (directory / "netlist.v").write_text(netlist, encoding="utf-8")
    bits = "proc; flatten; memory_map; opt_clean; simplemap; splitnets; opt_clean"
    script = f"read_verilog netlist.v; hierarchy -check -top {top}; {bits}; {command}"
    done = subprocess.run(["yosys", "-q", "-p", script], cwd=directory, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def _subscriber(frame: Frame, width: int, directory: Path, pipeline: str = NONE) -> str:
    entity = subscriber_entity(frame)
    configuration = variable_subscriber_configuration(frame, width, entity, pipeline)
    return _netlist(VARIABLE_SUBSCRIBER_TEMPLATE, entity, configuration, directory / "subscriber")


def _publisher(frame: Frame, width: int, directory: Path) -> str:
    entity = publisher_entity(frame)
    configuration = variable_publisher_configuration(frame, width, entity)
    return _netlist(VARIABLE_PUBLISHER_TEMPLATE, entity, configuration, directory / "publisher")


def _netlist(template: str, entity: str, configuration: Any, directory: Path) -> str:
    directory.mkdir(parents=True)
    Library("firm", directory).analyse(core_files("axis/package", "axis/axis"))
    file = directory / f"{entity}.vhd"
    file.write_text(render(template, configuration), encoding="ascii")
    library = Library("work", directory)
    library.analyse([file])
    # Both netlists have modules of the library.
    return library.synthesise(entity, language="verilog").replace("firm_axis", f"{directory.name}_firm_axis")


def _joined(frame: Frame, width: int) -> str:
    """Subscriber and publisher with the ports of their message side connected by name."""
    side = [port.name for port in message_ports(frame, width)] + ["payload_length", "segment_valid"]
    side += ["msg_valid", "msg_ready"]
    widths = {port.name: port.width or 1 for port in message_ports(frame, width)} | {"payload_length": 32}
    segments = variable_subscriber_configuration(frame, width, "any")["segments"]
    widths |= {"segment_valid": segments, "msg_valid": 1, "msg_ready": 1}
    wires = "".join(f"wire [{widths[name] - 1}:0] {name};\n" for name in dict.fromkeys(side))
    ports = ", ".join(f".{name}({name})" for name in dict.fromkeys(side))
    data = f"[{width - 1}:0]"
    keep = f"[{width // 8 - 1}:0]"
    return f"""
module top (input clk, input rst_n,
  input {data} s_axis_tdata, input {keep} s_axis_tkeep, input s_axis_tvalid, s_axis_tlast, output s_axis_tready,
  output {data} m_axis_tdata, output {keep} m_axis_tkeep, output m_axis_tvalid, m_axis_tlast, input m_axis_tready);
{wires}
{subscriber_entity(frame)} sub (.clk(clk), .rst_n(rst_n), .s_axis_tdata(s_axis_tdata), .s_axis_tkeep(s_axis_tkeep),
  .s_axis_tvalid(s_axis_tvalid), .s_axis_tlast(s_axis_tlast), .s_axis_tready(s_axis_tready), {ports});
{publisher_entity(frame)} pub (.clk(clk), .rst_n(rst_n), .m_axis_tdata(m_axis_tdata), .m_axis_tkeep(m_axis_tkeep),
  .m_axis_tvalid(m_axis_tvalid), .m_axis_tlast(m_axis_tlast), .m_axis_tready(m_axis_tready), {ports});
endmodule
"""
