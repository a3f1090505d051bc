"""`firm init`: new projects pass their simulations at once; what can be forwarded is, and nothing else."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.message.library import libraries
from fusesoc_firm.system.scaffold.pass_through import wires_of
from fusesoc_firm.system.scaffold.project import Project, ask, create
from fusesoc_firm.system.system_core import load_system
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.prompts import PipeAsker
from tests.system.simulated.systems import build, call

Captured = pytest.CaptureFixture[str]

# `number` follows `label` in one message and precedes it in the other: to the latter, the label cannot be forwarded.
LATE = "string label\nint32 number\nfloat64[] values\n"
EARLY = "int32 number\nstring label\nfloat64[] values\n"


def made(folder: Path, project: Project) -> Path:
    """A new project, with messages of its own beside it."""
    package = folder / "demo_msgs" / "msg"
    package.mkdir(parents=True)
    for name, text in (("Late", LATE), ("Early", EARLY)):
        (package / f"{name}.msg").write_text(text, encoding="utf-8")
    known = libraries([folder / "demo_msgs"], os.environ, None)
    create(project, folder / project.name, known, [folder / "demo_msgs"])
    return folder / project.name


def forwarded(folder: Path, name: str) -> list[str]:
    """The streams and elements that the accelerator of a project forwards."""
    known = libraries([folder.parent / "demo_msgs"], os.environ, None)
    (type_,) = load_system(folder / f"{name}.yaml", known).system.accelerator_types
    (wires,) = wires_of(type_)
    return [port.removeprefix("in_") for port in wires.ready]


@pytest.mark.one_in(3)
@pytest.mark.parametrize(
    ("given", "taken", "ready"),
    [
        ("sensor_msgs/Imu", "geometry_msgs/Vector3Stamped", ["header_frame_id_axis_tready"]),
        ("demo_msgs/Late", "demo_msgs/Early", ["values_axis_tready"]),
        ("demo_msgs/Early", "demo_msgs/Late", ["label_field_axis_tready", "values_axis_tready"]),
        ("sensor_msgs/Image", "sensor_msgs/CompressedImage", ["header_frame_id_axis_tready", "data_axis_tready"]),
        (
            "sensor_msgs/JointState",
            "sensor_msgs/JointState",
            [
                "header_frame_id_axis_tready",
                "name_ready",
                "name_element_axis_tready",
                *(f"{name}_axis_tready" for name in ("position", "velocity", "effort")),
            ],
        ),
        ("geometry_msgs/Pose", "geometry_msgs/Pose", []),
    ],
    ids=lambda value: value.rpartition("/")[2] if isinstance(value, str) else "",
)
def test_a_new_project_passes(tmp_path: Path, given: str, taken: str, ready: list[str]) -> None:
    folder = made(tmp_path, Project("first", given, taken, width=32))
    assert forwarded(folder, "first") == ready
    request = call(folder / "first.yaml", folder / "stimuli.yaml", folder / "model.py", paths=["../demo_msgs"])
    system = build(request, tmp_path / "system")
    assert system.passes(STALL_PERCENT=0)
    assert system.passes(SEED=3, STALL_PERCENT=60)
    assert system.work.latches("first") == []


def test_hardware_passes_messages_to_software(tmp_path: Path) -> None:
    folder = made(tmp_path, Project("first", "sensor_msgs/Imu", "geometry_msgs/Vector3Stamped", language="software"))
    assert (folder / "software" / "first.py").is_file()
    assert (folder / "rtl" / "pass_through.vhd").is_file()
    assert build(call(folder / "first.yaml", folder / "stimuli.yaml", folder / "model.py"), tmp_path / "s").passes()


def test_the_command_writes_a_whole_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["--in", "geometry_msgs/Point", "--out", "geometry_msgs/Vector3", "--ros", "1", "--width", "64"]
    assert main(["init", "turn", *arguments, "--language", "verilog"]) == 0
    names = ["fusesoc.conf", "model.py", "rtl/turn.v", "stimuli.yaml", "turn.core", "turn.yaml"]
    assert capsys.readouterr().out.splitlines() == [
        *(f"turn/{name}" for name in names),
        "ROS 1: geometry_msgs/Point in, geometry_msgs/Vector3 out",
        "edit: turn/rtl/turn.v (the computation), turn/model.py (the responses that it must give)",
        "next: cd turn && firm sim",
    ]
    specification: Any = yaml.safe_load((tmp_path / "turn" / "turn.yaml").read_text())
    assert specification["project"] == {"name": "turn", "width": 64}
    assert (tmp_path / "turn" / "build" / "FUSESOC_IGNORE").exists()
    assert "ignored_dirs = build" in (tmp_path / "turn" / "fusesoc.conf").read_text()
    assert main(["system", "check", "turn/turn.yaml"]) == 0
    capsys.readouterr()
    assert main(["init", "turn", *arguments]) == 1
    assert "cannot write turn: it exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "message", "said"),
    [
        ("entity", "geometry_msgs/Point", "'entity' is not legal"),
        ("../turn", "geometry_msgs/Point", "'../turn' is not legal"),
        ("pub", "geometry_msgs/Point", "'pub' is the name of another block"),
        ("turn", "geometry_msgs/Pont", "did you mean 'geometry_msgs/Point'"),
        ("turn", "Point", "'Point' is not a message name"),
    ],
)
def test_nothing_is_written_after_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, name: str, message: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", name, "--in", message, "--out", "geometry_msgs/Point"]) == 1
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_fault_in_the_new_specification_names_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "turn", "--in", "nav_msgs/Path", "--out", "std_msgs/UInt8", "--language", "hls"]) == 1
    assert capsys.readouterr().err.startswith("error: 'turn' has the type HLS")


def test_six_questions() -> None:
    def names(ros: int) -> list[str]:
        assert ros == 1
        return ["a_msgs/A", "a_msgs/B"]

    answers = ["turn", "1", "a_msgs/A", "a_msgs/B", "", "64"]
    project = ask({}, PipeAsker(answers, io.StringIO()), names, ["8", "64"])
    assert project == Project("turn", "a_msgs/A", "a_msgs/B", 1, "vhdl", 64)
    with pytest.raises(InputError, match="answer 1: 'in' cannot be 'a_msgs/C'"):
        ask({"name": "turn", "ros": "1"}, PipeAsker(["a_msgs/C"], io.StringIO()), names, ["8", "64"])
