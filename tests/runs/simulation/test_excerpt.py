"""`firm init --from-bag`: topics, messages and stimuli of a new project come from a recorded bag."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from fusesoc_firm.cli import main
from fusesoc_firm.message.bag_reader import definitions_in
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.simulation.excerpt import Recording
from tests.runs.replay.replays import FORMS, POINT, STRING, Item, payload, points, read, store_of, write
from tests.storage.forms import with_mcap

Captured = pytest.CaptureFixture[str]
SUFFIXES = {"ros1": ".bag", "sqlite3": ".db3", "mcap": ".mcap"}
# A message that no distribution knows.
TILT, TILT_TEXT = "lab_msgs/msg/Tilt", "float64 angle\nstring label\n"


def store_with(form: str, name: str, text: str) -> Typestore:
    """The types of a distribution, and a further one."""
    store = store_of(form)
    store.register(get_types_from_msg(text, name))
    return store


def bag(folder: Path, form: str, items: list[Item] | None = None) -> Path:
    """A bag of points, texts and messages of its own, in the format `form`."""
    store = store_with(form, TILT, TILT_TEXT)
    serialise = store.serialize_ros1 if form == "ros1" else store.serialize_cdr
    tilts = [
        ("/tilt", TILT, 10**18 + n, bytes(serialise(store.types[TILT](float(n), "x" * n), TILT))) for n in range(20)
    ]
    path = folder / ("drive.bag" if form == "ros1" else "drive")
    return write(path, form, [*points(form, 30), *tilts] if items is None else items, store)


def specification(folder: Path) -> Any:
    return yaml.safe_load((folder / f"{folder.name}.yaml").read_text())


@pytest.mark.parametrize("form", FORMS)
def test_the_topics_of_a_bag(tmp_path: Path, form: str) -> None:
    recording = Recording.of(bag(tmp_path, form))
    assert (recording.ros.number, recording.has_definitions) == (1 if form == "ros1" else 2, True)
    assert recording.topics == {
        "/p": (parse_name("geometry_msgs/Point"), 30),
        "/tilt": (parse_name("lab_msgs/Tilt"), 20),
    }
    assert recording.table == [
        "topic  message              count",
        "/p     geometry_msgs/Point     30",
        "/tilt  lab_msgs/Tilt           20",
    ]


@pytest.mark.parametrize("form", FORMS)
def test_a_project_has_the_first_messages_and_all_definitions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    source = bag(tmp_path, form)
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", source.name, "--in", "/p", "--out", "lab_msgs/Tilt"]) == 0
    stimuli = tmp_path / "turn" / f"stimuli{SUFFIXES[form]}"
    assert read(stimuli) == [item for item in read(source) if item[0] == "/p"][:10]
    assert {str(heading.name) for heading in definitions_in(stimuli).texts} == {"geometry_msgs/Point", "lab_msgs/Tilt"}
    subscriber, _, publisher = specification(tmp_path / "turn")["blocks"]
    assert (subscriber["topic"], subscriber["message"]) == ("/p", "geometry_msgs/Point")
    assert "topic" not in publisher
    # The project does not need the recording.
    source.rename(tmp_path / "elsewhere")
    assert main(["system", "check", "turn/turn.yaml"]) == 0


def test_topics_are_input_and_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = bag(tmp_path, "mcap")
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", str(source), "--in", "/tilt", "--out", "/p", "--limit", "15"]) == 0
    assert len(read(tmp_path / "turn" / "stimuli.mcap")) == 15
    subscriber, _, publisher = specification(tmp_path / "turn")["blocks"]
    assert (subscriber["topic"], publisher["topic"]) == ("/tilt", "/p")


def test_long_messages_have_a_limit_and_a_buffer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = store_with("mcap", "lab_msgs/msg/Scan", "string label\nuint8[] values\n")
    scan = store.types["lab_msgs/msg/Scan"]
    data = bytes(store.serialize_cdr(scan("a", np.zeros(70_000, dtype=np.uint8)), "lab_msgs/msg/Scan"))
    items = [("/scan", "lab_msgs/msg/Scan", 10**18 + n, data) for n in range(4)]
    write(tmp_path / "drive", "mcap", items, store)
    monkeypatch.chdir(tmp_path)
    arguments = ["--from-bag", "drive", "--in", "/scan"]
    assert main(["init", "turn", *arguments, "--out", "sensor_msgs/CompressedImage"]) == 0
    assert len(read(tmp_path / "turn" / "stimuli.mcap")) == 1
    subscriber, _, publisher = specification(tmp_path / "turn")["blocks"]
    assert (subscriber["maxLength"], publisher.get("buffer")) == (2**17, None)
    assert main(["init", "other", *arguments, "--out", "sensor_msgs/Image"]) == 0


def test_the_longest_message_of_the_bag_counts_and_not_only_of_the_first_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = [payload("mcap", STRING, "x" * (100_000 if number == 15 else 5)) for number in range(20)]
    write(tmp_path / "drive", "mcap", [("/name", STRING, 10**18 + n, data) for n, data in enumerate(texts)])
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", "drive", "--in", "name", "--out", "std_msgs/Empty"]) == 0
    assert len(read(tmp_path / "turn" / "stimuli.mcap")) == 10
    subscriber = specification(tmp_path / "turn")["blocks"][0]
    assert (subscriber["topic"], subscriber["maxLength"]) == ("/name", 2**17)


@pytest.mark.parametrize(("message", "most"), [("sensor_msgs/Image", 2**22), ("stereo_msgs/DisparityImage", 2**22)])
def test_without_a_bag_a_large_message_has_its_usual_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], message: str, most: int
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--in", message, "--out", "std_msgs/Bool"]) == 0
    assert specification(tmp_path / "turn")["blocks"][0]["maxLength"] == most
    said = f"maxLength: messages of up to {most} bytes (an image of 1280 x 720 pixels of 4 bytes); change it in"
    assert said in capsys.readouterr().out


def test_without_a_bag_a_small_message_has_no_limit_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--in", "std_msgs/String", "--out", "std_msgs/Bool"]) == 0
    assert "maxLength" not in specification(tmp_path / "turn")["blocks"][0]


def test_a_bag_of_foreign_channels_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = with_mcap(tmp_path, [], foreign=("json",), topics=())
    assert main(["init", "turn", "--from-bag", str(bag)]) == 1
    assert "contains no topics of ROS\n      = /other0: its messages are in 'json'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--in", "/q", "--out", "/tilt"], "the bag has no topic '/q'"),
        (["--in", "/p", "--out", "/q"], "the bag has no topic '/q'"),
        (["--in", "geometry_msgs/Point", "--out", "/p"], "the bag has no topic 'geometry_msgs/Point'"),
        (["--in", "/p", "--out", "/p"], "'/p' is the topic of both the input and the output"),
        (["--in", "/p", "--out", "/tilt", "--ros", "1"], "drive uses ROS 2, not ROS 1"),
        (["--in", "/p", "--out", "geometry_msgs/Pont"], "did you mean 'geometry_msgs/Point'"),
    ],
)
def test_what_does_not_fit_the_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, arguments: list[str], said: str
) -> None:
    bag(tmp_path, "mcap")
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", "drive", *arguments]) == 1
    assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["drive"]


def test_a_payload_that_is_not_of_the_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    bag(tmp_path, "mcap", [("/p", POINT, 10**18, payload("mcap", POINT, 1.0, 2.0, 3.0)[:-1])])
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--from-bag", "drive", "--in", "/p", "--out", "geometry_msgs/Point"]) == 1
    assert "/p, message 0: " in capsys.readouterr().err


def test_a_limit_without_a_bag(capsys: Captured) -> None:
    assert main(["init", "turn", "--limit", "3"]) == 1
    assert "--limit needs --from-bag" in capsys.readouterr().err


def test_the_topics_are_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    bag(tmp_path, "ros1")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO("turn\n/tilt\ngeometry_msgs/Point\n\n32\n"))
    assert main(["init", "--from-bag", "drive.bag"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["topic  message              count", "/p     geometry_msgs/Point     30"]
    assert lines[3:8] == [
        "name: turn",
        "in: /tilt",
        "out: geometry_msgs/Point",
        "language [vhdl]: ",
        "width [8]: 32",
    ]
    assert specification(tmp_path / "turn")["project"]["width"] == 32
