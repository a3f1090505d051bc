"""The report as JSON and as a page."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.campaign import Entry, Settings
from fusesoc_firm.runs.verify.complexity import Level, Statistics
from fusesoc_firm.runs.verify.report import Histogram, Report, as_data, as_html, histogram, write_report
from fusesoc_firm.runs.verify.task import Result, Verdict

ENTRIES = (
    Entry(
        parse_name("a_msgs/A"),
        ROS1,
        Result(Verdict.PASS, judge="genpy", payload_bytes=(1, 2, 3), cycles=99, seconds=0.25),
        Statistics(Level.SIMPLE, 2, 1, 1),
    ),
    Entry(
        parse_name("a_msgs/B"),
        ROS1,
        Result(Verdict.FAIL, "byte 7: expected <00>, got & 01", "genpy"),
        Statistics(Level.VARIABLE_SUBMESSAGES, 400, 3, 2),
    ),
    Entry(
        parse_name("a_msgs/C"),
        ROS1,
        Result(Verdict.FAIL, "byte 7", "genpy"),
        Statistics(Level.VARIABLE_SUBMESSAGES, 19, 3, 2),
        parse_name("a_msgs/B"),
    ),
    Entry(parse_name("a_msgs/D"), ROS2, Result(Verdict.NO_JUDGE, "wstring"), Statistics(Level.ARRAYS, 1, 1, 1)),
    Entry(parse_name("a_msgs/E"), ROS2, Result(Verdict.REFUSED, "line 2: unknown message")),
)
REPORT = Report(ENTRIES, Settings(width=64, seed=9), 1.5, {"GHDL": "GHDL 2.0 <mcode>"})


class Checker(HTMLParser):
    """Every element that is opened is closed, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Closed at once."""

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_data_say_all_of_a_message() -> None:
    data = as_data(REPORT)
    assert data["totals"] == {"messages": 5, "pass": 1, "fail": 2, "no judge": 1, "refused": 1}
    assert (data["width"], data["stimuli"], data["seed"], data["seconds"]) == (64, 3, 9, 1.5)
    assert data["messages"][0] == {
        "name": "a_msgs/A",
        "ros": 1,
        "signature": "",
        "level": 1,
        "fields": 2,
        "types": 1,
        "depth": 1,
        "verdict": "pass",
        "detail": "",
        "judge": "genpy",
        "bytes": [1, 2, 3],
        "cycles": 99,
        "seconds": 0.25,
    }
    assert data["messages"][2]["same_as"] == "a_msgs/B"
    assert "level" not in data["messages"][4]


def test_the_page_holds_figures_and_failures() -> None:
    page = as_html(REPORT)
    checker = Checker()
    checker.feed(page)
    assert checker.open == []
    words = " ".join(checker.text)
    assert "byte 7: expected <00>, got & 01" in words
    assert "a_msgs/C (as a_msgs/B)" in words
    assert "line 2: unknown message" in words
    assert page.count("<svg") == 2 * 3
    # Two, and two of 10 to 19 fields; one is beyond.
    assert "<title>0 to 9: 1</title>" in page and "<title>10 to 19: 1</title>" in page
    assert "3 messages; 1 beyond the figure" in words
    assert not re.search(r"(src|href)=|url\(", page)


def test_the_totals_are_by_version_and_level() -> None:
    rows = re.findall(r"<tr><td>(.*?)</td>(.*?)</tr>", as_html(REPORT).partition("<h2>Complexity")[0])
    found = {row: [int(number) for number in re.findall(r">(\d+)<", cells)] for row, cells in rows}
    assert found["ROS 1"] == [3, 1, 2, 0, 0]
    assert found["ROS 1, level 4 VariableSubmessages"] == [2, 0, 2, 0, 0]
    assert found["ROS 2"] == [2, 0, 0, 1, 1]
    assert found["ROS 2, level 3 Arrays"] == [1, 0, 0, 1, 0]


def test_histograms() -> None:
    assert histogram([0, 9, 10, 25, 250, 1000], 0, 10, 249) == Histogram(0, 10, (2, 1, 1), 2)
    assert histogram([1, 1, 3], 1, 1, 30) == Histogram(1, 1, (2, 0, 1), 0)
    assert histogram([], 0, 1, 9) == Histogram(0, 1, (0,), 0)


def test_both_files_are_written(tmp_path: Path) -> None:
    path = tmp_path / "new" / "report.json"
    assert write_report(REPORT, path) == path.with_suffix(".html")
    assert json.loads(path.read_text()) == as_data(REPORT)
    assert path.with_suffix(".html").read_text() == as_html(REPORT)


def test_a_report_without_a_message() -> None:
    empty = Report((), Settings(), 0.0, {})
    assert as_data(empty)["totals"]["messages"] == 0
    assert "<svg" not in as_html(empty)
