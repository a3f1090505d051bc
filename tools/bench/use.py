"""How many cycles schedulers lose between tasks, by their cycle-exact models: nothing is simulated but these."""

from __future__ import annotations

import numpy as np

from fusesoc_firm.scheduling.models import Generics, make_model
from fusesoc_firm.scheduling.policies import POLICIES
from tools.bench.schedulers import LONGEST_TIME, SHORTEST_TIME, TIME_BITS
from tools.bench.tables import MET, MISSED, Table, Tell

TITLE = "Cycles with a beat while every requester always has a task, in percent"
REQUESTERS = (8, 32, 256)
TASK_BEATS = (1, 2, 3, 4, 5, 8, 16)
LEAST_USED = 99.5
# Of times; the worst of them counts.
_SETS = 4
# After reset, when memories are cleared and the first tasks are accepted.
_SKIPPED_CYCLES = 500
_CYCLES = 3000

_COLUMNS = ("design", *map(str, TASK_BEATS), f"shortest with {LEAST_USED} %", "bar", "result")
_NOTE = f"""
    The column headings are the numbers of beats per task. Neither requesters nor the sink pause. The value is the worst
    for {_SETS} sets of periods from {SHORTEST_TIME} to {LONGEST_TIME} cycles, measured over {_CYCLES} cycles that begin
    {_SKIPPED_CYCLES} cycles after reset. The shortest task is the smallest number of beats from which all tasks reach
    {LEAST_USED} %.
    """


def rows() -> list[tuple[str, int]]:
    """A measured subject: a policy and a number of requesters."""
    return [(policy, requesters) for policy in POLICIES for requesters in REQUESTERS]


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [(_label(*row),) for row in rows()]}


def measure(seed: int, tell: Tell) -> list[Table]:
    """Run all models; `tell` hears of each row."""
    found = []
    for policy, requesters in rows():
        used = [used_of(policy, requesters, beats, seed) for beats in TASK_BEATS]
        found.append(_cells(_label(policy, requesters), used))
        tell(f"{_label(policy, requesters)}: {' '.join(found[-1][1:])}")
    return [Table(TITLE, _COLUMNS, tuple(found), _NOTE)]


def used_of(policy: str, requesters: int, beats: int, seed: int) -> float:
    """Cycles with a beat in percent of all, with tasks of so many beats."""
    shape = (_SETS, requesters)
    periods = np.random.default_rng(seed).integers(SHORTEST_TIME, LONGEST_TIME, shape, endpoint=True)
    model = make_model(policy, Generics(periods, np.full(shape, beats), time_bits=TIME_BITS))
    sets = np.arange(_SETS)
    everybody = np.ones(shape, np.bool_)
    left = np.full(shape, beats)
    used = np.zeros(_SETS, np.int64)
    for cycle in range(_SKIPPED_CYCLES + _CYCLES):
        beat, select = model.grant_valid, model.grant_select
        left[sets, select] -= beat
        last = beat & (left[sets, select] == 0)
        left[sets[last], select[last]] = beats
        if cycle >= _SKIPPED_CYCLES:
            used += beat
        model.step(everybody, beat, last)
    return 100 * int(used.min()) / _CYCLES


def _cells(label: str, used: list[float]) -> tuple[str, ...]:
    shortest = ""
    for beats, percent in reversed(list(zip(TASK_BEATS, used, strict=True))):
        if percent < LEAST_USED:
            break
        shortest = str(beats)
    result = MET if shortest == str(TASK_BEATS[0]) else MISSED
    return (label, *(f"{percent:.2f}" for percent in used), shortest, f">= {LEAST_USED} %", result)


def _label(policy: str, requesters: int) -> str:
    return f"{policy}, N = {requesters}"
