"""Continue a campaign that was interrupted: keep the verdicts in its report."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.verify.campaign import Entry, Settings
from fusesoc_firm.runs.verify.complexity import Level, Statistics
from fusesoc_firm.runs.verify.report import as_data, make_report
from fusesoc_firm.runs.verify.task import Result, Verdict
from fusesoc_firm.text.diagnostics import InputError, fail

# Verdicts of other settings or tools say nothing.
_SHARED = ("tools", "width", "stimuli", "stall_percent", "seed")


def kept_entries(
    report: Path, library: MessageLibrary, names: Collection[MessageName], settings: Settings
) -> list[Entry]:
    """Return the entries of a report for messages that passed and whose definitions have not changed.

    Raise `InputError` if the file is not a report, or is one of other settings or tools.
    """
    try:
        data = json.loads(report.read_text(encoding="utf-8"))
        own = as_data(make_report([], settings, 0))
        if other := [key for key in _SHARED if data[key] != own[key]]:
            said = f"{report} has other {' and '.join(other)}"
            fail(said, hint="omit --resume, or name another report")
        return [entry for item in data["messages"] if (entry := _kept(item, library, names))]
    except OSError as error:
        fail(f"cannot read {report}: {error.strerror}", hint="--resume continues the report at --report")
    except (ValueError, KeyError, TypeError) as error:
        fail(f"{report} is not a report of 'firm message verify': {error!r}", hint="omit --resume")


def _kept(item: Mapping[str, Any], library: MessageLibrary, names: Collection[MessageName]) -> Entry | None:
    name = parse_name(item["name"])
    if item["ros"] != library.ros.number or item["verdict"] != Verdict.PASS or name not in names:
        return None
    try:
        if signature(name, library.closure(name)) != item["signature"]:
            return None
    except InputError:
        return None
    measures = Statistics(Level(item["level"]), item["fields"], item["types"], item["depth"])
    sizes = tuple(item["bytes"])
    result = Result(Verdict.PASS, item["detail"], item["judge"], sizes, item["cycles"], item["seconds"])
    same_as = parse_name(item["same_as"]) if "same_as" in item else None
    return Entry(name, library.ros, result, measures, same_as, item["signature"])
