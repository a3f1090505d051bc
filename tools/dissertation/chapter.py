"""The tables and figures of section 4.3, reproduced from evaluations and measured areas."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from fusesoc_firm.scheduling.area import Areas
from fusesoc_firm.scheduling.evaluation.combinations import COMBINATIONS, COMBINED_REQUESTERS
from fusesoc_firm.scheduling.evaluation.jobs import Key
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS, REQUESTERS
from fusesoc_firm.scheduling.policies import POLICIES
from fusesoc_firm.scheduling.tables import UNKNOWN, decimal
from tools.dissertation.published import EVALUATED, dissertation
from tools.dissertation.tables import Figure, Panel, Table

BASELINES: Mapping[str, str] = MappingProxyType({"LOEDF256": "edf_latency", "LST256": "lst"})
"""The schedulers for comparison with combined ones: the name in table 4.5, and the policy."""

LARGE = "large"
CORNER_CASES = tuple(name for name in DATA_SETS if name != LARGE)

_NOT_MEASURED = "Our LUTs and FFs are not measured here; `make bench` measures them."
_MEASURED = "Ours are Yosys', the dissertation's Vivado's; a dash is not measured."
# Values whose text is equal are ranked as equal.
_EQUAL = 0.005
_ABBREVIATIONS = {
    "lru": "LRU",
    "fixed_priority": "NPFP",
    "fixed_priority_preemptive": "PFP",
    "round_robin": "RR",
    "edf_resources": "ROEDF",
    "edf_latency": "LOEDF",
    "lst": "LST",
}


@dataclass(frozen=True)
class Evaluation:
    """The mean of each metric over the sets of a data set, by key, with the known areas."""

    means: Mapping[Key, Mapping[str, float]]
    areas: Areas

    def value(self, data_set: str, policy: str, requesters: int, metric: str) -> float:
        """Return the mean of a metric, or NaN if the metric was not evaluated."""
        return self.means.get(Key(data_set, policy, requesters), {}).get(metric, math.nan)

    def requesters(self, data_set: str) -> tuple[int, ...]:
        """Return the evaluated numbers of accelerators."""
        return tuple(sorted({key.requesters for key in self.means if key.data_set == data_set}))

    def policies(self, data_set: str) -> tuple[str, ...]:
        """Return the evaluated policies, in the order of the tables; policies of others are last."""
        found = {key.policy for key in self.means if key.data_set == data_set}
        return tuple(name for name in dict.fromkeys((*EVALUATED, *POLICIES)) if name in found)


def tables(evaluation: Evaluation) -> Iterator[Table]:
    """Yield tables 4.1 to 4.6; the tables of a data set are included only if the data set was evaluated."""
    yield _area_table(evaluation.areas)
    yield _ratio_table(evaluation.areas)
    if evaluation.requesters(LARGE):
        yield _spread_table(evaluation, "4.3", "response time in cycles", "response", dissertation().response_time)
        yield _spread_table(evaluation, "4.4", "lateness in cycles", "lateness", dissertation().lateness)
    yield _combined_area_table(evaluation.areas)
    if evaluation.requesters(LARGE):
        yield _comparison_table(evaluation)


def figures(evaluation: Evaluation) -> Iterator[Figure]:
    """Yield figures 4.5 to 4.7 and 4.10 to 4.18 with all evaluated values.

    Areas are those of the evaluated numbers of accelerators, or all if none of these is measured.
    """
    evaluated = {key.requesters for key in evaluation.means}
    shown = tuple(number for number in REQUESTERS if number in evaluated)
    yield _area_figure(evaluation.areas, shown or REQUESTERS)
    if numbers := evaluation.requesters(LARGE):
        yield from _large_figures(evaluation, numbers)
    cases = [name for name in CORNER_CASES if evaluation.requesters(name)]
    if cases:
        yield from _corner_figures(evaluation, cases)
    if any(key.policy in COMBINATIONS for key in evaluation.means):
        yield _combined_figure(evaluation)


def _area_table(areas: Areas) -> Table:
    rows = []
    for policy in EVALUATED:
        for number, (lut, ff) in dissertation().area[policy].items():
            rows.append((_short(policy), str(number), *_area(areas, policy, number), str(lut), str(ff)))
    columns = ("scheduler", "accelerators", "LUT", "FF", "dissertation LUT", "dissertation FF")
    return Table("4.1", "resource utilisation", columns, tuple(rows), _area_note(areas))


def _area(areas: Areas, policy: str, requesters: int) -> tuple[str, str]:
    found = areas.get((policy, requesters))
    return (str(found.lut), str(found.ff)) if found else (UNKNOWN, UNKNOWN)


def _area_note(areas: Areas) -> str:
    return _MEASURED if areas else _NOT_MEASURED


def _ratio_table(areas: Areas) -> Table:
    rows = []
    for number, (lut, ff) in dissertation().edf_ratio.items():
        resources, latency = (areas.get((policy, number)) for policy in ("edf_resources", "edf_latency"))
        ours = (UNKNOWN, UNKNOWN)
        if resources and latency:
            ours = (decimal(resources.lut / latency.lut), decimal(resources.ff / latency.ff))
        rows.append((str(number), *ours, decimal(lut), decimal(ff)))
    columns = ("accelerators", "LUT", "FF", "dissertation LUT", "dissertation FF")
    return Table("4.2", "resources of ROEDF as a part of those of LOEDF", columns, tuple(rows), _area_note(areas))


def _spread_table(
    evaluation: Evaluation, number: str, title: str, metric: str, theirs: Mapping[str, Mapping[int, Sequence[float]]]
) -> Table:
    """Return a table of minima, averages and maxima by policy and number of accelerators, ours beside `theirs`."""
    parts = ("min", "avg", "max")
    rows = []
    for policy in evaluation.policies(LARGE):
        for requesters in evaluation.requesters(LARGE):
            ours = [evaluation.value(LARGE, policy, requesters, f"{metric}_{part}") for part in parts]
            known = theirs.get(policy, {}).get(requesters, (math.nan,) * 3)
            cells = map(decimal, (*ours, *known))
            rows.append((_short(policy), str(requesters), *cells, _verdict(ours[1], known[1])))
    columns = ("scheduler", "accelerators", *parts, *(f"dissertation {part}" for part in parts), "our average is")
    return Table(number, title, columns, tuple(rows))


def _verdict(ours: float, theirs: float) -> str:
    """Return a word that compares our value with the dissertation's, for metrics where smaller is better."""
    if math.isnan(ours) or math.isnan(theirs):
        return UNKNOWN
    if abs(ours - theirs) <= _EQUAL:
        return "equal"
    return "better" if ours < theirs else "worse"


def _combined_area_table(areas: Areas) -> Table:
    rows = []
    for name in (*BASELINES, *COMBINATIONS):
        key = BASELINES.get(name, name)
        rows.append((name, *_area(areas, key, COMBINED_REQUESTERS), *map(str, dissertation().combined_area[name])))
    columns = ("schedulers", "LUT", "FF", "dissertation LUT", "dissertation FF")
    return Table("4.5", "resource utilisation of combined schedulers", columns, tuple(rows), _area_note(areas))


# --- Table 4.6 ---------------------------------------------------------------------------------------------------


def _comparison_table(evaluation: Evaluation) -> Table:
    policies = [policy for policy in evaluation.policies(LARGE) if policy in EVALUATED]
    rows = []
    for number in evaluation.requesters(LARGE):
        for criterion, title, score in _criteria(evaluation, number):
            # Non-preemptive policies are omitted, as in the dissertation.
            taking_part = [name for name in policies if criterion != "preemptions" or POLICIES[name].is_preemptive]
            best = _best({name: score(name) for name in taking_part})
            theirs = dissertation().comparison.get(number, {}).get(criterion, [])
            rows.append((str(number), title, _names(best), _names(theirs)))
    note = "The least response time and lateness are those on average."
    return Table("4.6", "comparison", ("accelerators", "criterion", "best", "dissertation"), tuple(rows), note)


def _criteria(evaluation: Evaluation, number: int) -> Iterator[tuple[str, str, Callable[[str], float]]]:
    """Yield the key, title and score of each criterion; the smallest score is the best."""

    def area(policy: str, part: str) -> float:
        found = evaluation.areas.get((policy, number))
        return getattr(found, part) if found else math.nan

    def value(policy: str, metric: str) -> float:
        return evaluation.value(LARGE, policy, number, metric)

    yield "luts", "minimum LUTs", lambda policy: area(policy, "lut")
    yield "ffs", "minimum FFs", lambda policy: area(policy, "ff")
    yield "finished", "most accelerators with completed transactions", lambda policy: -value(policy, "finished")
    yield "preemptions", "least preemptions", lambda policy: value(policy, "preemptions")
    yield "response_time", "minimum response time", lambda policy: value(policy, "response_avg")
    yield "lateness", "minimum lateness", lambda policy: value(policy, "lateness_avg")
    yield "utilisation", "maximum channel utilisation", lambda policy: -value(policy, "utilisation")


def _best(scores: Mapping[str, float]) -> list[str]:
    """Return all policies with the best score, or an empty list if a score is unknown."""
    if not scores or any(math.isnan(score) for score in scores.values()):
        return []
    least = min(scores.values())
    return [name for name, score in scores.items() if score <= least + _EQUAL]


def _short(policy: str) -> str:
    return _ABBREVIATIONS.get(policy, policy)


def _names(policies: Sequence[str]) -> str:
    return ", ".join(_short(name) for name in policies) or UNKNOWN


# --- Figures -----------------------------------------------------------------------------------------------------


def _area_figure(areas: Areas, numbers: tuple[int, ...]) -> Figure:
    panels = []
    for index, (title, part) in enumerate((("LUTs", "lut"), ("FFs", "ff"))):
        ours, theirs = {}, {}
        for policy in EVALUATED:
            found = [areas.get((policy, number)) for number in numbers]
            ours[_short(policy)] = [float(getattr(each, part)) if each else math.nan for each in found]
            theirs[_short(policy)] = [dissertation().area[policy][number][index] for number in numbers]
        panels.append(Panel(title, ours, theirs))
    return Figure("4.5", "resource utilisation", "cells", numbers, tuple(panels))


def _large_figures(evaluation: Evaluation, numbers: tuple[int, ...]) -> Iterator[Figure]:
    theirs = dissertation()

    def panel(title: str, metric: str, table: Mapping[str, Mapping[int, Sequence[float]]], column: int) -> Panel:
        known = {
            _short(policy): [rows[number][column] if number in rows else math.nan for number in numbers]
            for policy, rows in table.items()
        }
        return Panel(title, _series(evaluation, LARGE, numbers, metric), known)

    finished = (panel("granted", "granted", {}, 0), panel("finished", "finished", {}, 0))
    yield Figure("4.6", "accelerators that got the grant and that finished", "accelerators", numbers, finished)
    preemptions = panel("preemptions", "preemptions", {}, 0)
    yield Figure("4.7", "preemptions per accelerator", "per completed transaction", numbers, (preemptions,))
    response = panel("response time", "response_avg", theirs.response_time, 1)
    yield Figure("4.10", "average response time", "cycles", numbers, (response,))
    yield Figure(
        "4.11", "average lateness", "cycles", numbers, (panel("lateness", "lateness_avg", theirs.lateness, 1),)
    )
    yield Figure(
        "4.12", "maximum lateness", "cycles", numbers, (panel("lateness", "lateness_max", theirs.lateness, 2),)
    )
    channel = (
        panel("of all cycles", "utilisation", {}, 0),
        panel("of the cycles with a request", "utilisation_requested", {}, 0),
    )
    yield Figure("4.13", "communication channel utilisation", "percent", numbers, channel)


def _corner_figures(evaluation: Evaluation, cases: Sequence[str]) -> Iterator[Figure]:
    numbers = tuple(sorted({number for case in cases for number in evaluation.requesters(case)}))
    for number, title, unit, metric in (
        ("4.14", "corner cases: preemptions per accelerator", "per completed transaction", "preemptions"),
        ("4.15", "corner cases: average response time", "cycles", "response_avg"),
        ("4.16", "corner cases: average lateness", "cycles", "lateness_avg"),
        ("4.17", "corner cases: channel utilisation", "percent", "utilisation"),
    ):
        panels = tuple(Panel(_case_title(case), _series(evaluation, case, numbers, metric)) for case in cases)
        yield Figure(number, title, unit, numbers, panels)


def _combined_figure(evaluation: Evaluation) -> Figure:
    panels = []
    for metric in ("granted", "finished"):
        series = {
            name: [evaluation.value(LARGE, BASELINES.get(name, name), COMBINED_REQUESTERS, metric)]
            for name in (*BASELINES, *COMBINATIONS)
        }
        panels.append(Panel(metric, series))
    title = "combined schedulers: accelerators that got the grant and that finished"
    return Figure("4.18", title, "accelerators", (COMBINED_REQUESTERS,), tuple(panels))


def _case_title(case: str) -> str:
    data_set = DATA_SETS[case]
    return f"transfer time {data_set.transfer_time}, frequency {data_set.frequency}"


def _series(evaluation: Evaluation, data_set: str, numbers: Sequence[int], metric: str) -> dict[str, list[float]]:
    return {
        _short(policy): [evaluation.value(data_set, policy, number, metric) for number in numbers]
        for policy in evaluation.policies(data_set)
    }
