"""The report of the dissertation's tables and figures."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.dissertation import code, pictures
from tools.dissertation.__main__ import main

Captured = pytest.CaptureFixture[str]
FEW = ["--requesters", "2,3", "--policies", "lru,fixed_priority", "--sets", "2", "--cycles", "500", "--jobs", "1"]


def small_report(folder: Path, *more: str) -> int:
    return main([*FEW, "--output", str(folder), *more])


def test_the_report_has_tables_and_figures(tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "new" / "report"
    assert small_report(folder, "--dataset", "large,cc1", "--seed", "5") == 0
    assert capsys.readouterr().out == f"{folder}/evaluation.md\n"
    names = {path.name for path in folder.iterdir()}
    assert {"table_4_3.csv", "table_4_6.csv", "table_6_2.csv", "figure_4_8.csv", "figure_4_17.csv"} <= names
    assert ("figure_4_10.svg" in names) == pictures.are_possible()
    report = (folder / "evaluation.md").read_text()
    assert "seed 5, normal distribution." in report and "### Table 4.4: lateness in cycles" in report


@pytest.mark.parametrize("options", [["--dataset", "large"], pytest.param([], marks=pytest.mark.check)])
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, options: list[str]) -> None:
    for name in ("one", "two"):
        assert small_report(tmp_path / name, *options) == 0
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes(), path.name


def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("")
    assert small_report(tmp_path / "file" / "below") == 1
    assert "/below: Not a directory" in capsys.readouterr().err


def test_lines_of_code_are_divided_by_purpose() -> None:
    found = code.table()
    rows = {row[0]: [int(cell) for cell in row[1:-1]] for row in found.rows}
    for name, (written, *parts, generated) in rows.items():
        assert generated == sum(parts) > written, name
    converters, wrappers, components = rows["multi_type"][2:5]
    assert wrappers == 0 < components < converters
    assert rows["resize"][3] > 0
