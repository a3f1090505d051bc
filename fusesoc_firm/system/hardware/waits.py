"""The wires between the blocks of a system, and the handshakes that reveal a waiting message.

A live simulation counts the waiting cycles (docs/reference/transports.md). In VHDL, a variant of the top level has an
output for each wire; in Verilog, the test bench reads the top level's signals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fusesoc_firm.converter.vhdl import bit
from fusesoc_firm.system.derived.model import Connection, DerivedSystem
from fusesoc_firm.system.derived.sides import handshakes
from fusesoc_firm.system.hardware.names import Names, forked
from fusesoc_firm.text.render import Context

HOST, FROM_HOST, TO_HOST = "the host", "from the host", "to the host"
"""The ends of wires that are not blocks: the host, and the two sides of the Manager."""

Wire = tuple[str, str]
"""The source and the sink of a wire: blocks, or ends that are not blocks."""
HOST_WIRES: tuple[Wire, ...] = ((HOST, FROM_HOST), (TO_HOST, HOST))
"""The wires whose waits the simulated host counts; they precede the wires within the system."""


@dataclass(frozen=True)
class Level:
    """A signal of one bit, or the bit `place` of a signal with `width` bits."""

    signal: str
    place: int = 0
    width: int | None = None

    @property
    def vhdl(self) -> str:
        """The level in VHDL."""
        return self.signal if self.width is None else bit(self.signal, self.place)

    @property
    def verilog(self) -> str:
        """The level in GHDL's netlist, which has lower-case names and one-bit vectors without an index."""
        name = self.signal.lower()
        return name if self.width in (None, 1) else f"{name}[{self.place}]"


Offer = tuple[Level, Level]
"""The levels `valid` and `ready` of a handshake."""


def wires(system: DerivedSystem) -> list[Wire]:
    """Return all wires in the order in which a live simulation counts."""
    return [*HOST_WIRES, *_offers(system)]


def watched_entity(system: DerivedSystem) -> str:
    """Return the name of the top level with an additional output for each wire."""
    return f"{system.entity}_watched"


def waits_configuration(system: DerivedSystem) -> Context:
    """Return the wires within the system, each with the levels of its handshakes in both languages."""
    found = _offers(system)
    return {
        "count": len(found),
        "wires": [
            {
                "bit": number,
                "source": source,
                "sink": sink,
                "handshakes": [
                    {
                        "valid": valid.vhdl,
                        "ready": ready.vhdl,
                        "verilog_valid": valid.verilog,
                        "verilog_ready": ready.verilog,
                    }
                    for valid, ready in offers
                ],
            }
            for number, ((source, sink), offers) in enumerate(found.items())
        ],
    }


def _offers(system: DerivedSystem) -> dict[Wire, list[Offer]]:
    """Return the handshakes of each wire within the system, in the order of the data flow."""
    names = Names(system)
    found: dict[Wire, list[Offer]] = {}
    for number, item in enumerate(system.subscribers):
        found[FROM_HOST, item.block] = [_of_manager("sub", number, len(system.subscribers))]
    for connection in system.connections:
        for number, sink in enumerate(connection.sinks):
            found.setdefault((connection.source.block, sink.block), []).extend(_of(names, connection, number))
    for item in system.publishers:
        found[item.block, TO_HOST] = [_of_manager("pub", system.places[item.id], len(system.publishers))]
    return found


def _of_manager(side: str, place: int, count: int) -> Offer:
    return Level(f"{side}_axis_tvalid", place, count), Level(f"{side}_axis_tready", place, count)


def _of(names: Names, connection: Connection, number: int) -> Iterator[Offer]:
    """Yield the handshakes of a connection with a sink, as its source sees them."""
    source, count = connection.source, len(connection.sinks)
    forks = [*forked(connection)]
    for fork in forks:
        valid, ready = (Level(names.forked(source, fork, word), number, count) for word in ("valid", "ready"))
        yield valid, ready
    if not forks and connection.frame.is_fixed_size:
        yield Level(names.at(source, "segment_valid"), 0, 1), Level(names.at(source, "msg_ready"))
    elif not forks:
        for item in handshakes(connection.frame):
            yield Level(names.at(source, item.valid)), Level(names.at(source, item.ready))
