"""Frame to template configuration: names of ports, windows, pieces, and the checks of the length."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fusesoc_firm.converter.configuration import (
    publisher_configuration,
    publisher_entity,
    subscriber_configuration,
    subscriber_entity,
)
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.slices import slices_of, stored_offset, windows_of
from fusesoc_firm.diagnostics import InputError
from fusesoc_firm.message.model import MessageName, RosVersion
from fusesoc_firm.naming import KEYWORDS
from tests.unit.frame.samples import AWKWARD
from tests.unit.frame.test_layout import layout

ROS1, ROS2 = RosVersion.ROS1, RosVersion.ROS2


def ports(ros: RosVersion, text: str, others: dict[str, str] | None = None) -> list[tuple[str, str, str]]:
    """(name, type, comment) of each port."""
    return [(port.name, port.vhdl_type, port.comment) for port in field_ports(layout(ros, text, others))]


def names(ros: RosVersion, text: str, others: dict[str, str] | None = None) -> list[str]:
    return [name for name, _, _ in ports(ros, text, others)]


def test_kinds_of_ports() -> None:
    inner = {"p/E": "float32 x\nbool[2] f\n"}
    assert ports(ROS1, "bool a\nuint8 b\nbool[1] c\nint16[3] d\nE e\nE[2] g\n", inner) == [
        ("a", "std_logic", "a: bool"),
        ("b", "std_logic_vector(7 downto 0)", "b: uint8"),
        ("c", "std_logic_vector(0 downto 0)", "c[1]: bool"),
        ("d", "std_logic_vector(47 downto 0)", "d[3]: int16"),
        ("e_x", "std_logic_vector(31 downto 0)", "e.x: float32"),
        ("e_f", "std_logic_vector(1 downto 0)", "e.f[2]: bool"),
        ("g_x", "std_logic_vector(63 downto 0)", "g[2].x: float32"),
        ("g_f", "std_logic_vector(3 downto 0)", "g[2].f[2]: bool"),
    ]


def test_names_that_vhdl_or_verilog_keep_for_themselves() -> None:
    assert names(ROS2, "uint8 in\nuint8 signal\nuint8 wire\nuint8 logic\n") == [
        "in_field",
        "signal_field",
        "wire_field",
        "logic_field",
    ]


def test_names_of_the_converters_own() -> None:
    assert names(ROS2, "uint8 clk\nuint8 id\nuint8 msg_valid\nuint8 s_axis_tdata\nuint8 frame\n") == [
        "clk_2",
        "id_2",
        "msg_valid_2",
        "s_axis_tdata_2",
        "frame_2",
    ]


def test_names_that_differ_in_case_only_or_in_underscores() -> None:
    assert names(ROS1, "uint8 Stamp\nuint8 stamp\nuint8 a__b\nuint8 a_b\nuint8 c_\nuint8 CLK\n") == [
        "Stamp",
        "stamp_2",
        "a_b",
        "a_b_2",
        "c",
        "CLK_2",
    ]


def test_paths_that_meet() -> None:
    assert names(ROS1, "E a\nuint8 a_b\nuint8 a_b_2\n", {"p/E": "uint8 b\n"}) == ["a_b", "a_b_2", "a_b_2_2"]


@pytest.mark.parametrize("ros", RosVersion)
def test_both_converters_have_the_same_legal_names(ros: RosVersion) -> None:
    for name, text in AWKWARD[ros].items():
        if "Inner" in text or any(word[0].isupper() for word in text.split()):
            continue
        frame = layout(ros, text)
        given = [port["name"].strip() for port in publisher_configuration(frame, 8)["ports"]]
        taken = [port["name"].strip() for port in subscriber_configuration(frame, 8)["ports"]]
        assert given == taken, name
        assert len({port.lower() for port in given}) == len(given)
        assert not KEYWORDS & {port.lower() for port in given}


def test_entities() -> None:
    frame = layout(ROS1, "uint8 a\n")
    assert (subscriber_entity(frame), publisher_entity(frame)) == ("axis_to_p_m", "p_m_to_axis")
    odd = replace(frame, message=MessageName("Odd__pkg_", "_X"))
    assert (subscriber_entity(odd), publisher_entity(odd)) == ("axis_to_odd_pkg_x", "odd_pkg_x_to_axis")


def test_windows_leave_the_gaps_out() -> None:
    frame = layout(ROS2, "uint8 a\nuint32[2] b\nuint8 c\nfloat64 d\n")
    windows = windows_of(frame)
    assert windows == [(4, 5), (8, 17), (20, 28)]
    assert [stored_offset(windows, offset) for offset in (4, 8, 16, 20)] == [0, 1, 9, 10]
    assert windows_of(layout(ROS2, "")) == []


def test_bools_are_pieces_of_a_bit_and_the_rest_is_cut_at_gaps_only() -> None:
    first, second = field_ports(layout(ROS2, "E[2] e\n", {"p/E": "bool[2] f\nuint16[2] n\n"}))
    assert [(piece.low, piece.high, piece.offset, piece.bytes) for piece in slices_of(first)] == [
        (0, 0, 4, 1),
        (1, 1, 5, 1),
        (2, 2, 10, 1),
        (3, 3, 11, 1),
    ]
    assert [(piece.low, piece.high, piece.offset, piece.bytes) for piece in slices_of(second)] == [
        (0, 31, 6, 4),
        (32, 63, 12, 4),
    ]


def test_a_publisher_drives_each_bit_once() -> None:
    for ros in RosVersion:
        frame = layout(ros, "bool a\nE[3] e\nfloat64 b\n", {"p/E": "uint8 x\nuint32 y\n"})
        driven: list[int] = []
        for piece in publisher_configuration(frame, 8)["pieces"]:
            high, low = piece["target"].strip().removeprefix("frame(").removesuffix(")").split(" downto ")
            driven += range(int(low), int(high) + 1)
        assert sorted(driven) == list(range(8 * frame.frame_bytes))


def test_the_lengths_of_ros1_and_ros2() -> None:
    one = subscriber_configuration(layout(ROS1, "uint8[300] a\n"), 8)
    assert (one["low_bytes"], one["length_carries"], one["has_trailing"]) == (["2c"], False, False)
    assert [check["value"] for check in one["length_checks"]] == ["01", "00", "00"]
    two = subscriber_configuration(layout(ROS2, "uint8[250] a\n"), 8)
    assert (two["low_bytes"], two["length_carries"], two["has_trailing"]) == (["fe", "ff", "00", "01"], True, True)
    assert [byte["value"] for byte in two["carried_bytes"]] == ["00", "01"]
    assert [(check["value"], check["carried"]) for check in two["length_checks"]] == [
        ("00", "01"),
        ("00", "00"),
        ("00", "00"),
    ]


@pytest.mark.parametrize(("count", "carries"), [(248, False), (249, True), (251, True), (252, False)])
def test_a_length_carries_only_where_three_more_bytes_reach_it(count: int, carries: bool) -> None:
    assert subscriber_configuration(layout(ROS2, f"uint8[{count}] a\n"), 8)["length_carries"] is carries


def test_widths_without_a_template_are_refused() -> None:
    frame = layout(ROS1, "uint8 a\n")
    for configuration in (subscriber_configuration, publisher_configuration):
        with pytest.raises(InputError, match=r"no converter is made for a stream of 12 bits\n.*legal here: 8"):
            configuration(frame, 12)


def test_a_frame_of_more_bits_than_vhdl_counts_is_refused() -> None:
    largest = layout(ROS1, "uint8[268435450] a\n")
    assert publisher_configuration(largest, 8)["frame_high"] == 8 * (2**28 - 1) - 1
    for configuration in (subscriber_configuration, publisher_configuration):
        with pytest.raises(InputError, match=r"p/M takes 268435451 bytes, too many for a converter"):
            configuration(layout(ROS1, "uint8[268435451] a\n"), 8)
