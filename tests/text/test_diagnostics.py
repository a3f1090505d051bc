"""Messages as printed for a user."""

from __future__ import annotations

import pytest

from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef, fail, nearest

PLACE = SourceRef("a.msg", 3, 7, "uint8 fo o", 4)


def test_a_fault_shows_its_place_its_line_and_a_caret() -> None:
    with pytest.raises(InputError) as raised:
        fail("bad name", PLACE, "did you mean 'foo'?")
    assert str(raised.value) == (
        "a.msg:3:7: error: bad name\n    3 | uint8 fo o\n      |       ^~~~\n      = did you mean 'foo'?"
    )


def test_a_tab_before_the_caret_keeps_its_width() -> None:
    assert SourceRef("a", 1, 3, "\t\tx").excerpt() == "    1 | \t\tx\n      | \t\t^"


def test_without_a_line_there_is_no_excerpt() -> None:
    with pytest.raises(InputError) as raised:
        fail("gone", SourceRef("a.msg", 1, 1))
    assert str(raised.value) == "a.msg:1:1: error: gone"


def test_without_a_place_the_sentence_stands_alone() -> None:
    with pytest.raises(InputError) as raised:
        fail("gone")
    assert str(raised.value) == "error: gone"


def test_all_faults_are_raised_in_the_order_of_their_places() -> None:
    faults = Diagnostics()
    faults.error("late", SourceRef("a", 10, 1))
    faults.error("other file", SourceRef("b", 1, 1))
    faults.error("early", SourceRef("a", 9, 2))
    faults.error("nowhere")
    faults.error("first in its line", SourceRef("a", 9, 1))
    with pytest.raises(InputError) as raised:
        faults.raise_if_any()
    messages = [diagnostic.message for diagnostic in raised.value.diagnostics]
    assert messages == ["nowhere", "first in its line", "early", "late", "other file"]


def test_the_same_fault_counts_once() -> None:
    faults = Diagnostics()
    faults.error("bad", PLACE)
    faults.error("bad", PLACE)
    faults.error("bad", SourceRef("a.msg", 4, 1))
    assert len(faults.found) == 2


def test_nothing_is_raised_without_a_fault() -> None:
    Diagnostics().raise_if_any()


@pytest.mark.parametrize(
    ("word", "choices", "hint"),
    [
        ("acclerators", ["accelerators", "project"], "did you mean 'accelerators'?"),
        ("HLs", ["HLS", "VHDL"], "did you mean 'HLS'?"),
        ("ros3", ["ROS", "ROS1", "ROS2"], "did you mean 'ROS1' or 'ROS2'?"),
        ("in_w", ["in_a", "in_x", "in_y", "in_z"], "did you mean 'in_z'?"),
        ("d", ["a", "b"], "legal here: a, b"),
        ("x", ["b", "a", "b"], "legal here: a, b"),
        ("x", [], ""),
        ("0", [f"key{n:02}" for n in range(30)], "legal here: " + ", ".join(f"key{n:02}" for n in range(20)) + ", ..."),
    ],
)
def test_the_nearest_word(word: str, choices: list[str], hint: str) -> None:
    assert nearest(word, choices) == hint
