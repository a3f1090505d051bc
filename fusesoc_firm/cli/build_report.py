"""Reports of builds: a progress bar, a table, a line of JSON for each event, and JUnit's XML."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.json_text import json_text
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.outcome import Build, Outcome
    from fusesoc_firm.builds.setup.steps import Step

_CACHED, _FAILED = "cached", "failed"


@dataclass(frozen=True)
class Words:
    """The words of a report: a build's name, and a good result. With `is_cached`, builds run as actions."""

    unit: str = "build"
    good: str = "ok"
    is_cached: bool = False

    @property
    def column(self) -> str:
        """The title of the column with targets."""
        return "test" if self.unit == "test" else "target"

    @property
    def counted(self) -> tuple[str, ...]:
        """The results whose number is always printed."""
        return (_CACHED, self.good, _FAILED) if self.is_cached else ()

    @property
    def results(self) -> tuple[str, ...]:
        """All results, in the order of the summary."""
        return (*((_CACHED,) if self.is_cached else ()), self.good, "flaky", _FAILED, "skipped")


@dataclass(frozen=True)
class Row:
    """The outcome of a build, its result in the report's words, and its steps, if it ran as actions."""

    outcome: Outcome
    result: str
    steps: tuple[Step, ...] = ()


@dataclass(frozen=True)
class Outputs:
    """The files of a report, and the printed parts: `is_quiet` omits progress and table, `is_verbose` adds all logs."""

    events: Path | None = None
    junit: Path | None = None
    is_quiet: bool = False
    is_verbose: bool = False


class Report:
    """The reports of one run, from the constructor to `close`."""

    def __init__(self, words: Words, outputs: Outputs) -> None:
        """Begin the reports. Raise `InputError` if the file for the events cannot be written."""
        self._started = time.monotonic()
        self._words, self._outputs = words, outputs
        self._builds: list[Build] = []
        self._rows: list[Row] = []
        self._running: list[Build] = []
        self._events = _opened(outputs.events) if outputs.events else None
        # A progress bar, created at the first miss: loading its module takes longer than recalling a build.
        self._bar: Any = None

    def plan(self, builds: Sequence[Build]) -> None:
        """Record all builds of the run, before the first one begins or ends."""
        self._builds = list(builds)
        if self._bar is not None:
            self._bar.total = len(builds)
        self._event("plan", builds=[_named(build) for build in builds])

    def tell(self, text: str) -> None:
        """Print a line above the progress bar."""
        self._print(text, sys.stderr)

    def progress(self, text: str) -> None:
        """Show the progress before the first build."""
        self._begin_bar()
        self._bar.set_postfix_str(text)

    def begin(self, build: Build, number: int) -> None:
        """Record the start of a try of a build; tries count from 1."""
        self._begin_bar()
        self._running.append(build)
        self._event("start", **_named(build), number=number)
        self._show()

    def end(self, outcome: Outcome) -> None:
        """Record the end of a build, and print its log if the report is verbose."""
        row = _row(outcome, self._words)
        if self._outputs.is_verbose and not outcome.is_skipped:
            self._print(f"{outcome.build}: {row.result}\n{_text_of(outcome.build.log)}".rstrip(), sys.stdout)
        self._rows.append(row)
        self._running = [build for build in self._running if build != outcome.build]
        self._event("end", **_facts(row))
        if self._bar is not None:
            self._show()
            self._bar.update()

    def close(self) -> None:
        """End the progress bar and the events, also of a run that was interrupted."""
        if self._bar is not None:
            self._bar.close()
        self._event("summary", builds=len(self._rows), **self._counts())
        if self._events:
            self._events.close()

    def finish(self) -> None:
        """Print the results and write JUnit's file. Raise `InputError` if a build failed."""
        places = {build: place for place, build in enumerate(self._builds)}
        rows = sorted(self._rows, key=lambda row: places[row.outcome.build])
        seconds = time.monotonic() - self._started
        if self._outputs.junit:
            _write(self._outputs.junit, junit(rows, seconds, self._words))
        for outcome in (row.outcome for row in rows):
            if outcome.last_lines:
                what = f"failed in try {outcome.tries - 1}" if outcome.is_good else "failed"
                print(f"{outcome.build} {what}; the last lines of {shown(outcome.build.log)}")
                print(*(f"    {line}" for line in outcome.last_lines), sep="\n")
        if not self._outputs.is_quiet:
            _print_table(rows, self._words)
            _print_faults(rows)
        print(self._summary(rows, seconds))
        if failed := self._counts()[_FAILED]:
            fail(f"{failed} of {len(rows)} {self._words.unit}s failed")

    def _summary(self, rows: Sequence[Row], seconds: float) -> str:
        shown_counts = [
            f"{count} {result}" for result, count in self._counts().items() if count or result in self._words.counted
        ]
        counts = f": {', '.join(shown_counts)}" if shown_counts else ""
        saved = sum(step.seconds for row in rows for step in row.steps if step.state == _CACHED)
        end = f"; {saved:.1f} s saved" if self._words.is_cached else ""
        return f"{len(rows)} {self._words.unit}s in {seconds:.1f} s{counts}{end}"

    def _counts(self) -> dict[str, int]:
        counts = Counter(row.result for row in self._rows)
        return {result: counts[result] for result in self._words.results}

    def _begin_bar(self) -> None:
        if self._bar is not None:
            return
        from tqdm import tqdm

        # Build processes are forked, which is safe only without other threads, such as tqdm's monitor.
        tqdm.monitor_interval = 0
        self._bar = tqdm(
            unit=self._words.unit,
            total=len(self._builds) or None,
            initial=len(self._rows),
            disable=self._outputs.is_quiet or None,
            file=sys.stderr,
        )

    def _print(self, text: str, file: TextIO) -> None:
        """Print text above the progress bar."""
        if self._bar is None:
            print(text, file=file)
        else:
            self._bar.write(text, file=file)

    def _show(self) -> None:
        failed = self._counts()[_FAILED]
        now = ", ".join(map(str, dict.fromkeys(self._running)))
        self._bar.set_postfix_str(f"{now}{f', {failed} failed' if failed else ''}")

    def _event(self, event: str, **facts: Any) -> None:
        if self._events:
            line = {"event": event, "time": round(time.monotonic() - self._started, 3), **facts}
            # A full disk must not end the builds.
            with suppress(OSError):
                print(json_text(line), file=self._events, flush=True)


def junit(rows: Sequence[Row], seconds: float, words: Words) -> str:
    """Return the results in the format of JUnit: a test case for each build, with the core as its class."""
    from xml.etree import ElementTree as ET

    counts = {
        "tests": len(rows),
        "failures": sum(row.result == _FAILED for row in rows),
        "skipped": sum(row.outcome.is_skipped for row in rows),
    }
    suite = ET.Element("testsuite", name=f"firm {words.unit}", time=f"{seconds:.3f}")
    suite.attrib |= {name: str(count) for name, count in counts.items()}
    for row in rows:
        outcome = row.outcome
        name, core = outcome.build.target, outcome.build.core
        case = ET.SubElement(suite, "testcase", classname=core, name=name, time=f"{outcome.seconds:.3f}")
        text = "\n".join(map(_legal, outcome.last_lines))
        if outcome.is_skipped:
            ET.SubElement(case, "skipped")
        elif not outcome.is_good:
            ET.SubElement(case, "failure", message=_legal(outcome.last_lines[-1:][0] if text else "")).text = text
        elif outcome.tries > 1:
            ET.SubElement(case, "system-out").text = f"flaky: passed in try {outcome.tries}\n{text}"
        elif row.result == _CACHED:
            ET.SubElement(case, "system-out").text = _CACHED
    suites = ET.Element("testsuites")
    suites.append(suite)
    ET.indent(suites)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(suites, encoding="unicode")}\n'


def _row(outcome: Outcome, words: Words) -> Row:
    steps: tuple[Step, ...] = ()
    if words.is_cached and not outcome.is_skipped:
        from fusesoc_firm.builds.setup.steps import steps_of

        steps = steps_of(outcome.build)
    is_cached = outcome.result == "ok" and bool(steps) and all(step.state == _CACHED for step in steps)
    good = _CACHED if is_cached else words.good
    return Row(outcome, good if outcome.result == "ok" else outcome.result, steps)


def _text_of(log: Path) -> str:
    """Return a log, or "" if it is missing."""
    try:
        return log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _print_table(rows: Sequence[Row], words: Words) -> None:
    cells = [("core", words.column, "result", "seconds", "log")]
    cells += [
        (
            row.outcome.build.core,
            row.outcome.build.target,
            row.result,
            f"{row.outcome.seconds:.1f}",
            "" if row.outcome.is_skipped else shown(row.outcome.build.log),
        )
        for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for line in cells:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=True)).rstrip())


def _print_faults(rows: Sequence[Row]) -> None:
    """Print why the results of steps were not stored, each reason once."""
    found = [
        f"'{step.name}' of {row.outcome.build} is not cached: {step.fault}"
        for row in rows
        for step in row.steps
        if step.fault
    ]
    print(*dict.fromkeys(found), sep="\n", end="\n" if found else "")


def _named(build: Build) -> dict[str, str]:
    return {"core": build.core, "target": build.target, "log": str(build.log)}


def _facts(row: Row) -> dict[str, object]:
    outcome = row.outcome
    return {
        **_named(outcome.build),
        "result": row.result,
        "tries": outcome.tries,
        "seconds": round(outcome.seconds, 3),
        "last_lines": list(outcome.last_lines),
        **({"steps": [asdict(step) for step in row.steps]} if row.steps else {}),
    }


def _legal(text: str) -> str:
    """Return a text without the characters that XML does not allow, such as those of colours."""
    return "".join(letter if letter.isprintable() or letter == "\t" else "?" for letter in text)


def _opened(path: Path) -> TextIO:
    try:
        return path.open("w", encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
