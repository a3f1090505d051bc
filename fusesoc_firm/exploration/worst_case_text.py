"""Bounds on the time of messages as text of at most 100 columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fusesoc_firm.exploration.tables import WIDTH, aligned, cut
from fusesoc_firm.exploration.worst_case import WorstTime

_HEAD = ("from", "to", "topic", "cycles")


def worst_times_text(found: Sequence[WorstTime]) -> Iterator[str]:
    """Yield the lines of a table of bounds, and the reasons for missing ones; nothing without messages."""
    known = [item for item in found if item.cycles is not None]
    if known:
        yield ""
        yield "worst case, in cycles, if the host takes each beat at once"
        rows = [(item.source, item.sink, item.topic, str(item.cycles)) for item in known]
        yield from aligned([_HEAD, *rows], 3)
    for item in found:
        if item.cycles is None:
            yield cut(f"no bound from {item.source} to {item.sink}: {item.reason}", WIDTH)
