"""Two generated cores of a design never define a unit differently, with FuseSoC and with `firm build`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.fusesoc_run import _units_of
from fusesoc_firm.tools.library_path import library_root

CORE = """\
CAPI=2:
name: me:p:{name}:1.0
filesets: {{base: {{depend: ["robot:firm:generators"]}}}}
generate: {{pose: {{generator: firm, parameters: {{message: geometry_msgs/Point, {parameters}}}}}}}
targets: {{default: {{filesets: [base], generate: [pose]}}}}
"""
TOP = """\
CAPI=2:
name: me:p:top:1.0
filesets: {base: {depend: ["me:p:left", "me:p:right"]}}
targets:
  default: {filesets: [base], toplevel: x, flow: generic, flow_options: {tool: yosys, arch: ice40}}
"""
BIN = Path(sys.executable).parent


class Project:
    """A design of two cores, each of which generates a converter."""

    def __init__(self, root: Path) -> None:
        self.root = root
        root.mkdir()
        (root / "top.core").write_text(TOP)
        places = {"p": ".", "firm": library_root() / "generators", "cores": library_root() / "cores"}
        libraries = (f"[library.{name}]\nlocation = {place}\n" for name, place in places.items())
        (root / "fusesoc.conf").write_text("".join(libraries))

    def write(self, left: str, right: str) -> None:
        for name, parameters in (("left", left), ("right", right)):
            (self.root / f"{name}.core").write_text(CORE.format(name=name, parameters=parameters))

    def set_up(self, *command: str | Path) -> subprocess.CompletedProcess[str]:
        """Set up the design with FuseSoC or another command; standard error is merged into the output."""
        fusesoc = shutil.which("fusesoc", path=str(BIN))
        assert fusesoc
        build = str(self.root.parent / "build")
        return subprocess.run(
            command or [fusesoc, "run", "--setup", "--build-root", build, "me:p:top"],
            cwd=self.root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            env=os.environ
            | {
                "FUSESOC_FIRM_PYTHON": sys.executable,
                "PYTHONPATH": str(library_root().parents[1]),
                "FUSESOC_FIRM_CACHE": str(self.root.parent / "store"),
                "HOME": str(self.root.parent),
            },
        )

    def refuse(self, *command: str | Path) -> str:
        done = self.set_up(*command)
        assert done.returncode, done.stdout
        assert "Traceback" not in done.stdout
        return done.stdout

    def accept(self) -> None:
        done = self.set_up()
        assert done.returncode == 0, done.stdout


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path / "project")


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("right", "unit"),
    [("ros: 2, width: 32", "axis_to_geometry_msgs_point"), ("ros: 1", "geometry_msgs_point_pkg")],
    ids=["width", "ros"],
)
def test_a_unit_in_two_ways_is_refused_naming_both_cores(project: Project, right: str, unit: str) -> None:
    project.write("ros: 2", right)
    # First generated, then from the store by its key, then recalled.
    for _ in range(3):
        said = project.refuse()
        assert "right.core:4:" in said
        assert f"me:p:right-pose:1.0 and me:p:left-pose:1.0 define the design unit '{unit}' differently" in said
        assert "name: left" in said


def test_firm_build_refuses_it_too(project: Project) -> None:
    project.write("ros: 2", "ros: 2, width: 32")
    command: list[str | Path] = [BIN / "firm", "build", "me:p:top", "--target", "default", "--setup"]
    command += ["--build-root", project.root.parent / "build"]
    for _ in range(2):
        said = project.refuse(*command)
        assert "me:p:right-pose:1.0 and me:p:left-pose:1.0 define the design unit" in said


def test_what_is_legal_is_accepted_whatever_earlier_runs_left(project: Project) -> None:
    project.write("ros: 2", "ros: 2")  # the same twice
    project.accept()
    project.write("ros: 2", "ros: 1, width: 32, name: right")
    project.accept()
    # The folders of width 8 remain, with the same names of cores and units.
    project.write("ros: 2, width: 64", "ros: 1, width: 16, name: right")
    project.accept()
    names = {path.name for path in (project.root.parent / "build").rglob("src/*right-pose*/*.vhd")}
    assert names >= {
        "right_axis_to_geometry_msgs_point.vhd",
        "right_geometry_msgs_point_to_axis.vhd",
        "right_geometry_msgs_point_pkg.vhd",
    }
    project.write("ros: 2, width: 64, name: right", "ros: 1, width: 16, name: right")
    project.refuse()
    # Each library has its own units.
    project.write("ros: 2, width: 64, logical_name: left_ip", "ros: 1, width: 16, logical_name: right_ip")
    project.accept()
    (edam,) = (project.root.parent / "build").rglob("*.eda.yml")
    libraries = {item.get("logical_name") for item in yaml.safe_load(edam.read_text())["files"]}
    assert {"left_ip", "right_ip", "firm"} <= libraries


def test_units_are_found_as_tools_see_them() -> None:
    vhdl = b"-- entity no is\nENTITY Yes IS\nend;\npackage body p is\npackage p is\r\nu: entity work.other\n"
    files = {"a.vhd": vhdl, "b.v": b"module m (\n// module n\n", "c.txt": b"entity text is"}
    assert set(_units_of(files)) == {"yes", "p", "m"}
    assert set(_units_of({**files, "x.core": b"- a.vhd:\n    logical_name: ip\n"})) == {"ip.yes", "ip.p", "ip.m"}
