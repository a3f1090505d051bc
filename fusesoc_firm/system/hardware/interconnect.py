"""The top level's host side as plain data: streams as ports, or the link or node that the streams connect to."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fusesoc_firm.system.derived.model import DerivedSystem, Link, LinkKind, NetworkKind

# A link's pins at the top level, with their names in the link's core; a board may omit pins that have a default.
LINK_PINS = {
    LinkKind.UART: (
        ("uart_rxd", "in", "std_logic"),
        ("uart_txd", "out", "std_logic"),
        ("uart_rts_n", "out", "std_logic"),
        ("uart_cts_n", "in", "std_logic := '0'"),
    ),
    LinkKind.SPI: (
        ("spi_sclk", "in", "std_logic"),
        ("spi_cs_n", "in", "std_logic"),
        ("spi_mosi", "in", "std_logic"),
        ("spi_miso", "out", "std_logic"),
        ("spi_irq", "out", "std_logic"),
    ),
}

# The chip's pins of a node in its sockets, at the top level and at the node.
CHIP_PINS = (
    ("spi_sck", "out", "std_logic"),
    ("spi_cs_n", "out", "std_logic"),
    ("spi_mosi", "out", "std_logic"),
    ("spi_miso", "in", "std_logic"),
    ("spi_rst_n", "out", "std_logic"),
)
CHIP_NUMBERS = {NetworkKind.W5500: 5500, NetworkKind.W5200: 5200}

# The default baud rate of firm_uart_link, which a netlist keeps.
_BAUD = 1_000_000


def interconnect_configuration(system: DerivedSystem) -> dict[str, Any]:
    """Return the streams as ports of the top level, or the link or node that they connect to."""
    if system.network:
        return {"has_streams": False, "link": None, "node": _node(system)}
    if system.link is None:
        return {"has_streams": True, "link": None, "node": None}
    return {
        "has_streams": False,
        "node": None,
        "link": {
            "entity": f"firm_{system.link.kind.value}_link",
            "longest": system.link.longest,
            "adapter": f"firm_sim_{system.link.kind.value}",
            "uart": _uart(system.link) if system.link.kind is LinkKind.UART else None,
            "pins": _pins(LINK_PINS[system.link.kind]),
        },
    }


def rom_entity(system: DerivedSystem) -> str:
    """Return the name of the ROM of a node in a chip's sockets."""
    return f"{system.entity}_rom"


def _node(system: DerivedSystem) -> dict[str, Any]:
    """Return a node in a chip's sockets."""
    assert system.network is not None
    assert system.clock is not None
    return {
        "chip": CHIP_NUMBERS[system.network.kind],
        "clock_hz": round(system.clock),
        "rom": rom_entity(system),
        "pins": _pins(CHIP_PINS),
    }


def _pins(pins: Iterable[tuple[str, str, str]]) -> list[dict[str, str]]:
    return [{"name": name, "direction": direction, "type": type_} for name, direction, type_ in pins]


def _uart(link: Link) -> dict[str, Any]:
    """Return the clock's frequency, and the cycles of a bit, as firm_uart_link rounds them."""
    return {"clock_hz": link.clock_hz, "bit_cycles": (link.clock_hz + _BAUD // 2) // _BAUD}
