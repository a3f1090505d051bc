"""Results of `firm system` as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import demos_root

Captured = pytest.CaptureFixture[str]

SPEC = str(demos_root() / "quat2euler" / "quat2euler_hls.yaml")


def printed(capsys: Captured, *arguments: str, status: int = 0) -> Any:
    capsys.readouterr()
    if status:
        with pytest.raises(SystemExit, match=str(status)):
            main(arguments)
    else:
        assert main(arguments) == 0
    return json.loads(capsys.readouterr().out)


def test_a_valid_specification(capsys: Captured) -> None:
    assert printed(capsys, "system", "check", SPEC, "--json") == {"valid": True, "diagnostics": []}


def test_faults_have_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "img", "--language", "verilog", "--in", "std_msgs/UInt8", "--out", "std_msgs/UInt8"]) == 0
    source = Path("img/rtl/img.v")
    source.write_text(source.read_text(encoding="utf-8").replace("in_data", "in_date", 1), encoding="utf-8")
    found = printed(capsys, "system", "check", "img/img.yaml", "--json", status=1)
    assert found["valid"] is False
    fault = {"severity": "error", "file": "img/rtl/img.v", "hint": "did you mean 'in_data'?"}
    assert any(fault.items() <= item.items() and item["line"] == 9 for item in found["diagnostics"]), found
    Path("img/img.yaml").write_text("project: 7\n", encoding="utf-8")
    found = printed(capsys, "system", "check", "img/img.yaml", "--json", status=1)
    assert {item["file"] for item in found["diagnostics"]} == {"img/img.yaml"}


def test_the_system_and_its_lines(capsys: Captured) -> None:
    shown = printed(capsys, "system", "show", SPEC, "--json")
    assert main(["system", "show", SPEC]) == 0
    assert shown == yaml.safe_load(capsys.readouterr().out)
    counted = printed(capsys, "system", "report", SPEC, "--json")
    assert counted["name"] == "quaterniontoeuler"
    assert counted["generated"] == counted["configuration"] + counted["files"]
