"""What the kinds of stimuli promise; test_every_message tries that they can be sent."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest

from fusesoc_firm.frame.codec import encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.runs.verify.stimuli import EMPTY, EXTREME, KINDS, ONE, TYPICAL, Stimuli, kinds
from tests.runs.verify.messages import Definitions, own

SEEDS = range(40)
DEEP = {"A": "float32[] x\n", "B": "A[] a\nstring[] s\n", "C": "B[] b\n", "D": "C[] c\nuint8[] d\n"}


def drawn(texts: dict[str, str], kind: str, ros: Any = ROS2) -> Iterator[dict[str, Any]]:
    name, definitions = own(ros, texts)
    for seed in SEEDS:
        yield Stimuli(definitions, ros, random.Random(seed)).message(name, kind)


def test_the_first_stimuli_are_of_all_kinds() -> None:
    assert list(kinds(3)) == [EMPTY, TYPICAL, EXTREME]
    assert set(kinds(4)) == set(KINDS)
    assert list(kinds(8))[4:] == [TYPICAL, EXTREME, TYPICAL, EXTREME]


def test_empty_is_zero_and_without_elements() -> None:
    texts = {"M": "string s\nfloat64[] a\nint8 i\nbool b\nfloat32 f\nuint8[2] p\n"}
    assert next(iter(drawn(texts, EMPTY))) == {"s": "", "a": [], "i": 0, "b": False, "f": 0.0, "p": [0, 0]}


def test_one_is_one_element_at_any_depth() -> None:
    for value in drawn(DEEP, ONE):
        (inner,) = value["c"]
        (innermost,) = inner["b"]
        assert len(innermost["a"]) == len(innermost["s"]) == len(value["d"]) == 1
        assert len(innermost["s"][0].encode()) == 1


def test_a_typical_one_fills_every_part() -> None:
    counts = [len(value["c"]) for value in drawn(DEEP, TYPICAL)]
    assert min(counts) == 1 and max(counts) == 4
    assert all(b["a"] and b["s"] for value in drawn(DEEP, TYPICAL) for c in value["c"] for b in c["b"])


def test_an_extreme_one_reaches_the_bounds_and_the_ends_of_ranges() -> None:
    texts = {
        "M": "string<=9 s\nwstring<=9 w\nuint16[<=7] a\nint64 i\nfloat32 f\nfloat64[3] g\nstring t\nstring<=5[<=6] l\n"
    }
    values = list(drawn(texts, EXTREME))
    for value in values:
        assert len(value["s"].encode()) == 9
        assert len(value["w"].encode("utf-16-le")) == 2 * 9
        assert len(value["a"]) == 7 and set(value["a"]) <= {0, 2**16 - 1}
        assert [len(text.encode()) for text in value["l"]] == [5] * 6
        assert value["i"] in (-(2**63), 2**63 - 1)
    floats = [value["f"] for value in values]
    assert any(map(math.isnan, floats)) and math.inf in floats and -math.inf in floats
    assert max(len(c.encode()) for value in values for c in value["t"]) == 4


def test_a_giant_message_stays_small() -> None:
    """Eight arrays of eight arrays of eight, each with a bound that could be reached alone."""
    bounded = {"A": "".join(f"uint8[<=200] a{n}\n" for n in range(8))}
    for inner, outer in ("AB", "BC"):
        bounded[outer] = "".join(f"{inner}[<=50] {inner.lower()}{n}\n" for n in range(8))
    name, definitions = own(ROS2, bounded)
    for kind in KINDS:
        stimuli = Stimuli(definitions, ROS2, random.Random(1))
        assert len(encode(frame_of(name, definitions), stimuli.message(name, kind))) < 8000


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_can_be_encoded(kind: str) -> None:
    texts = {"M": "time t\nduration d\nbyte b\nchar c\nbyte[] bs\nchar[] cs\nbool[] f\n"}
    definitions: Definitions
    name, definitions = own(ROS1, texts)
    for value in drawn(texts, kind, ROS1):
        encode(frame_of(name, definitions), value)
