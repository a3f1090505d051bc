"""JSON of any data: valid for a strict reader, and equal wherever JSON has the value."""

from __future__ import annotations

import datetime as dt
import json
import math
from typing import Any, NoReturn

import pytest

from fusesoc_firm.text.json_text import json_text


def strict(text: str) -> Any:
    """Read JSON as browsers do; the text has to be UTF-8."""

    def refuse(word: str) -> NoReturn:
        raise ValueError(word)

    return json.loads(text.encode(), parse_constant=refuse)


@pytest.mark.parametrize("data", [None, {"a": [1, 2.5, True, None, "é\n\u2028"]}, [], "", -0.0, 10**30])
def test_plain_data_are_unchanged(data: object) -> None:
    assert strict(json_text(data)) == data
    assert strict(json_text(data, 2)) == data


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ([math.nan, math.inf, -math.inf, 1.0], ["NaN", "Infinity", "-Infinity", 1.0]),
        ({math.nan: {1: 2, None: 3}}, {"nan": {"1": 2, "null": 3}}),
        ({dt.date(2026, 1, 2): dt.date(2026, 3, 4)}, {"2026-01-02": "2026-03-04"}),
        ({("a", 1): (math.nan,)}, {"('a', 1)": ["NaN"]}),
        (["\ud800", {"\udfff": 1}], ["?", {"?": 1}]),
    ],
)
def test_values_that_json_lacks_are_strings(data: object, expected: object) -> None:
    assert strict(json_text(data)) == expected
