"""Values that the codec rejects, and its messages; accepted values are compared with rosbags elsewhere."""

from __future__ import annotations

import pickle
import random
import struct
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from fusesoc_firm.frame.codec import CodecError, decode, encode, pack_frame, used_bytes
from fusesoc_firm.frame.defaults import encode_answer
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from tests.frame.test_layout import layout

INNER = {"p/E": "bool flag\nint16 number\n"}
GOOD: dict[str, Any] = {"e": [{"flag": True, "number": -2}, {"flag": False, "number": 3}], "f": [0.5, 2.0], "u": 7}
NUMBERS = "p/M has no field 'e.numbers'; did you mean 'number'?"


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
        ({"e": GOOD["e"][:1]}, "'e' must be a list of 2, not [{'flag': True, 'number': -2}]"),
        ({"e": GOOD["e"][0]}, "'e' must be a list of 2, not {'flag': True, 'number': -2}"),
        ({"e": [{"flag": True}, {"flag": True, "number": 1}]}, "no value for 'e.number'"),
        ({"e": [{"flag": True, "number": 1, "x": 2}, GOOD["e"][1]]}, "p/M has no field 'e.x'"),
        ({"e": [{"flag": "False", "number": 1}, GOOD["e"][1]]}, "'e.flag' must be of type bool, not 'False'"),
        ({"e": [{"flag": 2, "number": 1}, GOOD["e"][1]]}, "'e.flag' must be of type bool, not 2"),
        ({"e": [{"flag": True, "number": 32768}, GOOD["e"][1]]}, "'e.number' must be of type int16, not 32768"),
        ({"f": 1.0}, "'f' must be a list of 2, not 1.0"),
        ({"f": [1.0, "a"]}, "'f' must be of type float32, not 'a'"),
        ({"f": [1.0, 1e40]}, "'f' must be of type float32, not 1e+40"),
        ({"u": -1}, "'u' must be of type uint8, not -1"),
        ({"u": 1.5}, "'u' must be of type uint8, not 1.5"),
        ({"u": None}, "'u' must be of type uint8, not None"),
        ({"u": {"v": 1}}, "'u' must be of type uint8, not {'v': 1}"),
        ({"g": 1}, "p/M has no field 'g'"),
        ({"E": [{"x": 1}]}, "p/M has no field 'E.x'; did you mean 'e'?"),
        ({"e": [{"flag": True, "number": 1, "numbers": 1}, GOOD["e"][1]]}, NUMBERS),
    ],
)
def test_values_that_do_not_fit(frame: Frame, change: dict[str, Any], message: str) -> None:
    with pytest.raises(CodecError) as caught:
        encode(frame, {**GOOD, **change})
    assert str(caught.value) == message


def test_an_answer_may_have_arrays_of_numpy(frame: Frame) -> None:
    """Scalars, arrays and lists of them, and missing fields."""
    answer: dict[str, Any] = {
        "e": [{"flag": np.bool_(True), "number": np.int16(-2)}, {"number": 3}],
        "f": np.array([0.5, 2.0], dtype=np.float32),
        "u": np.uint8(7),
    }
    assert encode_answer(frame, answer) == encode(frame, GOOD)
    parts = layout(ROS2, "float64[] f\nuint8[] d\nE[] e\n", INNER)
    sent = {"f": np.arange(3) * 0.5, "d": np.arange(300, dtype=np.uint8)[:200], "e": (answer["e"][0],)}
    plain = {"f": [0.0, 0.5, 1.0], "d": [*range(200)], "e": GOOD["e"][:1]}
    assert encode_answer(parts, sent) == encode(parts, plain)
    with pytest.raises(CodecError, match=r"^'f' must be of type float64, not \[0.0\]"):
        encode_answer(parts, {"f": np.zeros((2, 1))})


def test_a_missing_field_is_named(frame: Frame) -> None:
    with pytest.raises(CodecError, match=r"^no value for 'u'$"):
        encode(frame, {name: value for name, value in GOOD.items() if name != "u"})


@pytest.mark.parametrize("missing", [21, 1])
def test_short_payloads_are_refused(frame: Frame, missing: int) -> None:
    payload = encode(frame, GOOD)[: 21 - missing]
    with pytest.raises(CodecError, match=rf"^the payload of p/M must have at least 21 bytes, not {21 - missing}$"):
        decode(frame, payload)


@pytest.mark.parametrize("extra", [1, 2, 3, 4, 200])
def test_trailing_bytes_are_ros2s(frame: Frame, extra: int) -> None:
    assert decode(frame, encode(frame, GOOD) + b"\xee" * extra) == GOOD
    with pytest.raises(CodecError, match=rf"^the payload of .* must have 1 bytes, not {1 + extra}$"):
        decode(layout(ROS1, "uint8 u\n"), bytes(1 + extra))


def test_only_the_encoding_of_the_header_counts(frame: Frame) -> None:
    payload = encode(frame, GOOD)
    assert decode(frame, payload[:2] + b"\xaa\xbb" + payload[4:]) == GOOD
    for wrong in (b"\0\0", b"\1\1", b"\0\3"):
        with pytest.raises(CodecError, match=rf"^the payload of p/M has the unknown encoding {wrong.hex()}$"):
            decode(frame, wrong + payload[2:])


def test_arrays_of_nothing_may_be_named_or_not() -> None:
    frame = layout(ROS1, "uint8[0] none\nuint8 a\nE[0] nobody\n", INNER)
    assert encode(frame, {"none": [], "a": 5, "nobody": []}) == b"\5"
    assert encode(frame, {"none": [], "a": 5}) == b"\5"
    assert decode(frame, b"\5") == {"none": [], "a": 5}


def test_a_frame_is_id_length_payload() -> None:
    assert pack_frame(200, b"ab" * 129) == b"\xc8\x02\x01\0\0" + b"ab" * 129


NANS = (0x7F800001, 0xFFA00000, 0x7FBFFFFF, 0x7FC00001, 0xFFFFFFFF, 0x7F800000, 0x3F800000)
NANS_64 = (0x7FF0000000000001, 0xFFF4000000000000, 0x7FF8000000000001, 0xFFFFFFFFFFFFFFFF)


def test_the_bits_of_every_nan_stay() -> None:
    """A signalling NaN, in which the top bit of the fraction is zero, must not become a quiet one."""
    both = layout(ROS1, "float32 a\nfloat32[7] b\nfloat32[] c\nfloat64 d\nfloat64[4] e\nfloat64[] f\n")
    some = random.Random(7)
    for _ in range(50):
        single = [*NANS, *(some.getrandbits(32) | 0x7F800000 for _ in range(20))]
        double = [*NANS_64, *(some.getrandbits(64) | 0x7FF0000000000000 for _ in range(20))]
        some.shuffle(single)
        some.shuffle(double)
        payload = struct.pack("<8I", *single[:8]) + struct.pack("<I", len(single))
        payload += struct.pack(f"<{len(single)}I", *single) + struct.pack("<5Q", *double[:5])
        payload += struct.pack(f"<I{len(double)}Q", len(double), *double)
        message = decode(both, payload)
        assert encode(both, message) == payload
        # Models and processes of a cluster receive such copies.
        for copied in (deepcopy(message), pickle.loads(pickle.dumps(message))):
            assert encode(both, copied) == payload


def test_a_nan_is_shown_as_a_nan() -> None:
    found = decode(layout(ROS1, "float32 a\n"), bytes.fromhex("010080ff"))["a"]
    assert (repr(found), str(found), f"{found:.3f}") == ("nan", "nan", "nan")
    assert found != found
