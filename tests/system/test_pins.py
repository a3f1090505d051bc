"""Pins: ports of accelerators that become ports of the top level, and what stands at them in simulation."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.runs.simulation.environment import environment_files
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.hardware.configuration import system_configuration
from fusesoc_firm.system.hardware.configuration import test_bench_configuration as bench_configuration
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import converter, derived, instance, specification

PINS = "pins: [{name: led, direction: out, bits: 4}, {name: tid, direction: in}]"


def system(folder: Path, *blocks: str, pins: str = PINS) -> DerivedSystem:
    """The blocks in a row, all of the same accelerator."""
    side = "[{middleware: ROS, message: geometry_msgs/Point}]"
    interface = f"{{input: {side}, output: {side}}}"
    type_ = f"  - {{name: panel, type: VHDL, sources: acc.vhd, interface: {interface}, {pins}}}\n"
    row = [*blocks, "pub"]
    text = converter("sub", "subscriber", "Point", row[0])
    text += "".join(instance(name, "panel", target) for name, target in pairwise(row))
    return derived(folder, specification(text + converter("pub", "publisher", "Point"), type_))


def top_level(found: dict[str, Any]) -> list[tuple[str, str, str]]:
    return [(port["name"], port["direction"], port["type"]) for group in found["pins"] for port in group["ports"]]


def test_every_block_has_its_own_pins(tmp_path: Path) -> None:
    found = system_configuration(system(tmp_path, "left", "right"))
    vector = "std_logic_vector(3 downto 0)"
    assert top_level(found) == [
        ("left_led", "out", vector),
        ("left_tid", "in", "std_logic"),
        ("right_led", "out", vector),
        ("right_tid", "in", "std_logic"),
    ]
    for block in found["accelerators"]:
        mapped = {port["formal"]: port["actual"] for port in block["ports"]}
        name = block["label"].removeprefix("u_")
        assert (mapped["led"], mapped["tid"]) == (f"{name}_led", f"{name}_tid_synced")


def test_an_input_may_be_wired_directly(tmp_path: Path) -> None:
    pins = "pins: [{name: sclk, direction: in, synchroniser: none}, {name: levels, direction: in, bits: 3}]"
    found = system_configuration(system(tmp_path, "a", pins=pins))
    ((block,), (synchroniser,)) = found["accelerators"], found["synchronisers"]
    mapped = {port["formal"]: port["actual"] for port in block["ports"]}
    assert (mapped["sclk"], mapped["levels"]) == ("a_sclk", "a_levels_synced")
    mapped = {port["formal"]: port["actual"] for port in synchroniser["ports"]}
    assert mapped == {"clk": "clk", "level": "a_levels", "synced": "a_levels_synced"}
    assert synchroniser["generics"] == [{"formal": "BITS", "actual": "3"}]


@pytest.mark.parametrize("block", ["m_axis", "from", "burst"])
def test_a_pin_is_called_like_no_port_of_the_system_or_its_bench(tmp_path: Path, block: str) -> None:
    found = system_configuration(system(tmp_path, block))
    assert [name for name, *_ in top_level(found)] == [f"{block}_led", f"{block}_tid_2"]


def test_a_pin_goes_before_a_signal_of_the_same_name(tmp_path: Path) -> None:
    found = system_configuration(system(tmp_path, "a", "a_out", pins="pins: [{name: out_in_x, direction: in}]"))
    assert [name for name, *_ in top_level(found)] == ["a_out_in_x", "a_out_out_in_x"]
    declared = [item["name"] for group in found["signals"] for item in group["declarations"]]
    assert "a_out_in_x_2" in declared


def test_without_pins_nothing_changes(tmp_path: Path) -> None:
    found = system(tmp_path, "a", pins="pins: []")
    assert system_configuration(found)["pins"] == []
    assert "pins" not in derived_description(found)["Accelerators"][0]


def test_the_derived_system_shows_pins(tmp_path: Path) -> None:
    (block,) = derived_description(system(tmp_path, "m_axis"))["Accelerators"]
    assert block["pins"] == [
        {"name": "led", "direction": "out", "bits": 4, "port": "m_axis_led"},
        {"name": "tid", "direction": "in", "bits": 1, "port": "m_axis_tid_2"},
    ]


def test_the_bench_connects_every_pin_to_the_environment(tmp_path: Path) -> None:
    found = bench_configuration(system(tmp_path, "a"), 1, 0, "switches", is_live=False)
    assert found["environment"]["entity"] == "switches"
    mapped = [(port["formal"], port["actual"]) for port in found["environment"]["ports"]]
    assert mapped == [(name, name) for name in ("clk", "rst_n", "a_led", "a_tid")]
    assert bench_configuration(system(tmp_path, "a"), 1, 0, None, is_live=False)["environment"] is None


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["missing.vhd"], "there is no file"),
        (["switches.v"], "'switches.v' is not a legal file name for a VHDL entity"),
        (["entity.vhd"], "'entity.vhd' is not a legal file name"),
        (["Panel.vhd"], "the system already has an entity 'Panel'"),
        (["robot_system_tb.vhd"], "the system already has an entity 'robot_system_tb'"),
    ],
)
def test_an_environment_that_cannot_be(tmp_path: Path, names: list[str], message: str) -> None:
    for name in names:
        if name != "missing.vhd":
            (tmp_path / name).touch()
    with pytest.raises(InputError, match=message):
        environment_files({tmp_path / name: None for name in names}, system(tmp_path, "a"))


def test_an_environment_needs_pins(tmp_path: Path) -> None:
    (tmp_path / "switches.vhd").touch()
    with pytest.raises(InputError, match="has no pins"):
        environment_files({tmp_path / "switches.vhd": None}, system(tmp_path, "a", pins="pins: []"))


def test_files_of_an_environment_stay_in_order(tmp_path: Path) -> None:
    names = ["switch.vhd", "board.vhd"]
    for name in names:
        (tmp_path / name).touch()
    found = environment_files({tmp_path / name: None for name in names}, system(tmp_path, "a"))
    assert [str(name) for name in found] == ["environment/switch.vhd", "environment/board.vhd"]
