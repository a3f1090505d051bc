"""Frame to the configuration of a publisher of variable size: places, words, and names in the text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import pytest

from fusesoc_firm.converter.message_ports import message_ports
from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.converter.variable_publisher import (
    VARIABLE_PUBLISHER_TEMPLATE,
    variable_publisher_configuration,
)
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.render import TEMPLATES, Context, render
from tests.frame.test_layout import layout

HEADER = "uint32 seq\ntime stamp\nstring frame_id\n"
IMAGE = "Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"


def configured(frame: Frame, width: int = 8) -> Context:
    return variable_publisher_configuration(frame, width, "p_m_to_axis")


def places(configuration: Context) -> list[tuple[int, int | None, str]]:
    return [(area["first"], area["last"], area["text"]) for area in configuration["areas"]]


def words(configuration: Context) -> list[tuple[int, int, str]]:
    """The highest and lowest bit of each piece of the words, with its value, in the order of the text."""
    text = render(VARIABLE_PUBLISHER_TEMPLATE, configuration)
    found = re.findall(r"^  all_words\((\d+) downto (\d+)\) *<= (.*);$", text, re.MULTILINE)
    return [(int(high), int(low), value) for high, low, value in found]


def image() -> Frame:
    return layout(ROS1, IMAGE.replace("Header header", "H header"), {"p/H": HEADER})


def test_the_places_of_an_image() -> None:
    assert places(configured(image())) == [
        (0, 4, "id and the payload's length"),
        (5, 16, "12 bytes: header.seq, header.stamp.sec, header.stamp.nsec"),
        (17, 20, "count of header.frame_id"),
        (21, None, "opens header.frame_id"),
        (22, None, "stream of header.frame_id"),
        (23, 30, "8 bytes: height, width"),
        (31, 34, "count of encoding"),
        (35, None, "opens encoding"),
        (36, None, "stream of encoding"),
        (37, 41, "5 bytes: is_bigendian, step"),
        (42, 45, "count of data"),
        (46, None, "opens data"),
        (47, None, "stream of data"),
    ]


@pytest.mark.parametrize(("width", "end"), [(8, 48), (16, 28), (32, 18), (64, 14), (128, 13), (512, 13)])
def test_a_wider_stream_has_fewer_places(width: int, end: int) -> None:
    assert configured(image(), width)["end"] == end


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_each_bit_of_the_words_is_driven_once(ros: Middleware, width: int) -> None:
    text = "bool a\nstring s\nE[2] e\nfloat64[] b\nF[] f\nuint8[70] big\n"
    frame = layout(ros, text, {"p/E": "uint8 x\nstring t\nuint32 y\n", "p/F": "bool[3] g\nuint64 h\n"})
    configuration = configured(frame, width)
    driven = [bit for high, low, _ in words(configuration) for bit in range(low, high + 1)]
    assert driven == list(range(configuration["all_bits"]))


@pytest.mark.parametrize("width", WIDTHS)
def test_the_word_of_the_end_is_zeros(width: int) -> None:
    """Zeros fill the rest of a frame."""
    for size in range(40):
        configuration = configured(layout(ROS1, f"uint8[{size}] block\nstring text\n"), width)
        high, low, value = words(configuration)[-1]
        assert value == "(others => '0')"
        assert high + 1 == configuration["all_bits"] == (configuration["end"] + 1) * width
        assert low <= configuration["end"] * width


def test_zeros_in_a_row_are_one_place() -> None:
    frame = select(layout(ROS1, "uint8[100] a\nuint8 b\nuint8[7] c\nstring s\n"), {"b": None, "s": None})
    configuration = configured(frame)
    assert configuration["repeats"] == [{"place": 5, "last": 99}, {"place": 7, "last": 6}]
    assert configuration["repeat_bits"] == 7
    # Words begin with the block: four of them and the rest of the fifth.
    wide = configured(frame, 128)
    assert (wide["repeats"], wide["repeat_bits"]) == ([{"place": 1, "last": 5}], 3)


def test_a_short_row_of_zeros_stays_as_it_is() -> None:
    frame = select(layout(ROS1, "uint8[3] a\nuint8 b\nstring s\n"), {"b": None, "s": None})
    assert not configured(frame)["repeats"]


def test_a_counter_is_as_wide_as_its_elements_need() -> None:
    assert configured(layout(ROS1, "uint8[] a\n"))["left_bits"] == 32
    assert configured(layout(ROS1, "uint8[] a\nfloat64[] b\n"))["left_bits"] == 35
    (depth,) = configured(layout(ROS1, "string[3] a\n"))["depths"]
    assert (depth["bits"], depth["fixed"][0]["value"]) == (2, '"01"')
    inner, outer = configured(layout(ROS1, "E[2] e\n", {"p/E": "string[] a\n"}))["depths"]
    assert (inner["bits"], outer["bits"]) == (2, 32)


def test_a_block_that_ends_an_element_ends_it_with_its_last_word() -> None:
    """A stream that ends an element needs a place for it."""
    with_block = configured(layout(ROS1, "E[] e\n", {"p/E": "string s\nuint16 x\n"}))
    assert (16, 17, "2 bytes: e.x") in places(with_block)
    assert with_block["closings"] == [{"name": "e", "place": 17}]
    with_stream = configured(layout(ROS1, "E[] e\n", {"p/E": "string s\n"}))
    assert places(with_stream)[-1][2] == "closes an element of e"


def test_a_message_that_is_too_large_is_an_error() -> None:
    with pytest.raises(InputError, match=r"the fields of p/M have .* bytes, which is too many for a converter"):
        configured(layout(ROS1, "E[4600] e\nstring s\n", {"p/E": "uint8[65536] a\n"}))


def test_every_name_of_the_text_is_kept_from_fields() -> None:
    """A field with the name of any declaration in the architecture gets another name."""
    template = (TEMPLATES / f"{VARIABLE_PUBLISHER_TEMPLATE}.mustache").read_text(encoding="utf-8")
    template = template.replace("{{{depth}}}", "1")
    declared = set(re.findall(r"^  (?:signal|constant) (\w+)", template, re.MULTILINE))
    declared |= set(re.findall(r"^  (\w+) : (?:process|entity|for)", template, re.MULTILINE))
    declared |= set(re.findall(r"^use firm\.\w+\.(\w+);", template, re.MULTILINE))
    assert len(declared) > 60
    frame = layout(ROS1, "string text\n" + "".join(f"uint8 {name}\n" for name in sorted(declared)))
    ports = {port.name.lower() for port in message_ports(frame, 8)}
    assert not ports & {name.lower() for name in declared}


def chains(text: str) -> Iterator[list[str]]:
    """The conditions of each conditional assignment and of each `if` with an `elsif`, in order, with "" for `else`."""
    body = re.sub(r"--.*", "", text).partition("\nbegin")[2]
    for statement in body.split(";"):
        if conditions := re.findall(r"\bwhen\s(.*?)\selse\b", statement, re.DOTALL):
            yield [*conditions, ""]
    for process in re.findall(r"\bprocess\b.*?\bend process\b", body, re.DOTALL):
        for chain in re.findall(r"\n      if .*?\n      end if;", process, re.DOTALL):
            yield re.findall(r"\n      (?:els)?if (.*?) then\n", chain, re.DOTALL)


def holds(condition: str, place: int, bits: Mapping[str, str]) -> bool | None:
    """Whether the condition holds at a place; None if other signals decide, too."""
    for name, definition in bits.items():
        condition = condition.replace(f"{name} = '1'", definition)
    condition = re.sub(r"\bplace_r = (\d+)", lambda found: str(place == int(found[1])), condition)
    condition = re.sub(r"is_equal\(place_index, (\d+)\)", lambda found: str(place == int(found[1])), condition)
    condition = re.sub(r"is_below\(place_index, (\d+)\) = '1'", lambda found: str(place < int(found[1])), condition)
    is_pure = re.fullmatch(r"(?:True|False|or|\s)+", condition)
    return eval(" ".join(condition.split())) if is_pure else None


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    "text",
    [
        "string a\n",
        "float64[] a\n",
        "uint8[3] a\nstring[2] b\n",
        "E[] e\nuint16[] f\n",
        "uint8[70] a\nE[3] e\nstring s\n",
        "string a\nuint32 b\nstring c\nuint8[] d\n",
    ],
)
@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_each_branch_is_that_of_some_place(ros: Middleware, text: str, width: int) -> None:
    """A branch that earlier ones cover, or whose places do not exist, is neither read nor tested by anyone."""
    configuration = configured(layout(ros, text, {"p/E": "uint8 x\nstring t\n"}), width)
    vhdl = render(VARIABLE_PUBLISHER_TEMPLATE, configuration)
    bits = dict(re.findall(r"\n  (in_stream|in_padding) +<= (.*?);", vhdl, re.DOTALL))
    found = list(chains(vhdl))
    assert found
    for conditions in found:
        left = set(range(configuration["end"] + 1))
        for condition in conditions:
            decided = {place: holds(condition, place, bits) if condition else True for place in left}
            assert any(is_held is not False for is_held in decided.values()), (condition, conditions)
            left -= {place for place, is_held in decided.items() if is_held}


@pytest.mark.parametrize("ros", [ROS1, ROS2])
def test_lines_are_of_a_readable_length(ros: Middleware) -> None:
    """For any number of parts; declarations of ports are as long as their names."""
    text = "".join(f"string s{number}\nuint8[] d{number}\n" for number in range(60))
    lines = render(VARIABLE_PUBLISHER_TEMPLATE, configured(layout(ros, text))).splitlines()
    assert max(map(len, lines)) <= 130
    assert len(lines) < 120 * 35
