"""The top level's configuration: every port is mapped, every signal is there once and is driven once."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm.core.request import Request
from fusesoc_firm.system import system_core
from fusesoc_firm.system.hardware.configuration import SYSTEM_TEMPLATE, system_configuration
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.render import render
from tests.system.systems import (
    accelerator,
    converter,
    derived,
    instance,
    maps,
    signals,
    specification,
    targets,
)

BLOCKS = (
    converter("s", "subscriber", "Point", "p", "acc")
    + converter("s_2", "subscriber", "Vector3", "acc")
    + instance("acc", "mix", "q", "r")
    + converter("p", "publisher", "Point")
    + converter("q", "publisher", "Point")
    + converter("r", "publisher", "Vector3")
)
# Blocks called like labels and signals of the top level, like keywords, and like each other's signals.
AWKWARD = (
    converter("manager", "subscriber", "Point", "manager_fork", "scheduler")
    + instance("scheduler", "same", "signal")
    + instance("manager_fork", "same", "clk", "m_axis")
    + "".join(converter(name, "publisher", "Point") for name in ("signal", "clk", "m_axis"))
    + converter("sub_axis", "subscriber", "Pose", "a")
    + converter("a", "publisher", "Pose")
    + converter("a_orientation", "subscriber", "Point", "a/position")
    + converter("a/position", "publisher", "Point")
)
TYPES = accelerator("mix", "Point Vector3", "Point Vector3") + accelerator("same", "Point", "Point")


def top_level(folder: Path, blocks: str) -> str:
    return render(SYSTEM_TEMPLATE, system_configuration(derived(folder, specification(blocks, TYPES))))


@pytest.mark.parametrize("blocks", [BLOCKS, AWKWARD])
def test_names_are_distinct(tmp_path: Path, blocks: str) -> None:
    text = top_level(tmp_path, blocks)
    names = Counter(
        name.lower() for name in [*maps(text), *signals(text), "clk", "rst_n", "s_axis_tdata", "robot_system"]
    )
    assert {"u_manager", "u_scheduler", "sub_axis_tdata"} < set(names)
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("blocks", [BLOCKS, AWKWARD])
def test_every_signal_is_driven_once_and_ends_somewhere(tmp_path: Path, blocks: str) -> None:
    text = top_level(tmp_path, blocks)
    assert set(Counter(targets(text)).values()) == {1}
    actuals = [actual for _, ports in maps(text).values() for actual in ports.values()]
    used = {name.partition("(")[0] for name in [*targets(text), *actuals]}
    assert set(signals(text)) <= used


def test_port_maps(tmp_path: Path) -> None:
    found = maps(top_level(tmp_path, BLOCKS))
    _, subscriber = found["u_s_2"]
    assert subscriber["s_axis_tvalid"] == "sub_axis_tvalid(1)"
    assert subscriber["frame_error_code"] == "frame_error_code(7 downto 4)"
    assert subscriber["x"] == "s_2_x"
    generics, publisher = found["u_r"]
    assert publisher["m_axis_tdata"] == "pub_axis_tdata(23 downto 16)"
    assert publisher["m_axis_tkeep"] == "pub_axis_tkeep(2 downto 2)"
    assert generics == {"ID": "2"}
    _, block = found["u_acc"]
    assert list(block)[:3] == ["clk", "rst_n", "in0_x"]
    assert block["in1_msg_ready"] == "acc_in1_msg_ready"
    assert {name for name in block if "msg_valid" in name} == {"in0_msg_valid", "in1_msg_valid"}


def test_a_fork_stands_between_one_source_and_its_sinks(tmp_path: Path) -> None:
    text = top_level(tmp_path, BLOCKS)
    assert "  -- geometry_msgs/Point from s to p, acc\n" in text
    found = maps(text)
    assert [label for label in found if label.endswith("_fork")] == ["u_s_fork"]
    assert {"s_fork_valid", "s_fork_ready"} < set(signals(text))
    assert found["u_s_fork"] == (
        {"SINKS": "2"},
        {
            "clk": "clk",
            "rst_n": "system_rst_n",
            "source_valid": "s_segment_valid(0)",
            "source_ready": "s_msg_ready",
            "sink_valid": "s_fork_valid",
            "sink_ready": "s_fork_ready",
        },
    )
    assert re.search(r"^  acc_in0_msg_valid +<= s_fork_valid\(1\);$", text, re.MULTILINE)
    assert re.search(r"^  s_fork_ready\(0\) +<= p_msg_ready;$", text, re.MULTILINE)


def test_the_text_is_the_same_every_time(tmp_path: Path) -> None:
    first, second = (top_level(tmp_path, AWKWARD) for _ in range(2))
    assert first == second


def test_a_source_of_two_types_is_in_the_core_once(tmp_path: Path) -> None:
    types = accelerator("one", "Point", "Point", sources="acc.vhd, sub/../acc.vhd, sub/own.vhd") + accelerator(
        "two", "Point", "Point", sources="acc.vhd, ../own.vhd"
    )
    folder = tmp_path / "spec"
    (folder / "sub").mkdir(parents=True)
    (folder / "sub" / "own.vhd").touch()
    (tmp_path / "own.vhd").touch()
    blocks = (
        converter("s", "subscriber", "Point", "a")
        + instance("a", "one", "b")
        + instance("b", "two", "p")
        + converter("p", "publisher", "Point")
    )
    derived(folder, specification(blocks, types))
    parameters = {"spec": "spec.yaml", "paths": None, "distro": None}
    core = system_core.system_core(system_core.load_requested(Request("far", "a:b:c-d:0", folder, parameters)))
    assert [name for name in core.files if "/" in name] == ["one/acc.vhd", "one/sub/own.vhd", "two/above/own.vhd"]
    assert list(core.files)[-1] == "robot_system.vhd"


BRIDGE = """\
  - name: bridge
    type: VHDL
    sources: acc.vhd
    interface:
      input: [{middleware: ROS, message: geometry_msgs/Point}]
      output: [{middleware: ROS2, message: geometry_msgs/Point}]
"""


def test_packages_come_first_and_those_of_two_versions_have_two_names(tmp_path: Path) -> None:
    blocks = (
        converter("s", "subscriber", "Point", "b")
        + instance("b", "bridge", "p")
        + converter("p", "publisher", "Point", ros="ROS2")
        + converter("t", "subscriber", "Pose", "q")
        + converter("q", "publisher", "Pose")
    )
    derived(tmp_path, specification(blocks, BRIDGE))
    parameters = {"spec": "spec.yaml", "paths": None, "distro": None}
    core = system_core.system_core(system_core.load_requested(Request("far", "a:b:c-d:0", tmp_path, parameters)))
    assert list(core.files)[:4] == [
        "geometry_msgs_point_ros1_pkg.vhd",
        "geometry_msgs_pose_pkg.vhd",
        "geometry_msgs_point_ros2_pkg.vhd",
        "axis_to_geometry_msgs_point.vhd",
    ]


def test_two_messages_cannot_have_one_package(tmp_path: Path) -> None:
    for package, name in (("odd_msgs", "Point"), ("odd", "Msgs_Point")):
        (tmp_path / package / "msg").mkdir(parents=True)
        (tmp_path / package / "msg" / f"{name}.msg").write_text("float64 x\n")
    blocks = (
        converter("s", "subscriber", "odd_msgs/Point", "a")
        + instance("a", "change", "p")
        + converter("p", "publisher", "odd/Msgs_Point")
    )
    types = accelerator("change", "odd_msgs/Point", "odd/Msgs_Point")
    (tmp_path / "acc.vhd").touch()
    (tmp_path / "spec.yaml").write_text(specification(blocks, types))
    request = Request("far", "a:b:c-d:0", tmp_path, {"spec": "spec.yaml", "paths": ["odd", "odd_msgs"], "distro": None})
    with pytest.raises(InputError) as raised:
        system_core.system_core(system_core.load_requested(request))
    (fault,) = raised.value.diagnostics
    assert fault.message == "'p' and converter 's' need the package 'odd_msgs_point_pkg' for different messages"
