"""Names are legal and distinct in every HDL, whatever names ROS gives its fields."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusesoc_firm.text.naming import (
    KEYWORDS,
    VHDL_KEYWORDS,
    VHDL_PREDEFINED,
    distinct_constants,
    distinct_identifiers,
    entity_name,
    identifier,
)

LEGAL = re.compile(r"[A-Za-z](_?[A-Za-z0-9])*")
WORDS = st.one_of(
    st.text(max_size=12),
    st.text(alphabet="aA_1-/é", max_size=6),
    st.sampled_from(sorted(KEYWORDS)),
    st.sampled_from(sorted(KEYWORDS)).map(str.upper),
    st.sampled_from(["x", "X", "x_2", "X_2", "x_2_2", "n", "n2", "signal_field", "clk", "CLK"]),
)
NAMES = st.lists(st.lists(WORDS, min_size=1, max_size=3), max_size=12)


def is_legal(name: str) -> bool:
    return LEGAL.fullmatch(name) is not None and name.lower() not in KEYWORDS


@given(NAMES, st.lists(st.sampled_from(["clk", "rst_n", "X", "s_axis_tdata"])))
def test_names_are_legal_distinct_and_not_reserved(names: list[list[str]], reserved: list[str]) -> None:
    chosen = distinct_identifiers(names, reserved)
    lowered = [name.lower() for name in chosen]
    assert all(map(is_legal, chosen))
    assert len(chosen) == len(names)
    assert len(set(lowered)) == len(lowered)
    assert not set(lowered) & {word.lower() for word in reserved}
    assert distinct_identifiers(names, reserved) == chosen


@given(st.from_regex(LEGAL, fullmatch=True))
def test_a_legal_name_stays_as_it_is(name: str) -> None:
    if name.lower() not in KEYWORDS and name.isascii():
        assert identifier(name) == name


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        (("header", "stamp", "sec"), "header_stamp_sec"),
        (("_private_",), "private"),
        (("a__b",), "a_b"),
        (("2d",), "n2d"),
        (("signal",), "signal_field"),
        (("Out",), "Out_field"),
        (("wire",), "wire_field"),
        (("___",), "n"),
        (("pkg/Type",), "pkg_Type"),
    ],
)
def test_what_changes_and_how(parts: tuple[str, ...], expected: str) -> None:
    assert identifier(*parts) == expected


def test_clashes_are_numbered_in_order() -> None:
    names = [("stamp",), ("Stamp",), ("stamp_2",), ("STAMP",), ("clk",)]
    assert distinct_identifiers(names, ["CLK"]) == ["stamp", "Stamp_2", "stamp_2_2", "STAMP_3", "clk_2"]


@given(st.lists(st.lists(st.one_of(WORDS, st.sampled_from(sorted(VHDL_PREDEFINED))), min_size=1, max_size=3)))
def test_constants_are_legal_distinct_and_hide_nothing(names: list[list[str]]) -> None:
    chosen = distinct_constants(names, ["SIGNATURE"])
    assert all(LEGAL.fullmatch(name) and name == name.upper() for name in chosen)
    assert not {name.lower() for name in chosen} & (VHDL_KEYWORDS | VHDL_PREDEFINED | {"signature"})
    assert len(set(chosen)) == len(chosen) == len(names)


def test_constants_stay_as_they_are_where_they_can() -> None:
    names = ["OK", "ERROR", "In", "ok", "wire", "SIGNATURE"]
    chosen = distinct_constants([(name,) for name in names], ["SIGNATURE"])
    assert chosen == ["OK", "ERROR_VALUE", "IN_VALUE", "OK_2", "WIRE", "SIGNATURE_2"]


def test_entity_name() -> None:
    assert entity_name("geometry_msgs", "Quaternion") == "geometry_msgs_quaternion"
