"""The top level's host side as plain data: streams as ports, or the link or node that the streams connect to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.derived.model import DerivedSystem, Link, LinkKind, NetworkKind, Phy

# A link's pins at the top level, with the link core's names; a board may omit pins with a default.
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

# The pins of a TCP/IP chip, at the top level and at the node.
CHIP_PINS = (
    ("spi_sck", "out", "std_logic"),
    ("spi_cs_n", "out", "std_logic"),
    ("spi_mosi", "out", "std_logic"),
    ("spi_miso", "in", "std_logic"),
    ("spi_rst_n", "out", "std_logic"),
)
# The PHY pins of an Ethernet node, at the top level and at the core firm_<phy>, with their widths.
PHY_PINS: Mapping[Phy, tuple[tuple[str, str, int | None], ...]] = {
    Phy.GMII: (
        ("gmii_rx_clk", "in", None),
        ("gmii_rx_dv", "in", None),
        ("gmii_rx_er", "in", None),
        ("gmii_rxd", "in", 8),
        ("gmii_tx_en", "out", None),
        ("gmii_tx_er", "out", None),
        ("gmii_txd", "out", 8),
    ),
    Phy.MII: (
        ("mii_rx_clk", "in", None),
        ("mii_rx_dv", "in", None),
        ("mii_rx_er", "in", None),
        ("mii_rxd", "in", 4),
        ("mii_tx_clk", "in", None),
        ("mii_tx_en", "out", None),
        ("mii_tx_er", "out", None),
        ("mii_txd", "out", 4),
    ),
    Phy.RGMII: (
        ("rgmii_rx_clk", "in", None),
        ("rgmii_rx_ctl", "in", None),
        ("rgmii_rxd", "in", 4),
        ("rgmii_tx_clk", "out", None),
        ("rgmii_tx_ctl", "out", None),
        ("rgmii_txd", "out", 4),
    ),
    Phy.RMII: (
        ("rmii_crs_dv", "in", None),
        ("rmii_rxd", "in", 2),
        ("rmii_tx_en", "out", None),
        ("rmii_txd", "out", 2),
    ),
}
HOST_PINS: tuple[Sequence[tuple[str, str, object]], ...] = (*LINK_PINS.values(), CHIP_PINS, *PHY_PINS.values())
"""The pins of every link, chip and PHY at the top level."""
# For each PHY, the bits per edge of the line clock, and the clocks that the PHY provides, in MHz.
_LINE_BITS = {Phy.GMII: 8, Phy.MII: 4, Phy.RGMII: 4, Phy.RMII: 2}
PHY_CLOCKS: Mapping[Phy, Mapping[str, int]] = {
    Phy.GMII: {"gmii_rx_clk": 125},
    Phy.MII: {"mii_rx_clk": 25, "mii_tx_clk": 25},
    Phy.RGMII: {"rgmii_rx_clk": 125},
    Phy.RMII: {},
}
# The firm_sim_phy signal for each pin, by the pin's name without the PHY prefix; other pins report errors or are open.
_SIMULATED = {
    **dict.fromkeys(("rx_dv", "crs_dv", "rx_ctl"), "rx_dv"),
    **dict.fromkeys(("tx_en", "tx_ctl"), "tx_en"),
    **{name: name for name in ("rxd", "txd")},
}
# The bits of network_error of firm_net_link, lowest first, by counter name.
NETWORK_FAULTS = {
    "broken_frames": "a frame on the line is broken or too long",
    "broken_datagrams": "a datagram for the board is broken",
    "dropped_fragments": "a fragment or an incomplete packet is dropped",
    "lost_packets": "a reply to ARP or ping, a packet of discovery or a frame beside a reassembled packet has no room",
    "refused_nodes": "another node has no room",
    "refused_endpoints": "a publisher or subscriber of another node, of a topic of the board, has no room",
    "lost_messages": "a message of another node has no room, or comes in fragments of RTPS and is too long"
    " or the node takes none",
    "refused_messages": "a message to send is empty, too long or of no publisher, or the board has no address yet",
    "taken_addresses": "another host has the address of the board",
    "broken_packets": "a packet of RTPS, or a list of parameters in it, is broken",
    "other_endpoints": "a publisher or subscriber of a topic of the board has another type, hash, quality, partition"
    " or encoding",
}
ADDRESS_FAULT = 8
"""The bit of network_error that reports an address conflict."""
CHIP_NUMBERS = {NetworkKind.W5500: 5500, NetworkKind.W5200: 5200}

# The default baud rate of firm_uart_link, which a netlist keeps.
_BAUD = 1_000_000


def interconnect_configuration(system: DerivedSystem) -> dict[str, Any]:
    """Return the configuration of the host side: streams as ports, a link or a node."""
    found: dict[str, Any] = {"has_streams": False, "link": None, "node": None, "ethernet": None, "host_end": "node"}
    ids = "ids count from 0 in each direction."
    if system.network and system.network.kind is NetworkKind.ETHERNET:
        found |= {"ethernet": _ethernet(system, system.network.phy)}
        found |= {"host_note": "The system is a node of ROS 2 by Ethernet."}
    elif system.network:
        found |= {"node": (node := _node(system))}
        found |= {"host_note": f"The system is a node of ROS 1 in the sockets of a W{node['chip']}."}
    elif system.link:
        found |= {"link": (link := _link(system.link)), "host_end": "link"}
        found |= {"host_note": f"The host sends and receives frames through {link['entity']}; {ids}"}
    else:
        found |= {"has_streams": True, "host_end": ""}
        found |= {"host_note": f"The host sends frames on s_axis and receives frames on m_axis; {ids}"}
    return found


def _link(link: Link) -> dict[str, Any]:
    """Return a link, with its core and the core of the simulated host."""
    return {
        "entity": f"firm_{link.kind.value}_link",
        "longest": link.longest,
        "adapter": f"firm_sim_{link.kind.value}",
        "uart": _uart(link) if link.kind is LinkKind.UART else None,
        "pins": _pins(LINK_PINS[link.kind]),
    }


def rom_entity(system: DerivedSystem) -> str:
    """Return the name of the ROM of a node with a TCP/IP chip."""
    return f"{system.entity}_rom"


def node_entity(system: DerivedSystem) -> str:
    """Return the name of the entity of a system's Ethernet node."""
    return f"{system.entity}_node"


def phy_pins(phy: Phy) -> list[tuple[str, str, str]]:
    """Return the pins of a PHY as ports of the top level."""
    return [(name, direction, vhdl_type(bits)) for name, direction, bits in PHY_PINS[phy]]


def _ethernet(system: DerivedSystem, phy: Phy) -> dict[str, Any]:
    """Return an Ethernet node, with the core for its PHY's pins."""
    return {
        "entity": node_entity(system),
        "name": phy.value.upper(),
        "phy": f"firm_{phy.value}",
        # An RMII does not report errors to the PHY.
        "sends_errors": phy is not Phy.RMII,
        "tx_error": "open" if phy is Phy.RMII else "line_tx_er",
        "pins": [{**pin, **_in_simulation(phy, pin)} for pin in _pins(phy_pins(phy))],
        "line_bits": _LINE_BITS[phy],
        "is_ddr": phy is Phy.RGMII,
        "faults": [{"bit": bit, "meaning": meaning} for bit, meaning in enumerate(NETWORK_FAULTS.values())],
        "fault_count": len(NETWORK_FAULTS),
    }


def _in_simulation(phy: Phy, pin: Mapping[str, str]) -> dict[str, Any]:
    """Return the connection of a pin to the PHY of a simulated board, whose line has the system's clock."""
    name, is_input = pin["name"], pin["direction"] == "in"
    signal = "clk" if name in PHY_CLOCKS[phy] else _SIMULATED.get(name.partition("_")[2], "")
    return {"signal": signal, "is_low": not signal and is_input, "is_open": not (signal or is_input)}


def _node(system: DerivedSystem) -> dict[str, Any]:
    """Return a node with a TCP/IP chip."""
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
    """Return the clock's frequency, and the cycles per bit with the rounding of firm_uart_link."""
    return {"clock_hz": link.clock_hz, "bit_cycles": (link.clock_hz + _BAUD // 2) // _BAUD}
