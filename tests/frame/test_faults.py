"""The codes and texts of faults are those of Python in templates and on the page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.text.render import TEMPLATES
from tests.hdl.ghdl import REPOSITORY


def found(path: Path, pattern: str) -> list[Any]:
    return re.findall(pattern, path.read_text(), re.MULTILINE)


def test_codes_are_1_to_12_and_fit_four_bits() -> None:
    assert [fault.value for fault in Fault] == list(range(1, 13))


def test_templates_have_the_codes() -> None:
    codes = [
        (Fault[name], int(code, 2))
        for template in sorted(TEMPLATES.glob("vhdl/*.mustache"))
        for name, code in found(template, r'constant (\w+) +: .* := "([01]+)";')
        if name in Fault.__members__
    ]
    assert {fault for fault, _ in codes} >= {Fault.BAD_LENGTH, Fault.BAD_COUNT, Fault.BROKEN_BEAT}
    assert all(fault == code for fault, code in codes), codes


def test_the_page_has_the_codes_and_texts() -> None:
    page = REPOSITORY / "docs" / "reference" / "faults.md"
    assert found(page, r"^\| (\d+) \| ([^|]*) \|") == [(str(fault.value), fault.text) for fault in Fault]
