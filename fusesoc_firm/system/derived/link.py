"""The link between the host and a system: the specification's `interconnect`."""

from __future__ import annotations

from fractions import Fraction

from fusesoc_firm.system.derived.model import Link, LinkKind, Scheduling
from fusesoc_firm.system.written.specification import AXI_STREAM, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# A higher frequency would exceed the range of the generic CLOCK_HZ, a VHDL integer.
_FASTEST = 10**9


def link_of(project: Project, clock: Fraction | None, scheduling: Scheduling, faults: Diagnostics) -> Link | None:
    """Return the link between the host and a system, or None if the streams are ports of the system; note faults.

    `clock` is the frequency of clk in Hz, if it is given.
    """
    if project.interconnect == AXI_STREAM:
        return None
    kind = LinkKind(project.interconnect)
    if scheduling.is_preemptive:
        faults.error(
            f"interconnect '{kind.value}' cannot carry the bursts of scheduler '{scheduling.policy}'",
            project.interconnect.source,
            "a byte link does not mark the end of a burst; use a non-preemptive scheduler or 'axi_stream'",
        )
    return Link(kind, _clock_hz(project, clock, faults))


def _clock_hz(project: Project, clock: Fraction | None, faults: Diagnostics) -> int:
    """Return the clock's frequency in Hz as an integer, or 0 if it is not given."""
    if project.clock is None or clock is None:
        if project.interconnect == LinkKind.UART.value:
            faults.error(
                f"interconnect '{project.interconnect}' needs the clock's frequency",
                project.interconnect.source,
                "add 'clock' to 'project', such as 'clock: 100 MHz'",
            )
        return 0
    if clock.denominator != 1 or clock > _FASTEST:
        faults.error(
            f"interconnect '{project.interconnect}' does not support the clock frequency {project.clock}",
            project.clock.source,
            "legal here: a whole number of Hz, at most 1 GHz",
        )
    return int(clock)
