"""The names of topics, and topics shared by several blocks. Faults: tests/errors/spec/topic*."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.system.system_core import load_system
from tests.system.systems import LIBRARIES, converter, derived, specification


def called(topic: str, line: str) -> str:
    """A converter's line of `blocks` with a topic."""
    return line.replace("}\n", f", topic: {topic}}}\n")


def test_a_topic_is_relative_unless_it_begins_with_a_slash(tmp_path: Path) -> None:
    blocks = (
        called("groundtruth", converter("a", "subscriber", "Point", "out"))
        + called("/arm/left", converter("b", "subscriber", "Point", "left  wheel"))
        + called("arm/right", converter("c", "subscriber", "Point", "pub"))
        # A keyword of VHDL.
        + converter("out", "publisher", "Point")
        + converter('"left  wheel"', "publisher", "Point")
        + converter("pub", "publisher", "Point")
    )
    system = derived(tmp_path, specification(blocks))
    topics = [(item.ros_name, item.name) for item in (*system.subscribers, *system.publishers)]
    assert topics == [
        ("groundtruth", "/groundtruth"),
        ("/arm/left", "/arm/left"),
        ("arm/right", "/arm/right"),
        ("out", "/out"),
        ("left_wheel", "/left_wheel"),
        ("pub", "/pub"),
    ]


@pytest.mark.parametrize(
    ("ros", "message", "topic", "warns"),
    [
        ("ROS", "Point", "/sub", True),
        ("ROS", "Point", "sub", False),
        ("ROS", "Point", "/sub/answer", False),
        ("ROS2", "Pose", "/sub", False),
    ],
)
def test_a_system_that_may_hear_itself_is_warned_of(
    tmp_path: Path, ros: str, message: str, topic: str, warns: bool
) -> None:
    """Not of ROS 1 and ROS 2, and not of the same name, with which blocks meet within the FPGA."""
    blocks = (
        converter("sub", "subscriber", "Point", "one")
        + converter("one", "publisher", "Point")
        + converter("other", "subscriber", message, "two", "three", ros=ros)
        + called(topic, converter("two", "publisher", message, ros=ros))
        + called(topic, converter("three", "publisher", message, ros=ros))
    )
    path = tmp_path / "spec.yaml"
    path.write_text(specification(blocks), encoding="utf-8")
    warnings = [str(item).splitlines()[0] for item in load_system(path, LIBRARIES).warnings]
    expected = f"{path}:6:102: warning: 'two' publishes on topic /sub, to which 'sub' subscribes"
    assert warnings == ([expected] if warns else [])
