"""The builds for boards that the page asks for: offered boards, steps, result, cancellation, and refused requests."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.studio import boards
from fusesoc_firm.studio.server import Studio
from fusesoc_firm.tools.programs import missing
from tests.studio.served import served
from tests.studio.test_resources import has_ended
from tests.studio.test_server import ask, scene

FILE = "tilt/tilt.yaml"
BUILD = {"file": FILE, "board": "ulx3s"}
STEP = '{"step": "synthesis", "number": 4, "count": 6, "line": "2.1. Executing"}'
END = '{"state": "done", "bitstream": "build/x.bit", "clocks": [], "area": []}'

Job = dict[str, Any]


@pytest.fixture
def studio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Studio]:
    """The page of a folder with the project tilt in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    assert main(["init", "tilt", "--in", "geometry_msgs/Vector3", "--out", "geometry_msgs/Vector3"]) == 0
    with served(tmp_path) as studio:
        yield studio


@pytest.fixture
def firm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Replace the command `firm` by a script, which notes its folder and its words."""

    def replaced(script: str) -> None:
        path = tmp_path / "firm.sh"
        path.write_text(f'echo "$PWD" "$@" >> {tmp_path}/calls\n{script}\n', encoding="utf-8")
        monkeypatch.setattr(boards, "_FIRM", ("/bin/sh", str(path)))

    return replaced


def reported(studio: Studio, is_last: Callable[[Job], bool], kind: str = "bitstream") -> list[Job]:
    """The states of a build in the reports, until the last one."""

    async def follow() -> list[Job]:
        found: list[Job] = []
        async with aiohttp.ClientSession() as session, session.ws_connect(f"{studio.address}api/watch") as socket:
            while not (found and is_last(found[-1])):
                report = await socket.receive_json(timeout=300)
                await socket.send_str("1")
                found += [report["jobs"][kind]] if kind in report.get("jobs", {}) else []
        return found

    return asyncio.run(follow())


def result(studio: Studio, path: str, body: object) -> Job:
    """The state of a build at its end."""
    assert ask(studio, "POST", f"api/{path}", body)[:1] == (200,)
    return reported(studio, lambda job: job["state"] != "running", path)[-1]


def test_boards_that_the_system_fits_are_offered(studio: Studio, tmp_path: Path) -> None:
    def offered() -> dict[str, Any]:
        return {offer["name"]: offer for offer in ask(studio, "GET", f"api/boards?file={FILE}")[2]["boards"]}

    found = offered()
    open_boards = ["crosslink_nx_evn", "gatemate_a1_evb", "icebreaker", "step_mxo2", "tangnano9k", "ulx3s"]
    assert [name for name in found if not found[name]["isProject"]] == open_boards
    assert found["ulx3s"]["command"] == "firm bitstream tilt.yaml --board ulx3s"
    assert found["ulx3s"]["folder"] == found["quartus"]["folder"] == str(tmp_path / "tilt")
    assert found["quartus"]["command"] == "fusesoc run --setup --target=quartus robot:sys:tilt:0.1.0"
    assert (found["ulx3s"]["loader"], found["ulx3s"]["description"]) == (True, "Radiona ULX3S, Lattice ECP5 LFE5U-85F")
    text = (tmp_path / FILE).read_text(encoding="utf-8")
    text = text.replace("project:\n", "project:\n  scheduler: fixed_priority_preemptive\n")
    edit = {"file": FILE, "version": scene(studio, FILE)["version"], "text": text}
    assert ask(studio, "POST", "api/write", edit)[0] == 200
    assert all(offer["isProject"] for offer in offered().values())


def test_missing_programs_have_their_commands(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards, "missing", lambda programs: [name for name in programs if name in ("yosys", "vivado")])
    found = {offer["name"]: offer for offer in ask(studio, "GET", f"api/boards?file={FILE}")[2]["boards"]}
    assert "yosys: apt-get install --no-install-recommends yosys" in found["ulx3s"]["missing"]
    assert found["zcu104"]["isProject"] and not found["zcu104"]["missing"]
    monkeypatch.setattr(boards, "missing", lambda _: [])
    found = {offer["name"]: offer for offer in ask(studio, "GET", f"api/boards?file={FILE}")[2]["boards"]}
    assert not found["zcu104"]["isProject"] and not found["ulx3s"]["missing"]
    assert found["quartus"]["isProject"]


def test_a_system_without_a_core_is_told_so(studio: Studio, tmp_path: Path) -> None:
    (tmp_path / "tilt" / "tilt.core").unlink()
    for method, path, body in ("GET", f"boards?file={FILE}", None), ("POST", "bitstream", BUILD):
        status, _, found = ask(studio, method, f"api/{path}", body)
        assert status == 409
        assert "firm system core tilt.yaml" in found["reason"]


def test_steps_and_result_are_reported(studio: Studio, firm: Callable[[str], None], tmp_path: Path) -> None:
    firm(f"echo '{STEP}'; while [ ! -e {tmp_path}/go ]; do sleep 0.1; done; echo '{END}'")
    assert ask(studio, "POST", "api/bitstream", BUILD)[0] == 200
    job = reported(studio, lambda job: "step" in job)[-1]
    assert {**BUILD, "state": "running", "number": 4, "line": "2.1. Executing"}.items() <= job.items()
    # One build at a time.
    status, _, found = ask(studio, "POST", "api/load", BUILD)
    assert (status, "a build is running" in found["reason"]) == (409, True)
    (tmp_path / "go").touch()
    job = reported(studio, lambda job: job["state"] != "running")[-1]
    assert (job["state"], job["bitstream"], job["folder"]) == ("done", "build/x.bit", str(tmp_path / "tilt"))
    # The bitstream's result stays beside that of its loading.
    assert result(studio, "load", BUILD | {"flash": True})["state"] == "done"
    assert reported(studio, lambda job: True)[-1]["bitstream"] == "build/x.bit"
    folder = tmp_path / "tilt"
    assert (tmp_path / "calls").read_text(encoding="utf-8").splitlines() == [
        f"{folder} bitstream tilt.yaml --board ulx3s --json",
        f"{folder} load tilt.yaml --board ulx3s --json --flash",
    ]


def test_a_command_without_a_result_has_failed(studio: Studio, firm: Callable[[str], None]) -> None:
    firm("echo 'a traceback'; echo 3; exit 3")
    job = result(studio, "bitstream", BUILD)
    assert (job["state"], job["output"]) == ("failed", ["a traceback", "3"])
    assert job["faults"] == [{"severity": "error", "message": "firm bitstream ended with status 3"}]


def test_a_command_that_cannot_start_has_failed(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boards, "_FIRM", ("/nowhere/firm",))
    job = result(studio, "bitstream", BUILD)
    assert job["state"] == "failed"
    assert job["faults"][0]["message"].endswith("No such file or directory")
    assert ask(studio, "POST", "api/cancel", {})[0] == 200


def test_a_cancelled_build_ends_with_its_programs(studio: Studio, firm: Callable[[str], None], tmp_path: Path) -> None:
    """They get a signal at which `make` removes half-written files, before they are ended."""
    firm(f"trap 'touch {tmp_path}/told' TERM; sleep 1000 & echo $$ $! > {tmp_path}/pids; while true; do wait; done")
    assert ask(studio, "POST", "api/bitstream", BUILD)[0] == 200
    found: list[str] = []
    while len(found) < 2:
        time.sleep(0.05)
        found = (tmp_path / "pids").read_text(encoding="utf-8").split() if (tmp_path / "pids").exists() else []
    assert ask(studio, "POST", "api/cancel", {})[0] == 200
    assert (tmp_path / "told").exists()
    assert all(has_ended(int(number)) for number in found)
    assert reported(studio, lambda job: True)[-1]["state"] == "cancelled"
    # The next build gets its turn, and nothing more is cancelled.
    firm(f"echo '{END}'")
    assert result(studio, "bitstream", BUILD)["state"] == "done"
    assert ask(studio, "POST", "api/cancel", {})[0] == 200
    assert reported(studio, lambda job: True)[-1]["state"] == "done"


@pytest.mark.parametrize("board", ["", "nowhere", "--help", "ulx3s_w5500", "sim", "../ulx3s.yaml", None, 1, ["ulx3s"]])
def test_no_other_board_is_built_for(
    studio: Studio, firm: Callable[[str], None], tmp_path: Path, board: object
) -> None:
    firm("exit 1")
    for path in "bitstream", "load":
        assert ask(studio, "POST", f"api/{path}", {"file": FILE, "board": board})[0] == 400
    assert not (tmp_path / "calls").exists()


def test_a_file_is_never_an_option(studio: Studio, firm: Callable[[str], None], tmp_path: Path) -> None:
    firm(f"echo '{END}'")
    folder = tmp_path / "tilt"
    (folder / "tilt.yaml").rename(folder / "--quiet.yaml")
    core = folder / "tilt.core"
    core.write_text(core.read_text(encoding="utf-8").replace("spec: tilt.yaml", "spec: --quiet.yaml"), encoding="utf-8")
    assert result(studio, "bitstream", BUILD | {"file": "tilt/--quiet.yaml"})["state"] == "done"
    assert " bitstream ./--quiet.yaml --board " in (tmp_path / "calls").read_text(encoding="utf-8")


def test_no_module_of_the_project_replaces_one_of_python(studio: Studio, tmp_path: Path) -> None:
    (tmp_path / "tilt" / "argparse.py").write_text("raise SystemExit(7)\n", encoding="utf-8")
    job = result(studio, "load", BUILD)
    assert job["faults"][0]["message"] == "there is no bitstream for ulx3s"


@pytest.mark.check
@pytest.mark.skipif(bool(missing(["yosys", "nextpnr-ice40", "icepack"])), reason="no tools for an iCE40")
def test_the_page_builds_a_bitstream_for_an_icebreaker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "near", "--example", "obstacle"]) == 0
    build = {"file": "near/obstacle.yaml", "board": "icebreaker"}
    with served(tmp_path) as studio:
        assert ask(studio, "POST", "api/bitstream", build)[0] == 200
        found = reported(studio, lambda job: job["state"] != "running")
    steps = [*dict.fromkeys(job["step"] for job in found if "step" in job)]
    assert steps == ["check", "generated files", "netlist", "synthesis", "place and route", "bitstream"]
    end = found[-1]
    assert end["state"] == "done", end
    assert (tmp_path / "near" / end["bitstream"]).stat().st_size > 100_000
    (clock,) = end["clocks"]
    assert clock["reached"] > clock["needed"] == pytest.approx(12, abs=0.01)
    assert next(item for item in end["area"] if item["name"] == "ICESTORM_LC")["available"] == 5280
    assert end["next"] == "firm load obstacle.yaml --board icebreaker"
