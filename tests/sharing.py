"""How a run shares its tests among its processes: a file or a group at a time, the longest first.

What a file's tests share, such as what they compile, is made once, and no process is left with a long file at the end.
How long they take is in `sharing.json`, which a run with `--record-seconds` writes; what is not in it comes first.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from _pytest.terminal import TerminalReporter

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler.loadgroup import LoadGroupScheduling

_SECONDS = Path(__file__).with_suffix(".json")
# Shorter ones make no difference.
_SHORT = 2
# With fewer units for each process, tests are shared out one by one.
_FEW = 4


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record-seconds", action="store_true", help=f"write to {_SECONDS.name} how long tests took")


def unit_of(test: str) -> str:
    """What runs in one process with the test of this id: its group, or its file."""
    group = test.rpartition("]")[2].rpartition("::")[2].partition("@")[2]
    return group or test.partition("::")[0]


@cache
def _seconds() -> Mapping[str, float]:
    known: dict[str, float] = json.loads(_SECONDS.read_text(encoding="utf-8")) if _SECONDS.exists() else {}
    return known


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: -_seconds().get(unit_of(item.nodeid), math.inf))


# Absent without pytest-xdist.
@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadGroupScheduling | None:
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler.loadgroup import LoadGroupScheduling

    class Scheduling(LoadGroupScheduling):  # type: ignore[misc]
        """Tests by their units, in the order of the collection."""

        def schedule(self) -> None:
            self.config.option.loadscopereorder = False
            tests: Sequence[str] = next(iter(self.registered_collections.values()))
            units = set(map(unit_of, tests))
            self._is_by_unit = len(units) > _FEW * len(self.nodes)
            super().schedule()

        def _split_scope(self, nodeid: str) -> str:
            return unit_of(nodeid) if self._is_by_unit else super()._split_scope(nodeid)

    return Scheduling(config, log)


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    if not config.getoption("--record-seconds"):
        return
    seconds: defaultdict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                seconds[unit_of(report.nodeid)] += report.duration
    long = {unit: round(taken) for unit, taken in sorted(seconds.items()) if taken >= _SHORT}
    _SECONDS.write_text(json.dumps(long, indent=2) + "\n", encoding="utf-8")
