"""The codes and texts of faults are the same in all languages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.faults import Fault
from tests.hdl.ghdl import REPOSITORY

TEXTS = [fault.text for fault in Fault]
NODE = REPOSITORY / "fusesoc_firm" / "node"


def found(path: Path, pattern: str) -> list[Any]:
    return re.findall(pattern, path.read_text(), re.MULTILINE)


def test_codes_are_1_to_12_and_fit_four_bits() -> None:
    assert [fault.value for fault in Fault] == list(range(1, 13))


def test_c_has_the_codes_and_texts() -> None:
    header = NODE / "c" / "firm" / "firm_faults.h"
    assert found(header, r"FIRM_FAULT_(\w+) = (\d+)") == [(fault.name, str(fault.value)) for fault in Fault]
    assert found(header, r'^ +"(.*)",$') == ["no fault", *TEXTS]


def test_cpp_has_the_codes_and_texts() -> None:
    header = NODE / "cpp" / "firm" / "faults.hpp"
    names = ["k" + fault.name.title().replace("_", "") for fault in Fault]
    assert found(header, r"(k\w+) = (\d+)") == [
        (name, str(fault.value)) for name, fault in zip(names, Fault, strict=True)
    ]
    assert found(header, r'^ +"(.*)",$') == ["no fault", *TEXTS]


def test_vhdl_has_the_codes_and_texts() -> None:
    package = REPOSITORY / "cores" / "axis" / "rtl" / "firm_fault_pkg.vhd"
    pattern = r'^  -- (.*)\n  constant (\w+) *: fault_t := "(\d+)"'
    assert found(package, pattern) == [(fault.text, fault.name, f"{fault.value:04b}") for fault in Fault]


def test_the_page_has_the_codes_and_texts() -> None:
    page = REPOSITORY / "docs" / "reference" / "faults.md"
    assert found(page, r"^\| (\d+) \| ([^|]*) \|") == [(str(fault.value), fault.text) for fault in Fault]
