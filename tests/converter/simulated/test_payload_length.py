"""Computed lengths in simulation: what rosbags serialises is as long as the hardware says, for every message."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.converter.payload_length import (
    LENGTH_TEMPLATE,
    length_entity,
    length_ports,
    payload_length_configuration,
)
from fusesoc_firm.frame.length import Repeat, sent_length_of
from fusesoc_firm.frame.model import Data, DataKind, Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.frame.values import part_of, units_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import KINDS, Stimuli
from fusesoc_firm.text.render import render
from tests.frame.oracle import Oracle
from tests.hdl.ghdl import Library
from tests.seeds import seeded

SEED = seeded(20240611)
VALUES_OF_A_KIND = 8

PACKAGE = "length_msgs"
_MESSAGES = {
    "Mixed": "float64 x\nuint8 y\n",
    "Steps": "uint8 a\nuint32 b\nuint8 c\nfloat64 d\nuint16 e\n",
    "Hollow": "",
    "Sizes": "uint8[] b\nuint8 x\nuint16[] h\nuint8 y\nuint32[] w\nuint8 z\nfloat64[] d\nuint8 last\n",
    "Arrays": "string s\nMixed[] mixed\nuint8 a\nSteps[] steps\nuint16 b\nMixed[2] two\nstring t\nSteps[3] three\n",
    "Hollows": "uint8 a\nHollow[] hollows\nstring s\nHollow[2] two\nfloat64[] d\n",
    "Rows": "bool[] flags\nuint16[] halves\nSteps[] steps\nfloat32 last\n",
}
MESSAGES = {f"{PACKAGE}/{name}": text for name, text in _MESSAGES.items()}
ORACLES = {ros: Oracle(ros, MESSAGES) for ros in (ROS1, ROS2)}


@dataclass(frozen=True)
class Vector:
    """Numbers of elements in the order of the ports, and the length that must come of them."""

    counts: tuple[int, ...]
    length: int

    def line(self, number: int) -> str:
        words = " ".join(f"{count % 2**32:032b}" for count in self.counts)
        return f"{number} {self.length % 2**32:032b} {len(self.counts)} {words}\n"


def computed_frames(ros: Middleware) -> list[tuple[str, Frame]]:
    """Every message of variable size whose length is computed."""
    oracle = ORACLES[ros]
    frames = ((name, oracle.frame(name)) for name in [*oracle.messages(), *MESSAGES])
    return [(name, f) for name, f in frames if not f.is_fixed_size and sent_length_of(f).is_computed]


def counts_of(frame: Frame, value: Any) -> tuple[int, ...]:
    """The lengths at the ports for a value, found by the parts' paths."""
    parts = [term.part for term in sent_length_of(frame).terms if isinstance(term, Repeat) and term.body]
    return tuple(
        _count(part, part_of(value, part, 0)) for part in parts if isinstance(part, Data) or part.count is None
    )


def _count(part: Any, value: Any) -> int:
    is_text = isinstance(part, Data) and part.kind is not DataKind.ARRAY
    return len(units_of(part, value)) // part.element.size if is_text else len(value)


def vectors(ros: Middleware, name: str, frame: Frame, source: random.Random) -> Iterator[Vector]:
    """Lengths of random messages and of what rosbags makes of them."""
    oracle = ORACLES[ros]
    stimuli = Stimuli(oracle.closure(name), ros, source, longest=9)
    for kind in KINDS * VALUES_OF_A_KIND:
        value = stimuli.message(parse_name(name), kind)
        yield Vector(counts_of(frame, value), len(oracle.serialise(name, value)))


def simulate(folder: Path, frames: Sequence[Frame], tests: Iterable[tuple[int, Vector]], netlists: bool = False) -> str:
    """All vectors through the entities of all frames, by their numbers; what the bench prints."""
    library = Library("work", folder)
    for frame in frames:
        file = folder / f"{length_entity(frame)}.vhd"
        file.write_text(render(LENGTH_TEMPLATE, payload_length_configuration(frame)), encoding="ascii")
        library.analyse([file])
        if netlists:
            library.replace_by_netlist(length_entity(frame))
    ports = [length_ports(frame) for frame in frames]
    configuration = {
        "port_high": max(map(len, ports)),
        "entity_high": len(frames) - 1,
        "entities": [
            {
                "number": number,
                "entity": length_entity(frame),
                "ports": [{"name": name, "index": index} for index, name in enumerate(names)],
            }
            for number, (frame, names) in enumerate(zip(frames, ports, strict=True))
        ],
    }
    bench = folder / "payload_lengths_tb.vhd"
    bench.write_text(render("payload_lengths_tb.vhd", configuration, Path(__file__).parent), encoding="ascii")
    library.analyse([bench])
    (folder / "vectors.txt").write_text("".join(vector.line(number) for number, vector in tests), encoding="ascii")
    result = library.run("payload_lengths_tb", directory=folder)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.one_in(2)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_message_is_as_long_as_rosbags_makes_it(tmp_path: Path, ros: Middleware) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    found = computed_frames(ros)
    assert len(found) > 50
    tests = [(number, vector) for number, (name, f) in enumerate(found) for vector in vectors(ros, name, f, source)]
    output = simulate(tmp_path, [frame for _, frame in found], tests)
    assert f"PASS {len(found) * len(KINDS) * VALUES_OF_A_KIND}" in output


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_there_is_no_latch_and_netlists_do_the_same(tmp_path: Path, ros: Middleware) -> None:
    names = ["sensor_msgs/Image", "geometry_msgs/PoseArray", f"{PACKAGE}/Sizes", f"{PACKAGE}/Arrays"]
    source = random.Random(SEED)
    frames = [ORACLES[ros].frame(name) for name in names]
    tests = [(number, v) for number, name in enumerate(names) for v in vectors(ros, name, frames[number], source)]
    library = Library("work", tmp_path)
    simulate(tmp_path, frames, tests)
    assert all(library.latches(length_entity(frame)) == [] for frame in frames)
    simulate(tmp_path, frames, tests, netlists=True)


def test_lengths_far_beyond_what_a_test_can_serialise(tmp_path: Path) -> None:
    """The arithmetic of ROS 1's Image, and of a scan with elements of four bytes, modulo 2**32."""
    image, scan = (ORACLES[ROS1].frame(f"sensor_msgs/{name}") for name in ("Image", "LaserScan"))
    tests = [
        (0, Vector((3, 4, 2**31), 37 + 7 + 2**31)),
        (0, Vector((0, 0, 2**32 - 1 - 37), 2**32 - 1)),
        (0, Vector((1, 0, 2**32 - 1 - 37), 0)),
        (0, Vector((2**32 - 1, 2**32 - 1, 2**32 - 1), 34)),
        (1, Vector((1, 2**29, 2**28), 53 + 2**31 + 2**30)),
        (1, Vector((0, 2**30 + 1, 0), 52 + 4)),
    ]
    simulate(tmp_path, [image, scan], tests)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize(
    ("name", "used"),
    [
        ("sensor_msgs/Image", ["data", "height"]),
        ("sensor_msgs/Image", ["encoding"]),
        ("sensor_msgs/Image", ["width"]),
        ("geometry_msgs/PoseArray", ["poses.position.x"]),
        ("sensor_msgs/PointCloud2", ["data"]),
        ("nav_msgs/Path", ["poses.pose"]),
        (f"{PACKAGE}/Arrays", ["mixed.y", "t"]),
    ],
)
def test_parts_that_are_not_used_are_empty(tmp_path: Path, ros: Middleware, name: str, used: list[str]) -> None:
    frame = select(ORACLES[ros].frame(name), dict.fromkeys(used))
    source = random.Random(SEED)
    tests = []
    stimuli = Stimuli(ORACLES[ros].closure(name), ros, source, longest=9)
    for kind in KINDS * VALUES_OF_A_KIND:
        value = stimuli.message(parse_name(name), kind)
        counts = counts_of(frame, value)
        tests.append((0, Vector(counts, len(ORACLES[ros].serialise(name, _emptied(value, used, ()))))))
    simulate(tmp_path, [frame], tests)


def _emptied(value: Any, used: list[str], path: tuple[str, ...]) -> Any:
    """The value with all strings and lists empty that do not lead to a used field."""
    name = ".".join(path)
    if any(name == word or name.startswith(f"{word}.") for word in used):
        return value
    if isinstance(value, dict):
        return {key: _emptied(inner, used, (*path, key)) for key, inner in value.items()}
    leads_on = any(word.startswith(f"{name}.") for word in used)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        is_array = name in ("two", "three")
        return [_emptied(inner, used, path) for inner in value] if leads_on or is_array else []
    if isinstance(value, str | bytes):
        return type(value)()
    return [] if isinstance(value, list) else value
