"""Size and clock of a node of ROS 2 by Ethernet, placed and routed on an ECP5."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from tests.cores.test_net_link import NODE
from tests.hdl.ghdl import Generic, Library, core_files
from tools.bench import timing
from tools.bench.nextpnr import SEEDS, Nextpnr
from tools.bench.tables import FAILED, NOT_MEASURED, Table, Tell, known_rows
from tools.bench.timing import Design, Row

TITLE = "A node of ROS 2 by Ethernet, MHz"
LONGEST_TITLE = "A node of ROS 2 by Ethernet with messages of 64 kB, MHz"
DEVICE = "--25k --speed 8 --package CABGA381"
_LARGE_DEVICE = "--85k --speed 8 --package CABGA756"
# The clock of a GMII, in MHz.
_BAR = 125.0
_CORES = (*NODE, "cdc/sync", "cdc/cdc")
# As fusesoc_firm.system.derived.ethernet sizes the memories: payloads of up to 3,840 bytes from others, and of 4,096 to
# others.
_LONG: Mapping[str, Generic] = {
    "SAMPLE": 4096,
    "ASSEMBLED": 4096,
    "DISCOVERY": 4096,
    "REASSEMBLIES": 1,
    "REASSEMBLED": 4096,
}
# The same for 65,280 bytes both ways, of one topic each, whose publisher has a depth of 1.
LONGEST: Mapping[str, Generic] = {
    "WRITERS": 2,
    "READERS": 1,
    "SOURCES": 8,
    "SINKS": 16,
    "SAMPLE": 65536,
    "SLOTS": 2,
    "ASSEMBLED": 65536,
    "DISCOVERY": 16384,
    "REASSEMBLIES": 1,
    "REASSEMBLED": 65536,
}
_TOPICS: Mapping[str, Generic] = {"WRITERS": 3, "READERS": 2, "SOURCES": 16, "SINKS": 24, "SAMPLE": 64}
_LONGEST_COLUMNS = ("design", "bits", "MHz", "of each seed", "LUT4", "FF", "block RAMs", "result")
_LONGEST_NOTE = f"""On an ECP5-85 (`{_LARGE_DEVICE}`), which has 208 block RAMs. The node has one topic each way,
    with up to 65,280 bytes, a `depth` of 1, and room for eight peers. It is measured without the memories of its
    program, packets and names."""
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


def longest_row() -> Row:
    """The node that takes and sends the longest messages, on a large FPGA."""
    return Row("the node with messages of 64 kB, both ways", 8, _entity("firm_net_link", {"WIDTH": 8, **LONGEST}))


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [row.key for row in rows()], LONGEST_TITLE: [longest_row().key]}


def measure(
    nextpnr: Nextpnr, tell: Tell, written: str = "", pattern: str = "", seeds: Sequence[int] = SEEDS
) -> list[Table]:
    """Place the rows whose names match the regular expression `pattern`; `tell` hears of each."""
    return [
        *timing.measured_tables({TITLE: rows()}, {TITLE: _NOTE}, nextpnr, tell, written, pattern, seeds),
        _longest(nextpnr, tell, written, pattern, seeds),
    ]


def _longest(nextpnr: Nextpnr, tell: Tell, written: str, pattern: str, seeds: Sequence[int]) -> Table:
    """Return the table of the node whose block RAMs decide."""
    row = longest_row()
    cells = known_rows(written, LONGEST_TITLE, _LONGEST_COLUMNS).get(row.key, (*row.key, *[""] * 5, NOT_MEASURED))
    if re.search(pattern, row.name):
        found = timing.placed(row, replace(nextpnr, device=_LARGE_DEVICE), seeds)
        if isinstance(found, str):
            cells = (*row.key, *[""] * 5, FAILED)
            tell(f"{row.name}: {found}")
        else:
            numbers = (str(found.cells.lut), str(found.cells.ff), str(found.cells.block))
            cells = (*row.key, f"{found.median:.1f}", timing.of_seeds(found), *numbers, "")
            tell(f"{row.name}: {timing.summary(found)}, {found.cells.block} block RAMs")
    return Table(LONGEST_TITLE, _LONGEST_COLUMNS, (cells,), _LONGEST_NOTE)


def _entity(entity: str, generics: Mapping[str, Generic]) -> Callable[[Path], Design]:
    def make(folder: Path) -> Design:
        library = Library("firm", folder)
        library.analyse(core_files(*_CORES))
        return Design(library.synthesise(entity, generics, "verilog"), entity)

    return make
