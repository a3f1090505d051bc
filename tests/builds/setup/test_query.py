"""`firm query`: dependencies, dependents, paths, targets, kinds and generated files; patterns of cores."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fusesoc_firm.builds.setup.selection import is_pattern, matching
from fusesoc_firm.cli import main
from fusesoc_firm.tools.library_path import library_root

Captured = pytest.CaptureFixture[str]

CORES = {
    "leaf": "targets: {default: {}}",
    "left": 'filesets: {x: {depend: ["me:p:leaf"]}}\ntargets: {default: {filesets: [x]}}',
    "right": """filesets: {x: {depend: ["target_sim ? (>=me:p:leaf:1.0)"]}}
targets: {sim: {filesets: [x], flow: sim, flow_options: {tool: ghdl}}}""",
    "top": """filesets: {x: {depend: ["me:p:left", "me:p:right", "robot:firm:generators"]}}
generate:
  point: {generator: firm, parameters: {message: geometry_msgs/Point, ros: 2}}
  other: {generator: another, parameters: {message: nothing}}
targets:
  default: {filesets: [x]}
  lint: {filesets: [x], generate: [point, other], flow: lint, flow_options: {tool: verilator}}
  sim: {filesets: [x], flow: sim, flow_options: {tool: ghdl}}
  old: {filesets: [x], default_tool: icarus}""",
    "alone": "targets: {default: {}}",
}


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A library of a project, of which `top` needs `leaf` in two ways."""
    for name, text in CORES.items():
        (tmp_path / f"{name}.core").write_text(f"CAPI=2:\nname: me:p:{name}:1.0\n{text}\n")
    (tmp_path / "fusesoc.conf").write_text(
        f"[library.firm]\nlocation = {library_root()}\n[library.me]\nlocation = {tmp_path}\n"
    )
    monkeypatch.chdir(tmp_path)


def ask(capsys: Captured, *arguments: str) -> list[str]:
    assert main(["query", *arguments]) == 0
    return capsys.readouterr().out.splitlines()


def mine(lines: list[str]) -> list[str]:
    return [line.split(":")[2] for line in lines if line.startswith("me:p:")]


def test_dependencies(capsys: Captured) -> None:
    assert mine(ask(capsys, "deps", "me:p:top")) == ["leaf", "left", "right", "top"]
    assert mine(ask(capsys, "deps", "le*")) == ["leaf", "left"]
    assert mine(ask(capsys, "rdeps", "leaf")) == ["leaf", "left", "right", "top"]
    assert mine(ask(capsys, "rdeps", "me:p:left:1.0")) == ["left", "top"]
    assert mine(ask(capsys, "rdeps", "alone", "left")) == ["alone", "left", "top"]
    assert "me:p:top:1.0" in ask(capsys, "rdeps", "robot:firm:generators")


def test_paths(capsys: Captured) -> None:
    assert mine(ask(capsys, "allpaths", "top", "leaf")) == ["leaf", "left", "right", "top"]
    assert mine(ask(capsys, "allpaths", "top", "left")) == ["left", "top"]
    assert ask(capsys, "allpaths", "leaf", "top") == []
    assert ask(capsys, "allpaths", "alone", "leaf") == []


def test_the_forms_of_an_answer(capsys: Captured) -> None:
    found = json.loads("\n".join(ask(capsys, "allpaths", "top", "left", "--output", "json")))
    names = ["me:p:left:1.0", "me:p:top:1.0"]
    assert found == {"rows": [{"core": name, "state": ""} for name in names], "edges": [names[::-1]]}
    picture = ask(capsys, "allpaths", "top", "left", "--output", "dot")
    assert picture[0] == "digraph {"
    assert '  "me:p:top:1.0" -> "me:p:left:1.0"' in picture
    assert json.loads("\n".join(ask(capsys, "allpaths", "alone", "leaf", "--output", "json"))) == {
        "rows": [],
        "edges": [],
    }


def test_targets_and_kinds(capsys: Captured) -> None:
    rows = [line.split() for line in ask(capsys, "targets", "me:p:*")]
    assert ["me:p:top:1.0", "old", "icarus"] in rows
    assert ["me:p:alone:1.0", "default", "-"] in rows
    assert len(rows) == 8
    simulations = [["me:p:right:1.0", "sim", "sim/ghdl"], ["me:p:top:1.0", "sim", "sim/ghdl"]]
    for kind in ("sim", "sim/*", "*/ghdl"):
        assert [line.split() for line in ask(capsys, "targets", "me:p:*", "--kind", kind)] == simulations
    assert [line.split() for line in ask(capsys, "kinds", "me:p:*")] == [
        ["-", "4"],
        ["icarus", "1"],
        ["lint/verilator", "1"],
        ["sim/ghdl", "2"],
    ]
    assert '  "me:p:right:1.0" -> "me:p:right:1.0 sim"' in ask(capsys, "targets", "right", "--output", "dot")


def test_generated_files(capsys: Captured) -> None:
    rows = [line.split() for line in ask(capsys, "generated", "me:p:top", "--target", "lint")]
    assert ["me:p:top-other:1.0", "another", "-"] in rows
    ours = [row[2] for row in rows if row[:2] == ["me:p:top-point:1.0", "firm"]]
    assert "axis_to_geometry_msgs_point.vhd" in ours
    assert ours[-1].endswith(".core")
    assert ask(capsys, "generated", "me:p:top", "--target", "sim") == []


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["deps", "me:q:*"], "error: no core matches 'me:q:*'\n      = 'fusesoc core list' lists all cores\n"),
        (["allpaths", "top", "nothing"], "error: no core matches 'nothing'\n"),
        (["generated", "me:p:none"], "error: unknown core 'me:p:none'\n"),
        (["generated", "me:p:top", "--target", "none"], "error: "),
    ],
)
def test_unknown_cores(capsys: Captured, arguments: list[str], error: str) -> None:
    assert main(["query", *arguments]) == 1
    assert capsys.readouterr().err.startswith(error)


def test_patterns() -> None:
    names = ["acme:m:one:1.0", "acme:m:two:1.0", "acme:m:two:2.0", "other:m:one:1.0", "::one:0"]
    for pattern, places in [
        ("acme:m:*", [0, 1, 2]),
        ("acme:m:two", [1, 2]),
        ("acme:m:two:2.0", [2]),
        ("*:m:one", [0, 3]),
        ("one", [0, 3, 4]),
        ("[ot]*", [0, 1, 2, 3, 4]),
        ("acme:*:*", [0, 1, 2]),
        ("acme:*", [0, 1, 2]),
        ("acme:m:two:2.0:1", []),
        ("", []),
    ]:
        assert matching(names, pattern) == [names[place] for place in places], pattern
    assert [is_pattern(text) for text in ("a:b:c", "a:b:*", "a:b:c?", "[ab]")] == [False, True, True, True]
