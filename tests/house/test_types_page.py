"""docs/reference/data-types.md: all features of the dissertation's Table 5.1 with its marks, and existing tests."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "data-types.md"

# Number, ROS 1, ROS 2 and FIRM in the dissertation's Table 5.1.
TABLE_5_1 = """
    1 ✓ ✓ ✓|2 ✓ ✓ ✓|3 ✓ ✓ ✓|4 ✓ ✓ ✓|5 ✗ ✗ ✓|6 ✓ ✓ ✓|7 ✓ ✓ ✓|8 ✓ ✓ ✓|9 ✗ ✗ +|10 ✓ ✓ ✓|11 ✗ ✗ +|12 ✗ ✗ +|13 ✗ ✓ ✓
    |14 ✗ ✗ +|15 ✓ ✓ ✓|16 ✗ ✗ ✗|17 ✓ ✓ ✓|18 ✗ ✗ +|19 ✗ ✗ +
"""


def rows() -> list[list[str]]:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if re.match(r"\| \d", line)]
    assert all(len(row) == 6 for row in found)
    return found


def test_every_row_is_there_with_its_marks() -> None:
    wanted = [row.split() for row in " ".join(TABLE_5_1.split()).split("|")]
    assert [[row[0], row[2], row[3], row[4][0]] for row in rows()] == wanted


def test_every_row_names_a_test_that_exists() -> None:
    for row in rows():
        path, _, name = row[5].strip("`").partition("::")
        functions = ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        assert any(isinstance(node, ast.FunctionDef) and node.name == name for node in functions), row
