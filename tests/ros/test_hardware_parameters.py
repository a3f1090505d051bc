"""Parameters of accelerators as parameters of nodes in real ROS: they change the answers of simulated hardware."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from tests.ros.live_nodes import LiveNode
from tests.ros.places import Place, running, versions
from tests.system.simulated.test_parameters import specification

pytestmark = pytest.mark.check
PEER = Path(__file__).with_name("parameter_peer.py")


@pytest.fixture(scope="module", params=versions("hardware_parameters"))
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    with running(request, tmp_path_factory) as (ros, folder):
        yield Place(ros, folder)


@pytest.fixture(scope="module")
def spec(place: Place) -> Path:
    path = specification(place.folder)
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


def steps(place: Place, *wanted: tuple[Any, ...]) -> list[Any]:
    command = [place.ros.python, str(PEER), str(place.version), "/tuning", json.dumps(wanted)]
    done = subprocess.run(command, env=dict(place.ros.environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found: list[Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("is_generated", [False, True], ids=["live", "generated"])
def test_a_parameter_changes_the_answers(place: Place, spec: Path, is_generated: bool) -> None:
    command = ["live", str(spec)]
    if is_generated:
        assert main(["system", "node", str(spec), "--language", "python", "-o", str(place.folder / "package")]) == 0
        (script,) = (place.folder / "package").rglob("*_node.py")
        command = [str(script)]
    command += ["--transport", place.simulator(spec)]
    # The master of ROS 1 keeps the values of a node that has ended.
    values = first_values(place, gain=3, offset=0.0, invert=False)
    with LiveNode(place.ros, place.folder / "node.log", command, *values) as node:
        node.wait_until_ready()
        found = steps(
            place,
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


def test_a_first_value_outside_of_the_range_ends_the_node(place: Place, spec: Path) -> None:
    command = ["live", str(spec), "--transport", place.simulator(spec)]
    with LiveNode(place.ros, place.folder / "node.log", command, *first_values(place, gain=101)) as node:
        assert node.process.wait(60) == 1
        assert "the parameter 'block.gain' cannot be set: 101 is outside of the range; legal: -4 to 100" in node.said()
