"""Frame to template configuration: names of ports, windows, pieces, and the checks of the length."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from fusesoc_firm.converter.configuration import (
    PUBLISHER_TEMPLATE,
    publisher_configuration,
    publisher_entity,
    subscriber_configuration,
    subscriber_entity,
)
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.slices import slices_of, windows_of
from fusesoc_firm.converter.storing import enables
from fusesoc_firm.converter.stream import WIDTHS, Store, StoredBytes, StoreMap, Stream, ranges, stores_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.naming import KEYWORDS
from fusesoc_firm.text.render import render
from tests.frame.samples import AWKWARD
from tests.frame.test_layout import layout


def ports(ros: Middleware, text: str, others: dict[str, str] | None = None) -> list[tuple[str, str, str]]:
    """(name, type, comment) of each port."""
    return [(port.name, port.vhdl_type, port.comment) for port in field_ports(layout(ros, text, others))]


def names(ros: Middleware, text: str, others: dict[str, str] | None = None) -> list[str]:
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


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_both_converters_have_the_same_legal_names(ros: Middleware) -> None:
    for name, text in AWKWARD[ros].items():
        if "Inner" in text or any(word[0].isupper() for word in text.split()):
            continue
        frame = layout(ros, text)
        given = [port["name"] for port in publisher_configuration(frame, 8)["ports"]]
        taken = [port["name"] for port in subscriber_configuration(frame, 8)["ports"]]
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
    windows = windows_of(frame.fields)
    assert windows == [(4, 5), (8, 17), (20, 28)]
    (store,) = stores_of(Stream(8), windows)
    assert store.bits == 8 * (1 + 9 + 8)
    places = StoreMap(Stream(8), [store])
    assert places.pieces(8, 9) == [StoredBytes(0, 8, 9)]
    assert [places.pieces(offset, 1)[0].low for offset in (4, 8, 16, 20)] == [0, 8, 72, 80]
    assert windows_of(layout(ROS2, "").fields) == []


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


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_a_publisher_drives_each_bit_once(ros: Middleware, width: int) -> None:
    frame = layout(ros, "bool a\nE[3] e\nfloat64 b\n", {"p/E": "uint8 x\nuint32 y\n"})
    configuration = publisher_configuration(frame, width)
    text = render(PUBLISHER_TEMPLATE, configuration)
    pieces = re.findall(r"^  frame\((\d+) downto (\d+)\) *<= ", text, re.MULTILINE)
    driven = [bit for high, low in pieces for bit in range(int(low), int(high) + 1)]
    assert sorted(driven) == list(range(configuration["all_bits"]))


def test_lanes_that_are_used_in_the_same_beats_share_a_store() -> None:
    # Behind the void lane and the length, 32 bytes begin in lane 5 of 8 and end in lane 4.
    narrow, wide = stores_of(Stream(64), [(0, 32)])
    assert narrow == Store(lanes=(0, 1, 2, 3, 4), beats=(1, 2, 3, 4))
    assert wide == Store(lanes=(5, 6, 7), beats=(0, 1, 2, 3))
    places = StoreMap(Stream(64), [narrow, wide])
    assert places.pieces(0, 8) == [StoredBytes(1, 0, 3), StoredBytes(0, 0, 5)]
    assert places.pieces(24, 8) == [StoredBytes(1, 72, 3), StoredBytes(0, 120, 5)]


@pytest.mark.parametrize(
    ("beats", "last_beat", "is_part", "conditions"),
    [
        ((2, 3, 4), 4, False, []),
        ((2, 3, 4), 5, False, ["p <= 4"]),
        ((2, 3, 4), 4, True, ["p >= 2"]),
        ((2, 3, 4), 5, True, ["(p >= 2 and p <= 4)"]),
        ((0, 3, 4, 6, 7), 7, False, ["p = 0", "(p >= 3 and p <= 4)", "p >= 6"]),
        ((3,), 3, True, ["p >= 3"]),
    ],
)
def test_a_store_has_no_needless_limits(
    beats: tuple[int, ...], last_beat: int, is_part: bool, conditions: list[str]
) -> None:
    """With the conditions, exactly the bytes of the store's beats are in it in the end."""
    assert enables(Store((0,), beats), "p", last_beat, is_part=is_part) == conditions
    enabled = [p for p in range(last_beat + 1) if not conditions or any(_holds(text, p) for text in conditions)]
    assert tuple(enabled[-len(beats) :]) == beats


def _holds(condition: str, p: int) -> bool:
    return bool(eval(condition.replace(" = ", " == "), {"p": p}))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_every_bit_of_a_field_comes_from_a_bit_of_its_own(ros: Middleware, width: int) -> None:
    frame = layout(ros, "int8 a\nE[3] e\nfloat64 b\n", {"p/E": "uint8 x\nuint32 y\n"})
    configuration = subscriber_configuration(frame, width)
    kept = sum(store.bits for store in stores_of(Stream(width), windows_of(frame.fields)))
    assert kept == sum(port.width or 1 for port in field_ports(frame))
    read = [
        (field["register"], bit) for field in configuration["fields"] for bit in range(field["low"], field["high"] + 1)
    ]
    assert len(set(read)) == len(read) == kept


def test_ranges() -> None:
    assert ranges([]) == []
    assert ranges([3]) == [(3, 3)]
    assert ranges([0, 1, 2, 5, 7, 8]) == [(0, 2), (5, 5), (7, 8)]


def lengths(ros: Middleware, count: int, width: int) -> list[list[list[str]]]:
    """For each beat with a part of the length, and each legal length, the bytes that it has there."""
    beats = subscriber_configuration(layout(ros, f"uint8[{count}] a\n"), width)["length_beats"]
    return [[[check["value"] for check in one["checks"]] for one in beat["candidates"]] for beat in beats]


def test_the_lengths_of_ros1_and_ros2() -> None:
    assert lengths(ROS1, 300, 8) == [[["2c"]], [["01"]], [["00"]], [["00"]]]
    assert lengths(ROS1, 300, 64) == [[["2c", "01", "00", "00"]]]
    # A payload of 254 bytes and up to three behind it.
    assert lengths(ROS2, 250, 32) == [
        [["fe", "00", "00"], ["ff", "00", "00"], ["00", "01", "00"], ["01", "01", "00"]],
        [["00"], ["00"], ["00"], ["00"]],
    ]


@pytest.mark.parametrize(
    ("width", "last_beats", "last_lanes"),
    [
        (8, [8, 9, 10, 11], [0, 0, 0, 0]),
        (32, [2, 2, 2, 3], [1, 2, 3, 0]),
        (64, [1, 1, 1, 1], [1, 2, 3, 4]),
        (512, [0, 0, 0, 0], [9, 10, 11, 12]),
    ],
)
def test_where_a_frame_may_end(width: int, last_beats: list[int], last_lanes: list[int]) -> None:
    configuration = subscriber_configuration(layout(ROS2, "uint8 a\n"), width)
    beats = ["is_first = '1'" if beat == 0 else f"position_r = {beat}" for beat in last_beats]
    assert [(end["number"], end["beat"]) for end in configuration["ends"]] == list(enumerate(beats))
    assert [end["lane"] for end in configuration["ends"]] == last_lanes


@pytest.mark.parametrize(
    ("width", "first", "last", "keep"), [(8, 3, 15, "1"), (32, 0, 3, "0001"), (64, 0, 1, "00011111")]
)
def test_the_publishers_beats(width: int, first: int, last: int, keep: str) -> None:
    configuration = publisher_configuration(layout(ROS1, "float64 a\n"), width)
    assert [configuration[name] for name in ("first_position", "last_position", "last_keep")] == [first, last, keep]
    assert configuration["all_bits"] == (last + 1) * width
    assert configuration["is_last_full"] is ("0" not in keep)


def test_widths_without_a_template_are_refused() -> None:
    frame = layout(ROS1, "uint8 a\n")
    for configuration in (subscriber_configuration, publisher_configuration):
        with pytest.raises(InputError, match=r"converters do not support 12-bit streams\n.*legal here: 8"):
            configuration(frame, 12)


def test_a_frame_of_more_bits_than_vhdl_counts_is_refused() -> None:
    """Of arrays that are not so long that they are streams."""

    def frame(count: int) -> Frame:
        return layout(ROS1, f"E[4095] e\nuint8[{count}] b\n", {"p/E": "uint8[65536] a\n"})

    assert publisher_configuration(frame(65_527), 8)["all_bits"] == 8 * (2**28 - 1)
    for configuration in (subscriber_configuration, publisher_configuration):
        with pytest.raises(InputError, match=r"p/M has 268435448 bytes, which is too many for a converter"):
            configuration(frame(65_528), 8)
