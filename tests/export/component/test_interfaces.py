"""Bus interfaces from the names, directions and widths of ports."""

from __future__ import annotations

import pytest

from fusesoc_firm.export.component.interfaces import infer
from fusesoc_firm.export.component.model import Bus, BusInterface, Direction, Port

IN, OUT, INOUT = Direction.IN, Direction.OUT, Direction.INOUT


def stream(name: str = "s_axis", *, source: Direction = IN, sink: Direction = OUT, bits: int = 16) -> list[Port]:
    return [
        Port(f"{name}_tdata", source, (bits - 1, 0)),
        Port(f"{name}_tkeep", source, (1, 0)),
        Port(f"{name}_tvalid", source),
        Port(f"{name}_tready", sink),
    ]


def lite(name: str = "s_axi", *, first: Direction = IN, second: Direction = OUT) -> list[Port]:
    forward = [
        ("awaddr", 8),
        ("awvalid", 0),
        ("wdata", 32),
        ("wvalid", 0),
        ("bready", 0),
        ("araddr", 8),
        ("arvalid", 0),
    ]
    backward = [("awready", 0), ("wready", 0), ("bvalid", 0), ("arready", 0), ("rdata", 32), ("rvalid", 0)]
    sides = ((first, [*forward, ("rready", 0)]), (second, backward))
    return [
        Port(f"{name}_{word}", side, (bits - 1, 0) if bits else None) for side, words in sides for word, bits in words
    ]


def by_name(ports: list[Port], **frequencies: int) -> dict[str, BusInterface]:
    return {item.name: item for item in infer(ports, (), frequencies)}


def test_a_stream_has_the_side_of_its_tvalid() -> None:
    found = by_name([*stream("s_axis"), *stream("m_axis", source=OUT, sink=IN)])
    assert {name: (item.bus, item.is_initiator) for name, item in found.items()} == {
        "s_axis": (Bus.AXI_STREAM, False),
        "m_axis": (Bus.AXI_STREAM, True),
    }
    assert found["s_axis"].ports["TDATA"] == "s_axis_tdata"
    assert found["s_axis"].parameters == {
        "TDATA_NUM_BYTES": 2,
        "TID_WIDTH": 0,
        "TDEST_WIDTH": 0,
        "TUSER_WIDTH": 0,
        "HAS_TREADY": 1,
        "HAS_TSTRB": 0,
        "HAS_TKEEP": 1,
        "HAS_TLAST": 0,
    }


@pytest.mark.parametrize(
    "ports",
    [
        stream(sink=IN),
        stream(source=INOUT),
        stream(bits=12),
        stream()[1:],
        [Port("tdata", IN, (7, 0)), Port("tvalid", IN)],
        lite(second=IN),
        lite()[1:2],
    ],
)
def test_ports_that_do_not_fit_are_no_bus(ports: list[Port]) -> None:
    assert not infer(ports)


def test_a_memory_mapped_bus_has_addresses() -> None:
    found = by_name([*lite(), *lite("m_axi", first=OUT, second=IN), Port("m_axi_awlen", OUT, (7, 0))])
    slave, master = found["s_axi"], found["m_axi"]
    assert (slave.parameters, slave.is_initiator) == (
        {"PROTOCOL": "AXI4LITE", "DATA_WIDTH": 32, "ADDR_WIDTH": 8},
        False,
    )
    assert (master.parameters["PROTOCOL"], master.is_initiator) == ("AXI4", True)
    # The least size that Vivado assigns.
    assert slave.addresses
    assert (slave.addresses.size, slave.addresses.width) == (4096, 32)


def test_each_bus_belongs_to_its_own_clock_or_to_the_common_one() -> None:
    ports = [Port(name, IN) for name in ("clk", "rst_n", "clk_slow", "m_axis_aclk", "m_axis_aresetn", "clk_en")]
    found = by_name([*ports, *stream("s_axis"), *stream("m_axis", source=OUT, sink=IN)], clk_slow=10_000_000)
    clocks = {name: item.parameters for name, item in found.items() if item.bus is Bus.CLOCK}
    assert clocks == {
        "clk": {"ASSOCIATED_BUSIF": "s_axis", "ASSOCIATED_RESET": "rst_n"},
        "clk_slow": {"FREQ_HZ": 10_000_000},
        "m_axis_aclk": {"ASSOCIATED_BUSIF": "m_axis", "ASSOCIATED_RESET": "m_axis_aresetn"},
    }


@pytest.mark.parametrize(
    ("name", "polarity"),
    [
        ("rst_n", "ACTIVE_LOW"),
        ("aresetn", "ACTIVE_LOW"),
        ("s_axi_aresetn", "ACTIVE_LOW"),
        ("rst", "ACTIVE_HIGH"),
        ("reset", "ACTIVE_HIGH"),
    ],
)
def test_resets_have_a_polarity(name: str, polarity: str) -> None:
    (reset,) = infer([Port(name, IN)])
    assert (reset.bus, reset.parameters) == (Bus.RESET, {"POLARITY": polarity})


def test_interrupts_are_outputs_of_one_bit() -> None:
    names = ["irq", "status_interrupt", "interrupted"]
    found = infer([*(Port(name, OUT) for name in names), Port("in_irq", IN), Port("x_irq", OUT, (1, 0))])
    assert [(item.name, item.bus, item.is_initiator) for item in found] == [
        ("irq", Bus.INTERRUPT, True),
        ("status_interrupt", Bus.INTERRUPT, True),
    ]
