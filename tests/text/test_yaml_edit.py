"""Edits of YAML files in place: the new data, by another YAML library, and every other character as before."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from copy import deepcopy
from typing import Any

import pytest
from ruamel.yaml import YAML

from fusesoc_firm.text.yaml_edit import EditError, insert, put, remove, word
from tests.seeds import seeded

SEED = seeded(20261124)
DOCUMENT = """\
# A system.
project: {name: arm, width: 64}   # one line

blocks:
  # the state
  - name: state  # of the joints
    mode: 'subscriber'
    include: [a, b]

    # where it goes
    outgoing:
      - name: left
      - name: right
  - name: left
    type:
"""
ORDER = ("name", "topic", "mode", "include", "outgoing")
EDITS: dict[str, tuple[Callable[[str], str], str, str]] = {
    "a plain value": (
        lambda text: put(text, ["blocks", 1, "name"], "top"),
        "- name: left\n    t",
        "- name: top\n    t",
    ),
    "a value in braces": (lambda text: put(text, ["project", "width"], "8"), "width: 64}", "width: 8}"),
    "a quoted value": (lambda text: put(text, ["blocks", 0, "mode"], "it's"), "'subscriber'", "'it''s'"),
    "a word that YAML misreads": (lambda text: put(text, ["project", "name"], "yes"), "arm", '"yes"'),
    "a value with a comment": (lambda text: put(text, ["blocks", 0, "name"], "s"), "state  #", "s  #"),
    "a missing value": (lambda text: put(text, ["blocks", 1, "type"], "arm"), "    type:\n", "    type: arm\n"),
    "a list in brackets": (lambda text: put(text, ["blocks", 0, "include"], ["b"]), "[a, b]", "[b]"),
    "a new key in braces": (
        lambda text: put(text, ["project", "clock"], "100 MHz"),
        "64}",
        "64, clock: 100 MHz}",
    ),
    "a new key in its order": (
        lambda text: put(text, ["blocks", 0, "topic"], "/s", ORDER),
        "joints\n",
        "joints\n    topic: /s\n",
    ),
    "a new key at the end": (
        lambda text: put(text, ["blocks", 1, "outgoing"], [{"name": "x"}]),
        "    type:\n",
        "    type:\n    outgoing:\n      - name: x\n",
    ),
    "a key at the top": (
        lambda text: put(text, ["paths"], ["a", "b c"], ("project", "paths", "blocks")),
        "# one line\n",
        "# one line\npaths: [a, b c]\n",
    ),
    "an item at the end": (
        lambda text: insert(text, ["blocks", 0, "outgoing"], 2, {"name": "x", "include": ["a", "b"]}),
        "- name: right\n",
        "- name: right\n      - name: x\n        include: [a, b]\n",
    ),
    "an item at the start": (
        lambda text: insert(text, ["blocks"], 0, {"name": "x"}),
        "  - name: state",
        "  - name: x\n  - name: state",
    ),
    "an item in brackets": (lambda text: insert(text, ["blocks", 0, "include"], 1, "c"), "[a, b]", "[a, c, b]"),
    "no item": (lambda text: remove(text, ["blocks", 0, "outgoing", 0]), "      - name: left\n", ""),
    "no first block": (
        lambda text: remove(text, ["blocks", 0]),
        DOCUMENT[DOCUMENT.index("  - name: state") : DOCUMENT.index("  - name: left\n    type")],
        "",
    ),
    "no key": (lambda text: remove(text, ["blocks", 0, "mode"]), "    mode: 'subscriber'\n", ""),
    "no first key": (lambda text: remove(text, ["blocks", 1, "name"]), "name: left\n    type", "type"),
    "no key in braces": (lambda text: remove(text, ["project", "width"]), ", width: 64", ""),
    "no first key in braces": (lambda text: remove(text, ["project", "name"]), "name: arm, ", ""),
    "no item in brackets": (lambda text: remove(text, ["blocks", 0, "include", 1]), ", b]", "]"),
}


@pytest.mark.parametrize("case", EDITS)
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_an_edit_changes_its_place_alone(case: str, line_end: str) -> None:
    edit, old, new = EDITS[case]
    assert DOCUMENT.count(old) == 1
    expected = DOCUMENT.replace(old, new).replace("\n", line_end)
    assert edit(DOCUMENT.replace("\n", line_end)) == expected
    # Neither a last line without an end nor a further document's mark is lost.
    assert edit(DOCUMENT.replace("\n", line_end).rstrip()).rstrip() == expected.rstrip()


@pytest.mark.parametrize(
    ("text", "edit", "reason"),
    [
        ("a: 1", lambda text: put(text, ["b", "c"], "x"), "there is no b"),
        ("a: [1]", lambda text: put(text, ["a", 3], "x"), "there is no a.3"),
        ("a: 1", lambda text: remove(text, ["b"]), "there is no b"),
        ("a: 1", lambda text: insert(text, ["a"], 0, "x"), "neither a mapping nor a list"),
        ("a: {b: 1}", lambda text: insert(text, ["a"], 0, "x"), "a is not a list"),
        ("a: &x [1]\nb: *x\n", lambda text: put(text, ["b", 0], "2"), "only by hand"),
        ("a: &x [1]\nb: *x\n", lambda text: remove(text, ["a"]), "only by hand"),
        ("a: &x {b: 1}\nc: {<<: *x}\n", lambda text: remove(text, ["c", "b"]), "'b' comes from another place"),
        ("a: [", lambda text: put(text, ["a"], "1"), "invalid YAML"),
        ("", lambda text: put(text, ["a"], "1"), "the file is empty"),
    ],
)
def test_what_cannot_be_edited_is_refused(text: str, edit: Callable[[str], str], reason: str) -> None:
    with pytest.raises(EditError, match=reason):
        edit(text)


@pytest.mark.parametrize(
    "text", ["", "yes", "1", "01", "1.5", "a: b", "a #b", "[", "é", "\x07", "~", "- a", "2026-11-24"]
)
def test_a_word_is_read_as_it_is(text: str) -> None:
    expected = int(text) if text == "1" else text
    assert YAML(typ="safe").load(f"a: {word(text)}\nb: [{word(text)}, {word(text)}]") == {
        "a": expected,
        "b": [expected, expected],
    }


class Writer:
    """Random data in random style, with comments wherever they may stand."""

    def __init__(self, source: random.Random) -> None:
        self._source = source
        self._count = 0
        self._offset = source.choice([0, 2, 4])

    def document(self) -> tuple[str, dict[str, Any]]:
        data = {f"key{number}": self._data(3) for number in range(self._source.randrange(1, 6))}
        return "\n".join(self._mapping(data, 0)) + self._source.choice(["", "\n", "\n\n# end\n"]), data

    def scalar(self) -> Any:
        return self._source.choice(
            ["a", "b c", "yes", "", "it's", "#x", 7, 64, "100 MHz", "geometry_msgs/Point", "0x1"]
        )

    def item(self) -> Any:
        """An item of a list, or a value: as the grammars of this project have them."""
        return self._source.choice([self.scalar(), {"name": self.scalar(), "include": ["a", self.scalar()]}])

    def _data(self, depth: int) -> Any:
        kind = self._source.randrange(4) if depth else 0
        if kind == 1:
            return {f"k{number}": self._data(depth - 1) for number in range(self._source.randrange(1, 4))}
        if kind == 2:
            return [self._data(0) for _ in range(self._source.randrange(1, 4))]
        if kind == 3:
            return [
                {f"k{place}": self._data(depth - 1) for place in range(self._source.randrange(1, 4))}
                for _ in range(self._source.randrange(1, 4))
            ]
        return self.scalar()

    def _mapping(self, data: dict[str, Any], column: int) -> Iterator[str]:
        for key, value in data.items():
            yield from self._comments(column)
            blanks = " " * column
            if self._is_flow(value):
                yield f"{blanks}{key}: {self._flow(value)}{self._comment()}"
            elif isinstance(value, dict):
                yield f"{blanks}{key}:{self._comment()}"
                yield from self._mapping(value, column + self._source.choice([2, 4]))
            else:
                yield f"{blanks}{key}:{self._comment()}"
                yield from self._list(value, column + self._offset)

    def _list(self, data: list[Any], column: int) -> Iterator[str]:
        for item in data:
            yield from self._comments(column)
            if self._is_flow(item):
                yield f"{' ' * column}- {self._flow(item)}{self._comment()}"
                continue
            lines = [*self._mapping(item, column + 2)]
            while not lines[0].strip() or lines[0].lstrip().startswith("#"):
                yield lines.pop(0)
            yield f"{' ' * column}- {lines[0].lstrip()}"
            yield from lines[1:]

    def _is_flow(self, value: Any) -> bool:
        return not isinstance(value, dict | list) or not self._source.randrange(4)

    def _flow(self, value: Any) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key}: {self._flow(item)}" for key, item in value.items()) + "}"
        if isinstance(value, list):
            return "[" + self._source.choice([", ", ",", " , "]).join(map(self._flow, value)) + "]"
        if isinstance(value, int):
            return str(value)
        styles = [word(value), f'"{value}"', "'" + value.replace("'", "''") + "'"]
        return str(self._source.choice(styles))

    def _comments(self, column: int) -> Iterator[str]:
        if not self._source.randrange(4):
            yield self._source.choice(["", " " * column + self._comment().strip()])

    def _comment(self) -> str:
        if self._source.randrange(3):
            return ""
        self._count += 1
        return f"  # comment {self._count}"


def paths(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The paths of all values."""
    for part, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*path, part)
        if isinstance(value, dict | list):
            yield from paths(value, (*path, part))


def at(data: Any, path: tuple[str | int, ...]) -> Any:
    for part in path:
        data = data[part]
    return data


def is_kept(old: str, new: str) -> bool:
    """Whether the lines before and after one place are as before."""
    before, after = old.split("\n"), new.split("\n")
    same = next((n for n, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), len(before))
    rest_old, rest_new = before[same:], after[same:]
    while rest_old and rest_new and rest_old[-1] == rest_new[-1]:
        rest_old.pop(), rest_new.pop()
    return len(rest_old) <= 1 or len(rest_new) <= 1


def test_random_edits_of_random_files() -> None:
    """Each edit has the data that it should, and its inverse gives the same bytes."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    loader = YAML(typ="safe")
    made = 0
    for _ in range(150):
        writer = Writer(source)
        text, data = writer.document()
        assert loader.load(text) == data
        path = source.choice([*paths(data)])
        parent = path[:-1]
        # A new item, at the path or after the last one; or a new key.
        expected = deepcopy(data)
        new = writer.item()
        if isinstance(at(data, parent), list):
            index = source.randrange(len(at(data, parent)) + 1)
            changed = insert(text, parent, index, new)
            at(expected, parent).insert(index, new)
            back = remove(changed, (*parent, index))
        else:
            changed = put(text, (*parent, "new"), new)
            at(expected, parent)["new"] = new
            back = remove(changed, (*parent, "new"))
        assert loader.load(changed) == expected, (text, path, new)
        assert is_kept(text, changed), (text, changed)
        assert back.rstrip("\n") == text.rstrip("\n"), (text, path, new)
        # Another value; a value keeps its style, so the way back has the same bytes.
        if not isinstance(at(data, path), dict | list):
            value = writer.scalar()
            changed = put(text, path, value)
            assert is_kept(text, changed)
            assert str(at(loader.load(changed), path)) == str(value)
        # One value less.
        expected = deepcopy(data)
        del at(expected, parent)[path[-1]]
        less = remove(text, path)
        assert loader.load(less) == expected, (text, path)
        made += 1
    assert made == 150
