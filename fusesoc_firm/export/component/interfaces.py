"""The bus interfaces of a component, inferred from the names of its ports as Vivado's packager does.

The ports of a bus have the bus' name and a suffix, such as `s_axis_tdata`. Ports whose directions do not fit the bus
are none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from fusesoc_firm.export.component.model import AddressBlock, Bus, BusInterface, Direction, Port
from fusesoc_firm.system.hardware.registers import Register

# The logical ports of each bus; those with a minus go from the target to the initiator.
_STREAM = "tvalid -tready tdata tstrb tkeep tlast tid tdest tuser"
_WRITE = (
    "awid awaddr awlen awsize awburst awlock awcache awprot awqos awregion awuser awvalid -awready "
    "wid wdata wstrb wlast wuser wvalid -wready -bid -bresp -buser -bvalid bready"
)
_READ = (
    "arid araddr arlen arsize arburst arlock arcache arprot arqos arregion aruser arvalid -arready "
    "-rid -rdata -rresp -rlast -ruser -rvalid rready"
)
_BUSES = {Bus.AXI_STREAM: _STREAM, Bus.AXI: f"{_WRITE} {_READ}"}
# The ports without which a group of ports is not the bus; one of the sets is enough.
_NEEDED = {
    Bus.AXI_STREAM: ({"tvalid", "tdata"},),
    Bus.AXI: ({"awaddr", "awvalid", "wdata", "wvalid", "bvalid"}, {"araddr", "arvalid", "rdata", "rvalid"}),
}
_CLOCK = re.compile(r"(?:\w+_)?a?cl(?:oc)?k(?:_(?!en)\w+)?", re.IGNORECASE)
_RESET = re.compile(r"(?:\w+_)?a?(?:rst|reset)(?P<low>_?n)?", re.IGNORECASE)
_INTERRUPT = re.compile(r"(?:\w+_)?(?:irq|interrupt)", re.IGNORECASE)
# The names of the clock and the reset of all buses without own ones.
_COMMON = re.compile(r"a?(?:cl(?:oc)?k|rst|reset)_?n?", re.IGNORECASE)
# Vivado assigns addresses in pages of this size.
_PAGE = 4096
_STREAM_WIDTHS = ("tid", "tdest", "tuser")
_STREAM_OPTIONS = ("tready", "tstrb", "tkeep", "tlast")
_BYTE = 8


def infer(
    ports: Sequence[Port], registers: Sequence[Register] = (), frequencies: Mapping[str, int] | None = None
) -> list[BusInterface]:
    """Return the interfaces of the ports: buses, resets, clocks, interrupts.

    `registers` are those of the memory-mapped target; `frequencies` are those of the clocks in Hz, by port.
    """
    buses = [*_buses(ports, registers)]
    resets = [port.name for port in _scalars(ports, Direction.IN, _RESET)]
    clocks = [port.name for port in _scalars(ports, Direction.IN, _CLOCK)]
    found = [*buses]
    for name in resets:
        match = _RESET.fullmatch(name)
        polarity = "ACTIVE_LOW" if match and match["low"] else "ACTIVE_HIGH"
        found.append(BusInterface(name, Bus.RESET, False, {"RST": name}, {"POLARITY": polarity}))
    for name in clocks:
        parameters: dict[str, str | int] = {
            "ASSOCIATED_BUSIF": ":".join(bus.name for bus in buses if _source_of(bus.name, clocks) == name),
            "ASSOCIATED_RESET": _reset_of(name, clocks, resets),
            "FREQ_HZ": (frequencies or {}).get(name, 0),
        }
        known = {word: value for word, value in parameters.items() if value}
        found.append(BusInterface(name, Bus.CLOCK, False, {"CLK": name}, known))
    for port in _scalars(ports, Direction.OUT, _INTERRUPT):
        level = {"SENSITIVITY": "LEVEL_HIGH"}
        found.append(BusInterface(port.name, Bus.INTERRUPT, True, {"INTERRUPT": port.name}, level))
    return found


def _scalars(ports: Sequence[Port], direction: Direction, name: re.Pattern[str]) -> Iterator[Port]:
    return (port for port in ports if port.direction is direction and not port.bounds and name.fullmatch(port.name))


def _source_of(bus: str, names: Sequence[str]) -> str:
    """Return the clock or reset of a bus: its own one, the common one, or the only one; empty if none is known."""
    own = [name for name in names if name.lower().startswith(f"{bus.lower()}_")]
    common = [name for name in names if _COMMON.fullmatch(name)]
    return next(iter([*own, *common]), names[0] if len(names) == 1 else "")


def _reset_of(clock: str, clocks: Sequence[str], resets: Sequence[str]) -> str:
    """Return the reset with a clock's prefix; the reset without one belongs to the clock without one."""
    bus = clock.rpartition("_")[0]
    own = [name for name in resets if bus and name.lower().startswith(f"{bus.lower()}_")]
    return own[0] if own else _source_of("", resets) if _source_of("", clocks) == clock else ""


def _buses(ports: Sequence[Port], registers: Sequence[Register]) -> Iterator[BusInterface]:
    """Yield the buses in the order of their first ports."""
    groups: dict[tuple[str, Bus], dict[str, Port]] = {}
    for port in ports:
        name, _, suffix = port.name.rpartition("_")
        for bus, logical in _BUSES.items():
            if name and suffix.lower() in logical.replace("-", "").split():
                groups.setdefault((name, bus), {})[suffix.lower()] = port
    for (name, bus), group in groups.items():
        if any(needed <= group.keys() for needed in _NEEDED[bus]) and (made := _bus(name, bus, group, registers)):
            yield made


def _bus(name: str, bus: Bus, group: Mapping[str, Port], registers: Sequence[Register]) -> BusInterface | None:
    """Return the interface of these ports, or None if a direction or a width does not fit."""
    backward = {word[1:] for word in _BUSES[bus].split() if word.startswith("-")}
    sides = {(port.direction is Direction.OUT) != (word in backward) for word, port in group.items()}
    if len(sides) > 1 or any(port.direction is Direction.INOUT for port in group.values()):
        return None
    is_initiator = sides == {True}
    names = {word.upper(): port.name for word, port in group.items()}
    if bus is Bus.AXI_STREAM:
        whole = group["tdata"].width % _BYTE == 0
        return BusInterface(name, bus, is_initiator, names, _stream_parameters(group)) if whole else None
    bits = max(port.width for word, port in group.items() if word in ("awaddr", "araddr"))
    width = next(port.width for word, port in group.items() if word in ("wdata", "rdata"))
    protocol = "AXI4" if {"awlen", "arlen"} & group.keys() else "AXI4LITE"
    parameters: dict[str, str | int] = {"PROTOCOL": protocol, "DATA_WIDTH": width, "ADDR_WIDTH": bits}
    addresses = AddressBlock(max(2**bits, _PAGE), width, () if is_initiator else registers)
    return BusInterface(name, bus, is_initiator, names, parameters, addresses)


def _stream_parameters(group: Mapping[str, Port]) -> dict[str, str | int]:
    widths = {f"{word.upper()}_WIDTH": group[word].width if word in group else 0 for word in _STREAM_WIDTHS}
    options = {f"HAS_{word.upper()}": int(word in group) for word in _STREAM_OPTIONS}
    return {"TDATA_NUM_BYTES": group["tdata"].width // _BYTE, **widths, **options}
