"""Derived System -> template configuration: the top level and its test bench as plain dictionaries.

All blocks have the same few ports on their message sides: the fields, `segment_valid`, `msg_valid` and `msg_ready`.
Every block has a signal `<block>_<port>` for each port (`names`); `instances` connects blocks to these signals, and
`wires` connects the signals to each other.
"""

from __future__ import annotations

from fusesoc_firm.converter.vhdl import index_bits, vhdl_type
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.derived.sides import SidePort
from fusesoc_firm.system.hardware.exchange import exchange_instance
from fusesoc_firm.system.hardware.instances import (
    ERROR_CODE_BITS,
    accelerator_instance,
    component,
    pin_synchroniser,
    publisher_instances,
    subscriber_instances,
)
from fusesoc_firm.system.hardware.interconnect import interconnect_configuration
from fusesoc_firm.system.hardware.junctions import junction_configuration
from fusesoc_firm.system.hardware.maps import instance, port_map
from fusesoc_firm.system.hardware.names import (
    OWN_RESET,
    RELEASED,
    Names,
    blocks,
    reset_label,
    seen_reset,
    synchronised_pins,
)
from fusesoc_firm.system.hardware.parameters import parameter_blocks, parameter_signals
from fusesoc_firm.system.hardware.scheduler import scheduler_configuration
from fusesoc_firm.system.hardware.status import status_configuration
from fusesoc_firm.system.hardware.waits import waits_configuration, watched_entity
from fusesoc_firm.system.hardware.wires import connections
from fusesoc_firm.text.render import Context

# The period of the simulated host's clock, in ps.
_HOST_PERIOD = 10_000

SYSTEM_TEMPLATE = "vhdl/system.vhd"
TEST_BENCH_TEMPLATE = "vhdl/test_bench.vhd"
NODE_BENCH_TEMPLATE, PHY_BENCH_TEMPLATE = "vhdl/node_bench.vhd", "vhdl/phy_bench.vhd"


def system_configuration(system: DerivedSystem, *, is_watched: bool = False) -> Context:
    """Return the configuration of the top level; `is_watched` adds an output with the waiting wires."""
    names = Names(system)
    return {
        **dimensions(system),
        "entity": watched_entity(system) if is_watched else system.entity,
        "name": system.name,
        **interconnect_configuration(system),
        **status_configuration(names, system),
        **scheduler_configuration(system),
        "has_watchdog": system.watchdog > 0,
        "clocks": _clocks(system),
        "resets": _resets(system),
        "publisher_errors": [
            {"bit": bit, "block": block}
            for bit, block in enumerate(system.error_blocks)
            if bit >= len(system.subscribers)
        ],
        "components": [component(type_) for type_ in system.accelerator_types if type_.is_component],
        "signals": [_signals(names, *block) for block in blocks(system)],
        "subscribers": [subscriber_instances(names, converter, system) for converter in system.subscribers],
        "publishers": [publisher_instances(names, converter, system) for converter in system.publishers],
        "accelerators": [accelerator_instance(names, block, system) for block in system.accelerators],
        "junctions": [
            *(junction_configuration(names, item, system) for item in system.junctions if not item.is_exchanged),
            *exchange_instance(names, system),
        ],
        "pins": pin_groups(names, system),
        "synchronisers": [pin_synchroniser(names, *pin, system) for pin in synchronised_pins(system)],
        "parameters": parameter_signals(names, system),
        "parameter_blocks": parameter_blocks(names, system),
        "connections": connections(names, system),
        "watched": waits_configuration(system) if is_watched else None,
    }


def test_bench_entity(system: DerivedSystem, *, is_live: bool) -> str:
    """Return the name of the test bench that compares frames with files, or of the live test bench with a pipe.

    The live test bench of a node in fabric simulates a board: the pipe carries the bytes of its chip, or its frames.
    """
    if system.network:
        return f"{system.entity}_network"
    return f"{system.entity}_live" if is_live else f"{system.entity}_tb"


def test_bench_configuration(
    system: DerivedSystem, seed: int, stall_percent: int, environment: str | None, *, is_live: bool
) -> Context:
    """Return the configuration of the test bench: the system, the simulated host, and the `environment` at the pins.

    The environment is an entity with the ports `clk` and `rst_n`, and with the pins in the opposite directions. If
    `is_live` is set, the host is at the other end of a pipe, and the test bench does not join bursts.
    """
    pins = pin_groups(Names(system), system)
    formals = [
        "clk",
        "rst_n",
        *(clock.port for clock in system.clocks),
        *(str(port["name"]) for group in pins for port in group["ports"]),
    ]
    # A link carries single bytes.
    host_width = 8 if system.link else system.width
    has_join = system.scheduling.is_preemptive and not is_live
    return {
        "bench": test_bench_entity(system, is_live=is_live),
        "unit": watched_entity(system) if is_live else system.entity,
        "watched": waits_configuration(system) if is_live else None,
        "is_live": is_live,
        "pins": pins,
        "clocks": [
            {**clock, "period": max(2, round(_HOST_PERIOD / item.ratio)), "number": number}
            for number, (clock, item) in enumerate(zip(_clocks(system), system.clocks, strict=True), start=1)
        ],
        "environment": {"entity": environment, "ports": port_map((name, name) for name in formals)}
        if environment
        else None,
        **dimensions(system),
        **interconnect_configuration(system),
        "host_width": host_width,
        "host_lanes": host_width // 8,
        "seed": seed,
        "stall_percent": stall_percent,
        "has_join": has_join,
        "from": "burst" if has_join else "from",
    }


def _clocks(system: DerivedSystem) -> list[Context]:
    """Return all clocks other than clk, as ports of the top level."""
    return [
        {
            "port": clock.port,
            "megahertz": f"{float(clock.frequency / 10**6):g}",
            "blocks": ", ".join(block.block for block in system.accelerators if block.clock == clock.name),
        }
        for clock in system.clocks
    ]


def _resets(system: DerivedSystem) -> Context:
    """Return the resets of all domains.

    The reset of clk is released separately. The domains of crossings are reset in turn and released together.
    """
    # Each reset with its clock and the reset that it waits for.
    turns = [(OWN_RESET, "clk", "")]
    if system.clocks:
        before = ""
        for clock in system.clocks:
            turns.append((seen_reset(clock), clock.port, before))
            before = seen_reset(clock)
        turns.append((RELEASED, "clk", before))
        turns += [(clock.reset, clock.port, RELEASED) for clock in system.clocks]
    return {
        "signals": [reset for reset, _, _ in turns],
        "has_turns": bool(system.clocks),
        "instances": [_reset(*turn) for turn in turns],
    }


def _reset(reset: str, clock: str, may_end: str) -> Context:
    ends = [("may_end", may_end)] if may_end else []
    ports = [("clk", clock), ("rst_n", "rst_n"), *ends, ("synced_rst_n", reset)]
    return instance(reset_label(reset), "entity firm.firm_cdc_reset", ports)


def top_level_pins(system: DerivedSystem) -> dict[tuple[str, str], str]:
    """Return the top level's name for each accelerator pin, by block and pin name."""
    names = Names(system)
    return {
        (block.block, pin.name): names.port(block.block, pin.name)
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    }


def pin_groups(names: Names, system: DerivedSystem) -> list[Context]:
    """Return the pins of each block that has pins, as ports of the top level."""
    return [
        {
            "block": block.block,
            "ports": [
                {
                    "name": names.port(block.block, pin.name),
                    "direction": str(pin.direction),
                    "type": vhdl_type(pin.bits),
                    "bits": pin.bits,
                }
                for pin in block.type.accelerator.pins
            ],
        }
        for block in system.accelerators
        if block.type.accelerator.pins
    ]


def dimensions(system: DerivedSystem) -> Context:
    """Return the sizes of the top level's ports and signals."""
    publishers = len(system.publishers)
    return {
        "entity": system.entity,
        "width": system.width,
        "lanes": system.width // 8,
        "subscriber_count": len(system.subscribers),
        "publisher_count": publishers,
        "pub_data_bits": publishers * system.width,
        "pub_keep_bits": publishers * system.width // 8,
        "wide_ids": system.id_bytes > 1,
        "id_bits": 8 * system.id_bytes,
        "select_bits": index_bits(publishers),
        "error_count": len(system.error_blocks),
        "error_code_bits": ERROR_CODE_BITS * len(system.error_blocks),
    }


def _signals(names: Names, block: str, ports: list[tuple[str, SidePort]]) -> Context:
    return {
        "block": block,
        "declarations": [
            {"name": names.port(block, f"{prefix}{port.name}"), "type": vhdl_type(port.width)} for prefix, port in ports
        ],
    }
