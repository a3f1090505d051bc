"""Values that the codec accepts, returns and rejects; test_every_message compares its bytes with those of others."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

from fusesoc_firm.frame.codec import CodecError, decode, decode_arrays, encode, pack_frame, used_bytes
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.frame.test_nodes import frame, standard

HEADER = bytes.fromhex("00010000")


def image(ros: Middleware, data: bytes) -> dict[str, Any]:
    stamp = {"sec": 1, "nsec": 2} if ros is ROS1 else {"sec": 1, "nanosec": 2}
    header = {"seq": 3, "stamp": stamp, "frame_id": "cam"} if ros is ROS1 else {"stamp": stamp, "frame_id": "cam"}
    rest = {"height": 4, "width": 5, "encoding": "mono8", "is_bigendian": 0, "step": 5, "data": data}
    return {"header": header, **rest}


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_large_image_keeps_its_bytes(ros: Middleware) -> None:
    made = standard(ros, "sensor_msgs/Image")
    value = image(ros, bytes(range(256)) * 4096)
    payload = encode(made, value)
    assert payload.endswith(value["data"])
    found = decode(made, payload)
    assert found == value
    assert list(found) == list(value)
    assert used_bytes(made, payload).endswith(b"\1" * 2**20)


@pytest.mark.parametrize("data", [b"\0\xff", bytearray(b"\0\xff"), memoryview(b"\0\xff"), [0, 255], (0, 255)])
@pytest.mark.parametrize("type_", ["uint8[]", "char[]", "uint8[2]"])
def test_octets_are_bytes_or_a_list(type_: str, data: Any) -> None:
    assert encode(frame(ROS1, f"{type_} x\n"), {"x": data}).endswith(b"\0\xff")


@pytest.mark.parametrize(
    ("ros", "text", "value", "payload"),
    [
        (ROS1, "string s\n", "hé", "03000000 68c3a9"),
        (ROS2, "string s\n", "hé", "04000000 68c3a900"),
        (ROS2, "string s\n", "", "01000000 00"),
        # These bytes are not UTF-8.
        (ROS1, "string s\n", "a\udcff", "02000000 61ff"),
        # UTF-16 with four bytes per unit, without a final zero.
        (ROS2, "wstring s\n", "aé", "02000000 61000000 e9000000"),
        (ROS2, "wstring s\n", "🤖", "02000000 3ed80000 16dd0000"),
        (ROS2, "wstring s\n", "\ud83e", "01000000 3ed80000"),
        (ROS2, "float64[] s\n", [], "00000000"),
        (ROS2, "float64[] s\n", [1.0], "01000000 00000000 000000000000f03f"),
        (ROS2, "bool[] s\n", [True, False], "02000000 0100"),
        (ROS1, "byte[] s\n", [-1], "01000000 ff"),
        (ROS1, "time[] s\n", [{"sec": 1, "nsec": 2}], "01000000 01000000 02000000"),
        (ROS2, "string[] s\n", ["a", "b"], "02000000 02000000 6100 0000 02000000 6200"),
        (ROS2, "string[2] s\n", ["a", "b"], "02000000 6100 0000 02000000 6200"),
    ],
)
def test_bytes_of_a_value(ros: Middleware, text: str, value: Any, payload: str) -> None:
    made = frame(ros, text)
    expected = made.prefix + bytes.fromhex(payload)
    assert encode(made, {"s": value}) == expected
    assert decode(made, expected) == {"s": value}


def test_bytes_for_octets_come_back_as_bytes() -> None:
    made = frame(ROS2, "uint8[] a\nbyte[] b\nchar[] c\nint8[] d\nuint8[2] e\n")
    value = {"a": b"\1", "b": b"\2", "c": b"\3", "d": [-4], "e": [5, 6]}
    assert decode(made, encode(made, value)) == value


# --- defaults ----------------------------------------------------------------------------------------------------

DEFAULTS = """
int32 number 5
bool flag true
string text "a b"
float32[3] three [1, 2, 3]
uint8[] octets [1, 2]
string[] texts ["x", "y"]
string[2] two ["v", "w"]
Inner inner
"""


def test_missing_fields_have_their_defaults() -> None:
    made = frame(ROS2, DEFAULTS, Inner="int8 deep -1\n")
    expected = {
        "number": 5,
        "flag": True,
        "text": "a b",
        "three": [1.0, 2.0, 3.0],
        "octets": b"\1\2",
        "texts": ["x", "y"],
        "two": ["v", "w"],
        "inner": {"deep": -1},
    }
    assert decode(made, encode(made, {})) == expected
    assert decode(made, encode(made, {"number": 6, "texts": ["z"]})) == {**expected, "number": 6, "texts": ["z"]}


def test_elements_have_defaults_but_arrays_of_messages_none() -> None:
    made = frame(ROS2, "Inner[] many\nInner[2] two\n", Inner="int8 deep -1\nstring text 'x'\n")
    element = {"deep": -1, "text": "x"}
    value = {"many": [{}], "two": [{}, {"deep": 2}]}
    assert decode(made, encode(made, value)) == {"many": [element], "two": [element, {"deep": 2, "text": "x"}]}
    for missing in ("many", "two"):
        with pytest.raises(CodecError, match=f"^no value for '{missing}'"):
            encode(made, {name: inner for name, inner in value.items() if name != missing})


# --- refusals ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value", "error"),
    [
        ("float64 x\n", {}, "no value for 'x'"),
        ("string s\n", {}, "no value for 's'"),
        ("Inner a\n", {}, "no value for 'a.b'"),
        ("Inner a\n", {"a": 1}, "the message with the field 'b' must be a mapping of fields, not 1"),
        ("Inner[] a\n", {"a": [{}]}, "no value for 'a.b'"),
        ("Inner[2] a\n", {}, "no value for 'a.b'"),
        ("uint8 x\n", {"x": 1, "y": 2}, "layout_msgs/Main has no field 'y'"),
        ("Inner[] a\n", {"a": [{"b": 1, "c": 2}]}, "layout_msgs/Main has no field 'a.c'"),
        ("Inner a\n", {"a": {"b": 1, "c": {"d": [2]}}}, "layout_msgs/Main has no field 'a.c.d'"),
        ("uint8 x\n", {"x": 256}, "'x' must be of type uint8, not 256"),
        ("bool x\n", {"x": "False"}, "'x' must be of type bool, not 'False'"),
        ("float32 x\n", {"x": 1e39}, r"'x' must be of type float32, not 1e\+39"),
        ("uint8[] x\n", {"x": [1, -1]}, "'x' must be of type uint8, not -1"),
        ("int8[] x\n", {"x": b"a"}, "'x' must be a list, not b'a'"),
        ("uint8[] x\n", {"x": "ab"}, "'x' must be a list, not 'ab'"),
        ("uint8[3] x\n", {"x": b"ab"}, "'x' must be a list of 3, not b'ab'"),
        ("uint8[<=2] x\n", {"x": b"abc"}, "the length of 'x' must be at most 2, not 3"),
        ("string<=2 x\n", {"x": "aé"}, "the length of 'x' must be at most 2, not 3"),
        ("wstring<=1 x\n", {"x": "🤖"}, "the length of 'x' must be at most 1, not 2"),
        ("string[<=1] x\n", {"x": ["", ""]}, "the length of 'x' must be at most 1, not 2"),
        ("string[2] x\n", {"x": [""]}, r"'x' must be a list of 2, not \[''\]"),
        ("string[] x\n", {"x": "abc"}, "'x' must be a list, not 'abc'"),
        ("string x\n", {"x": b"abc"}, "'x' must be of type string, not b'abc'"),
        ("string x\n", {"x": "\ud800"}, "'x' cannot contain a lone surrogate"),
    ],
)
def test_a_value_that_does_not_fit(text: str, value: dict[str, Any], error: str) -> None:
    with pytest.raises(CodecError, match=f"^{error}"):
        encode(frame(ROS2, text, Inner="uint8 b\n"), value)


def test_a_long_value_is_cut_in_its_error() -> None:
    with pytest.raises(CodecError) as caught:
        encode(frame(ROS1, "int8[] x\n"), {"x": bytes(10**6)})
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("text", "payload", "error"),
    [
        ("string s\n", "01000000 61", "the payload of layout_msgs/Main has the unknown encoding 0100"),
        ("string s\n", "00000000 01000000 00", "the payload of layout_msgs/Main has the unknown encoding 0000"),
        ("uint8 x\n", "00000000 01", "the payload of layout_msgs/Main has the unknown encoding 0000"),
        ("uint8 x\n", "00010000", "the payload of layout_msgs/Main must have at least 5 bytes, not 4"),
        ("string s\n", "", "the payload of layout_msgs/Main has the unknown encoding "),
        ("string s\n", "000100", "the payload of layout_msgs/Main ends after 3 bytes"),
        ("string s\n", "00010000 0200", "the payload of layout_msgs/Main ends within 's' after 6 bytes"),
        ("string s\n", "00010000 03000000 6100", "the payload of layout_msgs/Main ends within 's' after 10 bytes"),
        ("string s\n", "00010000 00000000", "'s' has no terminator"),
        ("string s\n", "00010000 02000000 6161", "'s' does not end with a zero"),
        ("string<=1 s\n", "00010000 03000000 616100", "the length of 's' must be at most 1, not 2"),
        ("wstring s\n", "00010000 01000000 00000100", "'s' contains a unit that is not UTF-16: 0x10000"),
        ("float64[] s\n", "00010000 ffffffff 00000000", "the payload of layout_msgs/Main ends within 's'"),
        ("uint8[<=2] s\n", "00010000 03000000 616161", "the length of 's' must be at most 2, not 3"),
        ("Inner[] s\n", "00010000 ffffffff 01000000", "the payload of layout_msgs/Main ends within 's.b'"),
        ("string s\nuint32 t\n", "00010000 01000000 00 00000000", "the payload of layout_msgs/Main ends within 't'"),
    ],
)
def test_a_payload_that_is_broken(text: str, payload: str, error: str) -> None:
    with pytest.raises(CodecError, match=f"^{error}"):
        decode(frame(ROS2, text, Inner="uint16 b\n"), bytes.fromhex(payload))


def test_bytes_after_a_message_of_ros_1_are_an_error() -> None:
    with pytest.raises(CodecError, match=r"^layout_msgs/Main ends after 4 bytes, but the payload has 5$"):
        decode(frame(ROS1, "string s\n"), bytes(5))


def test_any_bytes_may_trail_in_ros_2() -> None:
    made = frame(ROS2, "string s\n")
    payload = HEADER + bytes.fromhex("01000000 00")
    for trailing in (0, 1, 2, 3, 4, 200):
        assert decode(made, payload + bytes(trailing)) == {"s": ""}
        assert used_bytes(made, payload + bytes(trailing)) == b"\1" * 9 + bytes(trailing)


def test_every_cut_of_a_payload_is_an_error() -> None:
    made = frame(ROS2, "string s\nInner[] many\nfloat64[] numbers\nuint8 last\n", Inner="string t\nfloat64 x\n")
    payload = encode(made, {"s": "a", "many": [{"t": "b", "x": 1.0}], "numbers": [2.0], "last": 3})
    assert decode(made, payload)["last"] == 3
    for length in range(len(payload)):
        with pytest.raises(CodecError):
            decode(made, payload[:length])


NOTHING = ["uint8[0] none\n", ""]


@pytest.mark.parametrize("inner", NOTHING)
def test_elements_without_bytes_are_limited(inner: str) -> None:
    """Four bytes could announce four billion elements."""
    made = frame(ROS1, "Inner[] s\n", Inner=inner)
    element: dict[str, Any] = {"none": []} if inner else {}
    most = {"s": [element] * 1024}
    assert decode(made, encode(made, most)) == most
    error = "^the length of 's' must be at most 1024, since its elements have no bytes, not "
    with pytest.raises(CodecError, match=f"{error}4294967295$"):
        decode(made, b"\xff" * 4)
    with pytest.raises(CodecError, match=f"{error}1025$"):
        encode(made, {"s": [element] * 1025})


@pytest.mark.parametrize("ros", [ROS1, ROS2])
@pytest.mark.parametrize("read", [decode, decode_arrays])
def test_hostile_bytes_allocate_little(ros: Middleware, read: Callable[[Frame, bytes], Any]) -> None:
    """Every word may be a count; the limit is far above what 200 bytes contain."""
    text = "string s\nfloat64[] f\nInner[] many\nstring[] texts\nbool[] flags\nuint8[] octets\n"
    made = frame(ros, text, Inner="string t\nuint16[] n\nDeep[2] two\n", Deep="string[] names\n")
    value = {
        "s": "a",
        "f": [1.0],
        "many": [{"t": "b", "n": [2, 3], "two": [{"names": ["x"]}] * 2}],
        "texts": ["c", ""],
        "flags": [True],
        "octets": b"d",
    }
    payload = encode(made, value)
    read(made, payload)  # generates the function
    refused = 0
    for place in range(len(payload) - 4):
        for word in (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\1\0", b"\0\1\0\0"):
            tracemalloc.start()
            try:
                read(made, payload[:place] + word + payload[place + 4 :])
            except CodecError:
                refused += 1
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            assert peak < 200_000, place
    assert refused > 100


def test_padding_is_not_used() -> None:
    made: Frame = frame(ROS2, "string s\nuint32 x\nuint8 y\nuint16 z\n")
    used = used_bytes(made, encode(made, {"s": "", "x": 1, "y": 2, "z": 3}))
    assert used.hex() == "01" * 9 + "000000" + "01" * 5 + "00" + "0101"


def test_pack_frame() -> None:
    assert pack_frame(7, b"ab") == b"\7\2\0\0\0ab"
