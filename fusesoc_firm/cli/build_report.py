"""Reports of builds: a progress bar, a table, a line of JSON for each event, and JUnit's XML."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO
from xml.etree import ElementTree as ET

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.outputs import shown

if TYPE_CHECKING:
    from fusesoc_firm.building.plan import Build
    from fusesoc_firm.building.pool import Outcome

RESULTS = ("ok", "flaky", "failed", "skipped")


class Report:
    """The reports of one run, which is from the constructor to `close`."""

    def __init__(self, builds: Sequence[Build], events: Path | None, junit: Path | None) -> None:
        """Begin the reports. Raise `InputError` if the file for the events cannot be written."""
        from tqdm import tqdm

        # Build processes are forked, which is safe only without other threads, such as tqdm's monitor.
        tqdm.monitor_interval = 0
        self._started = time.monotonic()
        self._builds, self._junit = list(builds), junit
        self._outcomes: list[Outcome] = []
        self._running: list[Build] = []
        self._events = _opened(events) if events else None
        self._bar = tqdm(total=len(builds), unit="build", disable=None, file=sys.stderr)
        self._event("plan", builds=[_named(build) for build in builds])

    def tell(self, text: str) -> None:
        """Print a line above the progress bar."""
        self._bar.write(text, file=sys.stderr)

    def progress(self, text: str) -> None:
        """Show what happens before the first build."""
        self._bar.set_postfix_str(text)

    def begin(self, build: Build, number: int) -> None:
        """Note the start of a build's try, from 1."""
        self._running.append(build)
        self._event("start", **_named(build), number=number)
        self._show()

    def end(self, outcome: Outcome) -> None:
        """Note the end of a build."""
        self._outcomes.append(outcome)
        self._running = [build for build in self._running if build != outcome.build]
        self._event("end", **_result(outcome))
        self._show()
        self._bar.update()

    def close(self) -> None:
        """End the progress bar and the events, also of a run that was interrupted."""
        self._bar.close()
        self._event("summary", builds=len(self._outcomes), **self._counts())
        if self._events:
            self._events.close()

    def finish(self) -> None:
        """Print the results and write JUnit's file. Raise `InputError` if a build failed."""
        outcomes = sorted(self._outcomes, key=lambda outcome: self._builds.index(outcome.build))
        seconds = time.monotonic() - self._started
        if self._junit:
            _write(self._junit, junit(outcomes, seconds))
        for outcome in outcomes:
            if outcome.last_lines:
                what = f"failed in try {outcome.tries - 1}" if outcome.is_good else "failed"
                print(f"{outcome.build} {what}; the last lines of {shown(outcome.build.log)}")
                print(*(f"    {line}" for line in outcome.last_lines), sep="\n")
        _print_table(outcomes)
        counts = ", ".join(f"{count} {result}" for result, count in self._counts().items() if count)
        print(f"{len(outcomes)} builds in {seconds:.1f} s" + (f": {counts}" if counts else ""))
        if failed := self._counts()["failed"]:
            fail(f"{failed} of {len(outcomes)} builds failed")

    def _counts(self) -> dict[str, int]:
        counts = Counter(outcome.result for outcome in self._outcomes)
        return {result: counts[result] for result in RESULTS}

    def _show(self) -> None:
        failed = self._counts()["failed"]
        now = ", ".join(map(str, dict.fromkeys(self._running)))
        self._bar.set_postfix_str(f"{now}{f', {failed} failed' if failed else ''}", refresh=False)

    def _event(self, event: str, **facts: Any) -> None:
        if self._events:
            line = {"event": event, "time": round(time.monotonic() - self._started, 3), **facts}
            # A full disk must not end the builds.
            with suppress(OSError):
                print(json.dumps(line), file=self._events, flush=True)


def junit(outcomes: Sequence[Outcome], seconds: float) -> str:
    """Return the results in the format of JUnit: a test case for each build, with the core as its class."""
    counts = {
        "tests": len(outcomes),
        "failures": sum(outcome.result == "failed" for outcome in outcomes),
        "skipped": sum(outcome.is_skipped for outcome in outcomes),
    }
    suite = ET.Element("testsuite", name="firm build", time=f"{seconds:.3f}")
    suite.attrib |= {name: str(count) for name, count in counts.items()}
    for outcome in outcomes:
        name, core = outcome.build.target, outcome.build.core
        case = ET.SubElement(suite, "testcase", classname=core, name=name, time=f"{outcome.seconds:.3f}")
        text = "\n".join(map(_legal, outcome.last_lines))
        if outcome.is_skipped:
            ET.SubElement(case, "skipped")
        elif not outcome.is_good:
            ET.SubElement(case, "failure", message=_legal(outcome.last_lines[-1:][0] if text else "")).text = text
        elif outcome.tries > 1:
            ET.SubElement(case, "system-out").text = f"flaky: passed in try {outcome.tries}\n{text}"
    suites = ET.Element("testsuites")
    suites.append(suite)
    ET.indent(suites)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(suites, encoding="unicode")}\n'


def _print_table(outcomes: Sequence[Outcome]) -> None:
    rows = [("core", "target", "result", "seconds", "log")]
    rows += [
        (
            outcome.build.core,
            outcome.build.target,
            outcome.result,
            f"{outcome.seconds:.1f}",
            "" if outcome.is_skipped else shown(outcome.build.log),
        )
        for outcome in outcomes
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())


def _named(build: Build) -> dict[str, str]:
    return {"core": build.core, "target": build.target, "log": str(build.log)}


def _result(outcome: Outcome) -> dict[str, object]:
    return {
        **_named(outcome.build),
        "result": outcome.result,
        "tries": outcome.tries,
        "seconds": round(outcome.seconds, 3),
        "last_lines": list(outcome.last_lines),
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
