"""What a node opens, and may open anew: a simulator that was built for it, or hardware at an address."""

from __future__ import annotations

from functools import partial

from fusesoc_firm.node.node import HardwareListener, OpenTransport
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.simulator import ErrorPulse, Event, Pace, Simulator, SimulatorTransport, Taken
from fusesoc_firm.simulation.simulator import BuiltSimulator

# After so many cycles without a beat a simulation takes no more of the processor than it needs to go on now and then,
# for accelerators that send without being asked, and those that compute for longer. One that never slept would lose its
# turn to others when a message comes.
_PACE = Pace(rest_cycles=2_000, idle_seconds=0.05)


def of_simulator(built: BuiltSimulator, seed: int = 1, stall_percent: int = 0) -> OpenTransport:
    """Start the simulator of a system."""
    command = built.command(seed=seed, stall_percent=stall_percent)

    return lambda listener: SimulatorTransport(
        lambda: Simulator(command, built.folder), _PACE, partial(_tell, listener)
    )


def at_address(address: str) -> OpenTransport:
    """Open what a transport's address says, such as `uart:DEVICE:BAUD` (docs/reference/transports.md)."""
    return lambda listener: open_transport(address, _PACE, partial(_tell, listener))


def _tell(listener: HardwareListener, event: Event) -> None:
    if isinstance(event, Taken):
        listener.taken(event.first_cycle, event.last_cycle)
    elif isinstance(event, ErrorPulse):
        listener.refused(event.converter)
