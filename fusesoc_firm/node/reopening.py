"""The transports that a node opens and may reopen: a simulator built for the node, or hardware at an address."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from fusesoc_firm.node.engine.hardware_parameters import HardwareParameters
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.node import HardwareListener, OpenTransport
from fusesoc_firm.node.status.status import access, check_digest
from fusesoc_firm.node.transport.built_simulator import BuiltSimulator
from fusesoc_firm.node.transport.open_transport import open_transport
from fusesoc_firm.node.transport.simulator import (
    ErrorPulse,
    Event,
    Pace,
    Simulator,
    SimulatorTransport,
    Taken,
    Waits,
)
from fusesoc_firm.node.transport.status_registers import StatusRegisters, open_registers_at
from fusesoc_firm.node.transport.transport import Transport, TransportError

# After this many cycles without a beat, or four of its own pauses, the simulation runs only at intervals. These suffice
# for accelerators that send spontaneously or compute for longer. A simulation that never sleeps would use the processor
# time that an arriving message needs.
_PACE = Pace(rest_cycles=500, idle_seconds=0.05)


def of_simulator(built: BuiltSimulator, seed: int = 1, stall_percent: int = 0) -> OpenTransport:
    """Return a function that starts the simulator of a system."""
    command = built.command(seed=seed, stall_percent=stall_percent)

    return lambda listener: SimulatorTransport(
        lambda: Simulator(command, built.folder), _PACE, partial(_tell, listener), listener.wants_waits
    )


def at_address(address: str) -> OpenTransport:
    """Return a function that opens a transport; docs/reference/transports.md describes addresses."""
    return lambda listener: open_transport(address, _PACE, partial(_tell, listener), listener.wants_waits)


def status_registers(description: NodeDescription, address: str, transport: str) -> StatusRegisters | None:
    """Return the registers of the hardware's status, or None if frames read it, it is missing, or it is a simulator's.

    `address` is that of the registers; if it is empty, the overlay's device is searched. `transport` is the address of
    the transport, empty for a simulator. May raise `TransportError`.
    """
    if not description.has_status_registers:
        if address:
            raise TransportError(f"'{description.name}' has no 'status: axi_lite', so '--status' has no effect")
        return None
    is_simulated = not transport or transport.startswith("pipe:")
    return None if is_simulated and not address else open_registers_at(address)


def checked(
    open_transport: OpenTransport,
    description: NodeDescription,
    registers: StatusRegisters | None = None,
    parameters: HardwareParameters | None = None,
) -> OpenTransport:
    """Return a function that opens a transport, and raises `TransportError` if the hardware is another system's.

    `registers` are those of the status, if frames do not read it. Without a status, the hardware is not checked. The
    function sets the `parameters` of the hardware, which begins with the defaults.
    """
    if registers:
        return _checked_before(open_transport, description, registers, parameters)
    if description.has_status_frames:
        return _checked_by_frames(open_transport, description, parameters)
    return _without_status(open_transport, parameters)


def _without_status(open_transport: OpenTransport, parameters: HardwareParameters | None) -> OpenTransport:
    """Return a function that opens a transport, unless the hardware needs other parameters than its defaults."""

    def refuse(_: bytes) -> int:
        raise TransportError("the node has no access to the registers of the parameters, which are at their defaults")

    def opened(listener: HardwareListener) -> Transport:
        if parameters:
            parameters.restore(refuse)
        return open_transport(listener)

    return opened


def _checked_before(
    open_transport: OpenTransport,
    description: NodeDescription,
    registers: StatusRegisters,
    parameters: HardwareParameters | None,
) -> OpenTransport:
    def opened(listener: HardwareListener) -> Transport:
        # Opening the transport would reset the hardware of another system.
        check_digest(registers, description.digest, description.name)
        transport = open_transport(listener)
        _restore(parameters, registers, transport)
        return transport

    return opened


def _restore(parameters: HardwareParameters | None, status: Transport, transport: Transport) -> None:
    """Set parameters through the transport of the status; on failure, close the other one."""
    try:
        if parameters:
            parameters.restore(partial(access, status))
    except BaseException:
        transport.close()
        raise


def _checked_by_frames(
    open_transport: OpenTransport, description: NodeDescription, parameters: HardwareParameters | None
) -> OpenTransport:
    def opened(listener: HardwareListener) -> Transport:
        late = _LateListener(listener)
        transport = open_transport(late)
        try:
            check_digest(transport, description.digest, description.name)
        except BaseException:
            transport.close()
            raise
        _restore(parameters, transport, transport)
        late.listens = True
        return transport

    return opened


class _LateListener:
    """A listener that ignores the frames that read the digest."""

    def __init__(self, listener: HardwareListener) -> None:
        self._listener = listener
        self.listens = False

    def taken(self, first_cycle: int, last_cycle: int) -> None:
        if self.listens:
            self._listener.taken(first_cycle, last_cycle)

    def refused(self, converter: int | None, code: int = 0) -> None:
        if self.listens:
            self._listener.refused(converter, code)

    def wants_waits(self) -> bool:
        return self.listens and self._listener.wants_waits()

    def waited(self, first: int, cycle: int, counts: Sequence[int]) -> None:
        self._listener.waited(first, cycle, counts)


def _tell(listener: HardwareListener, event: Event) -> None:
    if isinstance(event, Taken):
        listener.taken(event.first_cycle, event.last_cycle)
    elif isinstance(event, ErrorPulse):
        listener.refused(event.converter, event.code)
    elif isinstance(event, Waits):
        listener.waited(event.first, event.cycle, event.counts)
