"""Parameters of accelerators as parameters of nodes in real ROS: they change the answers of simulated hardware."""

from __future__ import annotations

import json
import logging
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from tests.ros.cpp_nodes import Node, NodeProcess
from tests.ros.live_nodes import LiveNode
from tests.ros.places import Place, log_of, running, versions
from tests.system.simulated.test_parameters import specification

pytestmark = pytest.mark.check
PEER = Path(__file__).with_name("parameter_peer.py")


@pytest.fixture(scope="module", params=versions("hardware_parameters"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


@pytest.fixture(scope="module")
def spec(place: Place) -> Path:
    return written(place, place.folder)


@pytest.fixture(scope="module")
def own_spec(place: Place) -> Path:
    """A system whose name no other node on the computer has, as `firm status` finds nodes by their names."""
    folder = place.folder / "own"
    folder.mkdir()
    path = written(place, folder).rename(folder / "own.yaml")
    path.write_text(path.read_text().replace("name: tuning", f"name: {own_name()}"))
    return path


def own_name() -> str:
    return f"tuning_{os.getpid()}"


def written(place: Place, folder: Path) -> Path:
    path = specification(folder)
    if place.version == 1:
        path.write_text(path.read_text().replace("middleware: ROS2", "middleware: ROS"))
    return path


def first_values(place: Place, **values: object) -> list[str]:
    """The arguments of a node with first values of its parameters of the block."""
    if place.version == 1:
        return [f"_block/{name}:={json.dumps(value)}" for name, value in values.items()]
    return [
        "--ros-args",
        *(word for name, value in values.items() for word in ("-p", f"block.{name}:={json.dumps(value)}")),
    ]


def steps(place: Place, node: str, *wanted: tuple[Any, ...]) -> list[Any]:
    command = [place.ros.python, str(PEER), str(place.version), node, json.dumps(wanted)]
    done = subprocess.run(command, env=dict(place.ros.environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found: list[Any] = json.loads(done.stdout)
    return found


def started(place: Place, spec: Path, language: str, values: list[str]) -> NodeProcess:
    """A node of the system: that of `firm live`, or a generated one."""
    transport = place.simulator(spec)
    if language == "cpp":
        return Node(place.ros, place.program(spec), transport, *values)
    command = ["live", str(spec)]
    if language == "python":
        package = place.folder / f"{spec.stem}_python_package"
        assert main(["system", "node", str(spec), "--language", "python", "-o", str(package)]) == 0
        command = [str(next(package.rglob("*_node.py")))]
    return LiveNode(place.ros, place.folder / "node.log", [*command, "--transport", transport], *values)


LANGUAGES = pytest.mark.parametrize("language", ["live", "python", "cpp"])


@LANGUAGES
def test_a_parameter_changes_the_answers(place: Place, spec: Path, language: str) -> None:
    # The master of ROS 1 keeps the values of a node that has ended.
    values = first_values(place, gain=3, offset=0.0, invert=False)
    with started(place, spec, language, values):
        name = "/tuning_node" if language == "cpp" else "/tuning"
        found = steps(
            place,
            name,
            ("get", "block.gain"),
            ("ask", 5),
            ("set", "block.gain", -4),
            ("ask", 5),
            ("set", "block.gain", 101),
            ("get", "block.gain"),
            ("ask", 6),
            ("set", "block.invert", True),
            ("ask", 6),
            ("set", "block.offset", 1.0),
            ("get", "block.offset"),
            ("set", "block.invert", False),
            ("ask", 1),
        )
        assert found[:4] == [3, 15, "", -20]
        assert found[4], "a value outside of the range is refused"
        assert found[5:] == [-4, -24, "", 23, "", 1.0, "", 0x3F800000 - 4]


@pytest.mark.parametrize("language", ["live", "cpp"])
def test_clients_of_ros_2_find_the_parameters(place: Place, spec: Path, language: str) -> None:
    if place.version == 1:
        pytest.skip("the master of ROS 1 knows only values")
    boolean, integer, real = 1, 2, 3
    with started(place, spec, language, first_values(place, gain=2)):
        found = steps(
            place,
            "/tuning_node" if language == "cpp" else "/tuning",
            ("list", "block"),
            ("describe", "block.gain"),
            ("describe", "block.offset"),
            ("describe", "block.invert"),
            ("set_all", {"block.gain": 5, "block.invert": True}),
            ("ask", 1),
            ("set_all", {"block.gain": 6, "block.offset": -2.0}),
            ("get", "block.gain"),
            ("set", "block.gain", 1.0),
            ("set", "block.offset", 0.25),
            ("get", "block.offset"),
        )
    assert sorted(found[0]) == ["block.gain", "block.invert", "block.offset"]
    assert found[1] == ["block.gain", integer, integer, [[-4, 100]]]
    assert found[2] == ["block.offset", real, real, [[-1.5, 1e10]]]
    assert found[3] == ["block.invert", boolean, boolean, []]
    assert found[4:6] == ["", -6]
    assert found[6] and found[8], "a value outside of the range, and one of another type, are refused"
    assert (found[7], found[9], found[10]) == (5, "", 0.25)


@LANGUAGES
def test_clients_of_ros_2_see_each_change(place: Place, spec: Path, language: str) -> None:
    if place.version == 1:
        pytest.skip("the master of ROS 1 has no events")
    with started(place, spec, language, first_values(place, gain=2)):
        found = steps(
            place,
            "/tuning_node" if language == "cpp" else "/tuning",
            ("set", "block.gain", -4),
            ("event",),
            ("set", "block.gain", 101),
            ("set", "block.offset", 0.25),
            ("event",),
            ("set_all", {"block.gain": 5, "block.invert": True}),
            ("event",),
        )
    assert found[1] == [{}, {"block.gain": -4}, {}]
    assert found[2], "a refused value"
    assert found[4] == [{}, {"block.offset": 0.25}, {}]
    assert found[6] == [{}, {"block.gain": 5, "block.invert": True}, {}]


@LANGUAGES
def test_a_first_value_outside_of_the_range_ends_the_node(place: Place, spec: Path, language: str) -> None:
    with started(place, spec, language, first_values(place, gain=101)) as node:
        assert node.process.wait(60) == 1
        assert "the parameter 'block.gain' cannot be set: 101 is outside of the range; legal: -4 to 100" in node.said()


@LANGUAGES
def test_a_refused_value_is_a_warning_in_the_log(place: Place, spec: Path, language: str) -> None:
    with started(place, spec, language, first_values(place, gain=2)) as node, log_of(place.ros) as peer:
        name = "/tuning_node" if language == "cpp" else "/tuning"
        assert steps(place, name, ("set", "block.gain", 101))[0]
        line = peer.wait_for(" is not set: ")
        assert line["level"] == logging.WARNING and "gain" in line["text"]
        assert node.said().count(line["text"]) == 1


@LANGUAGES
def test_firm_status_shows_the_values_in_effect(
    place: Place, own_spec: Path, language: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with started(place, own_spec, language, first_values(place, gain=2, offset=0.25, invert=True)) as node:
        name = f"/{own_name()}_node" if language == "cpp" else f"/{own_name()}"
        assert steps(place, name, ("set", "block.gain", -4)) == [""]
        for words in ([], ["--system", str(own_spec)]):
            capsys.readouterr()
            assert main(["status", f"node:{own_name()}", "--json", *words]) == 0, node.said()
            found = json.loads(capsys.readouterr().out)["parameters"]
            assert [(item["name"], item["value"], item["range"]) for item in found] == [
                ("block.gain", -4, [-4, 100]),
                ("block.offset", 0.25, [-1.5, 1e10]),
                ("block.invert", True, [0, 1]),
            ]
