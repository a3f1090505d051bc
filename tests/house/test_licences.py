"""docs/reference/licences.md, as `make licences` writes it: pyproject.toml's requirements, and programs of builds."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

from fusesoc_firm.tools.programs import PROGRAMS

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "licences.md"


def rows(section: str) -> list[list[str]]:
    """The cells of each row of the first table in a section, without the header."""
    text = PAGE.read_text(encoding="utf-8").partition(f"\n## {section}\n")[2]
    found = re.search(r"^\|.*\n\| --- .*\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert found, f"no table in {section}"
    return [line.strip("| ").split(" | ") for line in found[1].splitlines()]


def test_the_direct_dependencies_are_those_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups: dict[str, list[str]] = {"run time": project["dependencies"], **project["optional-dependencies"]}
    asked = {
        (name.lower(), group)
        for group, items in groups.items()
        for item in items
        if (name := Requirement(item).name) != project["name"]
    }
    listed = {(name.lower(), group) for name, by, *_ in rows("Python packages") for group in by.split(", ")}
    assert listed == asked, "make licences"


def test_each_row_has_a_version_and_a_licence() -> None:
    for name, *_, version, licence in rows("Python packages") + rows("Programs and ROS 1") + rows("ROS 2"):
        assert re.match(r"\d", version), name
        assert licence not in ("", "UNKNOWN"), name


def test_every_package_of_debian_that_builds_may_need_is_listed() -> None:
    listed = {name for section in ("Programs and ROS 1", "Other programs") for name, *_ in rows(section)}
    assert {program.debian for program in PROGRAMS.values()} - {""} <= listed
