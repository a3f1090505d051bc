"""The link between the host and a system: the specification's `interconnect`."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from fusesoc_firm.system.derived.model import Converter, DerivedSystem, Link, LinkKind, Scheduling
from fusesoc_firm.system.written.specification import LINKS, Project
from fusesoc_firm.text.diagnostics import Diagnostics

# Bytes that ROS 2 may append to a payload.
_TRAILING_BYTES = 3
# The limit of the hardware's generic LONGEST.
_MOST_BYTES = 2**20
# A higher frequency would exceed the range of the generic CLOCK_HZ, a VHDL integer.
_FASTEST = 10**9


def link_of(
    project: Project,
    clock: Fraction | None,
    scheduling: Scheduling,
    subscribers: Iterable[Converter],
    faults: Diagnostics,
) -> Link | None:
    """Return the link between the host and a system, or None if the streams are ports of the system; note faults.

    `clock` is the frequency of clk in Hz, or None.
    """
    if project.interconnect not in LINKS:
        return None
    kind = LinkKind(project.interconnect)
    if scheduling.is_preemptive:
        faults.error(
            f"interconnect '{kind.value}' cannot carry the bursts of scheduler '{scheduling.policy}'",
            project.interconnect.source,
            "a byte link does not mark the end of a burst; use a non-preemptive scheduler or 'axi_stream'",
        )
    known = list(subscribers)
    for item in known:
        _check_length(item, project, faults)
    return Link(kind, _clock_hz(project, clock, faults), _longest(known))


def _check_length(converter: Converter, project: Project, faults: Diagnostics) -> None:
    """Note a converter whose frames are too long for a link."""
    longest = longest_payload_of(converter)
    if longest <= _MOST_BYTES:
        return
    limit = f"a link holds whole frames from the host, of at most {_MOST_BYTES} bytes"
    faults.error(
        f"interconnect '{project.interconnect}' cannot hold a frame of {longest} bytes, the longest of "
        f"'{converter.block}'",
        project.interconnect.source,
        f"{limit}: set 'maxLength' of '{converter.block}'" if converter.max_length else limit,
    )


def may_be_linked(system: DerivedSystem) -> bool:
    """Whether a system without a link could have one."""
    return not system.scheduling.is_preemptive and _longest(system.subscribers) <= _MOST_BYTES


def _longest(subscribers: Iterable[Converter]) -> int:
    """Return the number of payload bytes in the longest frame from the host."""
    return max(map(longest_payload_of, subscribers))


def longest_payload_of(converter: Converter) -> int:
    """Return the number of bytes in a converter's longest payload."""
    return converter.max_length or converter.buffer or converter.frame.payload_bytes + _TRAILING_BYTES


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
