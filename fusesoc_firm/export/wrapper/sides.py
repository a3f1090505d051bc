"""The sides of a module around a component: streams, buses, clocks and signals, as data of the templates."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from fusesoc_firm.export.component.model import Bus, BusInterface, Component, Direction, Port
from fusesoc_firm.export.wrapper.framework import Domain, Framework
from fusesoc_firm.text.render import Context

# The names of a component's only streams in both frameworks.
_STREAMS = {"s_axis": "sink", "m_axis": "source"}
_FIELDS = ("data", "keep", "last", "id", "dest", "user")
_HANDSHAKE = ("valid", "ready")
_LITE = "AXI4LITE"


def capitalised(name: str) -> str:
    """Return the name of a class for a name with underscores."""
    return "".join(word[0].upper() + word[1:] for word in name.split("_") if word)


def distinct(names: Iterable[str], reserved: Iterable[str] = ()) -> Iterator[str]:
    """Yield the names with a `_` at the end as long as another one, `reserved` or Python has the name."""
    taken = {*reserved, *keyword.kwlist}
    for name in names:
        chosen = name
        while chosen in taken:
            chosen += "_"
        taken.add(chosen)
        yield chosen


@dataclass(frozen=True)
class Sides:
    """A component in a framework, with an attribute of the module for each bus and each other port."""

    component: Component
    framework: Framework
    attributes: Mapping[str, str]

    def context(self) -> Context:
        """Return the data of the templates."""
        streams = [*map(self._stream, self._buses(Bus.AXI_STREAM))]
        buses = [*map(self._bus, self._buses(Bus.AXI))]
        wired = self._wired()
        signals = [self._signal(port) for port in self.component.ports if port.name not in wired]
        return {
            "streams": streams,
            "buses": buses,
            "signals": signals,
            "domains": [{"argument": item.argument, "name": item.name} for item in self._domains()],
            "connections": [self._connection(port, wired) for port in self.component.ports],
        }

    def _buses(self, bus: Bus) -> list[BusInterface]:
        """Return the streams, or the targets of AXI4-Lite."""
        found = [item for item in self.component.interfaces if item.bus is bus]
        lite = [item for item in found if item.parameters.get("PROTOCOL") == _LITE and not item.is_initiator]
        return lite if bus is Bus.AXI else found

    def _domains(self) -> list[Domain]:
        clocks = [item.name for item in self.component.interfaces if item.bus is Bus.CLOCK]
        others = [port.removeprefix("clk_") for port in clocks[1:]]
        names = distinct([self.framework.first_domain, *others])
        arguments = distinct(["clock_domain", *(f"{name}_domain" for name in others)])
        return [Domain(*item) for item in zip(clocks, names, arguments, strict=False)]

    def _domain_of(self, kind: str, name: str) -> Domain | None:
        """Return the domain whose clock has this bus or reset, or the first one."""
        clocks = {item.name: item.parameters for item in self.component.interfaces if item.bus is Bus.CLOCK}
        domains = self._domains()
        own = (item for item in domains if name in str(clocks[item.port].get(kind, "")).split(":"))
        return next(own, domains[0] if domains else None)

    def _wired(self) -> dict[str, str]:
        """Return the expressions of the ports that are not signals on their own."""
        found = {item.port: f"ClockSignal({self.framework.domain(item)})" for item in self._domains()}
        for reset in (item for item in self.component.interfaces if item.bus is Bus.RESET):
            if domain := self._domain_of("ASSOCIATED_RESET", reset.name):
                inverted = "~" * (reset.parameters["POLARITY"] == "ACTIVE_LOW")
                found[reset.name] = f"{inverted}ResetSignal({self.framework.domain(domain)})"
        for stream in self._buses(Bus.AXI_STREAM):
            for word, port in _fields(stream):
                found[port] = self.framework.beat(self.attributes[stream.name], word)
            if not stream.is_initiator and (keep := stream.ports.get("TKEEP")):
                found[keep] = self.framework.keep(found[keep], self._width(stream, "TKEEP"))
        for bus in self._buses(Bus.AXI):
            for word, port in bus.ports.items():
                found[port] = self.framework.channel(self.attributes[bus.name], word.lower(), self._width(bus, word))
        return found

    def _width(self, bus: BusInterface, word: str) -> int:
        return next((port.width for port in self.component.ports if port.name == bus.ports.get(word)), 0)

    def _stream(self, stream: BusInterface) -> Context:
        attribute = self.attributes[stream.name]
        domain = self._domain_of("ASSOCIATED_BUSIF", stream.name)
        widths = {word: self._width(stream, f"T{word.upper()}") for word in _FIELDS}
        lanes = widths["data"] // 8
        return {
            "name": stream.name,
            "attribute": attribute,
            "beat": f"{capitalised(attribute)}Beat",
            "is_source": stream.is_initiator,
            "domain": domain.argument if domain else "",
            "width": widths["data"],
            "lanes": lanes,
            "all_bytes": f"0x{2**lanes - 1:X}",
            "has_ready": "TREADY" in stream.ports,
            "has_keep": bool(widths["keep"]),
            "lacks_keep": stream.is_initiator and not widths["keep"],
            "others": _fields_of(widths, "last", "id", "dest", "user"),
            "sidebands": _fields_of(widths, "id", "dest", "user"),
        }

    def _bus(self, bus: BusInterface) -> Context:
        attribute = self.attributes[bus.name]
        domain = self._domain_of("ASSOCIATED_BUSIF", bus.name)
        directions = {port.name: port.direction for port in self.component.ports}
        assert bus.addresses
        return {
            "name": bus.name,
            "attribute": attribute,
            "constant": attribute.upper(),
            "domain": domain.argument if domain else "",
            "width": bus.addresses.width,
            "size": f"0x{bus.addresses.size:X}",
            "fields": [
                {
                    "word": word.lower(),
                    "flow": "Out" if directions[port] is Direction.IN else "In",
                    "width": self._width(bus, word),
                }
                for word, port in bus.ports.items()
            ],
        }

    def _signal(self, port: Port) -> Context:
        return {
            "attribute": self.attributes[port.name],
            "width": port.width,
            "flow": "In" if port.direction is Direction.IN else "Out",
            "default": str(port.default or ""),
        }

    def _connection(self, port: Port, wired: Mapping[str, str]) -> Context:
        side = "i" if port.direction is Direction.IN else "o"
        expression = wired.get(port.name) or f"self.{self.attributes[port.name]}"
        return {"argument": f"{side}_{port.name}", "expression": expression}


def sides(component: Component, framework: Framework) -> Sides:
    """Return the sides of a component's module, with distinct names that the framework does not use."""
    buses = [item.name for item in component.interfaces if item.bus in (Bus.AXI_STREAM, Bus.AXI)]
    ports = [port.name for port in component.ports]
    # A bus and a port have different names: those of the bus' ports have a suffix.
    wanted = {name: _STREAMS.get(name, name) for name in buses} | {name: name for name in ports if name not in buses}
    return Sides(component, framework, dict(zip(wanted, distinct(wanted.values(), framework.reserved), strict=True)))


def _fields_of(widths: Mapping[str, int], *words: str) -> list[Context]:
    return [{"word": word, "width": widths[word]} for word in words if widths[word]]


def _fields(stream: BusInterface) -> Iterator[tuple[str, str]]:
    for word in (*_HANDSHAKE, *_FIELDS):
        if port := stream.ports.get(f"T{word.upper()}"):
            yield word, port
