"""Generated systems in simulation with the real host: every byte against a model, with stalls and without."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.diagnostics import InputError
from tests.sim.frames import traffic
from tests.sim.ghdl import CORES, REPOSITORY, GhdlError, Library
from tests.sim.systems import DATA, RUNTIME, GeneratedSystem, build, request

SEED = 20240601
# The longest frame of geometry_msgs/Vector3 and Point in ROS 1: id, length, three float64.
VECTOR_BEATS = 5 + 24

Message = dict[str, Any]


def write_stimuli(path: Path, messages: list[tuple[str, Message]]) -> Path:
    path.write_text(yaml.safe_dump([{block: message} for block, message in messages]), encoding="utf-8")
    return path


def numbers(source: random.Random, *names: str) -> Message:
    return {name: source.choice([source.uniform(-1e3, 1e3), source.gauss(0, 1), 0.0]) for name in names}


def vectors(block: str, count: int) -> list[tuple[str, Message]]:
    source = random.Random(SEED)
    return [(block, numbers(source, "x", "y", "z")) for _ in range(count)]


def many(count: int) -> Iterator[tuple[str, Message]]:
    """Points and vectors in turn, since an accelerator waits for both; poses in between."""
    source = random.Random(SEED)
    for number in range(count):
        pair = [("point_sub", numbers(source, "x", "y", "z")), ("vector_sub", numbers(source, "x", "y", "z"))]
        yield from pair if number % 3 else reversed(pair)
        if source.random() < 0.5:
            pose = {"position": numbers(source, "x", "y", "z"), "orientation": numbers(source, "x", "y", "z", "w")}
            yield "pose_sub", pose


def in_version(spec: Path, version: str, folder: Path) -> Path:
    """A copy of a specification for another version of ROS, beside copies of its accelerators."""
    folder.mkdir()
    for source in DATA.glob("*.vhd"):
        (folder / source.name).write_bytes(source.read_bytes())
    copied = folder / spec.name
    copied.write_text(spec.read_text(encoding="utf-8").replace("ROS1", version), encoding="utf-8")
    return copied


# --- several converters and accelerators ---------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["ROS1", "ROS2"])
def system(request_: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> GeneratedSystem:
    folder = tmp_path_factory.mktemp("many")
    spec = in_version(DATA / "many.yaml", request_.param, folder / "spec")
    stimuli = write_stimuli(folder / "stimuli.yaml", list(many(25)))
    return build(request(spec, stimuli, DATA / "many_model.py"), folder / "work")
