"""Arrays of fixed size that are too long for registers are streams; here, arrays beyond eight bytes are."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import decode, encode
from fusesoc_firm.frame.defaults import completed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import bounded_payload
from fusesoc_firm.frame.model import Loop
from fusesoc_firm.message import ROS1, ROS2, bounds
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.task import Task, Verdict, verify

NAME = parse_name("a_msgs/Long")
TEXT = "uint8 first\nuint16[7] a\nuint8[3] short\nPart[2] parts\nfloat64[3] b\nbool[9] c\nuint8 last\n"


def definitions_of(folder: Path, ros: Middleware) -> Definitions:
    place = folder / "a_msgs" / "msg"
    place.mkdir(parents=True)
    (place / "Long.msg").write_text(TEXT)
    (place / "Part.msg").write_text("string name\nint32[4] values\n")
    return MessageLibrary(ros, [folder]).closure(NAME)


@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize("width", [8, 64])
def test_the_converters_of_long_arrays(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ros: Middleware, width: int
) -> None:
    definitions = definitions_of(tmp_path, ros)
    monkeypatch.setattr(bounds, "MOST_BYTES", 8)
    frame = frame_of(NAME, definitions)
    assert [node.names for node in frame.nodes if isinstance(node, Loop)] == [("a",), ("parts",), ("b",), ("c",)]
    message = completed(frame, {"a": list(range(7)), "parts": [{"name": "x", "values": [1, 2, 3, 4]}, {"name": ""}]})
    assert decode(frame, encode(frame, message)) == message
    result = verify(Task(NAME, definitions, width, stimuli=3, seed=1))
    assert (result.verdict, result.detail) == (Verdict.PASS, "")


def test_an_array_of_megabytes_is_legal(tmp_path: Path) -> None:
    (tmp_path / "a_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "a_msgs" / "msg" / "Long.msg").write_text("uint8[8388608] data\n")
    frame = frame_of(NAME, MessageLibrary(ROS2, [tmp_path]).closure(NAME))
    assert bounded_payload(frame) == 4 + 8388608 + 3
    payload = encode(frame, {"data": [7] * 8388608})
    assert payload == b"\0\1\0\0" + bytes([7]) * 8388608
    assert decode(frame, payload) == {"data": [7] * 8388608}
