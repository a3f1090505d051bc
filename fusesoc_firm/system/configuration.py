"""Derived System -> template configuration: the top level and its test bench as plain dictionaries.

The message side of a block is the same few ports everywhere: the fields, `segment_valid`, `msg_valid` and
`msg_ready`. Every block has a signal for each of its ports, called `<block>_<port>` (`names`); `instances` connects
blocks to them, and `wires` one with another.
"""

from __future__ import annotations

from typing import Any

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.derived import DerivedSystem
from fusesoc_firm.system.instances import (
    ERROR_CODE_BITS,
    accelerator_instance,
    component,
    publisher_instance,
    subscriber_instance,
)
from fusesoc_firm.system.interconnect import interconnect_configuration
from fusesoc_firm.system.maps import port_map
from fusesoc_firm.system.names import RELEASED, Names, blocks, reset_label, seen_reset
from fusesoc_firm.system.scheduler import scheduler_configuration
from fusesoc_firm.system.sides import SidePort
from fusesoc_firm.system.specification import DIRECTIONS
from fusesoc_firm.system.wires import connections

Configuration = dict[str, Any]

# Of the simulated host's clock, in ps.
_HOST_PERIOD = 10_000

SYSTEM_TEMPLATE = "vhdl/system.vhd"
TEST_BENCH_TEMPLATE = "vhdl/test_bench.vhd"


def system_configuration(system: DerivedSystem) -> Configuration:
    """The configuration of the top level."""
    names = Names(system)
    return {
        **dimensions(system),
        "name": system.name,
        **interconnect_configuration(system),
        **scheduler_configuration(system),
        "clocks": _clocks(system),
        "resets": _resets(system),
        "publisher_errors": [
            {"bit": bit, "block": block}
            for bit, block in enumerate(system.error_blocks)
            if bit >= len(system.subscribers)
        ],
        "components": [component(type_) for type_ in system.accelerator_types if type_.is_component],
        "signals": [_signals(names, *block) for block in blocks(system)],
        "subscribers": [subscriber_instance(names, converter, system) for converter in system.subscribers],
        "publishers": [publisher_instance(names, converter, system) for converter in system.publishers],
        "accelerators": [accelerator_instance(names, block, system) for block in system.accelerators],
        "pins": pin_groups(names, system),
        "connections": connections(names, system),
    }


def test_bench_entity(system: DerivedSystem, *, is_live: bool) -> str:
    """The test bench that compares with files, or the one that does what a pipe says."""
    return f"{system.entity}_live" if is_live else f"{system.entity}_tb"


def test_bench_configuration(
    system: DerivedSystem, seed: int, stall_percent: int, environment: str | None, *, is_live: bool
) -> Configuration:
    """The configuration of the test bench: the simulated host beside the system, and at its pins the `environment`.

    That is an entity with `clk`, `rst_n` and the pins, each in the other direction. If it `is_live`, the host is at the
    end of a pipe, and joins no bursts.
    """
    pins = pin_groups(Names(system), system)
    formals = [
        "clk",
        "rst_n",
        *(clock.port for clock in system.clocks),
        *(str(port["formal"]) for group in pins for port in group["ports"]),
    ]
    # A link carries bytes.
    host_width = 8 if system.link else system.width
    has_join = system.scheduling.is_preemptive and not is_live
    return {
        "bench": test_bench_entity(system, is_live=is_live),
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
        "host_data_high": host_width - 1,
        "host_keep_high": host_width // 8 - 1,
        "seed": seed,
        "stall_percent": stall_percent,
        "has_join": has_join,
        "from": "burst" if has_join else "from",
    }


def _clocks(system: DerivedSystem) -> list[Configuration]:
    """Every further clock as a port of the top level."""
    column = max([len("frame_error_code"), *(len(clock.port) for clock in system.clocks)])
    return [
        {
            "name": clock.port.ljust(column),
            "port": clock.port,
            "megahertz": f"{float(clock.frequency / 10**6):g}",
            "blocks": ", ".join(block.block for block in system.accelerators if block.clock == clock.name),
        }
        for clock in system.clocks
    ]


def _resets(system: DerivedSystem) -> Configuration | None:
    """The resets of further clocks: each domain sees it, one after the other, and clk's; then all let go."""
    if not system.clocks:
        return None
    before: list[tuple[str, str]] = []
    instances = []
    for clock in system.clocks:
        instances.append(_reset(clock.port, before, seen_reset(clock)))
        before = [("release", seen_reset(clock))]
    instances.append(_reset("clk", before, RELEASED))
    instances += [_reset(clock.port, [("release", RELEASED)], clock.reset) for clock in system.clocks]
    signals = [RELEASED, *(name for clock in system.clocks for name in (seen_reset(clock), clock.reset))]
    column = max(map(len, signals))
    return {"signals": [{"name": name.ljust(column)} for name in signals], "instances": instances}


def _reset(clock: str, release: list[tuple[str, str]], reset: str) -> Configuration:
    return {
        "label": reset_label(reset),
        "ports": port_map([("clk", clock), ("rst_n", "rst_n"), *release, ("synced_rst_n", reset)]),
    }


def top_level_pins(system: DerivedSystem) -> dict[tuple[str, str], str]:
    """What the pins of blocks are called at the top level, by block and name."""
    names = Names(system)
    return {
        (block.block, pin.name): names.port(block.block, pin.name)
        for block in system.accelerators
        for pin in block.type.accelerator.pins
    }


def pin_groups(names: Names, system: DerivedSystem) -> list[Configuration]:
    """The pins of each block that has some, as ports of the top level."""
    groups = []
    for block in system.accelerators:
        pins = block.type.accelerator.pins
        formals = [names.port(block.block, pin.name) for pin in pins]
        column = max(map(len, formals), default=0)
        ports = [
            {
                "formal": formal,
                "name": formal.ljust(column),
                "direction": str(pin.direction).ljust(max(map(len, DIRECTIONS))),
                "type": vhdl_type(pin.bits),
                "range": "" if pin.bits is None else f" -from {pin.bits - 1} -to 0",
                "low": "'0'" if pin.bits is None else "(others => '0')",
            }
            for pin, formal in zip(pins, formals, strict=True)
        ]
        if ports:
            groups.append({"block": block.block, "ports": ports})
    return groups


def dimensions(system: DerivedSystem) -> Configuration:
    """The sizes of the top level's ports and signals."""
    publishers = len(system.publishers)
    return {
        "entity": system.entity,
        "width": system.width,
        "data_high": system.width - 1,
        "keep_high": system.width // 8 - 1,
        "subscriber_count": len(system.subscribers),
        "publisher_count": publishers,
        "subscriber_high": len(system.subscribers) - 1,
        "publisher_high": publishers - 1,
        "pub_data_high": publishers * system.width - 1,
        "pub_keep_high": publishers * system.width // 8 - 1,
        "select_high": max(1, (publishers - 1).bit_length()) - 1,
        "error_count": len(system.error_blocks),
        "error_high": len(system.error_blocks) - 1,
        "error_code_high": ERROR_CODE_BITS * len(system.error_blocks) - 1,
    }


def _signals(names: Names, block: str, ports: list[tuple[str, SidePort]]) -> Configuration:
    declared = [(names.port(block, f"{prefix}{port.name}"), vhdl_type(port.width)) for prefix, port in ports]
    column = max(len(name) for name, _ in declared)
    return {
        "block": block,
        "declarations": [{"name": name.ljust(column), "type": type_} for name, type_ in declared],
    }
