"""`firm message verify`: run a campaign with a progress bar, a summary, and the files of failed messages."""

from __future__ import annotations

import shlex
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.runs.verify.campaign import Entry, Settings, run, select
from fusesoc_firm.runs.verify.progress import Progress
from fusesoc_firm.runs.verify.report import Report, as_data, make_report, write_report
from fusesoc_firm.runs.verify.resume import kept_entries
from fusesoc_firm.runs.verify.simulation import ghdl
from fusesoc_firm.runs.verify.task import Verdict
from fusesoc_firm.text.diagnostics import Diagnostics, fail
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.outputs import check_output, make_folder
from fusesoc_firm.tools.workers import chosen_workers

_SHOWN = 20


@dataclass(frozen=True)
class Places:
    """The places for work and results; `command` is the beginning of a command that verifies one message again.

    The report is printed as a summary, or as JSON if `is_json` is set. With `resumes`, the verdicts in `report` that
    still hold are kept.
    """

    jobs: int | None = None
    cluster: str | None = None
    report: Path | None = None
    keep: Path | None = None
    command: Sequence[str] = ()
    is_json: bool = False
    resumes: bool = False


def verify_messages(library: MessageLibrary, patterns: Sequence[str], settings: Settings, places: Places) -> None:
    """Verify messages and print the results, after Ctrl-C those until then.

    Raise `InputError` if a message fails, if no message could be verified, or if a name is unknown or invalid; the
    other messages are verified then.
    """
    _check(settings, places)
    faults = Diagnostics()
    names = select(library, patterns, faults)
    if not names:
        faults.raise_if_any()
    for fault in faults.found:
        print(fault, file=sys.stderr)
    started = time.monotonic()
    entries, is_whole = _verified(library, names, settings, places)
    report = make_report(entries, settings, time.monotonic() - started)
    _tell(report, places)
    if not is_whole:
        print(f"{len(entries)} of {len(names)} messages were verified{_continuing(places)}", file=sys.stderr)
        raise KeyboardInterrupt
    totals = report.totals
    if totals[Verdict.FAIL]:
        fail(f"{totals[Verdict.FAIL]} of {len(entries)} messages failed")
    if not totals[Verdict.PASS]:
        fail("no message could be verified")
    if faults.found:
        fail("no message failed, but the names above are unknown or invalid")


def _check(settings: Settings, places: Places) -> None:
    """Raise `InputError` if the settings are not legal, or if nothing can be verified or written."""
    if settings.width not in WIDTHS:
        legal = ", ".join(map(str, WIDTHS))
        fail(f"converters do not support {settings.width}-bit streams", hint=f"legal here: {legal}")
    if places.report:
        check_output(places.report, (".json",))
    if places.keep:
        make_folder(places.keep)
    if not places.cluster:
        ghdl()


def _verified(
    library: MessageLibrary, names: Sequence[MessageName], settings: Settings, places: Places
) -> tuple[list[Entry], bool]:
    """Verify messages; return their entries, and whether these are all of them: False after Ctrl-C."""
    entries = kept_entries(places.report, library, names, settings) if places.report and places.resumes else []
    kept = {entry.name for entry in entries}
    rest = [name for name in names if name not in kept]
    try:
        with chosen_workers(places.jobs, places.cluster) as workers, Progress(len(names), len(kept)) as progress:
            for entry in run(library, rest, settings, workers):
                entries.append(entry)
                _keep(entry, places.keep)
                progress.note(entry.name, is_failed=entry.result.verdict is Verdict.FAIL)
    except KeyboardInterrupt:
        return entries, False
    return entries, True


def _tell(report: Report, places: Places) -> None:
    """Write the report, and print it or its summary."""
    beside = write_report(report, places.report) if places.report else None
    if places.is_json:
        print(json_text(as_data(report), 2))
        return
    _print_summary(report, places)
    if beside:
        print(f"{places.report}, {beside}")


def _continuing(places: Places) -> str:
    return "; --resume continues" if places.report else "; with --report, --resume could continue"


def _keep(entry: Entry, folder: Path | None) -> None:
    """Write the contents of the work folder of a failed message below `folder`."""
    if folder is None or not entry.result.files:
        return
    below = folder / f"ros{entry.ros.number}_{entry.name.package}_{entry.name.name}"
    below.mkdir(parents=True, exist_ok=True)
    for name, text in entry.result.files.items():
        (below / name).write_text(text, encoding="utf-8")


def _print_summary(report: Report, places: Places) -> None:
    alone = [entry for entry in report.failures if entry.same_as is None]
    for entry in alone[:_SHOWN]:
        print(f"{entry.name}: {entry.result.detail}\n  to repeat: {shlex.join([*places.command, str(entry.name)])}")
    if len(alone) > _SHOWN:
        print(f"and {len(alone) - _SHOWN} more failed layouts")
    for verdict in (Verdict.NO_JUDGE, Verdict.REFUSED):
        found = [entry for entry in report.entries if entry.result.verdict is verdict]
        for entry in found[:_SHOWN]:
            print(f"{verdict}: {entry.name}: {entry.result.detail}")
        if len(found) > _SHOWN:
            print(f"and {len(found) - _SHOWN} more: {verdict}")
    counts = ", ".join(f"{count} {verdict}" for verdict, count in report.totals.items() if count)
    judges = Counter(entry.result.judge for entry in report.entries if entry.result.judge)
    judged = "; ".join(f"{count} by {judge}" for judge, count in sorted(judges.items()))
    print(f"{len(report.entries)} messages in {report.seconds:g} s: {counts}\njudged: {judged or 'none'}")
