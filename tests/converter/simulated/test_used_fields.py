"""Converters of some of the fields: the others are skipped or sent as defaults, and giant messages stay small."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path

import pytest

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.converter.simulated.converters import EVERYTHING, ConverterBench, Selection, printed, troubled_frames
from tests.frame.oracle import Oracle
from tests.frame.samples import AWKWARD
from tests.hdl.frames import traffic
from tests.seeds import seeded

SEED = seeded(20240603)

_DEFAULTS = {
    "x": 1.5,
    "triple": [1, -2, 3],
    "flag": True,
    "plain": 0,
    "tuned": {"gain": 7, "rate": 0.5},
    "pair": [{"gain": 7, "rate": 0.5}] * 2,
    "big": -5,
    "flags": [True, False],
    "letter": 65,
    "small": [-0.25, 1e10],
}

# Two fields far apart; a hundred, three in every 75 bytes and eight in every 100 from the first byte on; all of 5 kB.
_WINDOWS = 100
GIANTS = {
    "giant_msgs/Far": "uint8[1801] before\nfloat64[7] q\nuint8[2000] between\nfloat64[7] q_d\nuint8[900] behind\n",
    "giant_msgs/Many": "".join(f"uint8[{60 + 7 * n % 13}] gap{n}\nuint16 n{n}\nbool f{n}\n" for n in range(_WINDOWS)),
    "giant_msgs/Wide": "".join(f"float64 f{n}\nuint8[{90 + 5 * n % 11}] gap{n}\n" for n in range(_WINDOWS)),
    "giant_msgs/Full": "uint8[5000] data\nbool flag\n",
}
_FAR = Selection(include=("q", "q_d"))
_GAPS = Selection(exclude=tuple(f"gap{n}" for n in range(_WINDOWS)))
SMALL = [
    (ROS1, "geometry_msgs/PoseWithCovariance", Selection(include=("pose.position",))),
    (ROS1, "geometry_msgs/Quaternion", Selection(exclude=("x", "w"))),
    (ROS1, "awkward_msgs/Times", Selection(include=("spans.nsec", "last"))),
    (ROS1, "awkward_msgs/Large", Selection(exclude=("data",))),
    (ROS2, "awkward_msgs/Gaps", Selection(include=("elements.value", "single"))),
    (ROS2, "awkward_msgs/Flags", Selection(exclude=("many", "last"))),
    (ROS2, "awkward_msgs/Defaults", Selection(include=("plain",), defaults=json.dumps(_DEFAULTS))),
    (ROS2, "awkward_msgs/Defaults", Selection(exclude=("triple", "pair.rate", "flag"), defaults=json.dumps(_DEFAULTS))),
    (ROS2, "awkward_msgs/Grid", Selection(exclude=("before", "rows", "behind"))),
]
LARGE = [
    (ROS1, "giant_msgs/Far", _FAR),
    (ROS2, "giant_msgs/Many", _GAPS),
    (ROS1, "giant_msgs/Wide", _GAPS),
    (ROS1, "giant_msgs/Full", EVERYTHING),
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> ConverterBench:
    oracles = {ros: Oracle(ros, {**AWKWARD[ros], **GIANTS}) for ros in (ROS1, ROS2)}
    return ConverterBench(tmp_path_factory.mktemp("used_fields"), oracles)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", [8, 16, 64, 512])
@pytest.mark.parametrize(("ros", "name", "selection"), SMALL)
def test_the_other_fields_are_skipped_and_sent_as_their_defaults(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, selection: Selection, width: int
) -> None:
    pair = bench.pair(ros, name, width, selection)
    print(f"seed {SEED}")
    source = random.Random(SEED)
    values = [pair.oracle.random_value(name, source) for _ in range(8)]
    frames = [pair.sent(pair.oracle.serialise(name, value)) for value in values]
    result = pair.run(tmp_path, frames, SEED=SEED, STALL_PERCENT=35, SHOW_FIELDS=True)
    assert [int(digits, 16) for digits in printed(result, "fields")] == [pair.field_bits(value) for value in values]
    pair.run(tmp_path, troubled_frames(pair, 60, source), SEED=SEED, STALL_PERCENT=20)
    pair.run(tmp_path, troubled_frames(pair, 60, source), BUFFERED=True)


@pytest.mark.one_in(12, 3)
@pytest.mark.parametrize("width", [8, 64, 512])
@pytest.mark.parametrize(("ros", "name", "selection"), LARGE)
def test_giant_messages(
    bench: ConverterBench, tmp_path: Path, ros: Middleware, name: str, selection: Selection, width: int
) -> None:
    pair = bench.pair(ros, name, width, selection)
    print(f"seed {SEED}")
    source = random.Random(SEED)
    values = [pair.oracle.random_value(name, source) for _ in range(3)]
    frames = [pair.sent(pair.oracle.serialise(name, value)) for value in values]
    result = pair.run(tmp_path, frames, BUFFERED=True, SHOW_FIELDS=True)
    assert [int(digits, 16) for digits in printed(result, "fields")] == [pair.field_bits(value) for value in values]
    # Three frames in, the last one out again.
    beats = pair.beats(frames[0])
    assert traffic(result.output).cycles <= 4 * beats + 6
    # Whatever a broken frame leaves behind, the next one is received.
    pair.run(tmp_path, troubled_frames(pair, 12, source), SEED=SEED, STALL_PERCENT=10)
    for entity in pair.entities:
        assert pair.library.latches(entity) == []


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("name", "width"), [("giant_msgs/Many", 8), ("giant_msgs/Wide", 64)])
def test_the_netlist_with_a_table_does_the_same(tmp_path: Path, name: str, width: int) -> None:
    pair = ConverterBench(tmp_path, {ROS1: Oracle(ROS1, GIANTS)}).pair(ROS1, name, width, _GAPS)
    subscriber, _ = pair.entities
    ((_, file),) = subscriber_files([pair.frame], width).items()
    assert "TURNS_0" in str(file.content)
    pair.library.replace_by_netlist(subscriber)
    pair.analyse_bench()
    source = random.Random(SEED)
    values = [pair.oracle.random_value(name, source) for _ in range(2)]
    frames = [pair.sent(pair.oracle.serialise(name, value)) for value in values]
    result = pair.run(tmp_path, frames, BUFFERED=True, SHOW_FIELDS=True)
    assert [int(digits, 16) for digits in printed(result, "fields")] == [pair.field_bits(value) for value in values]
    pair.run(tmp_path, troubled_frames(pair, 6, source), SEED=SEED, STALL_PERCENT=10)


def test_a_field_costs_text_and_registers_only_if_it_is_used(bench: ConverterBench) -> None:
    """The text grows with the fields in use, not with the message; registers hold the bits of the ports and no more."""
    for ros, name, selection in LARGE[:3]:
        for width in (8, 64, 512):
            frame = bench.pair(ros, name, width, selection).frame
            bits = sum(port.width or 8 for port in field_ports(frame))
            ((_, file),) = subscriber_files([frame], width).items()
            text = str(file.content)
            sizes = re.findall(r"signal fields\w* *: std_logic_vector\((\d+) downto 0\)", text)
            assert sum(int(high) + 1 for high in sizes) == bits
            lines = len(text.splitlines()) + len(str(*publisher_files([frame], width).values()).splitlines())
            assert lines < 300 + 25 * len(field_ports(frame))
