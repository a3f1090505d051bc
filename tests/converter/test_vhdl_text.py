"""The generated text: golden files, and rules for the text of every converter."""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path

import pytest

from fusesoc_firm.converter.converter_core import publisher_files, subscriber_files
from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.expected import check_expected
from tests.frame.oracle import Oracle
from tests.frame.samples import AWKWARD

ORACLES = {ros: Oracle(ros, AWKWARD[ros]) for ros in (ROS1, ROS2)}
MESSAGES = [
    pytest.param(ros, name, id=f"ros{ros.number}-{name}")
    for ros, oracle in ORACLES.items()
    for name in [*oracle.fixed_size_messages(), *AWKWARD[ros]]
]
LONGEST_LINE = 120
GOLDEN = Path(__file__).parent / "golden"


def texts(frame: Frame, width: int = 8) -> dict[str, str]:
    """Both converters of a message by their files' names."""
    files = subscriber_files([frame], width) | publisher_files([frame], width)
    return {name: str(file.content) for name, file in files.items()}


@pytest.mark.parametrize(
    ("ros", "name", "file"),
    [
        (ROS1, "geometry_msgs/Quaternion", "axis_to_geometry_msgs_quaternion.vhd"),
        (ROS1, "geometry_msgs/Point", "geometry_msgs_point_to_axis.vhd"),
        (ROS2, "awkward_msgs/Gaps", "axis_to_awkward_msgs_gaps.vhd"),
        (ROS2, "awkward_msgs/Gaps", "awkward_msgs_gaps_to_axis.vhd"),
        # A length with a carry, and bytes after the last field.
        (ROS2, "awkward_msgs/Carry254", "axis_to_awkward_msgs_carry254.vhd"),
    ],
)
def test_golden_files(ros: Middleware, name: str, file: str) -> None:
    check_expected(GOLDEN / f"ros{ros.number}_{file}", texts(ORACLES[ros].frame(name))[file])


@pytest.mark.parametrize("file", ["axis_to_geometry_msgs_quaternion.vhd", "geometry_msgs_quaternion_to_axis.vhd"])
def test_golden_files_of_a_wide_stream(file: str) -> None:
    check_expected(GOLDEN / f"ros2_64_{file}", texts(ORACLES[ROS2].frame("geometry_msgs/Quaternion"), 64)[file])


def test_a_publisher_of_one_beat_has_no_branch() -> None:
    file = "std_msgs_uint16_to_axis.vhd"
    check_expected(GOLDEN / f"ros1_64_{file}", texts(ORACLES[ROS1].frame("std_msgs/UInt16"), 64)[file])


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_publisher_has_a_position_if_it_has_beats_to_tell_apart(ros: Middleware, width: int) -> None:
    for name in ORACLES[ros].fixed_size_messages():
        frame = ORACLES[ros].frame(name)
        (text,) = (str(file.content) for file in publisher_files([frame], width).values())
        has_position = frame.frame_bytes > width // 8
        assert all((word in text) is has_position for word in ("position_r", "withdrawn", "process")), name


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize(("ros", "name"), MESSAGES)
def test_the_text_is_clean(ros: Middleware, name: str, width: int) -> None:
    for file, text in texts(ORACLES[ros].frame(name), width).items():
        code = re.sub(r"--.*", "", text)
        assert text.isascii(), file
        assert text.endswith("\n"), file
        assert "__" not in code, file
        assert not re.search(r"\w_\b", code), file
        assert "\t" not in text, file
        assert not re.search(r"[ \t]$", text, re.MULTILINE), file
        assert "\n\n\n" not in text, file
        assert "{{" not in text, file
        assert not [line for line in text.splitlines() if len(line) > LONGEST_LINE], file
        assert f"entity {file.removesuffix('.vhd')} is" in text
        # The text does not depend on the run or the machine.
        assert not re.search(r"\b20\d\d-\d\d-\d\d|/tmp|/home|<rosbags", text), file


@pytest.mark.parametrize(("ros", "name"), MESSAGES)
def test_ports_are_aligned(ros: Middleware, name: str) -> None:
    """Each group of ports begins with a comment; its names, directions and types are in the same columns."""
    for text in texts(ORACLES[ros].frame(name)).values():
        ports = text.partition("  port (\n")[2].partition("  );\n")[0].splitlines()
        for is_comment, group in groupby(ports, lambda line: line.startswith("    --")):
            if not is_comment:
                columns = {found.span() for line in group if (found := re.search(r" : (in |out) ", line))}
                assert len(columns) == 1, ports
