"""The data sets of section 4.3."""

from __future__ import annotations

import numpy as np
import pytest

from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, Distribution, draw


def test_the_data_sets_are_those_of_the_section() -> None:
    found = {name: (each.formula, each.sets, each.cycles) for name, each in DATA_SETS.items()}
    assert found == {
        "large": ("({100, 100}, 50)", 200, 10_000),
        "cc1": ("({20, 20}, 10)", 10, 50_000),
        "cc2": ("({20, 180}, 10)", 10, 50_000),
        "cc3": ("({180, 20}, 10)", 10, 50_000),
        "cc4": ("({180, 180}, 10)", 10, 50_000),
    }


def test_a_seed_gives_the_same_sets_again() -> None:
    first = draw(DATA_SETS["large"], 8, seed=3, sets=5)
    again = draw(DATA_SETS["large"], 8, seed=3)
    other = draw(DATA_SETS["large"], 8, seed=4, sets=5)
    assert (again.sets, again.requesters) == (200, 8)
    assert (first.transfer_times == again.transfer_times[:5]).all()
    assert (first.frequencies == again.frequencies[:5]).all()
    assert (first.transfer_times != other.transfer_times).any()
    # A number of it, so that a change of the generator is noticed.
    assert first.transfer_times[0].tolist() == [45, 35, 24, 20, 70, 59, 116, 82]


@pytest.mark.parametrize("name", DATA_SETS)
@pytest.mark.parametrize("distribution", Distribution)
def test_times_spread_around_the_centre(name: str, distribution: Distribution) -> None:
    data_set = DATA_SETS[name]
    workload = draw(data_set, 256, seed=1, sets=20, distribution=distribution)
    spread = data_set.sigma if distribution is Distribution.NORMAL else 2 * data_set.sigma / 12**0.5
    for drawn, centre in (
        (workload.transfer_times, data_set.transfer_time),
        (workload.frequencies, data_set.frequency),
    ):
        assert drawn.min() >= 1
        # What is cut off below 1 moves mean and spread by less than 2 %.
        assert drawn.mean() == pytest.approx(centre, rel=0.02)
        assert drawn.std() == pytest.approx(spread, rel=0.04)
        if distribution is Distribution.UNIFORM:
            assert np.abs(drawn - centre).max() == data_set.sigma
    assert (workload.transfer_times != workload.frequencies).mean() > 0.8


def test_deadline_and_load_follow_from_both_times() -> None:
    workload = draw(DATA_SETS["cc2"], 4, seed=1, sets=2)
    transfer, pause = workload.transfer_times[0], workload.frequencies[0]
    assert workload.deadlines[0].tolist() == (transfer + pause).tolist()
    assert workload.load[0] == pytest.approx(sum(transfer / (transfer + pause)))
