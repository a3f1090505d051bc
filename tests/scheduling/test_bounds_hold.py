"""Bounds of the analysis against simulation by the cycle-exact models: none is exceeded, and some are reached."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest

from fusesoc_firm.scheduling.analysis import Channel, analyse, overheads_of
from fusesoc_firm.scheduling.evaluation.simulation import simulate
from fusesoc_firm.scheduling.evaluation.workloads import Times, Workload
from fusesoc_firm.scheduling.models import Generics, make_model
from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.scheduling.tasks import Task

SEED = 20
SMALL_PERIODS = (4, 5, 6, 8, 10, 12)
PERIODS = (12, 15, 20, 24, 30, 40, 60)


def task_set(chance: random.Random, count: int, periods: tuple[int, ...], load: float) -> list[Task]:
    """Tasks that ask for about this part of the channel; deadlines are constrained, implicit and arbitrary."""
    shares = [chance.uniform(0.2, 1) for _ in range(count)]
    tasks = []
    for index, share in enumerate(shares):
        period = chance.choice(periods)
        transfer_time = max(1, round(load * share / sum(shares) * period))
        deadline = max(1, round(period * chance.choice((0.5, 0.8, 1, 1, 1.5))))
        tasks.append(Task(f"t{index}", period, transfer_time, deadline))
    return tasks


def worst_responses(
    policy: str, tasks: list[Task], first: Times, pauses: Times, cycles: int, channel: Channel
) -> list[int]:
    """The greatest response of each task over all sets, that is, over all first requests; unfinished ones count too."""
    shape = first.shape
    transfer, periods, deadlines = (
        np.broadcast_to(np.array([getattr(task, key) for task in tasks]), shape)
        for key in ("transfer_time", "period", "deadline")
    )
    workload = Workload(transfer, pauses, periods)
    model = make_model(policy, Generics(periods, transfer, deadlines, channel.shortest_run))
    resume = 1 if POLICIES[policy].is_preemptive else 0
    trace = simulate(model, workload, cycles, first, resume)
    found = trace.tasks
    ends = np.where(found.is_finished, found.finish, cycles)
    return [int((ends - found.arrival)[found.requester == k].max(initial=0)) for k in range(len(tasks))]


def slack(policy: str, tasks: list[Task], first: Times, pauses: Times, cycles: int, channel: Channel) -> list[int]:
    """Bound less worst response of each task that has a bound; with fixed priorities, in the order of these."""
    analysis = analyse(policy, tasks, channel)
    bounds = {bound.task.name: bound.response for bound in analysis.bounds}
    by_name = {task.name: task for task in tasks}
    if analysis.priorities:
        tasks = [by_name[name] for name in analysis.priorities]
    worst = worst_responses(policy, tasks, first, pauses, cycles, channel)
    left = []
    for task, response in zip(tasks, worst, strict=True):
        bound = bounds[task.name]
        if bound is not None:
            assert response <= bound, f"seed {SEED}, {policy}, {task} among {tasks}: {response} > {bound}"
            left.append(bound - response)
    return left


@pytest.mark.one_in(3)
@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("count", [2, 3])
def test_over_the_hyperperiod_from_every_phase(policy: str, count: int) -> None:
    """Every combination of first requests, for two hyperperiods and more."""
    chance = random.Random(f"{SEED} {policy} {count}")
    left: list[int] = []
    for _ in range(15):
        tasks = task_set(chance, count, SMALL_PERIODS, chance.uniform(0.3, 1.2))
        phases = itertools.product(*(range(task.period) for task in tasks))
        first = np.array(list(phases))
        cycles = 3 * math.lcm(*(task.period for task in tasks))
        shortest_run = chance.choice((1, 1, 3))
        left += slack(policy, tasks, first, np.zeros_like(first), min(cycles, 400), Channel(1, shortest_run))
    # What a queue costs at worst is seldom met, least of all by tasks as short as these; LST's bound is no sharp one.
    if not overheads_of(policy, count).acceptance:
        nearest = min(left)
        assert nearest <= (5 if policy == "lst" else 3), f"seed {SEED}: {nearest} cycles from the nearest bound"


@pytest.mark.parametrize("policy", POLICIES)
def test_alone(policy: str) -> None:
    """A task that nobody can interrupt or keep waiting, with any deadline, and more of it than the channel can take."""
    chance = random.Random(f"{SEED} {policy} alone")
    for _ in range(10):
        period = chance.randint(2, 12)
        tasks = [Task("t", period, chance.randint(1, 12), chance.randint(1, 20))]
        first = np.arange(period)[:, np.newaxis]
        left = slack(policy, tasks, first, np.zeros_like(first), 300, Channel(1, chance.choice((1, 8))))
        # The bound is reached, but for what a queue costs.
        assert left == [0] or overheads_of(policy, 1).acceptance, f"seed {SEED}: {tasks}, {left}"


@pytest.mark.one_in(5, 3)
@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("count", [4, 7, 12, 20])
def test_with_random_requests(policy: str, count: int) -> None:
    """Sporadic requests: some sets as soon as may be, some with random pauses; 50 of each task set side by side."""
    generator = np.random.default_rng([SEED, count])
    chance = random.Random(f"{SEED} {policy} {count} random")
    for _ in range(4):
        tasks = task_set(chance, count, PERIODS if count < 10 else (60, 90, 120, 200), chance.uniform(0.4, 1.2))
        first = generator.integers(0, 60, (50, count)) * generator.integers(0, 2, (50, 1))
        pauses = generator.integers(0, 20, (50, count)) * generator.integers(0, 2, (50, 1))
        slack(policy, tasks, first, pauses, 1500, Channel(1, chance.choice((1, 2, 4))))
