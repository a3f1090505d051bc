"""The tutorial 'Your first accelerator in 15 minutes', followed literally."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages.console import blocks, check
from tools.pages.page import DOCS, Page

PAGE = Page(DOCS / "tutorials" / "first-accelerator.md")


@pytest.mark.check
def test_the_tutorial_ends_with_a_pass(tmp_path: Path) -> None:
    assert check(PAGE, tmp_path) == []


def test_the_tutorial_is_short() -> None:
    """At most three commands of `firm`, the last of which shows a pass, and 40 typed lines."""
    found = [*blocks(PAGE)]
    steps = [step for block in found if not (block.file or block.installs) for step in block.steps()]
    commands = [command for command, _ in steps]
    assert sum("firm " in command for command in commands) == 3
    assert steps[-1][1][-1] == "PASS 3/3"
    typed = sum(len(block.lines) for block in found if block.file) + sum(len(item.splitlines()) for item in commands)
    assert typed <= 40
