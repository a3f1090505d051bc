"""The FIFOs after publishers whose frames may be late (section 6.3.2), with sizes from the bounds on lateness."""

from __future__ import annotations

from dataclasses import replace

from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.derived.timing import bounds_of
from fusesoc_firm.system.written.specification import NOT_ADDED, Project
from fusesoc_firm.text.diagnostics import Diagnostics

_MOST_BYTES = 1 << 16


def with_lateness_buffers(system: DerivedSystem, project: Project, faults: Diagnostics) -> DerivedSystem:
    """Return the system with the `late_bytes` of each publisher, and warn if a FIFO would be too large.

    If a time of any publisher is unknown, or a publisher may never be served, there is no bound and no FIFO.
    """
    if project.lateness_buffers == NOT_ADDED:
        return system
    bounds = bounds_of(system)
    if not bounds:
        return system
    publishers = []
    for publisher, bound in zip(system.publishers, bounds, strict=True):
        late = bound.buffer or 0
        if late > _MOST_BYTES:
            faults.warn(
                f"'{publisher.block}' has no FIFO for the time in which its frames are late: it needs {late:,} bytes",
                project.place("scheduler"),
                f"at most {_MOST_BYTES:,} bytes are added; choose another scheduler, or longer periods",
            )
            late = 0
        publishers.append(replace(publisher, late_bytes=late))
    return replace(system, publishers=tuple(publishers))
