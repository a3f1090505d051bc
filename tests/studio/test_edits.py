"""Edits of specifications: each changes its own lines alone, and its inverse gives the same bytes."""

from __future__ import annotations

import difflib
import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.studio.edits import edited
from fusesoc_firm.text.yaml_edit import EditError
from tests.random_systems import random_system
from tests.seeds import seeded

SEED = seeded(20261124)
SPECS = sorted(
    path
    for path in (Path(__file__).parents[2] / "specs").glob("*/*.yaml")
    if "\nblocks:" in path.read_text(encoding="utf-8")
)


def changes(old: str, new: str) -> list[tuple[str, list[str], list[str]]]:
    """The lines that differ: what happened to them, as they were and as they are."""
    before, after = old.splitlines(), new.splitlines()
    codes = difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
    return [(code, before[i:j], after[k:m]) for code, i, j, k, m in codes if code != "equal"]


def there_and_back(text: str, edit: dict[str, Any], back: dict[str, Any]) -> str:
    """The text after an edit, whose inverse gives the same bytes."""
    made = edited(text, edit)
    assert made != text, edit
    assert edited(made, back) == text, (edit, back)
    return made


def check_all_edits(text: str, source: random.Random) -> set[str]:
    """One edit of each kind and its inverse, at random places; the kinds that the text had a place for."""
    seen = set()
    data = yaml.safe_load(text)
    blocks = data["blocks"]
    converters = [number for number, block in enumerate(blocks) if "mode" in block]
    number = source.choice(converters)
    path = ["blocks", number]
    # A value.
    change = {"edit": "set", "path": path, "key": "message"}
    made = there_and_back(text, change | {"value": "a_msgs/B"}, change | {"value": blocks[number]["message"]})
    assert [len(after) for _, _, after in changes(text, made)] == [1]
    seen.add("set")
    # A key that is not there.
    missing = [name for name in ("topic", "maxLength", "include") if name not in blocks[number]]
    change = {"edit": "set", "path": path, "key": missing[0]}
    made = there_and_back(text, change | {"value": "7"}, change | {"value": None})
    assert len(changes(text, made)) == 1
    seen.add("new key")
    # A block.
    place = source.randrange(len(blocks) + 1)
    value = {"name": "new_block", "type": "x", "outgoing": [{"name": "y", "include": ["a", "b"]}]}
    add = {"edit": "add", "path": ["blocks"], "value": value, "index": place}
    made = there_and_back(text, add, {"edit": "remove", "path": ["blocks", place]})
    assert yaml.safe_load(made)["blocks"][place] == value
    assert [code for code, _, _ in changes(text, made)] == ["insert"]
    seen.add("add")
    # Its name, there and wherever it is used.
    old = blocks[number]["name"]
    made = there_and_back(
        text, {"edit": "rename", "path": path, "name": "renamed"}, {"edit": "rename", "path": path, "name": old}
    )
    uses = sum(way["name"] == old for block in blocks for way in block.get("outgoing", []))
    assert yaml.safe_dump(yaml.safe_load(made)).count("renamed") == uses + 1
    assert sum(len(after) for _, _, after in changes(text, made)) <= uses + 1
    seen.add("rename")
    # A connection.
    ends = {"source": source.choice(blocks)["name"], "sink": source.choice(blocks)["name"]}
    start = next(block for block in blocks if block["name"] == ends["source"])
    if ends["sink"] not in [way["name"] for way in start.get("outgoing") or []]:
        made = there_and_back(text, {"edit": "connect", **ends}, {"edit": "disconnect", **ends})
        assert len(changes(text, made)) == 1
        seen.add("connect")
    # No block, and no connection to it.
    made = edited(text, {"edit": "remove", "path": path})
    left = yaml.safe_load(made)["blocks"]
    assert [block["name"] for block in left] == [block["name"] for block in blocks if block["name"] != old]
    assert old not in [way["name"] for block in left for way in block.get("outgoing", [])]
    assert all(len(after) <= len(before) for _, before, after in changes(text, made))
    seen.add("remove")
    return seen


@pytest.mark.one_in(4)
@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_edits_of_the_shipped_specifications(path: Path) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    for _ in range(5):
        assert check_all_edits(path.read_text(encoding="utf-8"), source) >= {
            "set",
            "new key",
            "add",
            "rename",
            "remove",
        }


def commented(text: str, source: random.Random) -> str:
    """A text with comments behind lines and between them."""
    lines: list[str] = []
    for number, line in enumerate(text.splitlines()):
        if not source.randrange(4):
            lines.append(" " * (len(line) - len(line.lstrip())) + f"# above {number}")
        lines.append(line + (f"  # behind {number}" if not source.randrange(4) else ""))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("number", "count"), [(0, 10), *(pytest.param(number, 48, marks=pytest.mark.check) for number in range(1, 5))]
)
def test_edits_of_random_specifications(number: int, count: int) -> None:
    """200 systems, as they are written and in PyYAML's style, with comments."""
    print(f"seed {SEED + number}")
    source = random.Random(SEED + number)
    seen: set[str] = set()
    for _ in range(count):
        blocks = source.randint(2, 20)
        random_one = random_system(source, blocks, source.randint(1, blocks // 2))
        text = random_one.text
        if source.randrange(2):
            text = yaml.safe_dump(yaml.safe_load(text), sort_keys=False, indent=source.choice([2, 4]))
        seen |= check_all_edits(commented(text, source), source)
    assert seen == {"set", "new key", "add", "rename", "connect", "remove"}


TEXT = """\
project:
  {name: robot, clock: 10 MHz, clocks: [{name: fast, frequency: 20 MHz}], groups: [{scheduler: lru, publishers: b}]}
accelerators:
  - {name: acc, type: VHDL, sources: acc.vhd, interface: {input: [], output: []}}
blocks:
  - {name: a, type: acc, clock: fast, outgoing: [{name: b}]}
  - name: b
    mode: publisher
"""


@pytest.mark.parametrize(
    ("path", "old"), [(["blocks", 1], "b"), (["accelerators", 0], "acc"), (["project", "clocks", 0], "fast")]
)
def test_a_new_name_is_used_everywhere(path: list[str | int], old: str) -> None:
    expected, count = re.subn(rf"\b{old}\b(?!\.)", "other", TEXT)
    assert count == (3 if old == "b" else 2)
    assert edited(TEXT, {"edit": "rename", "path": path, "name": "other"}) == expected


def test_a_removed_block_leaves_nothing_behind() -> None:
    made = yaml.safe_load(edited(TEXT, {"edit": "remove", "path": ["blocks", 1]}))
    assert made["blocks"] == [{"name": "a", "type": "acc", "clock": "fast"}]
    assert "publishers" not in made["project"]["groups"][0]


def test_one_source_stays_without_brackets() -> None:
    edit = {"edit": "set", "path": ["accelerators", 0], "key": "sources"}
    assert "sources: b.vhd," in edited(TEXT, edit | {"value": ["b.vhd"]})
    assert "sources: [b.vhd, c.vhd]," in edited(TEXT, edit | {"value": ["b.vhd", "c.vhd"]})


def test_the_authors_spelling_of_a_key_stays() -> None:
    made = edited("project: {FPGA: x}", {"edit": "set", "path": ["project"], "key": "fpgaPart", "value": "xc7"})
    assert made == "project: {FPGA: xc7}"


def illegal() -> Iterator[tuple[dict[str, Any], str]]:
    yield {}, "there is no edit 'None'; legal here: set, add"
    yield {"edit": "set", "path": ["blocks", 0]}, "needs 'key'"
    yield {"edit": "set", "path": "blocks", "key": "name"}, "a path is a list"
    yield {"edit": "set", "path": ["blocks", 9], "key": "name", "value": "x"}, "there is no blocks.9"
    yield {"edit": "set", "path": ["blocks", "a"], "key": "name", "value": "x"}, "have a number"
    yield {"edit": "set", "path": ["blocks", 0, "name"], "key": "x", "value": "x"}, "'name' is not a section"
    yield {"edit": "set", "path": ["blocks", 0], "key": "nmae", "value": "x"}, "there is no key 'nmae' here; legal"
    yield {"edit": "set", "path": ["blocks", 0], "key": "outgoing", "value": [{}]}, "'add' adds one"
    yield {"edit": "set", "path": ["blocks", 0], "key": "topic", "value": ["x"]}, "must be a word"
    yield {"edit": "set", "path": ["blocks", 0], "key": "include", "value": {"a": 1}}, "a list of words"
    yield {"edit": "add", "path": [], "value": {}}, "needs the path of a list"
    yield {"edit": "add", "path": ["blocks"], "value": {}}, "takes no item"
    yield {"edit": "add", "path": ["blocks"], "value": {"colour": "red"}}, "there is no key 'colour'"
    yield {"edit": "add", "path": ["blocks"], "value": {"name": "x"}, "index": 7}, "has 2 items"
    yield {"edit": "remove", "path": ["project"]}, "needs the path of a list's item"
    yield {"edit": "remove", "path": ["blocks", 4]}, "there is no blocks.4"
    yield {"edit": "connect", "source": "a", "sink": "x"}, "there is no block 'x'"
    yield {"edit": "disconnect", "source": "b", "sink": "a"}, "'b' is not connected to 'a'"


@pytest.mark.parametrize(("edit", "reason"), [*illegal()])
def test_an_edit_that_cannot_be_made_is_refused(edit: dict[str, Any], reason: str) -> None:
    with pytest.raises(EditError, match=reason):
        edited(TEXT, edit)


@pytest.mark.parametrize("text", ["blocks: [", "[1, 2]", "", "blocks: 1"])
def test_a_file_of_another_kind_is_not_edited(text: str) -> None:
    with pytest.raises(EditError):
        edited(text, {"edit": "connect", "source": "a", "sink": "b"})
