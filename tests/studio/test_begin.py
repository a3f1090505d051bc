"""A project that begins in the page is the one of `firm init`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.studio.server import Studio
from tests.studio.served import served
from tests.studio.test_server import ask, scene

FORM = {"name": "tilt", "in": "sensor_msgs/Imu", "out": "geometry_msgs/Vector3"}


@pytest.fixture
def studio(tmp_path: Path) -> Iterator[Studio]:
    (tmp_path / "studio").mkdir()
    with served(tmp_path / "studio") as studio:
        yield studio


def files_of(folder: Path) -> dict[str, bytes]:
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def test_it_is_what_the_command_writes(studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ask(studio, "GET", "api/outline")[2] is None
    choices = ask(studio, "GET", "api/choices")[2]
    assert choices["languages"] == ["vhdl", "verilog", "hls", "python", "software"]
    assert ask(studio, "GET", "api/types?ros=1&query=imu")[2] == {"messages": ["sensor_msgs/Imu"]}
    answer = {"language": "verilog", "width": 32, "ros": 2}
    assert ask(studio, "POST", "api/init", FORM | answer)[2] == {"file": "tilt/tilt.yaml"}
    (tmp_path / "command").mkdir()
    monkeypatch.chdir(tmp_path / "command")
    options = ["--language", "verilog", "--width", "32"]
    assert main(["init", "tilt", "--in", FORM["in"], "--out", FORM["out"], *options]) == 0
    assert files_of(tmp_path / "studio") == files_of(tmp_path / "command")
    assert ask(studio, "GET", "api/files")[2] == {"files": ["tilt/tilt.yaml"]}
    assert scene(studio, "tilt/tilt.yaml")["faults"] == []


@pytest.mark.parametrize(
    ("answers", "status"),
    [
        ({"name": "../tilt"}, 409),
        ({"name": ""}, 409),
        ({"name": "signal"}, 409),
        ({"in": "no_msgs/Such"}, 409),
        ({"width": 7}, 400),
        ({"width": "8"}, 400),
        ({"language": "sh"}, 400),
        ({"ros": True}, 400),
    ],
    ids=str,
)
def test_answers_that_no_project_has_write_nothing(
    studio: Studio, tmp_path: Path, answers: dict[str, object], status: int
) -> None:
    assert ask(studio, "POST", "api/init", FORM | answers)[0] == status
    assert files_of(tmp_path) == {}


def test_nothing_is_overwritten(studio: Studio, tmp_path: Path) -> None:
    assert ask(studio, "POST", "api/init", FORM)[0] == 200
    before = files_of(tmp_path)
    assert ask(studio, "POST", "api/init", FORM)[0] == 409
    assert files_of(tmp_path) == before
    with served(tmp_path / "studio" / "tilt" / "tilt.yaml") as single:
        assert ask(single, "POST", "api/init", FORM | {"name": "other"})[0] == 404
    assert files_of(tmp_path) == before
