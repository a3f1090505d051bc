"""The expression of a payload's length; test_every_message compares it with the lengths of real payloads."""

from __future__ import annotations

import itertools

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.length import Align, Bytes, Length, Repeat, Term, length_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from tests.frame.test_nodes import frame, standard

INNER = "float64 x\nuint8 y\n"


def shown(terms: tuple[Term, ...]) -> str:
    words = []
    for term in terms:
        match term:
            case Bytes(count):
                words.append(str(count))
            case Align(alignment):
                words.append(f"^{alignment}")
            case Repeat():
                words.append(f"{term.part.names[-1]}*({shown(term.body)}; {term.stride})")
    return " ".join(words)


@pytest.mark.parametrize(
    ("ros", "name", "expected"),
    [
        (ROS1, "geometry_msgs/Point", "24"),
        (ROS1, "sensor_msgs/Image", "16 frame_id*(1; 1) 12 encoding*(1; 1) 9 data*(1; 1)"),
        (ROS2, "sensor_msgs/Image", "12 frame_id*(1; 1) 1 ^4 12 encoding*(1; 1) 2 ^4 8 data*(1; 1)"),
        (ROS1, "geometry_msgs/PoseArray", "16 frame_id*(1; 1) 4 poses*(56; 56)"),
        (ROS2, "geometry_msgs/PoseArray", "12 frame_id*(1; 1) 1 ^4 4 poses*(^8 56; 56)"),
        (
            ROS1,
            "diagnostic_msgs/DiagnosticStatus",
            "5 name*(1; 1) 4 message*(1; 1) 4 hardware_id*(1; 1) 4 values*(4 key*(1; 1) 4 value*(1; 1); None)",
        ),
    ],
)
def test_expressions(ros: Middleware, name: str, expected: str) -> None:
    assert shown(length_of(standard(ros, name)).terms) == expected


@pytest.mark.parametrize(
    ("text", "is_computed", "minimum", "maximum"),
    [
        ("uint8 x\n", True, 5, 5),
        ("string s\n", True, 9, None),
        ("string<=10 s\n", True, 9, 19),
        ("wstring<=10 s\n", True, 8, 48),
        ("float64[<=3] a\n", True, 8, 36),
        # 4 for the count, 4 up to 8, 9 for the first and 16 for each further one.
        ("Inner[<=3] a\n", True, 8, 4 + 8 + 9 + 2 * 16),
        ("Inner[] a\n", True, 8, None),
        ("string[2] a\n", False, 4 + 5 + 3 + 5, None),
        ("string<=1[2] a\n", False, 4 + 5 + 3 + 5, 4 + 6 + 2 + 6),
        ("Text[<=2] a\n", False, 8, None),
        # The loop must not be walked four thousand million times.
        ("string<=1[<=4294967295] a\n", False, 8, 4 + 4 + 4294967295 * 8 - 2),
    ],
)
def test_bounds(text: str, is_computed: bool, minimum: int, maximum: int | None) -> None:
    length = length_of(frame(ROS2, text, Inner=INNER, Text="string s\n"))
    assert (length.is_computed, length.minimum, length.maximum) == (is_computed, minimum, maximum)


def test_counts_suffice_where_it_says_so() -> None:
    made = frame(ROS2, "string s\nInner[] a\nfloat64[] b\n", Inner=INNER)
    length = length_of(made)
    assert length.is_computed
    for size, count in itertools.product(range(9), range(4)):
        value = {"s": "x" * size, "a": [{"x": 1.0, "y": 2}] * count, "b": [3.0] * count}
        # Only the numbers of elements matter.
        counts = {"s": "y" * size, "a": [None] * count, "b": [None] * count}
        assert length.of(counts) == len(encode(made, value))


def test_a_length_is_a_value() -> None:
    made = standard(ROS2, "geometry_msgs/PoseArray")
    assert length_of(made) == length_of(made)
    assert isinstance(hash(length_of(made)), int)
    assert isinstance(length_of(made), Length)
