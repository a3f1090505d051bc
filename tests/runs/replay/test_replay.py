"""A bag sent through a model of a system: routes, stamps, and the reports of messages that are rejected."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer

from fusesoc_firm.cli import main
from fusesoc_firm.message.bag_reader import Form
from fusesoc_firm.node.engine.watch import Control, Watch
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.replay import audience
from fusesoc_firm.runs.replay.command import replay
from fusesoc_firm.runs.replay.options import Settings, Source, Target
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import InputError
from tests.runs.replay.replays import (
    FORMS,
    POINT,
    STRING,
    Item,
    load,
    passing,
    payload,
    points,
    read,
    run,
    specification,
    store_of,
    write,
)

Captured = pytest.CaptureFixture[str]


def version(form: str) -> int:
    return 1 if form == "ros1" else 2


def bag(folder: Path, form: str, items: list[Item], name: str = "in") -> Path:
    return write(folder / (f"{name}.bag" if form == "ros1" else name), form, items)


def renamed(items: list[Item], topic: str) -> list[Item]:
    return [(topic, *item[1:]) for item in items]


@pytest.mark.parametrize("form", FORMS)
def test_what_comes_out_has_type_payload_and_stamp(tmp_path: Path, form: str) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", version(form))))
    items = points(form, 20)
    target = tmp_path / ("out.bag" if form == "ros1" else "out")
    run(loaded, bag(tmp_path, form, items), target, "echo")
    assert read(target) == renamed(items, "/p_out")


@pytest.mark.parametrize("form", FORMS)
def test_the_same_twice_gives_the_same_bytes(tmp_path: Path, form: str) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", version(form))))
    source = bag(tmp_path, form, points(form, 50))
    found = []
    for place in ("one", "other"):
        (tmp_path / place).mkdir()
        target = tmp_path / place / ("out.bag" if form == "ros1" else "out")
        run(loaded, source, target, "twice")
        files = sorted(target.rglob("*")) if target.is_dir() else [target]
        found.append([(file.name, file.read_bytes()) for file in files])
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("name", "form", "files"),
    [
        ("out", None, ["out/metadata.yaml", "out/out.db3"]),
        ("out", "mcap", ["out/metadata.yaml", "out/out.mcap"]),
        ("out.mcap", None, ["out.mcap"]),
        ("out.db3", None, ["out.db3"]),
    ],
)
def test_the_name_says_the_form(tmp_path: Path, name: str, form: str | None, files: list[str]) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    items = points("sqlite3", 3)
    source = bag(tmp_path, "sqlite3", items)
    place = tmp_path / "place"
    place.mkdir()
    run(loaded, source, Target(place / name, Form(form) if form else None), "echo")
    assert [str(file.relative_to(place)) for file in sorted(place.rglob("*")) if file.is_file()] == files
    assert read(place / name) == renamed(items, "/p_out")


def test_a_form_against_the_name(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    with pytest.raises(InputError, match="--format is sqlite3, but the extension implies mcap"):
        run(loaded, bag(tmp_path, "mcap", points("mcap", 1)), Target(tmp_path / "o.mcap", Form.SQLITE3), "echo")


def test_a_bag_that_cannot_hold_the_answers(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    with pytest.raises(InputError, match=r"'p_out' uses ROS 2, but .*o\.bag would be a ROS 1 bag"):
        run(loaded, bag(tmp_path, "mcap", points("mcap", 1)), tmp_path / "o.bag", "echo")


def test_a_bag_that_is_there_is_replaced_only_by_force(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    source = bag(tmp_path, "mcap", points("mcap", 2))
    target = tmp_path / "out"
    run(loaded, source, target, "echo")
    with pytest.raises(InputError, match=r"already exists\n.*--force"):
        run(loaded, source, target, "echo")
    run(loaded, Source(source, limit=1), Target(target, force=True), "echo")
    assert len(read(target)) == 1
    (target / "notes.txt").touch()
    with pytest.raises(InputError, match=r"is not a bag: it contains notes\.txt"):
        run(loaded, source, Target(target, force=True), "echo")
    with pytest.raises(InputError, match="is the bag to replay"):
        run(loaded, source, Target(source, force=True), "echo")
    assert len(read(source)) == 2


def test_nothing_is_left_of_a_replay_that_cannot_begin(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 2)))
    source = bag(tmp_path, "mcap", [("/s", STRING, 0, payload("mcap", STRING, "x"))])
    before = sorted(tmp_path.iterdir())
    with pytest.raises(InputError) as raised:
        run(loaded, source, tmp_path / "out", "echo")
    assert str(raised.value) == (
        f"error: {source} contains no topic for the system, which takes /p (geometry_msgs/Point)\n"
        f"      = the bag contains /s ({STRING})"
    )
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--map", "/a"], "'/a' does not have the form TOPIC=BLOCK"),
        (["--map", "=a"], "'=a' does not have the form TOPIC=BLOCK"),
        (["--limit", "0"], "0 is less than 1"),
        (["--start", "-1"], "'-1' is not a number of seconds"),
        (["--duration", "inf"], "'inf' is not a number of seconds"),
        (["--duration", "ten"], "'ten' is not a number of seconds"),
        (["--format", "csv"], "invalid choice: 'csv'"),
    ],
)
def test_a_wrong_command_line(options: list[str], words: str, capsys: Captured) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["replay", "spec.yaml", "--in", "a.bag", "--out", "b.bag", *options])
    assert words in capsys.readouterr().err


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    source = bag(tmp_path, "ros1", points("ros1", 1))
    with pytest.raises(InputError, match=r"cannot write .*/none/o\.bag: there is no folder .*/none$"):
        run(loaded, source, tmp_path / "none" / "o.bag", "echo")


def test_a_simulator_that_cannot_be_started(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    source = Source(bag(tmp_path, "ros1", points("ros1", 1)))
    with pytest.raises(InputError, match="the simulator cannot be started"):
        replay(
            loaded, source, Target(tmp_path / "o.bag"), Settings({}, 9), lambda: Simulator(["true"], tmp_path / "none")
        )
    assert not (tmp_path / "o.bag").exists()


def test_a_simulator_that_does_not_end_well(tmp_path: Path, capsys: Captured) -> None:
    assert replayed(tmp_path, "ros1", points("ros1", 1), capsys, "grumpy") == ["the simulator ended with status 4"]
    assert len(read(tmp_path / "o.bag")) == 1


# --- stamps ----------------------------------------------------------------------------------------------------------


def test_an_answer_has_the_stamp_of_the_last_message_on_its_way(tmp_path: Path) -> None:
    # The late response of 'b' arrives while the hardware processes 'a', which is not its cause.
    blocks = passing("a", "geometry_msgs/Point", 2) + passing("b", "geometry_msgs/Vector3", 2)
    vector = "geometry_msgs/msg/Vector3"
    items = [
        ("/b", vector, 100, payload("mcap", vector, 1.0, 0.0, 0.0)),
        *((("/a", POINT, 200 + n, payload("mcap", POINT, float(n), 0.0, 0.0))) for n in range(5)),
    ]
    loaded = load(specification(tmp_path, blocks))
    run(loaded, bag(tmp_path, "mcap", items), tmp_path / "out", "echo", "late")
    # ids follow the order of blocks: a is 0, b is 1
    assert [(topic, stamp) for topic, _, stamp, _ in read(tmp_path / "out")] == [
        ("/b_out", 100),
        *(("/a_out", 200 + n) for n in range(5)),
    ]


def test_two_answers_to_one_message(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    items = points("ros1", 3)
    run(loaded, bag(tmp_path, "ros1", items), tmp_path / "o.bag", "twice")
    assert read(tmp_path / "o.bag") == [item for item in renamed(items, "/p_out") for _ in range(2)]


def test_the_latency_is_that_of_the_hardware(tmp_path: Path) -> None:
    project = "width: 64, clock: 50 MHz"
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1), project=project))
    items = points("ros1", 3)
    run(loaded, bag(tmp_path, "ros1", items), tmp_path / "o.bag", "echo", has_latency=True)
    # Frames of 29 bytes are 4 beats: the last output beat is 3 + 20 + 3 cycles after the first input beat.
    assert read(tmp_path / "o.bag") == [("/p_out", type_, stamp + 26 * 20, data) for _, type_, stamp, data in items]


def test_latency_needs_a_clock(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    with pytest.raises(InputError, match="the specification has no 'clock'"):
        run(loaded, bag(tmp_path, "ros1", points("ros1", 1)), tmp_path / "o.bag", "echo", has_latency=True)


# --- topics ----------------------------------------------------------------------------------------------------------


def test_a_topic_that_the_specification_names(tmp_path: Path) -> None:
    """A relative name is that of a node without a namespace, in the specification and in a bag."""
    blocks = [
        *passing("left", "geometry_msgs/Point", 1, ", topic: arm/left"),
        *passing("right", "geometry_msgs/Point", 1, ", topic: /arm/right"),
    ]
    blocks[1] += ", topic: arm/left/answer"
    items = points("ros1", 3, "/arm/left") + points("ros1", 2, "arm/right", 10**6)
    run(load(specification(tmp_path, blocks)), bag(tmp_path, "ros1", items), tmp_path / "o.bag", "echo", "echo")
    found = read(tmp_path / "o.bag")
    assert [topic for topic, *_ in found].count("/arm/left/answer") == 3
    assert [topic for topic, *_ in found].count("/right_out") == 2


def test_topics_that_the_command_names(tmp_path: Path) -> None:
    blocks = passing("left", "geometry_msgs/Point") + passing("right", "geometry_msgs/Point")
    items = points("ros1", 3, "/a") + points("ros1", 2, "/b", 10**6)
    source = bag(tmp_path, "ros1", items)
    loaded = load(specification(tmp_path, blocks))
    names = {"left": "/b", "right": "a", "left_out": "c"}
    run(loaded, source, tmp_path / "o.bag", "echo", "echo", names=names)
    topics = [topic for topic, *_ in read(tmp_path / "o.bag")]
    assert (topics.count("/c"), topics.count("/right_out")) == (2, 3)
    with pytest.raises(InputError) as raised:
        run(loaded, source, tmp_path / "p.bag", "echo", "echo", names={"lift": "/b"})
    assert str(raised.value) == (
        "error: the system has no subscriber or publisher 'lift'\n      = did you mean 'left'?"
    )
    with pytest.raises(InputError, match=r"has no topic /bb for 'left'\n.*did you mean '/b'"):
        run(loaded, source, tmp_path / "p.bag", "echo", "echo", names={"left": "/bb", "right": "/a"})


def test_two_subscribers_of_one_topic_both_get_it(tmp_path: Path) -> None:
    blocks = [
        *passing("one", "geometry_msgs/Point", 2, ", topic: /p"),
        *passing("other", "geometry_msgs/Point", 2, ", topic: /p"),
    ]
    items = points("mcap", 2)
    run(load(specification(tmp_path, blocks)), bag(tmp_path, "mcap", items), tmp_path / "out", "echo", "echo")
    assert [topic for topic, *_ in read(tmp_path / "out")] == ["/one_out", "/other_out"] * 2


def test_one_subscriber_and_two_topics_of_its_type(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("x", "geometry_msgs/Point", 2)))
    source = bag(tmp_path, "mcap", points("mcap", 1, "/p") + points("mcap", 1, "/q"))
    with pytest.raises(InputError, match=r"several topics in .* could go to x: /p, /q"):
        run(loaded, source, tmp_path / "out", "echo")


# --- which messages --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "numbers"),
    [
        ({"limit": 3}, range(3)),
        ({"start": 0.05}, range(5, 20)),
        ({"duration": 0.05}, range(5)),
        ({"start": 0.05, "duration": 0.1}, range(5, 15)),
        ({"start": 0.05, "duration": 0.1, "limit": 4}, range(5, 9)),
        ({"start": 0.15, "duration": 9}, range(15, 20)),
    ],
)
def test_a_part_of_a_bag(tmp_path: Path, source: dict[str, float], numbers: range) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    items = points("ros1", 20)
    path = bag(tmp_path, "ros1", items)
    run(loaded, Source(path, **source), tmp_path / "o.bag", "echo")  # type: ignore[arg-type]
    assert read(tmp_path / "o.bag") == renamed([items[number] for number in numbers], "/p_out")


def test_the_summary(tmp_path: Path, capsys: Captured) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    items = [*points("ros1", 12), ("/s", STRING, 10**18, payload("ros1", STRING, "x"))]
    run(loaded, bag(tmp_path, "ros1", items), tmp_path / "o.bag", "echo", quiet=100)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "in  p     /p     geometry_msgs/msg/Point 12",
        "out p_out /p_out geometry_msgs/msg/Point 12",
        f"no subscriber for /s ({STRING}): 1",
    ]
    # A message takes 4 + 19 + 4 cycles, and 100 cycles of rest.
    assert lines[3] == f"{tmp_path}/o.bag: 12 in, 12 out, 1 dropped, 0 errors, {12 * 127} cycles"


def test_the_summary_as_json(tmp_path: Path, capsys: Captured) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point", 1)))
    items = [*points("ros1", 12), ("/s", STRING, 10**18, payload("ros1", STRING, "x"))]
    items[3] = (*items[3][:3], items[3][3][:-9])
    source = bag(tmp_path, "ros1", items)
    with pytest.raises(InputError, match="1 error; 1 of 12 messages had errors"):
        run(loaded, source, tmp_path / "o.bag", "echo", quiet=100, is_json=True)
    assert json.loads(capsys.readouterr().out) == {
        "bag": f"{tmp_path}/o.bag",
        "in": [{"topic": "/p", "type": "geometry_msgs/msg/Point", "count": 12, "blocks": ["p"]}],
        "out": [{"topic": "/p_out", "type": "geometry_msgs/msg/Point", "count": 11, "block": "p_out"}],
        "dropped": [{"topic": "/s", "type": STRING, "count": 1}],
        "foreign": [],
        "responses": [],
        "requests": [],
        "feedback": [],
        "results": [],
        "goals": [],
        "cancellations": [],
        "warnings": [],
        "errors": 1,
        "messages_with_errors": 1,
        "first_errors": [
            "/p, message 3, at 1000000000.030000000: the payload of geometry_msgs/Point must have 24 bytes, not 15"
        ],
        "cycles": 11 * 127,
    }


# --- what does not go through ----------------------------------------------------------------------------------------


def replayed(tmp_path: Path, form: str, items: list[Item], capsys: Captured, kind: str = "broken") -> list[str]:
    """Replay faulty messages, and return the lines that report them, without the bag's path."""
    blocks = passing("p", "geometry_msgs/Point", version(form))
    source = bag(tmp_path, form, items)
    with pytest.raises(InputError) as raised:
        run(load(specification(tmp_path, blocks)), source, tmp_path / ("o.bag" if form == "ros1" else "out"), kind)
    errors = capsys.readouterr().err.splitlines()
    count = sum(line.startswith("error: ") for line in errors)
    assert str(raised.value).startswith(f"error: {count} error{'' if count == 1 else 's'}; ")
    return [line.removeprefix(f"error: {source}: ") for line in errors]


@pytest.mark.parametrize("form", FORMS)
def test_a_message_that_cannot_be_decoded(tmp_path: Path, form: str, capsys: Captured) -> None:
    items = points(form, 5)
    items[3] = (*items[3][:3], items[3][3][:-9])
    size = "24" if form == "ros1" else "at least 28"
    left = len(items[3][3])
    assert replayed(tmp_path, form, items, capsys) == [
        (
            "/p, message 3, at 1000000000.030000000: the payload of geometry_msgs/Point must have"
            f" {size} bytes, not {left}"
        )
    ]
    assert read(tmp_path / ("o.bag" if form == "ros1" else "out")) == renamed([*items[:3], items[4]], "/p_out")


def test_a_message_that_the_hardware_refuses(tmp_path: Path, capsys: Captured) -> None:
    items = points("ros1", 5)
    items[2] = (*items[2][:3], b"\xee" + items[2][3][1:])
    (found,) = replayed(tmp_path, "ros1", items, capsys)
    assert found == (
        "/p, message 2, at 1000000000.020000000: the hardware reports frame_error at 'p': "
        "the payload is longer than maxLength (code 7); give the block a larger 'maxLength'"
    )
    assert read(tmp_path / "o.bag") == renamed([*items[:2], *items[3:]], "/p_out")


@pytest.mark.parametrize("form", FORMS)
def test_a_topic_of_another_type(tmp_path: Path, form: str, capsys: Captured) -> None:
    wrong = [("/p", STRING, 10**18 + n, payload(form, STRING, "x" * 24)) for n in (1, 2)]
    assert replayed(tmp_path, form, [*points(form, 1), *wrong], capsys) == [
        f"/p, message {n}, at 1000000000.00000000{n}: its type is std_msgs/String, but 'p' takes geometry_msgs/Point"
        for n in (1, 2)
    ]
    assert len(read(tmp_path / ("o.bag" if form == "ros1" else "out"))) == 1


def test_a_hardware_that_knows_no_id(tmp_path: Path, capsys: Captured) -> None:
    assert replayed(tmp_path, "ros1", points("ros1", 1), capsys, "unknown") == [
        "/p, message 0, at 1000000000.000000000: the hardware reports id_error: no subscriber has the frame's id"
    ]


def test_a_message_that_is_never_taken(tmp_path: Path, capsys: Captured) -> None:
    assert replayed(tmp_path, "ros1", points("ros1", 4), capsys, "stuck") == [
        (
            "/p, message 1, at 1000000000.010000000: the rest of the bag was not replayed: "
            "the system does not accept the message at 'p'"
        )
    ]
    assert read(tmp_path / "o.bag") == []


def test_a_simulator_that_dies(tmp_path: Path, capsys: Captured) -> None:
    (line, printed) = replayed(tmp_path, "ros1", points("ros1", 4), capsys, "dies")[:2]
    assert "the simulator ended with status 3" in line
    assert "it is dead" in printed


def test_a_frame_that_is_not_over(tmp_path: Path, capsys: Captured) -> None:
    assert replayed(tmp_path, "ros1", points("ros1", 1), capsys, "beginning") == [
        "the system has not completed a frame of p_out"
    ]


def test_a_bag_that_is_damaged_within_is_refused_before_its_first_message(tmp_path: Path) -> None:
    items = points("ros1", 100)
    source = tmp_path / "in.bag"
    writer = Rosbag1Writer(source)
    writer.set_compression(Rosbag1Writer.CompressionFormat.LZ4)
    writer.chunk_threshold = 1000
    with writer:
        connection = writer.add_connection("/p", POINT, typestore=store_of("ros1"))
        for _, _, stamp, data in items:
            writer.write(connection, stamp, data)
    content = bytearray(source.read_bytes())
    chunk = content.find(b"compression=lz4", len(content) // 2)
    content[chunk + 60 : chunk + 100] = bytes(40)
    source.write_bytes(content)
    with pytest.raises(InputError, match=r"is not a readable bag: .* lz4 is damaged.*\n.*rosbag reindex"):
        run(load(specification(tmp_path, passing("p", "geometry_msgs/Point"))), source, tmp_path / "o.bag", "echo")
    assert not (tmp_path / "o.bag").exists()


def test_a_hardware_that_sends_what_it_must_not(tmp_path: Path, capsys: Captured) -> None:
    place = "/p, message 0, at 1000000000.000000000: the hardware sent invalid data: "
    assert replayed(tmp_path, "ros1", points("ros1", 1), capsys, "garbled") == [
        f"{place}the frame with id 0 is 9 bytes longer than its header announces",
        f"{place}the id is 200, but the publishers are 0 to 0",
    ]


def test_many_faults_are_counted(tmp_path: Path, capsys: Captured) -> None:
    items = [(*item[:3], item[3][:5]) for item in points("ros1", 130)]
    with pytest.raises(InputError, match="130 errors; 130 of 130 messages"):
        run(
            load(specification(tmp_path, passing("p", "geometry_msgs/Point"))),
            bag(tmp_path, "ros1", items),
            tmp_path / "o.bag",
            "echo",
        )
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 101
    assert lines[100] == "and 30 more errors"


def test_bursts_are_joined(tmp_path: Path) -> None:
    blocks = passing("a", "geometry_msgs/Pose", 2) + passing("b", "geometry_msgs/Pose", 2)
    pose = "geometry_msgs/msg/Pose"
    data = b"\0\1\0\0" + bytes(range(56))
    source = bag(tmp_path, "mcap", [("/a", pose, 10, data), ("/a", pose, 20, data)])
    run(load(specification(tmp_path, blocks)), source, tmp_path / "out", "parts", "silent", names={"a": "/a"})
    assert read(tmp_path / "out") == [
        (topic, pose, stamp, data) for stamp in (10, 20) for topic in ("/a_out", "/b_out")
    ]


# --- software --------------------------------------------------------------------------------------------------------

# p -> hardware -> scale in software -> hardware -> far, and p -> count in software -> counted.
TYPES = """\
accelerators:
  - {name: pass, type: VHDL, sources: pass.vhd, interface: {input: [INTERFACE], output: [INTERFACE]}}
  - {name: scale, type: ROS-SW, sources: functions.py, interface: {input: [INTERFACE], output: [INTERFACE]}}
  - {name: count, type: ROS-SW, sources: functions.py, interface: {input: [INTERFACE], output: [INTERFACE]}}
""".replace("INTERFACE", "{middleware: ROS, message: geometry_msgs/Point}")
BLOCKS = [
    "name: p, mode: subscriber, middleware: ROS, message: geometry_msgs/Point, outgoing: [{name: a}, {name: counter}]",
    "name: a, type: pass, outgoing: [{name: scaled}]",
    "name: scaled, type: scale, outgoing: [{name: b}]",
    "name: b, type: pass, outgoing: [{name: far}]",
    "name: far, mode: publisher, middleware: ROS, message: geometry_msgs/Point",
    "name: counter, type: count, outgoing: [{name: counted}]",
    "name: counted, mode: publisher, middleware: ROS, message: geometry_msgs/Point",
]
FUNCTIONS = """\
seen = 0

def scale(m):
    if m["x"] == 3:
        raise ValueError("three is no number")
    return {**m, "x": 2 * m["x"]}

def count(m):
    global seen
    seen += 1
    return None if seen % 2 else {**m, "y": float(seen)}
"""


def software(
    folder: Path, types: str = TYPES, blocks: Sequence[str] = BLOCKS, project: str = "width: 64"
) -> LoadedSystem:
    (folder / "pass.vhd").touch()
    (folder / "functions.py").write_text(FUNCTIONS)
    return load(specification(folder, blocks, types, project))


def test_software_runs_within(tmp_path: Path, capsys: Captured) -> None:
    items = points("ros1", 6)
    source = bag(tmp_path, "ros1", items)
    with pytest.raises(InputError, match="1 error; 1 of 6 messages"):
        run(software(tmp_path), source, tmp_path / "o.bag", "across", "across")
    expected = []
    for number, (_, type_, stamp, _) in enumerate(items):
        if number % 2:
            expected.append(("/counted", type_, stamp, payload("ros1", POINT, float(number), number + 1.0, 0.0)))
        if number != 3:
            expected.append(("/far", type_, stamp, payload("ros1", POINT, 2.0 * number, 0.0, 0.0)))
    assert sorted(read(tmp_path / "o.bag")) == sorted(expected)
    message = "message 3 to 'scaled': three is no number"
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(
        f"error: {source}: /p, message 3, at 1000000000.030000000: {tmp_path}/functions.py:5:9: "
    )
    assert lines[0].endswith(f"'scale' raised ValueError for {message}")


def test_the_latency_through_software_begins_with_the_message(tmp_path: Path) -> None:
    items = points("ros1", 1)
    loaded = software(tmp_path, project="width: 64, clock: 1 GHz")
    run(loaded, bag(tmp_path, "ros1", items), tmp_path / "o.bag", "across", "across", has_latency=True)
    # Twice the time without software, and one cycle in between.
    assert [stamp for topic, _, stamp, _ in read(tmp_path / "o.bag") if topic == "/far"] == [items[0][2] + 26 + 27]


def test_software_elsewhere_takes_and_gives_topics(tmp_path: Path) -> None:
    types = TYPES.replace("name: scale, type: ROS-SW, sources: functions.py,", "name: scale, type: ROS-SW,")
    blocks = [block.replace("outgoing: [{name: b}]", "outgoing: [{name: b}, {name: near}]") for block in BLOCKS]
    blocks.append("name: near, mode: publisher, middleware: ROS, message: geometry_msgs/Point")
    items = [item for p, s in zip(points("ros1", 3), points("ros1", 3, "/scaled_out"), strict=True) for item in (p, s)]
    run(software(tmp_path, types, blocks), bag(tmp_path, "ros1", items), tmp_path / "o.bag", "across", "across")
    found = read(tmp_path / "o.bag")
    for topic in ("/scaled_in", "/far", "/near"):
        assert [item for item in found if item[0] == topic] == renamed(points("ros1", 3), topic)


def test_a_watch_records_the_replay_and_pauses_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audience, "WAITS_SECONDS", 0.0)
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point")))
    items, watch, control = points("ros1", 20), Watch(), Control()
    # A page is open only while the replay is paused after two messages.
    watch.is_watched = lambda: not control.is_open
    control.step()
    control.step()
    source = bag(tmp_path, "ros1", items)
    replaying = threading.Thread(
        target=run, args=(loaded, source, tmp_path / "out.bag", "echo"), kwargs={"watch": watch, "control": control}
    )
    replaying.start()
    while watch.since(-1, 0).last < 3:
        time.sleep(0.01)
    replaying.join(0.1)
    assert replaying.is_alive()
    assert watch.since(-1, 0).last == 3
    # One count for each message; the model says that a wire waits in all cycles.
    first, second = watch.waits(10)
    assert (first.first, first.end) == (0, second.first)
    assert second.counts == (second.end,)
    control.resume()
    replaying.join(60)
    assert not replaying.is_alive()
    seen = watch.since(-1, 100).messages
    assert [item.block for item in seen] == ["p", "p_out"] * 20
    for number, item in enumerate(seen):
        assert item.payload == items[number // 2][3]
        assert item.time_ns == 10**7 * (number // 2)
        if item.block == "p_out":
            assert item.latency.cause == number - 1
            # 29 bytes come in 4 beats and go out in as many, the first of them 20 cycles after the last.
            assert item.latency.cycles == 3 + 20 + 3
    assert watch.waits(10) == [first, second]
    assert read(tmp_path / "out.bag") == renamed(items, "/p_out")


def test_a_count_of_waits_is_not_too_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock goes on by 4 ms from message to message, so each third one ends a count."""
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point")))
    watch, ticks = Watch(), count(1000)
    watch.is_watched = lambda: True
    monkeypatch.setattr(audience, "time", SimpleNamespace(monotonic=lambda: 0.004 * next(ticks)))
    run(loaded, bag(tmp_path, "ros1", points("ros1", 12)), tmp_path / "out.bag", "echo", watch=watch)
    assert len(watch.waits(100)) == 4


def test_waits_are_counted_anew_when_somebody_watches_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cycles between do not count."""
    monkeypatch.setattr(audience, "WAITS_SECONDS", 0.0)
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point")))
    watch, looks = Watch(), iter([True, True, False, False, True, True])
    watch.is_watched = lambda: next(looks, False)
    run(loaded, bag(tmp_path, "ros1", points("ros1", 12)), tmp_path / "out.bag", "echo", watch=watch)
    first, second = watch.waits(10)
    assert first.first == 0
    assert second.first == 4 * first.end
    assert watch.waits_of_all
    assert watch.waits_of_all.cycles == first.cycles + second.cycles


def test_a_replay_that_is_ended_in_the_page_has_recorded_what_came(tmp_path: Path) -> None:
    loaded = load(specification(tmp_path, passing("p", "geometry_msgs/Point")))
    control = Control()
    control.end()
    run(loaded, bag(tmp_path, "ros1", points("ros1", 20)), tmp_path / "out.bag", "echo", control=control)
    assert read(tmp_path / "out.bag") == []
