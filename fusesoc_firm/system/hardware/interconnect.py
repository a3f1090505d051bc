"""The top level's host side as plain data: streams as ports, or the link that the streams connect to."""

from __future__ import annotations

from typing import Any

from fusesoc_firm.system.derived.model import DerivedSystem, Link, LinkKind

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


# The default baud rate of firm_uart_link, which a netlist keeps.
_BAUD = 1_000_000


def interconnect_configuration(system: DerivedSystem) -> dict[str, Any]:
    """Return the streams as ports of the top level, or the link that they connect to."""
    if system.link is None:
        return {"has_streams": True, "link": None}
    return {
        "has_streams": False,
        "link": {
            "entity": f"firm_{system.link.kind.value}_link",
            "longest": system.link.longest,
            "adapter": f"firm_sim_{system.link.kind.value}",
            "uart": _uart(system.link) if system.link.kind is LinkKind.UART else None,
            "pins": [
                {"name": name, "direction": direction, "type": type_}
                for name, direction, type_ in LINK_PINS[system.link.kind]
            ],
        },
    }


def _uart(link: Link) -> dict[str, Any]:
    """Return the clock's frequency, and the cycles of a bit, as firm_uart_link rounds them."""
    return {"clock_hz": link.clock_hz, "bit_cycles": (link.clock_hz + _BAUD // 2) // _BAUD}
