"""What the cores of the library promise to the owner of another one."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm import __version__

ROOT = Path(__file__).resolve().parents[2]
GENERATORS = "robot:firm:generators"
LICENSE = "Apache-2.0"
# One core of ours that another one depends on, also under a condition.
_OURS = re.compile(r"[^\s('\"]*robot:\w+:\w+[^\s)'\"]*")


def read_core(path: Path) -> dict[str, Any]:
    core: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8").replace("CAPI=2:", "", 1))
    return core


CORES = {
    core["name"].rpartition(":")[0]: core
    for room in ("cores", "generators", "specs")
    for path in sorted((ROOT / room).rglob("*.core"))
    for core in [read_core(path)]
}


@pytest.mark.parametrize("name", CORES)
def test_a_reusable_core_is_recognised_by_its_name(name: str) -> None:
    """Somebody else's `cdc` is then the only one of that name."""
    _, library, short = name.split(":")
    assert short.startswith("firm_") or library == "sys" or name == GENERATORS


def test_the_last_part_of_a_name_is_enough() -> None:
    """`fusesoc run firm_cdc` takes no library."""
    assert max(Counter(name.rpartition(":")[2] for name in CORES).values()) == 1


@pytest.mark.parametrize("name", CORES)
def test_a_core_is_of_the_packages_version_and_so_is_what_it_depends_on(name: str) -> None:
    core = CORES[name]
    assert core["name"] == f"{name}:{__version__}"
    assert core["license"] == LICENSE
    depends = [item for fileset in core["filesets"].values() for item in fileset.get("depend", ())]
    for found in _OURS.findall(" ".join(depends)):
        assert re.fullmatch(rf"~robot:\w+:\w+:{re.escape(__version__)}", found), f"{found} is not ~NAME:{__version__}"


def test_the_package_has_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert (project["version"], project["license"]) == (__version__, LICENSE)
    assert f"## [{__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
