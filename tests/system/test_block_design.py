"""Boards with a processor: what the generator makes of a system for one."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.core.request import GeneratedFile, Request
from fusesoc_firm.system.system_core import load_requested, system_core
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools.flows import SUFFIX

SPECIFICATION = """\
project: {{name: robot, width: 16{clocks}}}
accelerators:
  - name: turn
    type: HLS
    sources: [src/turn.cpp, src/turn.hpp]
    interface:
      input: [{{middleware: ROS, message: geometry_msgs/Point}}]
      output: [{{middleware: ROS, message: geometry_msgs/Point}}]
blocks:
  - {{name: in, middleware: ROS, mode: subscriber, message: geometry_msgs/Point, outgoing: [{{name: slow}}]}}
  - {{name: slow, type: turn, outgoing: [{{name: fast}}]}}
  - {{name: fast, type: turn, {at}outgoing: [{{name: out}}]}}
  - {{name: out, middleware: ROS, mode: publisher, message: geometry_msgs/Point}}
"""
BOARD = """\
description: A board
flow: vivado
part: xc7z010clg400-1
processor: zynq7000
clock: 50 MHz
interconnect: axi_stream
"""
ONE_CLOCK = ", clock: 100 MHz, clocks: [{name: quick, frequency: 160 MHz}]"
FOUR_CLOCKS = ", clock: 100 MHz, clocks: [{}]".format(
    ", ".join(f"{{name: c{number}, frequency: 10 MHz}}" for number in range(4))
)


def made(folder: Path, clocks: str = "", at: str = "", board: str = "zynq7000") -> dict[str, GeneratedFile]:
    (folder / "src").mkdir()
    for name in ("turn.cpp", "turn.hpp"):
        (folder / "src" / name).write_text("// nothing is compiled here\n", encoding="ascii")
    (folder / "board.yaml").write_text(BOARD, encoding="ascii")
    (folder / "spec.yaml").write_text(SPECIFICATION.format(clocks=clocks, at=at), encoding="ascii")
    parameters = {"spec": "spec.yaml", "board": board, "paths": None, "distro": None}
    return dict(system_core(load_requested(Request("far", "test:sys:robot-system:0", folder, parameters))).files)


def test_what_comes_for_a_processor(tmp_path: Path) -> None:
    files = made(tmp_path)
    types = {name: file.file_type for name, file in files.items() if not name.endswith((".vhd", SUFFIX))}
    assert types == {
        "turn/src/turn.cpp": "user",
        "turn/src/turn.hpp": "user",
        "turn.tcl": "user",
        "zynq7000.xdc": "xdc",
        "zynq7000_checks.tcl": "user",
        "robot_zynq7000.tcl": "tclSource",
    }
    # Vivado reads it last: it refers to the top level.
    assert list(files)[-1] == "robot_zynq7000.tcl"


def test_a_kernel_is_made_once_for_the_fastest_of_its_clocks(tmp_path: Path) -> None:
    files = made(tmp_path, ONE_CLOCK, "clock: quick, ")
    assert "create_clock -period 6.250 -name default" in str(files["turn.tcl"].content)
    assert str(files["robot_zynq7000.tcl"].content).count("create_ip ") == 1
    assert files["zynq7000.xdc"].file_type == "xdc"


def test_a_board_of_ones_own(tmp_path: Path) -> None:
    """Its clock holds where the specification has none, and Vivado need not know it."""
    files = made(tmp_path, board="board.yaml")
    design = str(files["robot_board.tcl"].content)
    assert 'apply_board_preset "0"' in design
    assert "CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ 50\n" in design
    assert "set_part xc7z010clg400-1\n" in str(files["turn.tcl"].content)


def test_a_processor_makes_four_clocks(tmp_path: Path) -> None:
    specification = SPECIFICATION.format(clocks=FOUR_CLOCKS, at="")
    chain = "".join(
        f"  - {{name: b{n}, type: turn, clock: c{n}, outgoing: [{{name: {f'b{n + 1}' if n < 3 else 'out'}}}]}}\n"
        for n in range(4)
    )
    head, tail = specification.split("  - {name: slow")
    out = tail[tail.index("  - {name: out") :]
    (tmp_path / "src").mkdir()
    for name in ("turn.cpp", "turn.hpp"):
        (tmp_path / "src" / name).touch()
    (tmp_path / "spec.yaml").write_text(head.replace("slow", "b0") + chain + out, encoding="ascii")
    parameters = {"spec": "spec.yaml", "board": "zcu104", "paths": None, "distro": None}
    with pytest.raises(InputError, match="board 'zcu104' has at most 4 clocks, including clk; the system has 5"):
        system_core(load_requested(Request("far", "test:sys:robot-system:0", tmp_path, parameters)))


def test_a_status_has_a_bus_an_address_and_an_interrupt(tmp_path: Path) -> None:
    design = str(made(tmp_path, ", status: axi_lite")["robot_zynq7000.tcl"].content)
    assert "connect_bd_intf_net [get_bd_intf_pins control/M01_AXI] [get_bd_intf_pins system/s_axi]" in design
    assert "connect_bd_net [get_bd_pins system/status_interrupt] [get_bd_pins interrupts/In2]" in design
    assert "-offset 0x40410000 -range 64K" in design
    assert "CONFIG.NUM_MI 2\n" in design
    assert "CONFIG.NUM_PORTS 3\n" in design


def test_without_a_status_nothing_is_added(tmp_path: Path) -> None:
    design = str(made(tmp_path)["robot_zynq7000.tcl"].content)
    assert "s_axi/reg0" not in design
    assert "CONFIG.NUM_PORTS 2\n" in design
