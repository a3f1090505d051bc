"""What the codec refuses, and how it says so; what it accepts is compared with rosbags elsewhere."""

from __future__ import annotations

from typing import Any

import pytest

from fusesoc_firm.frame.codec import CodecError, decode, encode, pack_frame, used_bytes
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.model import RosVersion
from tests.unit.frame.test_layout import layout

ROS1, ROS2 = RosVersion.ROS1, RosVersion.ROS2
INNER = {"p/E": "bool flag\nint16 number\n"}
GOOD: dict[str, Any] = {"e": [{"flag": True, "number": -2}, {"flag": False, "number": 3}], "f": [0.5, 2.0], "u": 7}


@pytest.fixture
def frame() -> Frame:
    return layout(ROS2, "E[2] e\nfloat32[2] f\nuint8 u\n", INNER)


def test_bytes_by_hand(frame: Frame) -> None:
    payload = encode(frame, GOOD)
    assert payload.hex(" ") == "00 01 00 00 01 00 fe ff 00 00 03 00 00 00 00 3f 00 00 00 40 07"
    assert decode(frame, payload) == GOOD
    assert used_bytes(frame, payload).hex(" ") == "01 01 01 01 01 00 01 01 01 00 01 01 01 01 01 01 01 01 01 01 01"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"e": GOOD["e"][:1]}, "'e' takes a list of 2, not [{'flag': True, 'number': -2}]"),
        ({"e": GOOD["e"][0]}, "'e' takes a list of 2, not {'flag': True, 'number': -2}"),
        ({"e": [{"flag": True}, {"flag": True, "number": 1}]}, "no value for 'e.number'"),
        ({"e": [{"flag": True, "number": 1, "x": 2}, GOOD["e"][1]]}, "p/M has no field 'e.x'"),
        ({"e": [{"flag": "False", "number": 1}, GOOD["e"][1]]}, "'e.flag' takes a bool, not 'False'"),
        ({"e": [{"flag": 2, "number": 1}, GOOD["e"][1]]}, "'e.flag' takes a bool, not 2"),
        ({"e": [{"flag": True, "number": 32768}, GOOD["e"][1]]}, "'e.number' takes a int16, not 32768"),
        ({"f": 1.0}, "'f' takes a list of 2, not 1.0"),
        ({"f": [1.0, "a"]}, "'f' takes a float32, not 'a'"),
        ({"f": [1.0, 1e40]}, "'f' takes a float32, not 1e+40"),
        ({"u": -1}, "'u' takes a uint8, not -1"),
        ({"u": 1.5}, "'u' takes a uint8, not 1.5"),
        ({"u": None}, "'u' takes a uint8, not None"),
        ({"u": {"v": 1}}, "'u' takes a uint8, not {'v': 1}"),
        ({"g": 1}, "p/M has no field 'g'"),
    ],
)
def test_values_that_do_not_fit(frame: Frame, change: dict[str, Any], message: str) -> None:
    with pytest.raises(CodecError) as caught:
        encode(frame, {**GOOD, **change})
    assert str(caught.value) == message


def test_a_missing_field_is_named(frame: Frame) -> None:
    with pytest.raises(CodecError, match=r"^no value for 'u'$"):
        encode(frame, {name: value for name, value in GOOD.items() if name != "u"})


@pytest.mark.parametrize("extra", [-21, -1, 4])
def test_other_lengths_are_refused(frame: Frame, extra: int) -> None:
    payload = (encode(frame, GOOD) + bytes(4))[: frame.payload_bytes + extra]
    with pytest.raises(CodecError, match=rf"^p/M takes 21 bytes, not {21 + extra}$"):
        decode(frame, payload)


@pytest.mark.parametrize("extra", [1, 2, 3])
def test_trailing_bytes_are_ros2s(frame: Frame, extra: int) -> None:
    assert decode(frame, encode(frame, GOOD) + b"\xee" * extra) == GOOD
    with pytest.raises(CodecError):
        decode(layout(ROS1, "uint8 u\n"), bytes(1 + extra))


def test_only_the_encoding_of_the_header_counts(frame: Frame) -> None:
    payload = encode(frame, GOOD)
    assert decode(frame, payload[:2] + b"\xaa\xbb" + payload[4:]) == GOOD
    for wrong in (b"\0\0", b"\1\1", b"\0\3"):
        with pytest.raises(CodecError, match=rf"^unknown encoding {wrong.hex()} of p/M$"):
            decode(frame, wrong + payload[2:])


def test_arrays_of_nothing_may_be_named_or_not() -> None:
    frame = layout(ROS1, "uint8[0] none\nuint8 a\nE[0] nobody\n", INNER)
    assert encode(frame, {"none": [], "a": 5, "nobody": []}) == b"\5"
    assert encode(frame, {"none": [], "a": 5}) == b"\5"
    assert decode(frame, b"\5") == {"none": [], "a": 5}


def test_a_frame_is_id_length_payload() -> None:
    assert pack_frame(200, b"ab" * 129) == b"\xc8\x02\x01\0\0" + b"ab" * 129
