"""What the cores of the library promise to the owner of another one."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
GENERATORS = "robot:firm:generators"


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


def test_the_changelog_has_each_new_name() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert [name for name in CORES if ":firm_" in name and f"`{name}`" not in changelog] == []
