"""The exploration of operators and numbers: points, the front, errors, files, and measurements."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.exploration import placement
from fusesoc_firm.exploration.accuracy import accuracy, calls_of
from fusesoc_firm.exploration.points import Point, explored
from fusesoc_firm.exploration.resources import Tell
from fusesoc_firm.message.bag_reader import Form
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.bags.writer import RecordedTopic, write_bag
from fusesoc_firm.runs.simulation.software_run import system_stimuli
from fusesoc_firm.system.message_sources import load_beside
from tests.exploration.projects import loaded, project

Captured = pytest.CaptureFixture[str]
SUM = """
class Sum:
    def __init__(self):
        self.total = 0.0

    def __call__(self, message):
        self.total += message.x * 0.1
        if message.y > 16777216.0:
            return None
        return {"data": self.total / message.z}


pid = Sum()
"""


FLOAT32 = """
import numpy as np


class Sum:
    def __init__(self):
        self.total = np.float32(0.0)

    def __call__(self, message):
        self.total += message.range
        return {"data": self.total}


filter_range = Sum()
"""


def points(spec: Path, *numbers: str) -> list[Point]:
    system, type_ = loaded(spec)
    return explored(type_, system.folder, numbers, lambda _: None)


def out(capsys: Captured, *arguments: str) -> str:
    capsys.readouterr()
    assert main(["accelerator", "explore", *arguments]) == 0
    return capsys.readouterr().out


def stimuli(spec: Path, messages: Sequence[Mapping[str, float]]) -> None:
    text = "".join(f"- sub: {json.dumps(message)}\n" for message in messages)
    (spec.parent / "stimuli.yaml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize("name", ["pid", "filter_range", "nearest"])
def test_no_point_beats_one_of_the_front(name: str, tmp_path: Path) -> None:
    found = points(project(tmp_path, name), "float32", "float64")
    assert sum(item.is_current for item in found) == 1
    assert {item.numbers for item in found if item.is_front} == {"float32", "float64"}
    for item in found:
        better = [
            other
            for other in found
            if other.costs != item.costs and all(a <= b for a, b in zip(other.costs, item.costs, strict=True))
        ]
        assert item.is_front == (not better)
    keys = [(item.numbers, *sorted(item.operators.items())) for item in found]
    assert len({*keys}) == len(keys)


def test_the_point_of_the_specification_is_marked(tmp_path: Path) -> None:
    spec = project(tmp_path, "filter_range")
    keys = "type: Python\n    numbers: float64\n    resources: {multiply: 2}"
    spec.write_text(spec.read_text(encoding="utf-8").replace("type: Python", keys))
    (current,) = [item for item in points(spec, "float32", "float64") if item.is_current]
    assert (current.numbers, current.operators["multiply"]) == ("float64", 2)


def test_a_limit_that_cannot_be_met_leaves_the_other_points(tmp_path: Path) -> None:
    spec = project(tmp_path, "pid")
    spec.write_text(spec.read_text(encoding="utf-8").replace("type: Python", "type: Python\n    latency: 3"))
    assert not any(item.is_current for item in points(spec, "float64"))


def test_a_function_without_floats_has_any_numbers(tmp_path: Path) -> None:
    spec = project(
        tmp_path, "nearest", "def nearest(m):\n    n = 0\n    for r in m.ranges:\n        n += 1\n    return {}\n"
    )
    (found,) = points(spec, "float32", "float64")
    assert (found.numbers, found.is_front, found.is_current) == ("any", True, True)


def test_a_type_that_a_function_excludes_is_told(tmp_path: Path, capsys: Captured) -> None:
    """A state with a type of its own cannot be a float64."""
    spec = project(tmp_path, "filter_range", FLOAT32)
    text = out(capsys, str(spec))
    assert "\nfloat64 is not possible:\n" in text
    assert "'filter_range.total' is a float32 and a float64" in text
    data = json.loads(out(capsys, str(spec), "--json"))
    assert {item["numbers"] for item in data["points"]} == {"float32"}
    assert [*data["notPossible"]] == ["float64"]
    assert main(["accelerator", "explore", str(spec), "--numbers", "float64"]) == 1


def test_fields_of_several_types_are_a_point_of_their_own(tmp_path: Path) -> None:
    spec = project(
        tmp_path, "pid", "def pid(m):\n    return {'data': m.resolution * m.resolution + m.origin.position.x}\n"
    )
    text = spec.read_text(encoding="utf-8").replace("geometry_msgs/Point", "nav_msgs/MapMetaData")
    spec.write_text(text)
    found = points(spec, "float32", "float64")
    assert {item.numbers for item in found} == {"float32", "fields", "float64"}
    (current,) = [item for item in found if item.is_current]
    assert current.numbers == "fields"
    spec.write_text(text.replace("type: Python", "type: Python\n    numbers: float32"))
    assert {item.numbers for item in points(spec, "float32", "float64")} == {"float32", "float64"}


def test_many_operators_are_tried_in_powers_of_two(tmp_path: Path) -> None:
    text = "def pid(m):\n    return {'data': SUM}\n"
    products = " + ".join(f"(m.x * {n}.5 + m.y / {n}.7) * (m.z - {n}.0)" for n in range(3, 23))
    found = points(project(tmp_path, "pid", text.replace("SUM", products)), "float64")
    assert {item.operators["multiply"] for item in found} == {1, 2, 4, 8, 16}
    assert 20 < len(found) <= 200


def test_errors_are_those_of_numpy(tmp_path: Path) -> None:
    spec = project(tmp_path, "pid", SUM)
    sent = [{"x": 1.0, "y": 0.0, "z": 1.0}, {"x": 7.0, "y": 16777217.0, "z": 3.0}, {"x": 0.3, "y": 1.0, "z": 7.0}]
    stimuli(spec, sent)
    system, type_ = loaded(spec)
    calls = calls_of(system.system, type_, system.folder, system_stimuli(spec.parent / "stimuli.yaml", system))
    found = accuracy(type_, system.folder, calls, "float32")
    narrow, wide = np.float32(0.0), 0.0
    errors = []
    for item in sent:
        narrow, wide = narrow + np.float32(item["x"]) * np.float32(0.1), wide + item["x"] * 0.1
        wanted = wide / item["z"]
        errors.append((abs(float(narrow / np.float32(item["z"])) - wanted), abs(wanted)))
    del errors[1]
    assert found.absolute.error == max(error for error, _ in errors) > 0
    assert found.relative.error == max(error / wanted for error, wanted in errors)
    assert (found.calls, found.missing, found.absolute.field) == (3, 1, "data")
    assert accuracy(type_, system.folder, calls, "float64").absolute.error == 0


@pytest.mark.parametrize(("x", "z", "error"), [(1e300, 1.0, math.inf), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_infinite_numbers_and_nan(x: float, z: float, error: float, tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "pid", SUM)
    stimuli(spec, [{"x": x, "y": 0.0, "z": z}])
    found: dict[str, Any] = json.loads(out(capsys, str(spec), "--json"))
    assert float(found["errors"]["float32"]["absolute"]["error"]) == error


def test_the_messages_of_a_bag_take_another_topic(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = project(tmp_path, "pid", SUM)
    system, _ = loaded(spec)
    subscriber = system.system.subscribers[0]
    (library,) = [item for ros, item in system.libraries.items() if ros == subscriber.frame.ros]
    recorded = RecordedTopic.of("/arm/error", library.closure(parse_name("geometry_msgs/Point")))
    payload = system_stimuli(spec.parent / "stimuli.yaml", system)[0].payload
    with write_bag(tmp_path / "arm.mcap", Form.MCAP, [recorded]) as bag:
        for stamp in range(5):
            bag.write(recorded, stamp, payload)
    monkeypatch.chdir(tmp_path)
    text = out(capsys, str(spec), "--bag", "arm.mcap", "--topic", "/arm/error")
    assert "float32 against float64, 5 messages of arm.mcap:" in text
    assert main(["accelerator", "explore", str(spec), "--topic", "/arm/error"]) == 1


def test_a_table_is_the_same_in_each_run_and_has_100_columns(tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "filter_range")
    text = out(capsys, str(spec))
    assert text == out(capsys, str(spec))
    assert max(map(len, text.splitlines())) <= 100
    rows = [line.split() for line in text.splitlines() if "float32 " in line or "float64 " in line]
    assert len([row for row in rows if row[0] in ("float32", "float64", "*", "*=")]) >= 14


def test_a_picture_has_a_circle_for_each_point(tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "pid")
    out(capsys, str(spec), "--svg", str(tmp_path / "p.svg"), "--numbers", "float64")
    root = ET.parse(tmp_path / "p.svg").getroot()
    circles = root.findall(".//{*}circle")
    assert len(circles) == len(points(spec, "float64"))
    assert sum(item.get("r") == "5" for item in circles) == sum(item.is_front for item in points(spec, "float64"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--numbers", "float16"], "--numbers cannot be 'float16'"),
        (["--svg", "points.png"], "cannot write points.png: unknown file extension"),
        (["--topic", "/x"], "--topic names a topic of a bag"),
        (["--stimuli", "missing.yaml"], "the stimuli missing.yaml do not exist"),
    ],
)
def test_wrong_options_are_refused(words: list[str], message: str, tmp_path: Path, capsys: Captured) -> None:
    assert main(["accelerator", "explore", str(project(tmp_path, "pid")), *words]) == 1
    assert f"error: {message}\n" in capsys.readouterr().err


def test_without_stimuli_there_is_no_error(tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "pid")
    (spec.parent / "stimuli.yaml").unlink()
    assert out(capsys, str(spec)).endswith("no error: there are no stimuli\n")
    assert out(capsys, str(spec), "--numbers", "float64").endswith("no error: only float64 is explored\n")


def test_measurements_are_beside_estimates(tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    async def placed(netlist: Path, top: str, yosys: Path, tell: Tell) -> dict[str, Any]:
        assert netlist.read_text(encoding="utf-8")
        await tell({"step": "cells"})
        blocks = [
            {"name": "add", "lut": 600, "ff": 400, "dsp": 4},
            {"name": "between blocks", "lut": 77, "ff": 1, "dsp": 0},
        ]
        return {"blocks": blocks, "clocks": {"clk": 123.4}, "missing": ""}

    async def translated(request: Path) -> None:
        (request.parent / "kernel.v").write_text(request.read_text(encoding="utf-8"))

    monkeypatch.setattr(placement, "resources_of_netlist", placed)
    monkeypatch.setattr(placement, "translated", translated)
    monkeypatch.setattr(placement, "yosys_program", lambda: Path("yosys"))
    spec = project(tmp_path, "pid")
    text = out(capsys, str(spec), "--place", "--numbers", "float64")
    assert [line.split()[-3:] for line in text.splitlines() if line.startswith("*")] == [["677", "401", "123"]]
    found = json.loads(out(capsys, str(spec), "--place", "--json", "--numbers", "float64"))
    measured = [item["measured"] for item in found["points"] if item["front"]]
    assert measured == [{"lut": 677, "ff": 401, "dsp": 4, "mhz": 123.4}]


@pytest.mark.check
def test_a_small_function_is_placed(tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "pid", "def pid(m):\n    return {'data': m.x if m.x < m.y else m.y}\n")
    found = json.loads(out(capsys, str(spec), "--place", "--json", "--numbers", "float64"))
    (point,) = found["points"]
    assert 0.5 < point["estimate"]["lut"] / point["measured"]["lut"] < 2
    assert abs(point["estimate"]["ff"] - point["measured"]["ff"]) < 40


CHAIN = """
project: {name: chain}
accelerators:
  - {name: half, type: Python, sources: f.py, interface: {input: [POINT], output: [POINT]}}
  - {name: sum_up, type: Python, sources: f.py, interface: {input: [POINT, POINT], output: [POINT, POINT]}}
blocks:
  - {name: one, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: half_it}]}
  - {name: two, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: sum_up}]}
  - {name: half_it, type: half, outgoing: [{name: sum_up}]}
  - {name: sum_up, type: sum_up, outgoing: [{name: out}, {name: other}]}
  - {name: out, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}
  - {name: other, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}
""".replace("POINT", "{middleware: ROS2, message: geometry_msgs/Point}")


def test_messages_pass_other_accelerators_in_python(tmp_path: Path) -> None:
    spec = tmp_path / "chain.yaml"
    spec.write_text(CHAIN, encoding="utf-8")
    text = "def half(m):\n    return {'x': m.x / 2}\n\n\ndef sum_up(one, two):\n"
    (tmp_path / "f.py").write_text(text + "    return {'x': one.x + two.x}, None if one.x > two.x else {'y': two.x}\n")
    lines = ["one: {x: 2.2}", "one: {x: 40.4}", "two: {x: 0.1}", "two: {x: 1.0e-9}", "two: {x: 7.0}"]
    (tmp_path / "stimuli.yaml").write_text("".join(f"- {line}\n" for line in lines), encoding="utf-8")
    system = load_beside(spec)
    (type_,) = {item.own for item in system.system.accelerator_types if item.accelerator.name == "sum_up"}
    calls = calls_of(system.system, type_, tmp_path, system_stimuli(tmp_path / "stimuli.yaml", system))
    ((first, second),) = calls
    inputs = [[message["x"] for message in call] for call in (first, second)]
    assert sorted(map(sorted, inputs)) == [[1.0e-9, 20.2], [0.1, 1.1]]
    found = accuracy(type_, tmp_path, calls, "float32")
    errors = [abs(float(np.float32(one) + np.float32(two)) - (one + two)) for one, two in inputs]
    errors += [abs(float(np.float32(two)) - two) for one, two in inputs if one <= two]
    assert (found.calls, found.missing, found.absolute.error) == (2, 0, max(errors))
