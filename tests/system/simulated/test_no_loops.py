"""No system has a combinational loop, whatever message it passes through; a sample of `make bench BENCH=loops`."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.converter.pipeline import PIPELINES
from tests.converter.simulated.pass_through import PassThrough
from tests.seeds import seeded
from tools.bench.loops import loops_of_messages, loops_of_random_system

SEED = seeded(20260611)
RANDOM_SYSTEMS = 30
# An array of messages with strings, an array of strings, and both without.
SAMPLE = ("diagnostic_msgs/DiagnosticArray", "sensor_msgs/JointState", "sensor_msgs/Image")


@pytest.mark.one_in(2, 3)
@pytest.mark.parametrize("distribution", ["noetic", "humble"])
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("pipeline", PIPELINES)
def test_messages_that_are_passed_through(tmp_path: Path, distribution: str, width: int, pipeline: str) -> None:
    system = PassThrough(distribution, SAMPLE, count=0, seed=0, width=width, pipeline=pipeline)
    found = loops_of_messages(system, tmp_path)
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(number, marks=pytest.mark.thorough if number % 5 else pytest.mark.check)
        for number in range(RANDOM_SYSTEMS)
    ],
)
def test_a_random_system(tmp_path: Path, number: int) -> None:
    """Accelerators are first versions, in which an input's ready depends on the outputs'."""
    print(f"seed {SEED + number}")
    found = loops_of_random_system(SEED + number, tmp_path)
    assert not found, "\n".join(found)
