"""LUTs and flip-flops of the links between a host and a system, and of the crossings between two clocks."""

from __future__ import annotations

from collections.abc import Iterator

from tests.hdl.ghdl import Generic
from tools.bench.area import WIDTHS, Row, of_core, tables_of
from tools.bench.tables import Table, Tell
from tools.bench.yosys import Yosys

LINKS_TITLE, CROSSINGS_TITLE = "Links between a host and a system", "Crossings between two clocks"

_CORES = ("axis/package", "axis/axis", "cdc/sync", "board/link", "cdc/cdc")
# Bits of all fields, segments and streams of sensor_msgs/Image in ROS 2.
_IMAGE: dict[str, Generic] = {"FIELD_BITS": 296, "SEGMENTS": 3, "PARTS": 3}
_CROSSINGS: dict[str, tuple[str, dict[str, Generic]]] = {
    "a message of fixed size": ("firm_cdc_message", {"FIELD_BITS": 1}),
    "sensor_msgs/Image of ROS 2, without its streams": ("firm_cdc_message", _IMAGE),
    **{
        f"a stream, {source} bits to {sink}": ("firm_cdc_stream", {"S_WIDTH": source, "M_WIDTH": sink})
        for source, sink in ((8, 8), (64, 64), (512, 512), (8, 64), (64, 8))
    },
}
_NOTES = {
    LINKS_TITLE: """The buffers have their default sizes and are in block RAM; all counts are connected.
        The clock is 100 MHz, and the UART runs at 1 Mbaud.""",
    CROSSINGS_TITLE: """The crossing of a message of fixed size has no registers for fields, since the fields are
        stable until the message is accepted.""",
}


def rows() -> dict[str, list[Row]]:
    """All rows, by the title of their table."""
    return {LINKS_TITLE: [*_links()], CROSSINGS_TITLE: [*_crossings()]}


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {title: [row.key for row in found] for title, found in rows().items()}


def measure(yosys: Yosys, tell: Tell) -> list[Table]:
    """Synthesise all; `tell` hears of each."""
    return tables_of(rows(), _NOTES, yosys, tell)


def _links() -> Iterator[Row]:
    for entity in ("firm_uart_link", "firm_spi_link"):
        for width in WIDTHS:
            yield Row(entity, "", width, of_core(entity, {"WIDTH": width}, _CORES))


def _crossings() -> Iterator[Row]:
    for label, (entity, generics) in _CROSSINGS.items():
        yield Row(label, "", None, of_core(entity, generics, _CORES))
