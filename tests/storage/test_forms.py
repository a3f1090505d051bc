"""Each form of bags is read whole: with every recorder, compression, index and split."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.bag_reader import definitions_in, is_bag, open_bag
from fusesoc_firm.message.joint import Heading, Language
from fusesoc_firm.message.parser import parse_name
from tests.storage.forms import DEBIAN, FORMS, TEXT, TOPICS, Form, has_debian_rosbag, items, version_of


@pytest.mark.parametrize("name", FORMS)
def test_a_form_is_read_whole(tmp_path: Path, name: str) -> None:
    check_whole(tmp_path, name, FORMS[name])


@pytest.mark.parametrize("name", DEBIAN)
def test_a_bag_of_debians_rosbag_is_read_whole(tmp_path: Path, name: str) -> None:
    if not has_debian_rosbag():
        pytest.skip("Debian's python3-rosbag is not installed")
    check_whole(tmp_path, name, DEBIAN[name])


def check_whole(folder: Path, name: str, form: Form) -> None:
    found = items(version_of(name))
    path = form(folder, found)
    assert is_bag(path)
    with open_bag(path) as bag:
        assert bag.form.ros is (ROS1 if version_of(name) == 1 else ROS2)
        assert bag.start == found[0].stamp
        assert {stream.topic: count for stream, count in bag.streams.items()} == {
            topic: sum(item.topic == topic for item in found) for topic in TOPICS
        }
        read = [(item.stream.topic, item.stamp, item.payload) for item in bag.messages(TOPICS)]
    assert read == [tuple(item) for item in found]
    if not name.startswith("sqlite"):
        text = definitions_in(path).texts[Heading(Language.MSG, parse_name("geometry_msgs/Point"))][0]
        assert text.strip().splitlines()[-3:] == TEXT.splitlines()
