"""The robotic arm in simulation: the system and its netlist against the bit-true model, its cycles, the other ROS."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.core.request import Plain
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify.stimuli import TYPICAL, Stimuli
from tests.applications.applications import SPECS, for_ros2, simulation
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

ARM = SPECS / "robotic_arm"
CORES = ("acc/cordic/cordic", "acc/float64/float64")
SEED = seeded(20240901)
LATENCY = 305
# Fields, their elements, and how far from zero these are: some desired ones have no result.
FIELDS = (("q", 7, 4.0), ("q_d", 7, 16.5), ("o_t_ee", 16, 1.5), ("o_t_ee_d", 16, 4.02))


def numbers(source: random.Random, count: int, reach: float) -> list[float]:
    return [source.uniform(-reach, reach) for _ in range(count)]


def states(count: int) -> list[dict[str, Any]]:
    source = random.Random(SEED)
    return [{"state": {name: numbers(source, size, reach) for name, size, reach in FIELDS}} for _ in range(count)]


def test_the_stimuli_with_stalls(tmp_path: Path) -> None:
    system = simulation(ARM, tmp_path, *CORES)
    assert system.passes(SEED=3, STALL_PERCENT=40)


def test_random_states_and_latency(tmp_path: Path) -> None:
    """Cycles from the state's last beat to the result's first one, those of the converters among them."""
    print(f"seed {SEED}")
    stimuli = tmp_path / "stimuli.yaml"
    stimuli.write_text(yaml.safe_dump(states(6)))
    system = simulation(ARM, tmp_path / "system", *CORES, stimuli=str(stimuli))
    result = system.run(STALL_PERCENT=0)
    assert result.output.splitlines()[-1] == "PASS 6/6"
    found = re.search(r"(\d+) last beat in to first beat out", result.output)
    assert found is not None
    assert int(found[1]) == LATENCY


@pytest.mark.check
def test_ros2(tmp_path: Path) -> None:
    system = simulation(for_ros2("robotic_arm", tmp_path), tmp_path / "system", *CORES)
    assert system.passes(SEED=4)


@pytest.fixture(scope="module")
def accelerator(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("accelerator")
    Library("firm", folder).analyse(core_files(*CORES))
    work = Library("work", folder)
    work.analyse([ARM / "rtl" / f"{name}.vhd" for name in ("panda_pkg", "arm_chain", "robotic_arm")])
    return work


def test_synthesis_makes_no_latch_and_verilog(accelerator: Library) -> None:
    """ghdl 2.0 writes wide constants as strings and shifts signed numbers without their sign."""
    assert accelerator.latches("robotic_arm") == []
    netlist = accelerator.synthesise("robotic_arm", language="verilog")
    assert '"' not in netlist
    assert not re.search(r"\$signed\([^;]*>>[^>]", netlist)


@pytest.mark.check
def test_the_netlist_answers_alike(tmp_path: Path) -> None:
    """Of the first states of the stimuli, which hold all kinds: a netlist is slow."""
    stimuli = yaml.safe_load((ARM / "stimuli.yaml").read_text())
    (tmp_path / "stimuli.yaml").write_text(yaml.safe_dump(stimuli[3:5] + stimuli[-1:]))
    system = simulation(ARM, tmp_path / "system", *CORES, stimuli=str(tmp_path / "stimuli.yaml"))
    system.work.replace_by_netlist("arm_chain")
    system.work.analyse([system.folder / "robotic_arm/rtl/robotic_arm.vhd", system.folder / f"{system.entity}.vhd"])
    system.work.analyse([system.folder / f"{system.entity}_tb.vhd"])
    assert system.passes(SEED=5, STALL_PERCENT=10)


def test_the_state_as_franka_ros_publishes_it(tmp_path: Path) -> None:
    """The same answers to franka_msgs/FrankaState: our states within messages whose other fields are at random."""
    print(f"seed {SEED}")
    name = MessageName("franka_msgs", "FrankaState")
    closure = MessageLibrary(ROS1, [ARM / "franka_msgs"]).closure(name)
    draw = Stimuli(closure, ROS1, random.Random(SEED))
    messages = []
    for stimulus in states(6):
        state = stimulus["state"]
        ours = {"q": state["q"], "q_d": state["q_d"], "O_T_EE": state["o_t_ee"], "O_T_EE_d": state["o_t_ee_d"]}
        messages.append({"state": draw.message(name, TYPICAL) | ours})
    stimuli = tmp_path / "stimuli.yaml"
    stimuli.write_text(yaml.safe_dump(messages))
    changes: dict[str, Plain] = {"spec": "robotic_arm_franka.yaml", "paths": ["msg", "franka_msgs"]}
    system = simulation(ARM, tmp_path / "system", *CORES, stimuli=str(stimuli), **changes)
    assert system.passes(SEED=7)
