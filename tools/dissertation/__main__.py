"""`make dissertation`: reproduce section 4.3 and table 6.2 of the dissertation as Markdown, CSV and pictures.

    python -m tools.dissertation -o FOLDER [options of firm scheduler bench]

Pictures need matplotlib. Equal options result in equal bytes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.cli.scheduler import add_evaluations, selection_of
from fusesoc_firm.scheduling import area
from fusesoc_firm.scheduling.evaluation.bench import Selection, evaluated, heading, settings_text
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.text.outputs import make_folder
from fusesoc_firm.tools.workers import chosen_workers
from tools.dissertation import chapter, code, pictures
from tools.dissertation.tables import Figure, Table, figure_csv, figure_markdown, markdown, table_csv
from tools.dissertation.timeline import Timeline, timelines

REPORT = "evaluation.md"


def main(words: Sequence[str] | None = None) -> int:
    """Evaluate the schedulers, and write the report."""
    parser = argparse.ArgumentParser("tools.dissertation", description="Reproduce tables and figures.")
    add_evaluations(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", required=True, help="the folder of the report")
    arguments = parser.parse_args(words)
    try:
        make_folder(arguments.output)
        selection = selection_of(arguments)
        means = evaluated(selection, chosen_workers(arguments.jobs, arguments.cluster))
        print(write(chapter.Evaluation(means, area.measured()), selection, arguments.output))
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def write(evaluation: chapter.Evaluation, selection: Selection, folder: Path) -> Path:
    """Write the report with all tables and figures into an existing folder, and return its path."""
    tables = [*chapter.tables(evaluation), code.table()]
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
        print("No pictures are drawn, because matplotlib is not installed", file=sys.stderr)
    path = folder / REPORT
    path.write_text(_report(selection, tables, figures, lines), encoding="utf-8")
    return path


def _report(selection: Selection, tables: Sequence[Table], figures: Sequence[Figure], lines: Sequence[Timeline]) -> str:
    settings = selection.settings
    data_sets = "\n".join(f"* {heading(name, settings)}" for name in selection.data_sets)
    intro = f"""The dissertation's section 4.3, reproduced with `make dissertation`: {settings_text(settings)}.
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


if __name__ == "__main__":
    sys.exit(main())
