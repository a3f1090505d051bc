"""Every fault of the samples in tests/errors leads to what it concerns: by lines that another YAML library counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.studio.scene import outline, scene
from fusesoc_firm.system.system_core import LoadedSystem, load_system
from fusesoc_firm.system.written.specification import Draft

SAMPLES = Path(__file__).parents[1] / "errors" / "spec"


def block_of(text: str, line: int) -> int | None:
    """The index of the block whose lines contain a line (from 1), or None; the last item may end anywhere."""
    content: Any = YAML().load(text)
    blocks = content.get("blocks") if isinstance(content, CommentedMap) else None
    if not isinstance(blocks, CommentedSeq) or blocks.fa.flow_style():
        return None
    first_key = min(
        (content.lc.key(key)[0] for key in content if content.lc.key(key)[0] > blocks.lc.line), default=10**9
    )
    starts = [blocks.lc.item(index)[0] for index in range(len(blocks))]
    if line - 1 >= first_key:
        return None
    return max((index for index, start in enumerate(starts) if start <= line - 1), default=None)


def test_faults_lead_to_their_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(SAMPLES)
    libraries = {ros: MessageLibrary(ros, [Path("messages")]) for ros in (ROS1, ROS2)}
    seen = 0
    for path in filter(Path.is_file, sorted(SAMPLES.glob("*.yaml"))):
        text = path.read_bytes().decode("utf-8-sig", errors="replace")

        def load(text: str, name: str = path.name) -> LoadedSystem:
            return load_system(Draft(Path(name), text), libraries)

        found = scene(text, path.name, load)
        # A system that has no blocks yet is not wrong yet.
        is_empty = path.stem == "no_blocks"
        assert any(fault["severity"] == "error" for fault in found["faults"]) != is_empty, path
        if found["specification"] is None:
            continue
        for fault in found["faults"]:
            if fault["path"] is None:
                assert fault.get("file") != path.name, (path, fault)
                continue
            try:
                block = block_of(text, fault["line"])
            except YAMLError:
                continue
            if block is not None:
                assert fault["path"][:2] == ["blocks", block], (path, fault)
                seen += 1
    assert seen > 100


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("project: {name: a}\n", 0),
        ("project: {name: a}\nblocks: []\n", 0),
        ("project: {name: a}\nblocks:\n", 0),
        ("project: {name: a, widht: 8}\nblocks: []\n", 1),
        ("project: {name: a}\nblocks: {}\n", 1),
        ("blocks: []\n", 1),
    ],
)
def test_an_empty_system_is_not_wrong_yet(text: str, count: int) -> None:
    libraries = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}
    found = scene(text, "a.yaml", lambda text: load_system(Draft(Path("a.yaml"), text), libraries))
    assert (len(found["faults"]), found["derived"]) == (count, None)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("project: {name: a}\n", []),
        ("blocks: []\n", []),
        ("blocks: 5\n", []),
        ("- blocks\n", []),
        ("blocks:\n  - name: a\n    mode: b\n  - {name: c}\n\npaths: [x]\n", [(2, 3), (4, 5)]),
        ("blocks: [{name: a}, {name: b}]\n", [(1, 1), (1, 1)]),
        ("paths: [x]\nblocks:\n  # First.\n  - name: a\n    type: b", [(4, 5)]),
        ("blocks:\n  - &a {name: a}\n  - *a\n", [(2, 2), (2, 3)]),
    ],
)
def test_the_lines_of_blocks(text: str, lines: list[tuple[int, int]]) -> None:
    assert outline(text)["lines"] == lines
