"""`firm scheduler bench`: reproduce section 4.3 as Markdown, CSV and pictures, with a progress bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from fusesoc_firm.scheduling import area
from fusesoc_firm.scheduling.evaluation import chapter, pictures
from fusesoc_firm.scheduling.evaluation.jobs import Outcome, Settings, jobs, run
from fusesoc_firm.scheduling.evaluation.metrics import METRICS
from fusesoc_firm.scheduling.evaluation.timeline import Timeline, timelines
from fusesoc_firm.scheduling.evaluation.workloads import DATA_SETS
from fusesoc_firm.scheduling.tables import (
    Figure,
    Table,
    decimal,
    figure_csv,
    figure_markdown,
    grid,
    markdown,
    table_csv,
)
from fusesoc_firm.text.diagnostics import fail, nearest
from fusesoc_firm.text.outputs import check_output, make_folder
from fusesoc_firm.tools.workers import Workers, cluster_workers, local_workers

REPORT = "evaluation.md"

# The metrics that the terminal shows for each evaluation.
_SHOWN = ("granted", "finished", "preemptions", "response_avg", "lateness_avg", "lateness_max", "utilisation")


@dataclass(frozen=True)
class Selection:
    """The evaluations to run: all combinations of these values."""

    data_sets: Sequence[str]
    policies: Sequence[str]
    requesters: Sequence[int]
    settings: Settings


@dataclass(frozen=True)
class Places:
    """The places where the jobs run and where the results are written."""

    jobs: int | None = None
    cluster: str | None = None
    output: Path | None = None
    csv: Path | None = None


def bench(selection: Selection, places: Places) -> None:
    """Run the evaluations, print a summary, and write the outputs that `places` requests.

    Raise `InputError` before the first evaluation if an output cannot be written.
    """
    _check(places)
    settings = selection.settings
    to_do = jobs(selection.data_sets, selection.policies, selection.requesters, settings)
    started = time.monotonic()
    outcomes: list[Outcome] = []
    print(_of_all(settings), file=sys.stderr)
    bar = tqdm(total=len(to_do), unit="run", disable=None, file=sys.stderr)
    with _workers(places) as workers, bar:
        for outcome in run(to_do, workers):
            outcomes.append(outcome)
            key = outcome.key
            bar.set_postfix_str(f"{key.data_set}, {key.policy}, {key.requesters}", refresh=False)
            bar.update()
    seconds = time.monotonic() - started
    outcomes.sort(key=lambda outcome: outcome.key)
    means = {outcome.key: outcome.metrics.means() for outcome in outcomes}
    evaluation = chapter.Evaluation(means, area.measured())
    for data_set in selection.data_sets:
        print(f"## {_heading(data_set, settings)}\n\n{_summary(evaluation, data_set)}")
    print(f"{len(outcomes)} evaluations in {seconds:.1f} s")
    if places.csv:
        places.csv.write_text(_all_values(evaluation), encoding="utf-8")
        print(places.csv)
    if places.output:
        print(write(evaluation, selection, places.output))


def write(evaluation: chapter.Evaluation, selection: Selection, folder: Path) -> Path:
    """Write the report with all tables and figures into an existing folder, and return its path."""
    tables = list(chapter.tables(evaluation))
    figures = list(chapter.figures(evaluation))
    lines = list(timelines())
    for table in tables:
        (folder / f"{table.file_name}.csv").write_text(table_csv(table), encoding="utf-8")
    for figure in figures:
        (folder / f"{figure.file_name}.csv").write_text(figure_csv(figure), encoding="utf-8")
    for timeline in lines:
        (folder / f"{timeline.file_name}.csv").write_text(timeline.csv(), encoding="utf-8")
    if pictures.are_possible():
        for figure in figures:
            pictures.draw_figure(figure, folder)
        for timeline in lines:
            pictures.draw_timeline(timeline, folder)
    else:
        print(
            "No pictures are drawn, because matplotlib is not installed: pip install 'fusesoc-firm[plots]'",
            file=sys.stderr,
        )
    path = folder / REPORT
    path.write_text(_report(selection, tables, figures, lines), encoding="utf-8")
    return path


def _check(places: Places) -> None:
    """Create the folder, and check that the file can be written, so that a long evaluation does not fail at its end."""
    if places.output:
        make_folder(places.output)
    if places.csv:
        check_output(places.csv, (".csv",))
        try:
            places.csv.open("a", encoding="utf-8").close()
        except OSError as error:
            fail(f"cannot write {places.csv}: {error.strerror}")


def _workers(places: Places) -> AbstractContextManager[Workers]:
    return cluster_workers(places.cluster) if places.cluster else local_workers(places.jobs)


def _report(selection: Selection, tables: Sequence[Table], figures: Sequence[Figure], lines: Sequence[Timeline]) -> str:
    settings = selection.settings
    data_sets = "\n".join(f"* {_heading(name, settings)}" for name in selection.data_sets)
    intro = f"""The dissertation's section 4.3, reproduced with `firm scheduler bench`: {_of_all(settings)}.
Times are in clock cycles; docs/explanation/scheduler-evaluation.md defines the metrics.

{data_sets}
"""
    parts = [
        "# Evaluation of the schedulers\n",
        intro,
        "## Tables\n",
        *map(markdown, tables),
        "## Figures\n",
    ]
    drawn = pictures.are_possible()
    for figure in figures:
        parts.append(figure_markdown(figure))
        if drawn:
            parts.append(f"![{figure.title}]({figure.file_name}.svg)\n")
    for line in lines:
        parts.append(f"### Figure {line.number}: {line.title}\n\nCycle by cycle in {line.file_name}.csv.\n")
        if drawn:
            parts.append(f"![{line.title}]({line.file_name}.svg)\n")
    return "\n".join(parts)


def _of_all(settings: Settings) -> str:
    """Return a text with the shared settings that differ from section 4.3."""
    found = f"seed {settings.seed}, {settings.distribution} distribution"
    if settings.shortest_run > 1:
        found += f", a shortest run of {settings.shortest_run} beats"
    if settings.resume_beats:
        found += f", {settings.resume_beats} additional beats in each resumed run"
    return found


def _heading(data_set: str, settings: Settings) -> str:
    found = DATA_SETS[data_set]
    size = f"{settings.sets_of(data_set)} sets, {settings.cycles_of(data_set)} cycles"
    return f"{found.title}, {data_set} = {found.formula}: {size}"


def _summary(evaluation: chapter.Evaluation, data_set: str) -> str:
    rows = [
        (key.policy, str(key.requesters), *(decimal(means[metric]) for metric in _SHOWN))
        for key, means in evaluation.means.items()
        if key.data_set == data_set
    ]
    return grid(("policy", "N", *(metric.replace("_", " ") for metric in _SHOWN)), rows)


def _all_values(evaluation: chapter.Evaluation) -> str:
    """Return CSV text with a row for each evaluation and a column for each metric; NaN becomes an empty cell."""
    lines = [",".join(("data_set", "policy", "requesters", *METRICS))]
    for key, means in evaluation.means.items():
        values = ("" if means[name] != means[name] else f"{means[name]:.6g}" for name in METRICS)
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
