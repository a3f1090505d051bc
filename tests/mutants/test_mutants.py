"""The mutants fit the sources: a line that has moved is told here, not only when all of them are tried."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path

import pytest

from tests.hdl.ghdl import REPOSITORY
from tools.mutants.mutants import HARDWARE, KINDS, PROGRAM, PYTHON, SOFTWARE, Mutant, as_json, mutants

# The smallest number of mutants of each kind.
FEWEST = {PYTHON: 40, HARDWARE: 50, SOFTWARE: 22, PROGRAM: 8}
MUTANT = Mutant("a/b.vhd.mustache", "if x > 1", "if x >= 1", "tests/one.py")


def test_each_line_is_there_once() -> None:
    assert [mistake for mutant in mutants() for mistake in mutant.mistakes()] == []


def test_the_tests_are_there() -> None:
    words = {word.partition("::")[0] for mutant in mutants() for word in shlex.split(mutant.tests)}
    places = {word for word in words if word.startswith("tests")}
    assert places
    assert [place for place in sorted(places) if not (REPOSITORY / place).exists()] == []


def test_no_mutant_is_there_twice() -> None:
    found = Counter((mutant.file, mutant.line, mutant.fault) for mutant in mutants())
    assert [mutant for mutant, count in found.items() if count > 1] == []


def test_there_are_enough_of_each_kind() -> None:
    counts = Counter(mutant.kind for mutant in mutants())
    assert {kind: counts[kind] for kind, fewest in FEWEST.items() if counts[kind] < fewest} == {}


def test_patterns_choose_by_the_path() -> None:
    chosen = mutants(["fusesoc_firm/node", "fusesoc_firm/frame"])
    assert {Path(mutant.file).parts[1] for mutant in chosen} == {"frame", "node"}


@pytest.mark.parametrize(
    ("text", "mistakes"),
    [
        ("if x > 1 then\n", []),
        ("if x > 1 then\nif x > 1 then\n", ["the line is there 2 times instead of once"]),
        ("", ["the line is there 0 times instead of once"]),
        (None, ["the line is there 0 times instead of once"]),
    ],
)
def test_a_line_that_is_not_there_once_is_told(text: str | None, mistakes: list[str], tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "a").mkdir()
        (tmp_path / MUTANT.file).write_text(text, encoding="utf-8")
    name = "a/b.vhd.mustache: if x > 1 -> if x >= 1"
    assert [*MUTANT.mistakes(tmp_path)] == [f"{name}: {mistake}" for mistake in mistakes]


def test_a_fault_takes_the_place_of_the_line(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / MUTANT.file).write_text("  if x > 1 then\n", encoding="utf-8")
    assert MUTANT.apply(tmp_path) == "  if x > 1 then\n"
    assert (tmp_path / MUTANT.file).read_text(encoding="utf-8") == "  if x >= 1 then\n"


@pytest.mark.parametrize(
    ("file", "kind"),
    [
        ("fusesoc_firm/a.py", 0),
        ("cores/a.vhd", 1),
        ("fusesoc_firm/templates/vhdl/a.vhd.mustache", 1),
        ("fusesoc_firm/templates/node/a.cpp.mustache", 2),
        ("fusesoc_firm/node/c/a.h", 2),
        ("fusesoc_firm/fabric/a.seq", 3),
    ],
)
def test_the_kind_follows_from_the_name(file: str, kind: int) -> None:
    assert Mutant(file, "a", "b", "").kind == KINDS[kind]


def test_an_entry_of_a_report() -> None:
    entry = as_json(MUTANT, "found", 1.26)
    assert (entry["file"], entry["verdict"], entry["seconds"]) == ("a/b.vhd.mustache", "found", 1.3)
