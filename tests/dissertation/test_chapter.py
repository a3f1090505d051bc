"""Tables and figures of section 4.3 from given means, and the dissertation's values beside them."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import pytest

from fusesoc_firm.scheduling import area
from fusesoc_firm.scheduling.area import Area
from fusesoc_firm.scheduling.evaluation.combinations import COMBINATIONS
from fusesoc_firm.scheduling.evaluation.jobs import Key
from fusesoc_firm.scheduling.evaluation.metrics import METRICS
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, REQUESTERS
from fusesoc_firm.scheduling.policies import POLICIES
from tools.bench import tables as bench_tables
from tools.bench.areas import write_areas
from tools.dissertation import pictures
from tools.dissertation.chapter import BASELINES, Evaluation, figures, tables
from tools.dissertation.published import EVALUATED, dissertation
from tools.dissertation.tables import Table, figure_csv, figure_markdown, markdown, table_csv


def evaluation(areas: area.Areas | None = None) -> Evaluation:
    """The k-th policy's metrics are all k, but for what is better if it is more: that is the same for all."""
    means = {
        Key(data_set, policy, number): {
            name: 7.0 if name in ("finished", "utilisation") else float(place) for name in METRICS
        }
        for data_set in DATA_SETS
        for place, policy in enumerate(EVALUATED)
        for number in REQUESTERS
    }
    return Evaluation(means, areas or {})


def table(number: str, areas: area.Areas | None = None) -> Table:
    (found,) = [each for each in tables(evaluation(areas)) if each.number == number]
    return found


def test_all_tables_and_figures_are_there() -> None:
    assert [each.number for each in tables(evaluation())] == ["4.1", "4.2", "4.3", "4.4", "4.5", "4.6"]
    numbers = [each.number for each in figures(evaluation())]
    assert numbers == ["4.5", "4.6", "4.7", "4.10", "4.11", "4.12", "4.13", "4.14", "4.15", "4.16", "4.17"]


def test_what_was_not_evaluated_is_left_out() -> None:
    nothing = Evaluation({}, {})
    assert [each.number for each in tables(nothing)] == ["4.1", "4.2", "4.5"]
    assert [each.number for each in figures(nothing)] == ["4.5"]


def test_facts_of_the_dissertation() -> None:
    """Cells in the corners of its tables."""
    facts = dissertation()
    assert set(facts.area) == set(facts.response_time) == set(facts.lateness) == set(EVALUATED)
    for rows in (*facts.area.values(), *facts.response_time.values(), *facts.lateness.values(), facts.edf_ratio):
        assert tuple(rows) == REQUESTERS
    assert facts.area["lru"][2] == [209, 103]
    assert facts.area["lst"][256] == [92123, 25136]
    assert facts.edf_ratio[256] == [0.73, 0.97]
    assert facts.response_time["lru"][2] == [4.99, 45.77, 101.78]
    assert facts.response_time["lst"][256] == [1.71, 3808.68, 9801.34]
    assert facts.lateness["lru"][2] == [-129.11, -65.9, -1.81]
    assert facts.lateness["lst"][256] == [-96.74, 4078.41, 9526.57]
    assert facts.combined_area["(LST128+LST128)+LRU2"] == [86673, 33515]
    assert set(facts.combined_area) == {*BASELINES, *COMBINATIONS}
    assert facts.comparison[2]["finished"] == ["edf_resources"]
    assert facts.comparison[256]["utilisation"] == ["lst"]
    # Table 4.2 is what table 4.1 gives.
    for number, ratios in facts.edf_ratio.items():
        for part in (0, 1):
            quotient = facts.area["edf_resources"][number][part] / facts.area["edf_latency"][number][part]
            assert ratios[part] == pytest.approx(quotient, abs=0.0101)


def test_the_dissertation_stands_beside_ours() -> None:
    found = table("4.3")
    assert len(found.rows) == len(EVALUATED) * len(REQUESTERS)
    assert found.rows[0] == ("LRU", "2", "0.00", "0.00", "0.00", "4.99", "45.77", "101.78", "better")
    assert found.rows[-1] == ("LST", "256", "5.00", "5.00", "5.00", "1.71", "3808.68", "9801.34", "better")
    # Of round robin it knows nothing; a value may be worse, or the same.
    means = {
        Key("large", policy, 2): {f"lateness_{part}": value for part in ("min", "avg", "max")}
        for policy, value in (("lru", -65.9), ("fixed_priority", -72.0), ("round_robin", 0.0))
    }
    (lateness,) = [each for each in tables(Evaluation(means, {})) if each.number == "4.4"]
    assert [row[-1] for row in lateness.rows] == ["equal", "worse", "-"]


def test_area_that_is_not_measured_says_so() -> None:
    found = table("4.1")
    assert found.rows[0] == ("LRU", "2", "-", "-", "209", "103")
    assert "not measured here" in found.note
    areas = {("edf_resources", 2): Area(30, 20), ("edf_latency", 2): Area(40, 40)}
    assert "not measured here" not in table("4.1", areas).note
    assert ("ROEDF", "2", "30", "20", "156", "71") in table("4.1", areas).rows
    assert table("4.2", areas).rows[:2] == (("2", "0.75", "0.50", "0.87", "0.95"), ("4", "-", "-", "0.54", "0.95"))


def test_comparison_names_the_best() -> None:
    rows = [row for row in table("4.6").rows if row[0] == "8"]
    assert rows == [
        ("8", "minimum LUTs", "-", "NPFP"),
        ("8", "minimum FFs", "-", "NPFP"),
        (
            "8",
            "most accelerators with completed transactions",
            "LRU, NPFP, PFP, ROEDF, LOEDF, LST",
            "LRU, ROEDF, LOEDF, LST",
        ),
        ("8", "least preemptions", "PFP", "PFP"),
        ("8", "minimum response time", "LRU", "PFP"),
        ("8", "minimum lateness", "LRU", "NPFP"),
        ("8", "maximum channel utilisation", "LRU, NPFP, PFP, ROEDF, LOEDF, LST", "LST"),
    ]


def test_text_and_csv_hold_the_same_cells() -> None:
    found = table("4.4")
    lines = markdown(found).splitlines()
    assert lines[0] == "### Table 4.4: lateness in cycles"
    assert [cell.strip() for cell in lines[4].strip("| ").split("|")] == list(found.rows[0])
    assert len({len(line) for line in lines[2:] if line}) == 1
    rows = list(csv.reader(io.StringIO(table_csv(table("4.1")))))
    assert rows[1] == ["LRU", "2", "", "", "209", "103"]


def test_a_figure_holds_a_line_a_scheduler() -> None:
    (found,) = [each for each in figures(evaluation()) if each.number == "4.10"]
    assert list(found.panels[0].series) == ["LRU", "NPFP", "PFP", "ROEDF", "LOEDF", "LST"]
    assert found.panels[0].dissertation["LST"][-1] == 3808.68
    rows = list(csv.DictReader(io.StringIO(figure_csv(found))))
    assert len(rows) == len(EVALUATED) * len(REQUESTERS)
    last = {
        "panel": "response time",
        "scheduler": "LST",
        "accelerators": "256",
        "value": "5",
        "dissertation": "3808.68",
    }
    assert rows[-1] == last
    assert "| 256 " in figure_markdown(found)


def test_corner_cases_are_four_diagrams() -> None:
    (found,) = [each for each in figures(evaluation()) if each.number == "4.16"]
    assert [panel.title for panel in found.panels][1] == "transfer time 20, frequency 180"
    assert len(found.panels) == 4


def test_the_bench_writes_what_it_measured(tmp_path: Path) -> None:
    columns = ("design", "ROS", "bits", "LUT", "FF", "LUT as RAM", "result")
    schedulers = (
        ("lru, N = 8", "", "", "70", "40", "10", "met"),
        ("(LST128+LST128)+LRU2, N = 256", "", "", "900", "379", "", ""),
        ("lst, N = 8", "", "", "", "", "", "FAILED"),
    )
    managers = (("manager, N = 8", "", "8", "90", "50", "", ""), ("manager, N = 8", "", "64", "400", "300", "", ""))
    path = tmp_path / "area.csv"
    write_areas([bench_tables.Table("any", columns, rows) for rows in (schedulers, managers)], path)
    text = path.read_text()
    assert text.startswith("design,requesters,lut,ff\n(LST128+LST128)+LRU2,256,900,379\nlru,8,80,40\n")
    assert area.read(text) == {
        ("(LST128+LST128)+LRU2", 256): Area(900, 379),
        ("lru", 8): Area(80, 40),
        ("manager", 8): Area(90, 50),
    }


def test_every_area_of_the_tables_is_measured() -> None:
    """What tables 4.1, 4.2 and 4.5 and the choice need; `make bench BENCH=manager` writes it."""
    for number in ("4.1", "4.2", "4.5"):
        assert not any("-" in row for row in table(number, area.measured()).rows), number
    for design in (*POLICIES, area.MANAGER, area.MANAGER_PREEMPTIVE):
        assert {number for name, number in area.measured() if name == design} == set(REQUESTERS), design


def test_areas_are_shown_for_the_evaluated_numbers() -> None:
    def numbers(*asked: int) -> tuple[int, ...]:
        means = {Key("large", "lru", number): dict.fromkeys(METRICS, 1.0) for number in asked}
        (found,) = [each for each in figures(Evaluation(means, {})) if each.number == "4.5"]
        assert all(len(values) == len(found.requesters) for panel in found.panels for values in panel.series.values())
        return found.requesters

    assert numbers(4, 8, 24) == (4, 8)
    assert numbers(24) == REQUESTERS


@pytest.mark.parametrize(
    ("series", "scale"),
    [
        ([[1.0, 19.0]], {"value": "linear"}),
        ([[0.0, 5.0], [5.0, 5.0]], {"value": "linear"}),
        ([[math.nan]], {"value": "linear"}),
        ([[1.0, 100.0], [math.nan, 7.0]], {"value": "log"}),
        ([[-2.0, 1000.0]], {"value": "symlog", "linthresh": 2.0}),
        ([[0.0, 0.001, 1000.0]], {"value": "symlog", "linthresh": 1.0}),
    ],
)
def test_the_scale_shows_small_values(series: list[list[float]], scale: dict[str, object]) -> None:
    assert pictures._scale(series) == scale


@pytest.mark.skipif(not pictures.are_possible(), reason="matplotlib is not installed")
def test_pictures_are_the_same_each_time(tmp_path: Path) -> None:
    (found,) = [each for each in figures(evaluation()) if each.number == "4.13"]
    first: list[bytes] = []
    second: list[bytes] = []
    for drawn in (first, second):
        pictures.draw_figure(found, tmp_path)
        drawn += [(tmp_path / f"figure_4_13.{suffix}").read_bytes() for suffix in pictures.SUFFIXES]
    assert first == second
    assert first[0].startswith(b"\x89PNG")
