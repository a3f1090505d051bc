"""What a node opens, and may open anew: a simulator that was built for it, or hardware at an address."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from fusesoc_firm.host.node.node import HardwareListener, OpenTransport
from fusesoc_firm.host.simulator import BuiltSimulator
from fusesoc_firm.host.transport.simulator import ErrorPulse, Event, Pace, Simulator, SimulatorTransport, Taken
from fusesoc_firm.host.transport.transport import Transport, TransportError

# A simulation at rest goes on now and then, for accelerators that send without being asked.
_IDLE_SECONDS = 0.05
# So long a system without a beat still works at something, as far as a simulation knows.
_REST_CYCLES = 20_000


def of_simulator(built: BuiltSimulator, seed: int = 1, stall_percent: int = 0) -> OpenTransport:
    """Start the simulator of a system."""
    command = built.command(seed=seed, stall_percent=stall_percent)

    def opened(listener: HardwareListener) -> Transport:
        return _simulator(lambda: Simulator(command, built.folder), listener)

    return opened


def at_address(address: str) -> OpenTransport:
    """Open what a transport's address says, such as `pipe:COMMAND` (docs/transport.md)."""

    def opened(listener: HardwareListener) -> Transport:
        kind, _, rest = address.partition(":")
        if kind != "pipe" or not rest:
            raise TransportError(f"the transport is '{address}'; legal: pipe:COMMAND")
        return _simulator(lambda: Simulator(["/bin/sh", "-c", rest]), listener)

    return opened


def _simulator(start: Callable[[], Simulator], listener: HardwareListener) -> Transport:
    return SimulatorTransport(
        start, Pace(rest_cycles=_REST_CYCLES, idle_seconds=_IDLE_SECONDS), partial(_tell, listener)
    )


def _tell(listener: HardwareListener, event: Event) -> None:
    if isinstance(event, Taken):
        listener.taken(event.first_cycle, event.last_cycle)
    elif isinstance(event, ErrorPulse):
        listener.refused(event.converter)
