"""The metrics of section 4.3 on tasks that are small enough to work them out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusesoc_firm.scheduling.evaluation.metrics import METRICS, Metrics, measure
from fusesoc_firm.scheduling.evaluation.simulation import Tasks, Trace
from fusesoc_firm.scheduling.evaluation.workloads import Workload
from tests.scheduling.numbers import times

# (set, requester, arrival, grant, finish, preemptions); transfer time 10, pause 20 in requester 0, 5 and 40 in 1.
TASKS = [
    (0, 0, 0, 2, 12, 0),
    (0, 1, 0, 12, 17, 1),
    (0, 0, 40, 40, 75, 2),
    (0, 0, 95, 96, -1, 4),
    (1, 1, 7, 8, -1, 3),
]


def metrics() -> Metrics:
    workload = Workload(times([10, 5], [10, 5], [10, 5]), times([20, 40], [20, 40], [20, 40]))
    columns = [np.array(column) for column in zip(*TASKS, strict=True)]
    return measure(Trace(workload, 100, Tasks(*columns), np.array([29, 92, 0]), np.array([58, 93, 0])))


def values(name: str) -> list[float]:
    return [float(value) for value in getattr(metrics(), name)]


@pytest.mark.parametrize(
    ("name", "of_set_0"),
    [
        ("granted", 2),
        ("finished", 2),
        ("completed", 3),
        ("preemptions", ((2 + 4) / 2 + 1 / 1) / 2),
        ("response_min", 0),
        ("response_avg", (2 + 12 + 0 + 1) / 4),
        ("response_max", 12),
        ("lateness_min", 17 - 45),
        ("lateness_avg", ((12 - 30) + (17 - 45) + (75 - 70)) / 3),
        ("lateness_max", 75 - 70),
        ("utilisation", 29),
        ("utilisation_requested", 50),
    ],
)
def test_metric_of_a_set(name: str, of_set_0: float) -> None:
    assert values(name)[0] == pytest.approx(of_set_0)


def test_a_set_without_tasks_has_no_times() -> None:
    assert values("granted") == [2, 1, 0]
    assert values("finished") == [2, 0, 0]
    for name in METRICS:
        if name.startswith(("lateness", "preemptions")):
            assert all(math.isnan(value) for value in values(name)[1:]), name
    # Set 1 has a task that was granted and not completed.
    assert values("response_max")[1] == 1 and math.isnan(values("response_max")[2])
    assert math.isnan(values("utilisation_requested")[2])


def test_means_leave_out_sets_without_a_value() -> None:
    means = metrics().means()
    assert set(means) == set(METRICS)
    assert means["granted"] == 1
    assert means["response_max"] == (12 + 1) / 2
    assert means["lateness_max"] == 75 - 70
    assert means["utilisation"] == pytest.approx((29 + 92) / 3)
