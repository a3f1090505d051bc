"""The watchdog of the Manager: the specification's `watchdog`. `queue` contains the watchdogs before subscribers."""

from __future__ import annotations

from collections.abc import Iterable

from fusesoc_firm.system.derived.model import Converter, Scheduling
from fusesoc_firm.system.written.specification import Project
from fusesoc_firm.text.diagnostics import Diagnostics

# Schedulers withdraw a grant for a few cycles.
_LEAST = 16
_MOST = 1 << 30


def watchdog_of(project: Project, scheduling: Scheduling, publishers: Iterable[Converter], faults: Diagnostics) -> int:
    """Return the cycles after which the Manager cuts a publisher off, or 0 without a watchdog; note faults.

    A preemptive scheduler serves other publishers while one pauses.
    """
    if project.watchdog and not _LEAST <= project.watchdog <= _MOST:
        faults.error(
            f"'watchdog' cannot be {project.watchdog}",
            project.place("watchdog"),
            f"legal here: {_LEAST} to {_MOST} cycles, or 0 for none",
        )
    needs_one = not scheduling.is_preemptive and any(item.may_pause for item in publishers)
    return project.watchdog if needs_one else 0
