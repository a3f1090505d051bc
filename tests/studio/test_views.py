"""What the page shows on demand: bytes of frames, generated VHDL with its origins, schedulers, bursts, numbers."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.cli import main
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.studio.byte_map import byte_map
from fusesoc_firm.studio.server import Studio
from fusesoc_firm.system.system_core import artifacts
from fusesoc_firm.text.render import TEMPLATES
from tests.studio.played import modelled, write_system
from tests.studio.served import load, served
from tests.studio.test_live import begin, until
from tests.studio.test_server import ask

TIMED = """\
project: {name: robot, width: 64, clock: 100 MHz, scheduler: lru}
blocks:
  - {name: a, middleware: ROS2, mode: subscriber, message: geometry_msgs/Pose, outgoing: [{name: b}, {name: c}]}
  - {name: b, middleware: ROS2, mode: publisher, message: geometry_msgs/Pose, period: 1 ms}
  - {name: c, middleware: ROS2, mode: publisher, message: geometry_msgs/Pose, period: 300}
"""


@pytest.fixture
def timed(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(TIMED, encoding="utf-8")
    return path


@pytest.fixture
def studio(timed: Path) -> Iterator[Studio]:
    with served(timed) as studio:
        yield studio


def one_block(tmp_path: Path, middleware: str, message: str) -> Any:
    """The frame of a message, from a system with it."""
    spec = tmp_path / "one.yaml"
    lines = [
        f"  - {{name: a, middleware: {middleware}, mode: subscriber, message: {message}, outgoing: [{{name: b}}]}}"
    ]
    lines += [f"  - {{name: b, middleware: {middleware}, mode: publisher, message: {message}}}"]
    spec.write_text("project: {name: one}\nblocks:\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return load(spec, spec.read_text(encoding="utf-8")).system.subscribers[0].frame


@pytest.mark.parametrize("middleware", ["ROS1", "ROS2"])
@pytest.mark.parametrize("name", ["geometry_msgs/Transform", "sensor_msgs/RegionOfInterest", "std_msgs/ColorRGBA"])
def test_bytes_are_where_another_serialiser_puts_them(tmp_path: Path, middleware: str, name: str) -> None:
    store = get_typestore(Stores.ROS1_NOETIC if middleware == "ROS1" else Stores.ROS2_HUMBLE)
    values: dict[str, float | int] = {}

    def filled(type_: str, path: str = "") -> Any:
        arguments = {}
        for field, (kind, what) in store.fielddefs[type_][1]:
            place = f"{path}.{field}" if path else field
            if kind == 2 or what[0] not in ("float32", "float64", "uint32", "bool"):
                arguments[field] = filled(str(what), place)
            else:
                arguments[field] = values[place] = bool(len(values) % 2) if what[0] == "bool" else len(values) + 1
        return store.types[type_](**arguments)

    message = filled(name.replace("/", "/msg/"))
    serialise = store.serialize_ros1 if middleware == "ROS1" else store.serialize_cdr
    payload = bytes(serialise(message, name.replace("/", "/msg/")))
    frame = b"\x07" + struct.pack("<I", len(payload)) + payload
    codes = {"float32": "<f", "float64": "<d", "uint32": "<I", "bool": "?"}
    parts = byte_map(one_block(tmp_path, middleware, name), 1)
    found = {
        part.name: struct.unpack_from(codes[part.type], frame, part.offset)[0]
        for part in parts
        if part.name in values and part.offset is not None
    }
    assert found == pytest.approx(values)
    assert sum(part.size for part in parts if part.size is not None) == len(frame)


def test_places_end_where_they_vary(tmp_path: Path) -> None:
    parts = byte_map(one_block(tmp_path, "ROS2", "sensor_msgs/JointState"), 2)
    shown = [(part.name, part.type, part.offset, part.size) for part in parts if part.name]
    assert shown[:6] == [
        ("id", "id", 0, 2),
        ("length", "uint32", 2, 4),
        ("prefix", "encapsulation", 6, 4),
        ("header.stamp.sec", "int32", 10, 4),
        ("header.stamp.nanosec", "uint32", 14, 4),
        ("header.frame_id", "count, uint32", 18, 4),
    ]
    assert shown[6] == ("header.frame_id", "string", 22, None)
    assert all(offset is None for _, _, offset, _ in shown[7:])
    # The texts of an array are parts of its elements.
    assert ("name", "count, uint32", 1) in [(part.name, part.type, part.depth) for part in parts]


def test_the_page_gets_the_frames_of_all_converters(studio: Studio) -> None:
    found = ask(studio, "GET", "api/bytes?file=robot.yaml")[2]
    assert found["width"] == 8
    assert [*found["blocks"]] == ["a", "b", "c"]
    assert found["blocks"]["a"][0] == {"name": "id", "type": "id", "offset": 0, "size": 1, "depth": 0}


def test_generated_lines_lead_to_their_origins(studio: Studio, timed: Path) -> None:
    made = {item.path: item.text for item in artifacts(load(timed, TIMED))}
    top = ask(studio, "GET", "api/generated?file=robot.yaml")[2]
    assert (top["name"], top["names"]) == ("robot_system.vhd", [*made])
    for name, text in made.items():
        found = ask(studio, "GET", f"api/generated?file=robot.yaml&name={name}")[2]
        assert "\n".join(line["text"] for line in found["lines"]) == text.rstrip("\n")
        for line in found["lines"]:
            file, number = line["template"].split(":")
            assert int(number) <= len((TEMPLATES / file).read_text(encoding="utf-8").splitlines())
    # An instance leads to the line of its block.
    (instance,) = (line for line in top["lines"] if re.match(r"\s+u_c : ", line["text"]))
    assert instance["specification"] == [5]
    assert ask(studio, "GET", "api/generated?file=robot.yaml&name=../../etc/passwd")[2] == top


def test_schedulers_are_those_of_the_command(studio: Studio, timed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = ask(studio, "GET", "api/schedulers?file=robot.yaml")[2]
    assert main(["scheduler", "choose", str(timed), "--format", "json"]) == 0
    said = json.loads(capsys.readouterr().out)
    # The page does not show the bounds from topic to topic.
    assert said.pop("worstCase")
    assert found == {"chosen": "lru", "clock": 1e8, **said}


def test_a_system_without_times_is_told_what_is_missing(studio: Studio, timed: Path) -> None:
    timed.write_text(TIMED.replace(", period: 300", "").replace("scheduler: lru", "scheduler: round_robin"))
    ask(studio, "GET", "api/scene?file=robot.yaml")
    found = ask(studio, "GET", "api/schedulers?file=robot.yaml")[2]
    assert "publisher 'c' needs a 'period'" in found["missing"]


def test_a_run_shows_its_bursts_and_numbers(tmp_path: Path) -> None:
    spec = write_system(tmp_path)
    with served(spec, modelled()) as studio:
        for name in "timeline", "status", "series?block=point", "wave?number=0":
            assert ask(studio, "GET", f"api/{name}")[0] == 404
        begin(studio)
        news = until(studio, lambda now: now["run"] and now["run"]["state"] == "ended")
        grants = ask(studio, "GET", "api/timeline")[2]["grants"]
        sizes = {row[1]: row[3] for row in news["messages"]}
        # A beat has 8 bytes; the frame begins with an id and a length.
        assert [last - first + 1 for _, first, last in grants] == [-(-(sizes[name] + 5) // 8) for name, _, _ in grants]
        assert [name for name, _, _ in grants] == ["point_out", "text_out", "image_out"]
        assert all(before[2] < after[1] for before, after in pairwise(grants))
        number = next(row[0] for row in news["messages"] if row[1] == "point_out")
        wave = ask(studio, "GET", f"api/wave?number={number}")[2]
        # The id 0 and the length 28, then the payload, which begins with the encapsulation.
        assert (wave["beats"][0], wave["count"]) == ("00 1c 00 00 00 00 01 00", 5)
        payload = bytes.fromhex("".join(wave["beats"]))[5:]
        assert struct.unpack_from("<3d", payload, 4) == (1.5, -2.0, 1e300)
        assert wave["cycles"] == grants[0][1:]
        assert ask(studio, "GET", "api/status")[2] == {"access": None, "counts": {}}
        latency = ask(studio, "GET", "api/series?block=point_out")[2]
        assert [value for _, value in latency["points"]] == [19]
        # A number that JSON has not is left out.
        values = ask(studio, "GET", "api/series?block=point_out&field=y")[2]
        assert (values["fields"], values["points"][0][1]) == (["latency", "bytes", "x", "y", "z"], -2.0)
        assert ask(studio, "GET", "api/series?block=image_out&field=data[1]")[2]["points"][0][1] is None
        assert ask(studio, "GET", "api/series?block=image_out&field=header.stamp.sec")[2]["points"][0][1] == 1
        assert ask(studio, "GET", "api/series?block=nobody")[0] == 404


@pytest.mark.check
def test_what_the_hardware_counts_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "tilt", "--in", "geometry_msgs/Vector3", "--out", "geometry_msgs/Vector3"]) == 0
    spec = tmp_path / "tilt" / "tilt.yaml"
    text = spec.read_text(encoding="utf-8")
    spec.write_text(text.replace("project:\n", "project:\n  status: frames\n"), encoding="utf-8")
    with served(spec, partial(build_simulator, build_root=tmp_path / "simulators")) as studio:
        begin(studio, file="tilt.yaml", rate=20, isEndless=True)
        counts: dict[str, int] = {}

        def is_counted(news: dict[str, Any]) -> bool:
            assert not news["run"] or news["run"]["state"] in ("building", "running"), news
            counts.update(ask(studio, "GET", "api/status")[2]["counts"] if news["run"] else {})
            # The status is read in parts.
            frames = [counts.get(f"{name} frames", 0) for name in ("sub", "pub")]
            return min(frames) > 5 and "pub longest wait in cycles" in counts

        until(studio, is_counted)
        # The node's own count is that of an earlier moment.
        until(studio, lambda news: news["counts"].get("sub", {"messages": 0})["messages"] >= counts["sub frames"])
        assert counts["pub longest wait in cycles"] >= 0
