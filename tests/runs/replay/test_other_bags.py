"""Bags with channels that are not of ROS, with silent topics, and with fewer messages than they state."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.runs.replay.options import Source
from fusesoc_firm.text.diagnostics import InputError
from tests.runs.replay.replays import load, passing, read, run, specification
from tests.storage.forms import items, with_mcap, with_sqlite

Captured = pytest.CaptureFixture[str]


def summary(capsys: Captured) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    return specification(tmp_path, passing("p", "geometry_msgs/Point", 2))


def test_foreign_channels_are_listed_and_left(tmp_path: Path, spec: Path, capsys: Captured) -> None:
    bag = with_mcap(tmp_path, items(2, 6), foreign=("json", "protobuf"))
    run(load(spec), bag, tmp_path / "out.mcap", "echo", is_json=True)
    found = summary(capsys)
    assert [(row["topic"], row["count"]) for row in found["in"]] == [("/p", 4)]
    assert found["foreign"] == [
        {
            "topic": f"/other{number}",
            "type": f"other.Type{number}",
            "count": 1,
            "reason": f"its messages are in '{name}', not in cdr or ros1",
        }
        for number, name in enumerate(("json", "protobuf"))
    ]
    assert found["errors"] == 0
    run(load(spec), bag, tmp_path / "other.mcap", "echo")
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2].startswith("not replayed: /other1 (other.Type1), since its messages are in 'protobuf'")
    assert "4 in, 4 out, 4 dropped, 0 errors" in lines[-1]


def test_a_subscriber_of_a_foreign_channel(tmp_path: Path) -> None:
    spec = specification(tmp_path, passing("other0", "geometry_msgs/Point", 2))
    bag = with_mcap(tmp_path, items(2, 6), foreign=("json",))
    with pytest.raises(InputError, match=rf"topic /other0 in {bag} cannot go to 'other0': .*'json'.*\n.*=.*another"):
        run(load(spec), bag, tmp_path / "out.mcap", "echo")
    assert not (tmp_path / "out.mcap").exists()


def test_a_topic_without_messages_is_an_error(tmp_path: Path, capsys: Captured) -> None:
    spec = specification(tmp_path, [*passing("p", "geometry_msgs/Point", 2), *passing("q", "geometry_msgs/Point", 2)])
    bag = with_sqlite(tmp_path, items(2, 2), metadata={})
    with pytest.raises(InputError, match="1 error; 0 of 2 messages"):
        run(load(spec), bag, tmp_path / "out.mcap", "echo", is_json=True)
    found = summary(capsys)
    assert found["first_errors"] == ["/q has no messages"]
    assert [row["count"] for row in found["in"]] == [2, 0]


def test_a_part_of_a_bag_without_messages_is_an_error(tmp_path: Path, spec: Path) -> None:
    bag = with_sqlite(tmp_path, items(2, 6), metadata={})
    with pytest.raises(InputError, match="1 error"):
        run(load(spec), Source(bag, start=100), tmp_path / "out.mcap", "echo")


@pytest.mark.parametrize("stated", [5, 7])
def test_another_number_than_the_bag_states(tmp_path: Path, spec: Path, stated: int) -> None:
    bag = with_sqlite(tmp_path, items(2, 9), metadata={})
    file = bag / "metadata.yaml"
    text = yaml.safe_load(file.read_text(encoding="utf-8"))
    text["rosbag2_bagfile_information"]["topics_with_message_count"][0]["message_count"] = stated
    file.write_text(yaml.safe_dump(text), encoding="utf-8")
    words = (
        rf"topic /p \(geometry_msgs/msg/Point\) has 6 messages, but metadata.yaml states {stated}\n.*ros2 bag reindex"
    )
    with pytest.raises(InputError, match=words):
        run(load(spec), bag, tmp_path / "out.mcap", "echo")
    assert not (tmp_path / "out.mcap").exists()


def test_files_that_the_metadata_do_not_list(tmp_path: Path, spec: Path) -> None:
    bag = with_sqlite(tmp_path, items(2, 9), files=2, metadata={"relative_file_paths": ["a_1.db3"]})
    with pytest.raises(InputError, match=r"contains a_0\.db3, which metadata\.yaml does not list\n.*reindex"):
        run(load(spec), bag, tmp_path / "out.mcap", "echo")


def test_bytes_after_the_messages_are_ignored(tmp_path: Path, spec: Path, capsys: Captured) -> None:
    """rclpy's `serialize_message` returns its whole buffer."""
    found = items(2, 6)
    longer = [item._replace(payload=item.payload + bytes(range(4 + 16 * number))) for number, item in enumerate(found)]
    run(load(spec), with_sqlite(tmp_path, longer, metadata={}), tmp_path / "out.mcap", "echo")
    assert "4 in, 4 out, 2 dropped, 0 errors" in capsys.readouterr().out
    answers = [(stamp, payload) for _, _, stamp, payload in read(tmp_path / "out.mcap")]
    assert answers == [(item.stamp, item.payload) for item in found if item.topic == "/p"]
