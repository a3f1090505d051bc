"""The examples of docs/how-to/use-python.md."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

from fusesoc_firm.system.scaffold.example import copy_example
from fusesoc_firm.tools.library_path import demos_root
from tests.hdl.ghdl import REPOSITORY

PAGE = REPOSITORY / "docs" / "how-to" / "use-python.md"


def test_the_examples_of_the_page_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    list(copy_example("quat2euler", Path("quat2euler"), demos_root()))
    result = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert (result.attempted > 15, result.failed) == (True, 0)
