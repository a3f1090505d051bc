"""`firm scheduler bench`: evaluate schedulers, print a summary and write all values as CSV, with a progress bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from fusesoc_firm.scheduling.evaluation.jobs import Key, Settings, jobs, run
from fusesoc_firm.scheduling.evaluation.metrics import METRICS
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS
from fusesoc_firm.scheduling.tables import decimal, grid
from fusesoc_firm.text.diagnostics import fail, nearest
from fusesoc_firm.text.outputs import check_output
from fusesoc_firm.tools.workers import Workers

Means = Mapping[Key, Mapping[str, float]]
"""The mean of each metric over the sets of a data set, by evaluation."""

# The metrics that the terminal shows for each evaluation.
_SHOWN = ("granted", "finished", "preemptions", "response_avg", "lateness_avg", "lateness_max", "utilisation")


@dataclass(frozen=True)
class Selection:
    """The evaluations to run: all combinations of these values."""

    data_sets: Sequence[str]
    policies: Sequence[str]
    requesters: Sequence[int]
    settings: Settings


def bench(selection: Selection, workers: AbstractContextManager[Workers], csv: Path | None = None) -> None:
    """Run the evaluations, print a summary, and write all values to `csv`.

    Raise `InputError` before the first evaluation if the file cannot be written.
    """
    if csv:
        _check(csv)
    started = time.monotonic()
    means = evaluated(selection, workers)
    seconds = time.monotonic() - started
    for data_set in selection.data_sets:
        print(f"## {heading(data_set, selection.settings)}\n\n{_summary(means, data_set)}")
    print(f"{len(means)} evaluations in {seconds:.1f} s")
    if csv:
        csv.write_text(_all_values(means), encoding="utf-8")
        print(csv)


def evaluated(selection: Selection, workers: AbstractContextManager[Workers]) -> Means:
    """Run the evaluations with a progress bar, and return their means by the sorted keys."""
    to_do = jobs(selection.data_sets, selection.policies, selection.requesters, selection.settings)
    print(settings_text(selection.settings), file=sys.stderr)
    found = {}
    bar = tqdm(total=len(to_do), unit="run", disable=None, file=sys.stderr)
    with workers as started, bar:
        for outcome in run(to_do, started):
            key = outcome.key
            found[key] = outcome.metrics.means()
            bar.set_postfix_str(f"{key.data_set}, {key.policy}, {key.requesters}", refresh=False)
            bar.update()
    return dict(sorted(found.items()))


def _check(csv: Path) -> None:
    """Check that the file can be written, so that a long evaluation does not fail at its end."""
    check_output(csv, (".csv",))
    try:
        csv.open("a", encoding="utf-8").close()
    except OSError as error:
        fail(f"cannot write {csv}: {error.strerror}")


def settings_text(settings: Settings) -> str:
    """Return a text with the shared settings that differ from section 4.3."""
    found = f"seed {settings.seed}, {settings.distribution} distribution"
    if settings.shortest_run > 1:
        found += f", a shortest run of {settings.shortest_run} beats"
    if settings.resume_beats:
        found += f", {settings.resume_beats} additional beats in each resumed run"
    return found


def heading(data_set: str, settings: Settings) -> str:
    """Return a title of a data set, with its size."""
    found = DATA_SETS[data_set]
    size = f"{settings.sets_of(data_set)} sets, {settings.cycles_of(data_set)} cycles"
    return f"{found.title}, {data_set} = {found.formula}: {size}"


def _summary(means: Means, data_set: str) -> str:
    rows = [
        (key.policy, str(key.requesters), *(decimal(found[metric]) for metric in _SHOWN))
        for key, found in means.items()
        if key.data_set == data_set
    ]
    return grid(("policy", "N", *(metric.replace("_", " ") for metric in _SHOWN)), rows)


def _all_values(means: Means) -> str:
    """Return CSV text with a row for each evaluation and a column for each metric; NaN becomes an empty cell."""
    lines = [",".join(("data_set", "policy", "requesters", *METRICS))]
    for key, found in means.items():
        values = ("" if found[name] != found[name] else f"{found[name]:.6g}" for name in METRICS)
        lines.append(",".join((key.data_set, key.policy, str(key.requesters), *values)))
    return "\n".join(lines) + "\n"


def names_of(text: str, legal: Sequence[str], what: str) -> tuple[str, ...]:
    """Return the names in a comma-separated list; raise `InputError` for an unknown name."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        if name not in legal:
            fail(f"unknown {what} '{name}'", hint=nearest(name, legal))
    return names


def numbers_of(text: str, most: int = 256) -> tuple[int, ...]:
    """Return the sorted numbers of accelerators in a comma-separated list; raise `InputError` for an illegal one."""
    found = set()
    for word in text.split(","):
        if not word.strip().isdecimal() or not 1 <= int(word) <= most:
            fail(
                f"'{word.strip()}' is not a legal number of accelerators",
                hint=f"legal: 1 to {most}; an example of a list is 2,8,256",
            )
        found.add(int(word))
    return tuple(sorted(found))
