"""The `.core` of a system: those in specs/ are what the command writes, and what their authors wrote stays."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.system.boards.board import boards
from fusesoc_firm.system.scaffold.core_file import CoreOptions, new_core, updated_core
from fusesoc_firm.text.diagnostics import InputError
from tests.system.systems import accelerator, converter, derived, instance, specification

SPECS = Path(__file__).resolve().parents[2] / "specs"
CORES = sorted(SPECS.glob("*/*.core"))
# Boards with a network are for systems that are nodes.
NETWORK_BOARDS = {"ecp5_versa", "icebreaker_w5500", "ulx3s_lan8720", "ulx3s_w5500"}
SYNTHESIS = {*(f"synth_{family}" for family in ("xilinx", "ecp5", "ice40", "gowin")), *boards()} - NETWORK_BOARDS
SIMULATION = {"sim", "sim_icarus", "sim_verilator", "sim_nvc", "live", "live_verilator", "live_nvc", "emulate"}


def blocks() -> str:
    return (
        converter("sub", "subscriber", "Point", "acc")
        + instance("acc", "turn", "pub")
        + converter("pub", "publisher", "Point")
    )


def system(folder: Path, kind: str = "VHDL", source: str = "acc.vhd") -> Any:
    return derived(folder, specification(blocks(), accelerator("turn", "Point", "Point", kind, source)))


def content(text: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(text.replace("CAPI=2:", ""))
    return found


def command(core: Path) -> list[str]:
    folders = content(core.read_text())["generate"]["system"]["parameters"].get("paths", [])
    options = [word for folder in folders for word in ("--path", str(core.parent / folder))]
    return ["system", "core", str(core.with_suffix(".yaml")), *options]


def test_there_are_cores() -> None:
    assert len(CORES) >= 8


@pytest.mark.parametrize("core", CORES, ids=lambda path: path.stem)
def test_a_checked_in_core_is_what_the_command_writes(core: Path, tmp_path: Path) -> None:
    text = core.read_text(encoding="utf-8")
    made = tmp_path / core.name
    # Of the targets, nothing is taken over.
    made.write_text(text[: text.index("\ntargets:") + 1], encoding="utf-8")
    assert main([*command(core), "--output", str(made)]) == 0
    assert made.read_text(encoding="utf-8") == text
    assert main([*command(core), "--output", str(made)]) == 0
    assert made.read_text(encoding="utf-8") == text


def test_a_new_core_has_all_that_is_given(tmp_path: Path) -> None:
    options = CoreOptions(
        "me:robots:arm:1.0",
        "An arm",
        ["robot:acc:firm_cordic"],
        "in.bag",
        "says.py",
        ["tb/a.vhd", "tb/b.vhd"],
        ["msg"],
        "noetic",
    )
    found = content(new_core(system(tmp_path), "arm.yaml", options))
    assert (found["name"], found["description"]) == ("me:robots:arm:1.0", "An arm")
    assert found["filesets"]["base"]["depend"] == ["robot:firm:firm_system", "robot:acc:firm_cordic"]
    common = {"spec": "arm.yaml", "paths": ["msg"], "distro": "noetic"}
    assert found["generate"]["system"]["parameters"] == common
    assert found["generate"]["simulation"]["parameters"] == {
        **common,
        "product": "simulation",
        "stimuli": "in.bag",
        "model": "says.py",
        "environment": ["tb/a.vhd", "tb/b.vhd"],
    }


def test_a_core_that_depends_on_the_generators_of_converters_alone_is_refused(tmp_path: Path) -> None:
    core = tmp_path / "robot.core"
    text = new_core(system(tmp_path), "robot.yaml", CoreOptions())
    core.write_text(text.replace("robot:firm:firm_system", "robot:firm:generators"), encoding="utf-8")
    with pytest.raises(
        InputError, match="does not depend on 'robot:firm:firm_system', which provides the generator 'far'"
    ):
        updated_core(system(tmp_path), core)


def test_only_targets_for_tools_have_the_launcher(tmp_path: Path) -> None:
    targets = content(new_core(system(tmp_path), "robot.yaml", CoreOptions()))["targets"]
    assert [name for name, target in targets.items() if "firm_launcher" not in target.get("flags", {})] == ["default"]


def test_a_new_core_without_options_is_whole(tmp_path: Path) -> None:
    found = content(new_core(system(tmp_path), "robot.yaml", CoreOptions()))
    assert found["name"] == "robot:sys:robot:0.1.0"
    assert found["generate"]["simulation"]["parameters"]["stimuli"] == "stimuli.yaml"
    assert set(found["targets"]) == {"default", "lint", *SIMULATION, *SYNTHESIS}
    assert all("description" in target for name, target in found["targets"].items() if name != "default")
    assert found["targets"]["sim"]["generate"] == ["system", "simulation"]


@pytest.mark.parametrize(("has_model", "depend"), [(False, ()), (True, ()), (False, ("robot:acc:firm_python:0.2.0",))])
def test_functions_in_python_are_the_model_unless_there_is_one(
    has_model: bool, depend: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "turn.py").write_text("def turn(m):\n    return {'x': m.y}\n", encoding="utf-8")
    spec = tmp_path / "robot.yaml"
    spec.write_text(specification(blocks(), accelerator("turn", "Point", "Point", "Python", "turn.py")))
    if has_model:
        (tmp_path / "model.py").touch()
    assert main(["system", "core", str(spec), *(word for item in depend for word in ("--depend", item))]) == 0
    found = content((tmp_path / "robot.core").read_text(encoding="utf-8"))
    assert ("model" in found["generate"]["simulation"]["parameters"]) == has_model
    assert found["filesets"]["base"]["depend"][1:] == [*(depend or ("robot:acc:firm_python",))]


def test_a_new_core_is_short_enough_to_be_read(tmp_path: Path) -> None:
    options = CoreOptions(depend=["robot:acc:firm_float"])
    lines = new_core(system(tmp_path), "robot.yaml", options).splitlines()
    # Each further board is one line.
    assert sum("<<: *board" not in line for line in lines) <= 60
    assert sum("<<: *board" in line for line in lines) < len(boards())
    assert max(map(len, lines)) <= 120


def test_targets_of_a_kind_differ_in_what_they_generate(tmp_path: Path) -> None:
    targets = content(new_core(system(tmp_path), "robot.yaml", CoreOptions()))["targets"]
    first, other = targets["ulx3s"], targets["zcu104"]
    assert other == first | {"generate": [{"system": {"board": "zcu104"}}], "toplevel": "robot_zcu104_wrapper"}
    verilator = targets["sim"] | {
        "flags": {"firm_launcher": True, "verilog_host": True},
        "generate": ["system", {"simulation": {"simulator": "verilator"}}],
    }
    assert targets["sim_verilator"] == verilator
    assert targets["synth_gowin"] == targets["synth_xilinx"] | {"flow_options": {"family": "gowin"}}
    assert targets["emulate"]["generate"] == [
        {"system": {"interconnect": "uart", "clock": "10 MHz"}},
        {
            "simulation": {
                "product": "live",
                "simulator": "verilator",
                "interconnect": "uart",
                "clock": "10 MHz",
            }
        },
    ]


def test_words_with_commas_and_quotes_stay_whole(tmp_path: Path) -> None:
    options = CoreOptions(stimuli="a, b.yaml", model="it's {1}.py", paths=["x: y", "#z"])
    parameters = content(new_core(system(tmp_path), "a, b: c.yaml", options))["generate"]["simulation"]["parameters"]
    assert parameters == {
        "spec": "a, b: c.yaml",
        "paths": ["x: y", "#z"],
        "product": "simulation",
        "stimuli": "a, b.yaml",
        "model": "it's {1}.py",
    }


def test_a_bench_has_a_target_for_each_simulator_of_cocotb(tmp_path: Path) -> None:
    found = content(new_core(system(tmp_path), "robot.yaml", CoreOptions(bench="test_robot.py")))
    options = {name: target["flow_options"] for name, target in found["targets"].items() if "cocotb" in name}
    assert options == {
        "test_cocotb": {
            "cocotb_module": "test_robot",
            "tool": "ghdl",
            "sim_options": ["--ieee-asserts=disable-at-0"],
        },
        "test_cocotb_icarus": {
            "cocotb_module": "test_robot",
            "tool": "icarus",
            "iverilog_options": ["-g2012"],
            "frontends": ["ghdlsynth"],
            "ghdlsynth_top": "robot_system",
        },
    }
    assert [name for item in found["filesets"]["cocotb"]["files"] for name in item] == [
        "test_robot.py",
        "robot.yaml",
        "stimuli.yaml",
        "model.py",
    ]


def test_a_system_with_verilog_is_simulated_with_icarus(tmp_path: Path) -> None:
    found = content(new_core(system(tmp_path, "Verilog", "acc.v"), "robot.yaml", CoreOptions()))
    assert found["targets"]["sim"]["generate"] == ["system", {"simulation": {"simulator": "icarus"}}]
    assert found["targets"]["sim_icarus"] == found["targets"]["sim"]


def test_what_is_the_authors_own_stays(tmp_path: Path) -> None:
    path = tmp_path / "robot.core"
    target = "  # The board on my desk.\n  desk:\n    <<: *default\n    flow: vivado\n\n    toplevel: top\n"
    parameters = "\nparameters:\n  x: {paramtype: generic, datatype: int}\n"
    text = new_core(system(tmp_path), "robot.yaml", CoreOptions())
    text = text.replace("description: System robot", "description: Mine  # and this")
    text = text.replace("flow: firm", "flow: sim", 1)
    path.write_text(text.replace("\n  sim_icarus:", f"\n{target}\n  sim_icarus:") + parameters, encoding="utf-8")
    updated = updated_core(system(tmp_path), path)
    path.write_text(updated, encoding="utf-8")
    assert "description: Mine  # and this" in updated
    assert "flow: sim" not in updated
    assert updated.endswith(f"\n\n{target}{parameters}")
    assert set(content(updated)["targets"]) == {"default", "lint", "desk", *SIMULATION, *SYNTHESIS}
    assert updated_core(system(tmp_path), path) == updated


def test_a_target_that_is_no_longer_written_keeps_no_anchor(tmp_path: Path) -> None:
    path = tmp_path / "robot.core"
    text = new_core(system(tmp_path), "robot.yaml", CoreOptions())
    (first,) = re.findall(r"^  (\S+): &board {", text, re.MULTILINE)
    path.write_text(text.replace(f"\n  {first}: &board {{", "\n  desk: &board {"), encoding="utf-8")
    updated = updated_core(system(tmp_path), path)
    found = content(updated)["targets"]
    assert found["desk"] == found[first]
    assert updated.count("&board") == 1


def test_without_a_simulation_there_is_no_target_for_it(tmp_path: Path) -> None:
    path = tmp_path / "robot.core"
    text = new_core(system(tmp_path), "robot.yaml", CoreOptions())
    path.write_text(text[: text.index("  simulation:")] + text[text.index("\ntargets:") :])
    path.write_text(path.read_text()[: path.read_text().index("\ntargets:")])
    assert set(content(updated_core(system(tmp_path), path))["targets"]) == {"default", "lint", *SYNTHESIS}


@pytest.mark.parametrize(
    "text", ["", "CAPI=2:\nname: a:b:c:1\n", "CAPI=2:\ngenerate: {other: {generator: far}}\n", "a: [\n"]
)
def test_another_core_is_left_alone(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.core"
    path.write_text(text)
    with pytest.raises(InputError, match=r"robot\.core( has no section| has no inst|:\d+:\d+: error: invalid YAML)"):
        updated_core(system(tmp_path), path)
