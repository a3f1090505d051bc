"""YAML with places: the parsed nodes, and the reports of invalid YAML."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.text.yaml_text import (
    MOST_LEVELS,
    Text,
    YamlText,
    is_null,
    items,
    kind,
    parse_yaml,
    read_yaml,
    yaml_data,
)


def parse(text: str) -> tuple[YamlText, str]:
    """The text's nodes, and the faults as printed."""
    faults = Diagnostics()
    parsed = parse_yaml(text, "a.yaml", faults)
    return parsed, "\n".join(str(fault) for fault in faults.found)


def mapping(text: str) -> tuple[YamlText, yaml.MappingNode]:
    parsed, fault = parse(text)
    assert not fault
    assert isinstance(parsed.root, yaml.MappingNode)
    return parsed, parsed.root


def test_a_word_knows_its_place() -> None:
    parsed, root = mapping("a: 1\nbcd:   efg  # comment\n")
    text = parsed.text(root.value[1][1])
    assert text == "efg"
    assert isinstance(text, Text)
    assert text.source is not None
    assert (str(text.source), text.source.width, text.source.text) == ("a.yaml:2:8", 3, "bcd:   efg  # comment")


@pytest.mark.parametrize("word", ["1e-3", "0x10", "yes", "2024-01-01", "1_000"])
def test_a_word_stays_as_it_was_written(word: str) -> None:
    parsed, root = mapping(f"a: {word}\n")
    assert parsed.text(root.value[0][1]) == word


def test_what_has_several_lines_is_shown_by_its_first() -> None:
    parsed, root = mapping("a:\n  - b  \n  - c\n")
    source = parsed.source(root.value[0][1])
    assert (source.line, source.column, source.width) == (2, 3, 3)


def test_a_default_has_no_place() -> None:
    assert Text("x").source is None


@pytest.mark.parametrize(("text", "is_nothing"), [("a:", True), ("a: ~", True), ("a: null", True), ("a: ''", False)])
def test_nothing(text: str, is_nothing: bool) -> None:
    _, root = mapping(text)
    assert is_null(root.value[0][1]) is is_nothing


def test_kinds() -> None:
    _, root = mapping("a: b\nc: [d]\ne: {f: g}\nh:\n")
    assert [kind(value) for _, value in root.value] == ["'b'", "a list", "a mapping", "nothing"]


def test_items_come_once() -> None:
    parsed, root = mapping("a: 1\nb: 2\na: 3\n[c]: 4\n")
    faults = Diagnostics()
    assert [key for key, _, _ in items(parsed, root, faults)] == ["a", "b"]
    assert [str(fault).splitlines()[0] for fault in faults.found] == [
        "a.yaml:3:1: error: key 'a' is given twice",
        "a.yaml:4:1: error: a key must be a word",
    ]


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("a: b\n\tc: d\n", ["a.yaml:2:1: error: invalid YAML: found character '\\t' that cannot start any token"]),
        ("a: [b, c\n", ["a.yaml:1:4: error: invalid YAML: expected ',' or ']', but got '<stream end>'"]),
        ("a: 'b\nc: d\n", ["a.yaml:1:4: error: invalid YAML: found unexpected end of stream"]),
        ("a: b\nc d\ne: f\n", ["a.yaml:2:1: error: invalid YAML: could not find expected ':'"]),
        ("a: *b\n", ["a.yaml:1:4: error: invalid YAML: found undefined alias 'b'"]),
        ("a: b\n---\nc: d\n", ["a.yaml:2:1: error: invalid YAML: but found another document"]),
        ("a: &b [*b]", ["a.yaml:1:8: error: invalid YAML: the alias '*b' is inside its own value"]),
        ("&a\nb: {c: *a}", ["a.yaml:2:8: error: invalid YAML: the alias '*a' is inside its own value"]),
        (
            "a: \x01\x02",
            [
                "a.yaml:1:4: error: invalid YAML: it contains the control character 0x01",
                "a.yaml:1:5: error: invalid YAML: it contains the control character 0x02",
            ],
        ),
        (
            "a: " + "\x01" * 300,
            [f"a.yaml:1:{4 + n}: error: invalid YAML: it contains the control character 0x01" for n in range(200)],
        ),
        ("a: @b", ["a.yaml:1:4: error: invalid YAML: found character '@' that cannot start any token"]),
        (
            "a: b\x01\nc: \x00[\n",
            [
                "a.yaml:1:5: error: invalid YAML: it contains the control character 0x01",
                "a.yaml:2:4: error: invalid YAML: it contains the control character 0x00",
            ],
        ),
    ],
)
def test_what_is_no_yaml_is_shown_where_it_begins(text: str, faults: list[str]) -> None:
    _, found = parse(text)
    assert [line for line in found.splitlines() if ": error: " in line] == faults


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("a: [b, c\nd: e\n", "close the list with ']'"),
        ("a: 'b\nc: d\n", "close the quotation mark"),
        ("a:\n  d: e\n  b:c\n", "write 'key: value', with a blank after the colon"),
        ("a:\n  b:c\n  d: e\n", "write a blank after the colon in line 2"),
    ],
)
def test_what_the_parser_was_reading_selects_the_cure(text: str, cure: str) -> None:
    _, fault = parse(text)
    assert cure in fault.splitlines()[-1]


def test_the_bracket_that_is_open_is_named() -> None:
    _, fault = parse("a: {b: c\nd:\n  - e\n")
    assert fault.splitlines()[-1] == (
        "      = close the mapping with '}', or separate its items with ','; it begins at a.yaml:1:4"
    )


@pytest.mark.parametrize(
    ("text", "legal"),
    [
        ("a:\n  b: c\n # d\n e: f\n", "0 (a, line 1), 2 (b, line 2)"),
        ("a:\n  - - b: c - d\n\n   e: f\n", "0 (a, line 1), 2 (-, line 2), 4 (-, line 2), 6 (b, line 2)"),
        ("  a: b\nc: d\n", "2 (a, line 1)"),
        ("a:\n    b: c\nd:\n  e: f\n   g: h\n", "0 (a, line 1), 2 (e, line 4)"),
    ],
)
def test_how_far_a_line_may_be_indented_is_said(text: str, legal: str) -> None:
    _, fault = parse(text)
    indent = len(text.splitlines()[-1]) - len(text.splitlines()[-1].lstrip())
    assert (
        fault.splitlines()[-1]
        == f"      = the line is indented by {indent}, but the open blocks above are indented by {legal}"
    )


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("a: b\nc: d\n\te: f\n", ["a", "c"]),
        ("a: b\nc: [d\ne: f\n", ["a"]),
        ("a: b\nc: d\n---\n", ["a", "c"]),
    ],
)
def test_what_stands_above_is_kept(text: str, keys: list[str]) -> None:
    parsed, fault = parse(text)
    assert fault
    assert parsed.is_cut
    assert isinstance(parsed.root, yaml.MappingNode)
    assert [key.value for key, _ in parsed.root.value] == keys


@pytest.mark.parametrize("text", ["", "# nothing\n", "[a\n", "\ta: b\n"])
def test_nothing_stands_above(text: str) -> None:
    assert parse(text)[0].root is None


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: b\r\nc: d\r\n")
    parsed = read_yaml(path, "a.yaml")
    assert isinstance(parsed.root, yaml.MappingNode)
    assert str(parsed.source(parsed.root.value[0][1])) == "a.yaml:1:4"
    assert parsed.lines == ("a: b", "c: d")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "error: cannot read a.yaml: No such file or directory"),
        (b"a: \xff\n", "a.yaml:1:4: error: byte 0xff is not UTF-8"),
        (b"a: [\n", "a.yaml:1:4: error: invalid YAML"),
    ],
)
def test_a_file_that_cannot_be_read(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "a.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as raised:
        read_yaml(path, "a.yaml")
    assert str(raised.value).startswith(message)


def test_the_levels_below_an_alias_count() -> None:
    """Data of any depth could otherwise be written with few levels in the text."""
    levels = MOST_LEVELS // 2
    text = f"a: &a {'[' * levels}{']' * levels}\nb: {'[' * levels}*a{']' * levels}\n"
    with pytest.raises(InputError, match=f"a.yaml:2:{levels + 4}: error: the file is too large: more than 64 levels"):
        parse(text)


@pytest.mark.parametrize(
    "value",
    [
        "!!timestamp a",
        "!!int ''",
        "!!float a",
        "!!bool a",
        "!!python/name:os.system",
        "2026-99-99",
        "{[]: a}",
        "{{}: a}",
        "9" * 1001,
        f"0x{'f' * 1000}",
        f"1{':1' * 1000}",
    ],
    ids=range(11),
)
def test_data_that_no_value_fits_are_invalid(value: str) -> None:
    with pytest.raises(yaml.YAMLError):
        yaml_data(f"a: {value}\n")
