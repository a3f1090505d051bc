"""Jobs of the evaluation, and combined schedulers."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.evaluation.combinations import COMBINATIONS, combined
from fusesoc_firm.scheduling.evaluation.jobs import Job, Key, Settings, evaluate, jobs
from fusesoc_firm.scheduling.evaluation.simulation import simulate
from fusesoc_firm.scheduling.evaluation.workloads import Workload
from fusesoc_firm.scheduling.models import Generics
from tests.scheduling.numbers import times

FEW = Settings(seed=3, sets=4, cycles=2000)


def test_a_job_gives_the_same_outcome_again() -> None:
    job = Job(Key("large", "round_robin", 5), FEW)
    first, again = evaluate(job).metrics.means(), evaluate(job).metrics.means()
    assert first == again
    other = evaluate(Job(job.key, Settings(seed=4, sets=4, cycles=2000))).metrics.means()
    assert first != other
    # Five accelerators of 100 beats in 200 cycles each: the channel is full, and every accelerator is served.
    assert first["finished"] == 5
    assert first["utilisation"] > 95 and first["utilisation_requested"] > 99.5


def test_the_longest_jobs_come_first() -> None:
    keys = [job.key for job in jobs(["cc1", "large"], ["lru"], [2, 256], Settings())]
    assert keys[0] == Key("large", "lru", 256)
    assert keys[-1] == Key("large", "lru", 2) or keys[-1] == Key("cc1", "lru", 2)


def test_combinations_join_in_with_their_parts() -> None:
    everything = {job.key.policy for job in jobs(["large"], ["edf_latency", "lst", "lru"], [2, 256], Settings())}
    assert set(COMBINATIONS) <= everything
    without = {job.key.policy for job in jobs(["large"], ["edf_latency", "lru"], [2, 256], Settings())}
    assert without & set(COMBINATIONS) == {"(LOEDF128+LOEDF128)+LRU2"}
    assert not {job.key.policy for job in jobs(["large"], ["edf_latency", "lst"], [2], Settings())} & set(COMBINATIONS)
    assert not {job.key.policy for job in jobs(["cc1"], ["edf_latency", "lst"], [256], Settings())} & set(COMBINATIONS)


def test_halves_take_turns_and_keep_their_order() -> None:
    workload = Workload(times([3, 3, 3, 3]), times([99, 99, 99, 99]))
    model = combined(("fixed_priority", "fixed_priority"), Generics(workload.deadlines))
    tasks = simulate(model, workload, 40, np.zeros_like(workload.frequencies)).tasks
    assert tasks.requester.tolist() == [0, 2, 1, 3]
    assert tasks.is_finished.all()
