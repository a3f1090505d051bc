"""The generator `firm`, as FuseSoC calls it: which fields get ports, and where a fault in their paths is shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.builds.call.answer import main

CORE = """\
CAPI=2:
name: me:robots:arm:1.0
generate:
  tip:
    generator: firm
    parameters:
      message: arm_msgs/Tip
      ros: 2
      paths: [msgs]
{selection}
"""


class Project:
    """A core that asks for the converters of a message."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "msgs" / "arm_msgs").mkdir(parents=True)
        (folder / "msgs" / "arm_msgs" / "Tip.msg").write_text(
            "geometry_msgs/Pose pose\nuint8 mode 3\nuint16[4] torque\n"
        )

    def run(self, selection: str) -> int:
        text = CORE.format(selection=selection)
        (self.folder / "arm.core").write_text(text)
        given = yaml.safe_load(text.removeprefix("CAPI=2:\n"))["generate"]["tip"]["parameters"]
        call = {"gapi": "1.0", "files_root": str(self.folder), "vlnv": "me:robots:arm-tip:1.0", "parameters": given}
        Path("call.yml").write_text(yaml.safe_dump(call))
        return main("firm", ["call.yml"])


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setenv("FUSESOC_FIRM_CACHE", str(tmp_path / "store"))
    return Project(tmp_path)


def fields(file: str) -> list[str]:
    """The field ports of a converter: those whose comment names a field and its type."""
    return re.findall(r"^    (\w+) *: (?:in|out) .*; *-- [\w.\[\]]+: \w+$", Path(file).read_text(), re.MULTILINE)


@pytest.mark.parametrize(
    ("selection", "expected"),
    [
        ("", ["pose_position_x", "pose_position_y", "pose_position_z"]),
        ("      include: [torque]", ["torque"]),
        ("      include: [pose.position, mode]", ["pose_position_x", "pose_position_y", "pose_position_z", "mode"]),
        ("      include: [pose.position]\n      exclude: [pose.position.y]", ["pose_position_x", "pose_position_z"]),
        ("      exclude: [pose, torque]", ["mode"]),
        ("      exclude: [pose, torque, mode]", []),
    ],
)
def test_only_the_fields_that_are_used_have_ports(project: Project, selection: str, expected: list[str]) -> None:
    assert project.run(selection) == 0
    for file in ("axis_to_arm_msgs_tip.vhd", "arm_msgs_tip_to_axis.vhd"):
        found = fields(file)
        assert (found if selection else found[:3]) == expected


def test_a_wrong_path_is_shown_in_the_core(project: Project, capsys: pytest.CaptureFixture[str]) -> None:
    assert project.run("      include: [pose.positon]\n      exclude:\n        - mode\n        - modes") == 1
    core = project.folder / "arm.core"
    assert (
        capsys.readouterr().err
        == f"""\
{core}:10:17: error: arm_msgs/Tip has no field 'pose.positon'
   10 |       include: [pose.positon]
      |                 ^~~~~~~~~~~~
      = did you mean 'pose.position'?
{core}:13:11: error: arm_msgs/Tip has no field 'modes'
   13 |         - modes
      |           ^~~~~
      = did you mean 'mode'?
"""
    )
    assert not list(Path().glob("*.core"))
