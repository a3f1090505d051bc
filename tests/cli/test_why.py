"""`firm why`: each generated line leads to the lines that made it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from fusesoc_firm import __version__
from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS
from fusesoc_firm.cli import main
from fusesoc_firm.core.request import GeneratorCall, as_files
from fusesoc_firm.text.render import TEMPLATES, Rendering, recorded, render, traced_lines

SPECS = Path(__file__).resolve().parents[2] / "specs"
APPLICATIONS = ("quat2euler", "image_pipeline", "mobile_robot")

Captured = pytest.CaptureFixture[str]


def no_messages(_: object) -> tuple[Path, ...]:
    return ()


def build(folder: Path, application: str = "quat2euler", **parameters: object) -> Path:
    """A build as FuseSoC leaves it: the generated core and its copy, which is returned."""
    given = {"spec": f"{application}.yaml"} | parameters
    generator = "far" if "spec" in parameters or not parameters else "firm"
    root, vlnv = SPECS / application, f"robot:sys:{application}-system:{__version__}"
    if generator == "firm":
        given, root = parameters, folder
        core = {"name": f"robot:sys:{application}:1", "generate": {"system": {"generator": "firm"}}}
        (folder / "converters.core").write_text(f"CAPI=2:\n{yaml.safe_dump(core)}")
    request = make_request(
        GeneratorCall(generator, vlnv, str(root), given), GENERATORS[generator].parameters, no_messages
    )
    made = folder / "generator_cache" / f"robot_sys_{application}-system_{__version__}-1234"
    for name, content in as_files(GENERATORS[generator].load(request).generate(), request).items():
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_bytes(content)
    call = {"files_root": str(root), "vlnv": vlnv, "parameters": given}
    (made / "system_input.yml").write_text(yaml.safe_dump(call))
    copy = folder / "src" / f"robot_sys_{application}-system_{__version__}"
    shutil.copytree(made, copy, ignore=shutil.ignore_patterns("*.yml"))
    return copy


def line_with(path: Path, text: str) -> int:
    return next(number for number, line in enumerate(path.read_text().splitlines(), 1) if text in line)


def why(capsys: Captured, path: Path, text: str) -> dict[str, list[str]]:
    """Return the explanation of the line with `text`: kinds and places."""
    assert main(["why", f"{path}:{line_with(path, text)}"]) == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert text in first
    found: dict[str, list[str]] = {}
    for line in rest:
        kind, place = line.split(maxsplit=1)
        found.setdefault(kind, []).append(place)
    return found


@pytest.mark.parametrize("application", APPLICATIONS)
def test_every_line_is_that_of_the_template_named(application: str) -> None:
    """The text of a template's line, without its tags, is in the generated line."""
    call = GeneratorCall("far", f"a:b:{application}-x:1", str(SPECS / application), {"spec": f"{application}.yaml"})
    request = make_request(call, GENERATORS["far"].parameters, no_messages)
    with recorded() as renderings:
        GENERATORS["far"].load(request).generate()
    for text, rendering in renderings.items():
        lines = traced_lines(rendering)
        assert [line.text for line in lines] == text.splitlines()
        for before, line in zip([None, *lines], lines, strict=False):
            if before and replace(before, text=line.text) == line:
                continue  # a value of several lines
            source = (TEMPLATES / line.template).read_text().splitlines()[line.line - 1]
            start = source.partition("{{")[0]
            assert not line.text or line.text.lstrip().startswith(start.lstrip()) or not start.strip()


def test_scopes_are_paths_in_the_context(tmp_path: Path) -> None:
    (number,) = (
        line.scope
        for line in traced_lines(Rendering("partials/port_map", {"ports": [{"formal": "a", "actual": "b"}] * 3}))[1:2]
    )
    assert number == "ports[1]"


def test_a_port_of_a_converter(tmp_path: Path, capsys: Captured) -> None:
    path = build(tmp_path) / "axis_to_geometry_msgs_quaternion.vhd"
    template = "vhdl/subscriber.vhd.mustache"
    number = line_with(TEMPLATES / template, "-- {{{comment}}}")
    found = why(capsys, path, "-- y: float64")
    assert found["message"] == ["<rosbags ros1_noetic>/geometry_msgs/Quaternion:2: float64 y"]
    assert found["template"] == [f"{template}:{number} for ports[1]"]
    assert "specification" not in found


def test_a_signal_and_an_instance_of_a_system(tmp_path: Path, capsys: Captured) -> None:
    path = build(tmp_path) / "quat2euler_system.vhd"
    spec = (SPECS / "quat2euler" / "quat2euler.yaml").read_text().splitlines()
    block = next(line for line in spec if "QuaternionToEuler_sub" in line)
    found = why(capsys, path, "signal QuaternionToEuler_sub_z ")
    assert [place.partition(": ")[2] for place in found["specification"]] == [block.strip()]
    assert found["message"] == ["<rosbags ros1_noetic>/geometry_msgs/Quaternion:3: float64 z"]
    # The scope names the block where the line does not.
    found = why(capsys, path, "=> pub_axis_tlast(0)")
    assert [place.partition(": ")[2] for place in found["specification"]] == [
        next(line for line in spec if "QuaternionToEuler_pub" in line and "name: " in line).strip()
    ]
    assert list(why(capsys, path, "library ieee;")) == ["template"]


def test_a_core_of_converters_alone_and_all_lines(tmp_path: Path, capsys: Captured) -> None:
    path = build(tmp_path, message="geometry_msgs/Pose", ros=2) / "axis_to_geometry_msgs_pose.vhd"
    found = why(capsys, path, "-- orientation.w: float64")
    assert [place.partition("/geometry_msgs/")[2] for place in found["message"]] == [
        "Quaternion:4: float64 w",
        "Pose:2: geometry_msgs/Quaternion orientation",
    ]
    assert main(["why", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(path.read_text().splitlines())
    assert all(line.startswith(f"{number}: ") for number, line in enumerate(lines, start=1))
    # Which generator it was, nobody else knows.
    (tmp_path / "converters.core").unlink()
    assert main(["why", str(path)]) == 1
    assert f"error: no core in {tmp_path} generates " in capsys.readouterr().err


def test_the_generated_core_itself_may_be_named(tmp_path: Path, capsys: Captured) -> None:
    build(tmp_path)
    (path,) = (tmp_path / "generator_cache").rglob("quat2euler_system.vhd")
    assert "template" in why(capsys, path, "architecture")


def test_faults(tmp_path: Path, capsys: Captured) -> None:
    copy = build(tmp_path)

    def fault(place: str) -> str:
        assert main(["why", place]) == 1
        return capsys.readouterr().err

    path = copy / "quat2euler_system.vhd"
    last = len(path.read_text().splitlines())
    for number in (last + 1, 0):
        assert f"has no line {number}; its last line is {last}" in fault(f"{path}:{number}")
    source = SPECS / "quat2euler/rtl/quat2euler.vhd"
    assert f"was not generated from a template\n      = the file is a copy of {source}\n" in fault(
        f"{copy / 'quat2euler/rtl/quat2euler.vhd'}:1"
    )
    (copy / "robot.vhd").write_text("")
    assert "'robot.vhd' is not a file of the generated core" in fault(f"{copy / 'robot.vhd'}:1")
    path.write_text(path.read_text() + "-- edited\n")
    assert "is outdated or was edited" in fault(f"{path}:1")
    (tmp_path / "a.vhd").write_text("")
    assert "is not a generated file" in fault(str(tmp_path / "a.vhd"))
    for place in (f"{copy / 'nothing.vhd'}:1", f"{path}:x", f"{path}:-1", str(copy), ""):
        assert "there is no file" in fault(place)


def test_recording_ends(tmp_path: Path) -> None:
    with recorded() as renderings:
        pass
    render("partials/port_map", {"ports": []})
    assert renderings == {}
