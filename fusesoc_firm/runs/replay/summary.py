"""Print the summary of a replay as a table."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from fusesoc_firm.runs.replay.errors import SHOWN
from fusesoc_firm.runs.replay.exchanges import OF_GOALS
from fusesoc_firm.runs.replay.goals import Verdict


def print_summary(found: Mapping[str, Any]) -> None:
    """Print the numbers of a summary: received and sent messages, the others, verdicts, and the sums."""
    if found["errors"] > SHOWN:
        print(f"and {found['errors'] - SHOWN} more errors", file=sys.stderr)
    for line in (*_topics(found), *_others(found), *_verdicts(found)):
        print(line)
    sums = {key: sum(row["count"] for row in found[key]) for key in ("in", "out", "dropped", "foreign")}
    print(
        f"{found['bag']}: {sums['in']} in, {sums['out']} out, {sums['dropped'] + sums['foreign']} dropped,"
        f" {found['errors']} errors, {found['cycles']} cycles"
    )


def _topics(found: Mapping[str, Any]) -> Iterator[str]:
    rows = [("in", ", ".join(row["blocks"]), row["topic"], row["type"], str(row["count"])) for row in found["in"]]
    rows += [("out", row["block"], row["topic"], row["type"], str(row["count"])) for row in found["out"]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for *words, count in rows:
        padded = (word.ljust(width) for word, width in zip(words, widths, strict=False))
        yield f"{' '.join(padded)} {count.rjust(widths[-1])}"


def _others(found: Mapping[str, Any]) -> Iterator[str]:
    for row in found["dropped"]:
        yield f"no subscriber for {row['topic']} ({row['type']}): {row['count']}"
    for row in found["foreign"]:
        yield f"not replayed: {row['topic']} ({row['type'] or 'no type'}), since {row['reason']}: {row['count']}"


def _verdicts(found: Mapping[str, Any]) -> Iterator[str]:
    titled = [(f"responses to {row['topic']}", row) for row in found["responses"]]
    titled += [(f"requests on {row['topic']}", row) for row in found["requests"]]
    titled += [(f"{kind} of {row['topic']}", row) for kind in OF_GOALS for row in found[kind]]
    for title, row in titled:
        kinds = (verdict.value for verdict in Verdict if verdict.value in row)
        counts = (f"{row[kind]} {kind.replace('_', ' ')}" for kind in kinds)
        yield f"{title}: {', '.join(counts)}"
