"""The report of a compiled accelerator: cycles, operators, the critical chain."""

from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.exploration.report import Report
from fusesoc_firm.system.hardware.compiled import schedule_of
from fusesoc_firm.text.diagnostics import InputError
from tests.compiler.compiled import Unit
from tests.exploration.projects import loaded, project

Captured = pytest.CaptureFixture[str]


def report(text: str, **limits: int) -> Report:
    return Report(Unit("f", textwrap.dedent(text), limits=limits).schedule())


def printed(capsys: Captured, *arguments: str) -> str:
    capsys.readouterr()
    assert main(["accelerator", "report", *arguments]) == 0
    return capsys.readouterr().out


def test_the_chain_waits_for_operands_and_for_busy_operators() -> None:
    found = report(
        """
        def f(m):
            x = m.a / m.b
            y = m.v[0] / m.v[1]
            return {"a": x + y}
        """
    )
    assert [(item.operation.unit, item.reason) for item in found.chain] == [
        ("divide64 0", ""),
        ("divide64 0", "operator"),
        ("add64 0", "operand"),
    ]
    assert [item.operation.line for item in found.chain] == [3, 4, 5]
    first, second, third = (item.operation for item in found.chain)
    assert (first.last, second.last) == (second.first, third.first)
    two = report("def f(m):\n    return {'a': m.a / m.b + m.v[0] / m.v[1]}\n", divide=2)
    assert [item.operation.unit for item in two.chain] == ["divide64 0", "add64 0"]


def test_the_busy_cycles_of_a_pipeline_overlap() -> None:
    (use,) = report("def f(m):\n    return {'a': m.a + m.b, 'b': m.a + m.v[0]}\n").uses
    assert (use.operations, use.busy) == (2, 10)


def test_slow_operands_make_the_latency_longer() -> None:
    found = report("def f(m):\n    return {'a': m.a / m.b}\n")
    assert found.longest - found.schedule.latency == 168 - 64


@pytest.mark.parametrize("name", ["pid", "filter_range", "nearest"])
def test_a_report_for_people_has_at_most_100_columns(name: str, tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, name)
    text = printed(capsys, str(spec))
    assert max(map(len, text.splitlines())) <= 100
    system, type_ = loaded(spec)
    schedule = schedule_of(type_, system.folder)
    cycle = "cycle" if name == "nearest" else "cycles"
    assert f"latency {schedule.latency} {cycle}; interval {schedule.interval} cycles\n" in text
    for issue in schedule.issues.values():
        first = schedule.bases[issue.node.phase] + issue.start
        assert issue.node.place
        cycles = f"{first}-{first + issue.ready - issue.start}"
        row = rf"^{cycles} .*{issue.unit.operator.operation}.* {issue.node.place.line} "
        assert re.search(row, text, re.MULTILINE)


def test_phases_are_named(tmp_path: Path, capsys: Captured) -> None:
    assert "  after 'header.frame_id':\n" in printed(capsys, str(project(tmp_path, "filter_range")))
    assert "  for each element of 'ranges':\n" in printed(capsys, str(project(tmp_path, "nearest")))


def test_a_report_as_json(tmp_path: Path, capsys: Captured) -> None:
    found: dict[str, Any] = json.loads(printed(capsys, str(project(tmp_path, "pid")), "--json"))
    assert found["interval"] == found["latency"] + 2
    assert [item["operator"] for item in found["operators"]] == ["add64 0", "multiply64 0"]
    assert {item["line"] for item in found["operations"]} == {8, 9, 10, 12}
    assert found["chain"][-1]["last"] + 1 == found["latency"]
    assert found["estimate"]["dsp"] == 9


def test_a_function_is_named_by_its_file_or_its_folder(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = project(tmp_path, "pid")
    monkeypatch.chdir(spec.parent)
    texts = {printed(capsys, *words) for words in ([], ["python/pid.py"], ["."], ["pid.yaml", "--accelerator", "pid"])}
    assert len(texts) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pid.yaml", "--accelerator", "pdi"], "pid.yaml has no accelerator 'pdi' with 'type: Python'"),
        (["python/missing.py"], "there is no file python/missing.py"),
        (["other.py"], "no specification beside other.py, or in the folder above, lists it in 'sources'"),
        (["rtl.yaml"], "rtl.yaml has no accelerator with 'type: Python'"),
        (["pid.core"], "pid.core is not a specification"),
    ],
)
def test_what_is_not_there_is_refused(
    words: list[str], message: str, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = project(tmp_path, "pid")
    monkeypatch.chdir(spec.parent)
    Path("other.py").write_text("def other(m): ...\n")
    text = spec.read_text(encoding="utf-8").replace("Python", "VHDL").replace("python/pid.py", "pid.vhd")
    Path("rtl.yaml").write_text(text)
    Path("pid.vhd").touch()
    assert main(["accelerator", "report", *words]) == 1
    assert f"error: {message}\n" in capsys.readouterr().err


def test_one_of_several_accelerators_is_named(tmp_path: Path, capsys: Captured) -> None:
    spec = project(tmp_path, "pid")
    text = spec.read_text(encoding="utf-8")
    begin, end = text.index("  - name: pid"), text.index("blocks:")
    twice = text[:end] + text[begin:end].replace("name: pid", "name: other") + text[end:]
    twice = twice.replace("[{name: pid}]", "[{name: pid}, {name: two}]").rstrip()
    message = "middleware: ROS2, mode: publisher, message: std_msgs/Float64"
    twice += f"\n  - {{name: two, type: other, outgoing: [{{name: pub2}}]}}\n  - {{name: pub2, {message}}}\n"
    spec.write_text(twice)
    (spec.parent / "python/pid.py").write_text("def pid(m): return {'data': m.x + m.y}\nother = pid\n")
    assert main(["accelerator", "report", str(spec)]) == 1
    assert "which accelerator? " in capsys.readouterr().err
    assert printed(capsys, str(spec), "--accelerator", "other").startswith("other: ")


def test_a_limit_that_cannot_be_met_is_reported(tmp_path: Path) -> None:
    spec = project(tmp_path, "pid")
    spec.write_text(spec.read_text(encoding="utf-8").replace("type: Python", "type: Python\n    latency: 9"))
    system, type_ = loaded(spec)
    with pytest.raises(InputError, match="'latency' of 'pid' cannot be 9"):
        schedule_of(type_, system.folder)
