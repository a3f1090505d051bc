"""Reports in the format of JUnit, which cocotb, VUnit and pytest write: whether the tests in them passed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_SHOWN = 5
# pytest marks an expected failure as skipped, although the test has run.
_EXPECTED_FAILURE = "pytest.xfail"


def fault_in(report: Path) -> str:
    """Return why a report does not show that the tests passed, or an empty text.

    At least one test must have run, and none may have failed. Skipped tests have not run.
    """
    from xml.etree import ElementTree as ET

    try:
        cases = list(ET.parse(report).iter("testcase"))
    except OSError:
        return f"no test ran: there is no report {report.name}"
    except ET.ParseError as error:
        return f"the report {report.name} is damaged: {error}"
    if not cases:
        return f"no test ran: the report {report.name} is empty"
    if failed := [_name(case) for case in cases if _has(case, "failure") or _has(case, "error")]:
        further = f" and {len(failed) - _SHOWN} more" if len(failed) > _SHOWN else ""
        return f"{len(failed)} of {len(cases)} tests failed: {', '.join(failed[:_SHOWN])}{further}"
    return f"no test ran: all {len(cases)} are skipped" if all(map(_is_skipped, cases)) else ""


def _is_skipped(case: Element) -> bool:
    skipped = case.find("skipped")
    return skipped is not None and skipped.get("type") != _EXPECTED_FAILURE


def _has(case: Element, tag: str) -> bool:
    return case.find(tag) is not None


def _name(case: Element) -> str:
    return ".".join(filter(None, (case.get("classname"), case.get("name"))))
