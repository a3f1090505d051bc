"""Size and clock of a node of ROS 2 by Ethernet, placed and routed on an ECP5-25, and of whole systems on boards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tests.bench import bitstreams, timing
from tests.bench.nextpnr import SEEDS, Nextpnr
from tests.bench.tables import Table, Tell
from tests.bench.timing import Design, Row
from tests.cores.test_net_link import NODE
from tests.hdl.ghdl import Generic, Library, core_files

TITLE = "A node of ROS 2 by Ethernet, MHz"
DEVICE = "--25k --speed 8 --package CABGA381"
# The clock of a GMII, in MHz.
_BAR = 125.0
_CORES = (*NODE, "cdc/sync", "cdc/cdc")
# Payloads of up to 3,840 bytes from others, and of 4,096 to others, as fusesoc_firm.system.derived.ethernet sizes them.
_LONG: Mapping[str, Generic] = {
    "SAMPLE": 4096,
    "ASSEMBLED": 4096,
    "PAYLOADS": 8192,
    "DISCOVERY": 8192,
    "REASSEMBLIES": 1,
    "REASSEMBLED": 4096,
}
_TOPICS: Mapping[str, Generic] = {"WRITERS": 3, "READERS": 2, "SOURCES": 16, "SINKS": 24, "SAMPLE": 64}
_NOTE = """The node consists of the MAC, ARP and ping, IGMP and the probes for its address, UDP, RTPS and the packet
    builder. It has two topics each way, with up to 64 bytes, and room for eight peers with all of them. It is measured
    without the memories of its program, packets and names. Block RAMs and distributed memories are not counted. Long
    messages have up to 4,096 bytes, and come and leave in fragments."""


def rows() -> list[Row]:
    """All rows: the node with MAC, ARP, ICMP, IGMP and UDP, with what it may have as well, and two parts of it."""
    node: Mapping[str, Generic] = {"WIDTH": 8, **_TOPICS}
    return [
        Row("the node", 8, _entity("firm_net_link", node), _BAR),
        Row("the node with DHCP", 8, _entity("firm_net_link", {**node, "HAS_DHCP": True})),
        Row("the node with long messages", 8, _entity("firm_net_link", {**node, **_LONG})),
        Row("RTPS in it", 8, _entity("firm_rtps_node", _TOPICS)),
        Row("the packet builder in it", 8, _entity("firm_packet_builder", {})),
    ]


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [row.key for row in rows()], **bitstreams.keys()}


def measure(
    nextpnr: Nextpnr, tell: Tell, written: str = "", pattern: str = "", seeds: Sequence[int] = SEEDS
) -> list[Table]:
    """Place the rows whose names match the regular expression `pattern`; `tell` hears of each."""
    return [
        *timing.measured_tables({TITLE: rows()}, {TITLE: _NOTE}, nextpnr, tell, written, pattern, seeds),
        bitstreams.measure(tell, written, pattern),
    ]


def _entity(entity: str, generics: Mapping[str, Generic]) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        library = Library("firm", folder)
        library.analyse(core_files(*_CORES))
        return Design(library.synthesise(entity, generics, "verilog"), entity)

    return make
