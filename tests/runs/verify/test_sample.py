"""Sixty messages of both versions and all levels of complexity, verified as `make corpus` does it with all."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware, middleware_of
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.complexity import Level, statistics
from fusesoc_firm.runs.verify.task import Task, Verdict, verify
from tests.seeds import seeded

SEED = seeded(20240602)
WIDTHS = (8, 64)
LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}


def sample() -> list[tuple[Middleware, Level, str]]:
    lines = (Path(__file__).parent / "data" / "sample.txt").read_text().splitlines()
    words = [line.split() for line in lines if not line.startswith("#")]
    return [(middleware_of(int(ros)), Level(int(level)), name) for ros, level, name in words]


def cases() -> list[Any]:
    return [
        pytest.param(ros, name, width, id=f"ros{ros.number}-{name}-{width}")
        for ros, _, name in sample()
        for width in WIDTHS
    ]


def test_the_sample_holds_all_levels() -> None:
    assert len(set(sample())) == 60
    for ros, level, name in sample():
        assert statistics(parse_name(name), LIBRARIES[ros].closure(parse_name(name))).level is level
    counts = Counter((ros, level) for ros, level, _ in sample())
    assert min(counts.values()) >= 4 and len(counts) == 2 * len(Level)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("ros", "name", "width"), cases())
def test_converters_of_the_sample(ros: Middleware, name: str, width: int) -> None:
    message = parse_name(name)
    found = verify(Task(message, LIBRARIES[ros].closure(message), width, stimuli=4, seed=SEED))
    assert (found.verdict, found.detail) == (Verdict.PASS, "")
