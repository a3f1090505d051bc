"""Reports of cocotb, VUnit and pytest: when they show that tests passed."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.builds.step.report import fault_in

PASSED = '<testcase classname="m" name="a"/>'
FAILED = '<testcase classname="m" name="b"><failure/></testcase>'
BROKEN = '<testcase name="c"><error/></testcase>'
SKIPPED = '<testcase classname="m" name="d"><skipped/></testcase>'
EXPECTED = '<testcase classname="m" name="e"><skipped type="pytest.xfail"/></testcase>'


@pytest.mark.parametrize(
    ("cases", "fault"),
    [
        (PASSED, ""),
        (PASSED + SKIPPED, ""),
        (EXPECTED, ""),
        (PASSED + FAILED, "1 of 2 tests failed: m.b"),
        (BROKEN + FAILED, "2 of 2 tests failed: c, m.b"),
        (FAILED * 7, "7 of 7 tests failed: m.b, m.b, m.b, m.b, m.b and 2 more"),
        (SKIPPED * 2, "no test ran: all 2 are skipped"),
        ("", "no test ran: the report results.xml is empty"),
    ],
)
def test_a_test_must_have_run_and_none_failed(cases: str, fault: str, tmp_path: Path) -> None:
    report = tmp_path / "results.xml"
    report.write_text(f"<testsuites><testsuite>{cases}</testsuite></testsuites>")
    assert fault_in(report) == fault


def test_a_missing_and_a_cut_report(tmp_path: Path) -> None:
    report = tmp_path / "results.xml"
    assert fault_in(report) == "no test ran: there is no report results.xml"
    report.write_text(f"<testsuites><testsuite>{PASSED}")
    assert fault_in(report).startswith("the report results.xml is damaged: ")
