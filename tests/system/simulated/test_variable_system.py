"""Systems with messages of variable size, from host to host: lengths given, computed and buffered, and forks."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import EMPTY, TYPICAL, Stimuli
from tests.frame.oracle import Oracle
from tests.seeds import seeded
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call

SEED = seeded(20240615)
IMAGE, CLOUD, STRING = "sensor_msgs/Image", "sensor_msgs/PointCloud2", "std_msgs/String"
ORACLE = Oracle(ROS2)

Message = dict[str, Any]
INVERT = """
def respond(subscriber, message):
    inverted = {**message, "data": bytes(255 - byte for byte in message["data"])}
    return [("pub", inverted)]
"""
ALL = """
def respond(subscriber, message):
    inverted = {**message, "data": bytes(255 - byte for byte in message["data"])}
    return [("pub", inverted), ("copy", message), ("twice", message)]
"""
COPIES = """
def respond(subscriber, message):
    return [(name, message) for name in ("left", "middle", "right")]
"""
SPELL = """
import itertools, string

def respond(subscriber, message):
    letters = "".join(itertools.islice(itertools.cycle(string.ascii_lowercase), message["data"]))
    return [("pub", {"data": letters})] if message["data"] <= LONGEST else []
"""


def values(name: str, count: int, longest: int = 40) -> list[Message]:
    """Random messages, an empty one in front."""
    stimuli = Stimuli(ORACLE.closure(name), ROS2, random.Random(SEED), longest=longest)
    return [stimuli.message(parse_name(name), EMPTY if not n else TYPICAL) for n in range(count)]


def bag(folder: Path, name: str, messages: Sequence[Message]) -> Path:
    """A bag of ROS 2 with the messages as rosbags serialises them."""
    path = folder / "recorded"
    package, _, short = name.partition("/")
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/sub", f"{package}/msg/{short}", typestore=get_typestore(Stores.ROS2_JAZZY))
        for time, message in enumerate(messages):
            writer.write(connection, time, ORACLE.serialise(name, message))
    return path


def converter(name: str, mode: str, message: str, *outgoing: str, **more: Any) -> dict[str, Any]:
    ways = [{"name": block} for block in outgoing]
    return {"name": name, "middleware": "ROS2", "mode": mode, "message": message, "outgoing": ways, **more}


def system(
    folder: Path, stimuli: Path, model: str, width: int, accelerators: Sequence[Any], blocks: Sequence[Any]
) -> GeneratedSystem:
    """The system of a specification, whose accelerators' sources lie in DATA."""
    for accelerator in accelerators:
        shutil.copy(DATA / accelerator["sources"], folder)
    spec = folder / "system.yaml"
    content = {"project": {"name": "variable", "width": width}, "accelerators": accelerators, "blocks": blocks}
    spec.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    (folder / "model.py").write_text(model, encoding="utf-8")
    return build(call(spec, stimuli, folder / "model.py"), folder / "work")


def image_accelerator(**length: Any) -> dict[str, Any]:
    image = {"middleware": "ROS2", "message": IMAGE}
    interface = {"input": [image], "output": [{**image, **length}]}
    return {"name": "invert", "type": "VHDL", "sources": "invert.vhd", "interface": interface}


def check(made: GeneratedSystem) -> None:
    for seed, stall_percent in ((1, 0), (2, 30), (3, 70)):
        assert made.passes(SEED=seed, STALL_PERCENT=stall_percent)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [8, 32, 128])
def test_an_image_streams_through(tmp_path: Path, width: int) -> None:
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc"),
        {"name": "acc", "type": "invert", "outgoing": [{"name": "pub"}]},
        converter("pub", "publisher", IMAGE),
    ]
    stimuli = bag(tmp_path, IMAGE, values(IMAGE, 12))
    made = system(tmp_path, stimuli, INVERT, width, [image_accelerator(length="given")], blocks)
    check(made)
    assert made.work.latches(made.entity) == []


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("fields", [["height", "width", "encoding"], ["data", "step"], ["width"], ["header.frame_id"]])
def test_parts_of_an_image_pass(tmp_path: Path, fields: list[str], width: int) -> None:
    blocks = [
        converter("sub", "subscriber", IMAGE, "pub", include=fields),
        converter("pub", "publisher", IMAGE, buffer=None if fields == ["width"] else 1000),
    ]
    model = f"""
def respond(subscriber, message):
    header = {{"stamp": {{"sec": 0, "nanosec": 0}}, "frame_id": message["header"]["frame_id"]}}
    none = {{"height": 0, "width": 0, "encoding": "", "is_bigendian": 0, "step": 0, "data": []}}
    empty = {{"header": {{**header, "frame_id": ""}}, **none}}
    given = {{"header": header}} if "header.frame_id" in {fields} else {{}}
    return [("pub", {{**empty, **given, **{{name: message[name] for name in none if name in {fields}}}}})]
"""
    check(system(tmp_path, bag(tmp_path, IMAGE, values(IMAGE, 8)), model, width, [], blocks))


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 64])
def test_an_image_goes_many_ways(tmp_path: Path, width: int) -> None:
    """To an accelerator, past it, and through it twice."""
    blocks = [
        converter("sub", "subscriber", IMAGE, "acc", "copy"),
        {"name": "acc", "type": "invert", "outgoing": [{"name": "pub"}, {"name": "again"}]},
        {"name": "again", "type": "invert", "outgoing": [{"name": "twice"}]},
        *(converter(name, "publisher", IMAGE, buffer=500) for name in ("pub", "copy", "twice")),
    ]
    stimuli = bag(tmp_path, IMAGE, values(IMAGE, 8))
    made = system(tmp_path, stimuli, ALL, width, [image_accelerator(length="given")], blocks)
    check(made)
    if width == 8:
        # GHDL 2.0 writes the netlist of a wider Manager in an order that it cannot read.
        made.replace_by_netlist()
        assert made.passes(SEED=4, STALL_PERCENT=30)


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("message", [CLOUD, "geometry_msgs/PolygonStamped", "diagnostic_msgs/DiagnosticArray"])
def test_elements_go_several_ways(tmp_path: Path, message: str, width: int) -> None:
    names = ("left", "middle", "right")
    blocks = [
        converter("sub", "subscriber", message, *names),
        *(converter(name, "publisher", message, buffer=4000) for name in names),
    ]
    stimuli = bag(tmp_path, message, values(message, 6, longest=5))
    check(system(tmp_path, stimuli, COPIES, width, [], blocks))


def spelling(
    folder: Path, width: int, numbers: Sequence[int], longest: int, buffer: int | None = None
) -> GeneratedSystem:
    number = {"middleware": "ROS2", "message": "std_msgs/UInt16"}
    text = {"middleware": "ROS2", "message": STRING, "length": "buffered" if buffer else None}
    interface = {"input": [number], "output": [text]}
    spell = {"name": "spell", "type": "VHDL", "sources": "spell.vhd", "interface": interface}
    blocks = [
        converter("sub", "subscriber", "std_msgs/UInt16", "acc"),
        {"name": "acc", "type": "spell", "outgoing": [{"name": "pub"}]},
        converter("pub", "publisher", STRING, buffer=buffer),
    ]
    stimuli = folder / "stimuli.yaml"
    stimuli.write_text("".join(f"- sub: {{data: {number}}}\n" for number in numbers), encoding="utf-8")
    return system(folder, stimuli, SPELL.replace("LONGEST", str(longest)), width, [spell], blocks)


@pytest.mark.parametrize("width", [8, 64])
def test_a_length_is_computed(tmp_path: Path, width: int) -> None:
    check(spelling(tmp_path, width, [0, 1, 2, 3, 25, 26, 100, 255], 1000))


@pytest.mark.parametrize("width", [8, 64])
def test_a_length_is_counted_in_a_buffer_and_what_is_too_long_is_dropped(tmp_path: Path, width: int) -> None:
    # A payload is CDR's header, the count, the letters and a zero.
    longest = 55
    numbers = [0, 1, 2, 30, longest, longest + width // 8, 200, 7]
    made = spelling(tmp_path, width, numbers, longest, buffer=4 + 4 + longest + 1)
    expected = made.folder / "expected.txt"
    expected.write_text("! frame_error 2\n" + expected.read_text(encoding="ascii"), encoding="ascii")
    check(made)


def test_a_message_that_is_not_as_announced_is_reported(tmp_path: Path) -> None:
    made = spelling(tmp_path, 8, [5], 1000)
    top = made.folder / f"{made.entity}.vhd"
    text = top.read_text(encoding="ascii")
    shorter = re.sub(r"(pub_payload_length +<= )acc_out_sent_length", r'\1x"0000000B"', text)
    assert shorter != text
    top.write_text(shorter, encoding="ascii")
    made.work.analyse([top, made.folder / f"{made.entity}_tb.vhd"])
    result = made.run(WATCHDOG=500)
    assert result.exit_code != 0
    assert "frame_error(1) pulses" in result.output
