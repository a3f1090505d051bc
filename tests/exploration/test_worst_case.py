"""Bounds on the time of messages: by hand, against the slowest that a search finds, and in simulated demo systems."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import chdir
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.exploration.worst_case import worst_times
from fusesoc_firm.system.derived.timing import responses_of
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import LoadedSystem
from tests.applications.applications import SPECS
from tests.exploration.topic_systems import accelerator, converter, loaded, random_system, ratios
from tests.seeds import seeded

Captured = pytest.CaptureFixture[str]
SEED = seeded(71)
# The bound for the frame of a point, of 8 beats of 32 bits, under round robin.
RESPONSE = 2 + 8
# Of the accelerators of demo systems in VHDL: the most cycles to an answer, and those between messages for one that
# takes a message before its answer has left. The frames of robotic_arm_franka have strings of some length.
PACES = {
    "mobile_robot": {"latency": 9958},
    "robotic_arm": {"latency": 302, "interval": 304},
    "robotic_arm_franka": {"latency": 302, "interval": 304},
    "obstacle": {"latency": 4},
    "quat2euler_python": {},
}
# Dividers and roots need most cycles for subnormal numbers.
SMALL = ("5.0e-324", "1.0e-310", "2.2e-308", "1.0e-300", "3.0e-162", "1.0e-160", "0.0", "1.0", "1.0e-155")


def pipeline(folder: Path, fabric: str, **reader: Any) -> LoadedSystem:
    """Two accelerators, with a topic between."""
    point = "geometry_msgs/Point"
    types, made = zip(accelerator("first", point, point, 10), accelerator("second", point, point, 20), strict=True)
    blocks = [
        converter("start", "subscriber", point, outgoing=[{"name": "first"}]),
        made[0],
        converter("first_out", "publisher", point, topic="between", deliver="fabric"),
        converter("second_in", "subscriber", point, topic="between", outgoing=[{"name": "second"}], **reader),
        made[1],
        converter("second_out", "publisher", point),
    ]
    return loaded({"fabric": fabric, "width": 32}, list(types), blocks, folder)


def cycles(system: LoadedSystem) -> dict[tuple[str, str], int | None]:
    return {(item.source, item.sink): item.cycles for item in worst_times(system)}


def test_the_bound_of_a_pipeline(tmp_path: Path) -> None:
    """A message has 6 beats in the exchange, and one is at each of the accelerators and at each end of the exchange."""
    response = RESPONSE
    assert responses_of(pipeline(tmp_path, "wires").system) == {"second_out": response}
    # The second accelerator needs its 20 cycles, its answer leaves, and it takes two cycles to release its message.
    second = 20 + (1 + response)
    assert cycles(pipeline(tmp_path, "wires")) == {
        ("first_out", "second_in"): 0,
        ("start", "second_out"): 1 + 10 + second,
    }
    # A message of 6 beats waits in the publisher for the one before, which waits for the reader's accelerator.
    found = cycles(pipeline(tmp_path, "crossbar"))
    busy = second + 2
    assert found["first_out", "second_in"] == (busy + 6) - 1 + (1 + busy + 6) + 1
    # The publisher may be busy with the message that was before this one at the subscriber, 6 beats ago.
    assert found["start", "second_out"] == (busy + 6) - 6 + (1 + busy + 6) + 1 + second


def test_a_queue_and_a_drop(tmp_path: Path) -> None:
    """Each message in a queue waits for its turn; the one that finds it full is in time, if it is not dropped."""
    # The next message is offered in the cycle after the one before is taken.
    busy = 20 + (1 + RESPONSE) + 2 + 1
    assert (
        cycles(pipeline(tmp_path, "wires", queue=3))["start", "second_out"]
        == busy - 6 + 2 * busy + 1 + 20 + 1 + RESPONSE
    )
    dropping = pipeline(tmp_path, "wires", queue=3, overflow="drop_oldest")
    assert cycles(dropping)["start", "second_out"] == (1 + 10) + 2 * busy + 1 + 20 + 1 + RESPONSE


def test_reasons(tmp_path: Path) -> None:
    system = pipeline(tmp_path, "wires")
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8")

    def reason(old: str, new: str) -> str:
        assert old in text
        (tmp_path / "robot.yaml").write_text(text.replace(old, new), encoding="utf-8")
        return worst_times(load_beside(tmp_path / "robot.yaml"))[-1].reason

    assert worst_times(system)[-1].reason == ""
    assert reason("  latency: 20\n", "") == "'second_type' has no 'latency'"
    assert reason("  latency: 20\n", "  latency: 20\n  interval: 5\n") == "'second_type' has several messages at a time"
    assert (
        reason(
            "message: geometry_msgs/Point\n  topic: between\n  deliver: fabric",
            "message: geometry_msgs/Point\n  topic: between\n  deliver: both",
        )
        == ""
    )


@pytest.mark.parametrize(
    ("overflow", "reason"),
    [("block", "messages wait for each other at 'total_in_queue'"), ("drop_oldest", "messages return to 'sum'")],
)
def test_messages_that_return_have_no_bound(tmp_path: Path, overflow: str, reason: str) -> None:
    point = "geometry_msgs/Point"
    type_, block = accelerator("sum", point, point, 3)
    type_["interface"]["input"] *= 2
    blocks = [
        converter("raw", "subscriber", point, outgoing=[{"name": "sum"}]),
        block,
        converter("sum_out", "publisher", point, topic="total"),
        converter(
            "total_in", "subscriber", point, topic="total", queue=2, overflow=overflow, outgoing=[{"name": "sum"}]
        ),
    ]
    (found,) = [item for item in worst_times(loaded({}, [type_], blocks, tmp_path)) if not item.topic]
    assert (found.cycles, found.reason) == (None, reason)


def test_it_is_shown(tmp_path: Path, capsys: Captured) -> None:
    pipeline(tmp_path, "crossbar")
    with chdir(tmp_path):
        assert main(["fabric", "show", "robot.yaml"]) == 0
        shown = capsys.readouterr().out
        assert re.search(r"^first_out +second_in +/between +\d+$", shown, re.MULTILINE), shown
        assert main(["fabric", "show", "robot.yaml", "--json"]) == 0
        times = json.loads(capsys.readouterr().out)["worstCase"]
    assert [(item["from"], item["to"]) for item in times] == [("first_out", "second_in"), ("start", "second_out")]


@pytest.mark.parametrize("number", range(4))
def test_random_exchanges(number: int, tmp_path: Path) -> None:
    system = random_system(Random(f"{SEED} {number}"), tmp_path)
    assert min(ratios(system, SEED + number, 20, 600)) >= 1


@pytest.mark.thorough
def test_two_hundred_random_systems(tmp_path: Path) -> None:
    """Never below the slowest found message, and near to it."""
    found = []
    for number in range(200):
        system = random_system(Random(f"{SEED} {number}"), tmp_path)
        found += ratios(system, SEED + number, 100, 2000)
    print(f"{len(found)} messages, median {median(found):.3f}, greatest {max(found):.2f}")
    assert median(found) <= 1.3


@pytest.mark.thorough
@pytest.mark.parametrize("name", PACES)
def test_a_demo_system(name: str, tmp_path: Path) -> None:
    """In a simulation with as many messages as it takes, none is slower, and the slowest one is near to the bound."""
    folder = name.removesuffix("_python").removesuffix("_franka")
    shutil.copytree(SPECS / folder, tmp_path / folder)
    path = tmp_path / folder / f"{name}.yaml"
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    content["accelerators"][0] |= PACES[name]
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    if name == "quat2euler_python":
        chance = Random(SEED)
        rows = [", ".join(f"{axis}: {chance.choice(SMALL)}" for axis in "wxyz") for _ in range(100)]
        stimuli = "".join(f"- QuaternionToEuler_sub: {{{row}}}\n" for row in rows)
        (path.parent / "stimuli_python.yaml").write_text(stimuli, encoding="utf-8")
    system = load_beside(path)
    (bound,) = worst_times(system)
    assert bound.cycles, bound.reason
    with chdir(path.parent):
        assert main(["sim", path.name, "--tool", "ghdl", "--options=-gSTALL_PERCENT=0"]) == 0
    (log,) = (tmp_path / folder / "build").glob("*/sim.log")
    first_beats = re.findall(r"last beat out, (\d+) last beat in to first beat out", log.read_text(encoding="utf-8"))
    (times,) = system.system.scheduling.times
    assert times.transfer_time
    # A frame leaves without a pause.
    slowest = max(map(int, first_beats)) + times.transfer_time - 1
    print(f"{name}: bound {bound.cycles}, slowest {slowest}, ratio {bound.cycles / slowest:.3f}")
    assert slowest <= bound.cycles


def test_the_exchange_of_the_perception_demo(tmp_path: Path) -> None:
    shutil.copytree(SPECS / "perception", tmp_path / "perception")
    path = tmp_path / "perception" / "perception.yaml"
    text = path.read_text(encoding="utf-8").replace("fabric: wires", "fabric: mesh, scheduler: round_robin")
    path.write_text(text, encoding="utf-8")
    found = ratios(load_beside(path), SEED, 10, 3000)
    print(f"median {median(found):.3f}")
    assert min(found) >= 1
