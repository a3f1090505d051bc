"""The guarantees of the library's cores for a project with other cores."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm import __version__
from fusesoc_firm.tools.library_path import library_root
from tests.hdl.ghdl import core_description

ROOT = Path(__file__).resolve().parents[2]
GENERATORS = "robot:firm:generators"
LICENSE = "Apache-2.0"
# A dependency on one of our cores, also under a condition.
_OURS = re.compile(r"[^\s('\"]*robot:\w+:\w+[^\s)'\"]*")


CORES = {
    core["name"].rpartition(":")[0]: core
    for room in ("cores", "generators", "specs")
    for path in sorted((ROOT / room).rglob("*.core"))
    for core in [core_description(path)]
}


@pytest.mark.parametrize("name", CORES)
def test_a_reusable_core_is_recognised_by_its_name(name: str) -> None:
    """Another project's `cdc` is then the only core of that name."""
    _, library, short = name.split(":")
    assert short.startswith("firm_") or library == "sys" or name == GENERATORS


def test_the_last_part_of_a_name_is_enough() -> None:
    """`fusesoc run firm_cdc` needs no library name."""
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


CONVERTER = """\
CAPI=2:
name: me:p:one:1.0
filesets: {base: {depend: ["robot:firm:generators"]}}
generate: {pose: {generator: firm, parameters: {message: geometry_msgs/Point, ros: 2}}}
targets:
  default:
    filesets: [base]
    generate: [pose]
    toplevel: axis_to_geometry_msgs_point
    flow: generic
    flow_options: {tool: ghdl}
"""


def test_what_a_project_generates_is_no_core_of_its_own_folder(tmp_path: Path) -> None:
    """FuseSoC takes every .core below a library, and a build is below a project's own folder."""
    (tmp_path / "one.core").write_text(CONVERTER)
    (tmp_path / "fusesoc.conf").write_text(
        f"[library.firm]\nlocation = {library_root()}\n[library.own]\nlocation = .\n"
    )

    def fusesoc(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "fusesoc.main", *arguments],
            cwd=tmp_path,
            env=os.environ | {"FUSESOC_FIRM_CACHE": str(tmp_path / "store")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=True,
        )
        return done.stdout

    for origin in ("generated", "from store"):
        assert f"firm: one-pose {origin}" in fusesoc("run", "--setup", "me:p:one")
        (ignored,) = tmp_path.rglob("FUSESOC_IGNORE")
        listed = fusesoc("core", "list")
        assert "me:p:one:1.0 " in listed
        assert "one-pose" not in listed
        ignored.unlink()
