"""The instances of the top level: converters with their buffers, and accelerators."""

from __future__ import annotations

from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.system.derived import AcceleratorBlock, AcceleratorType, Converter, DerivedSystem
from fusesoc_firm.system.maps import port_map
from fusesoc_firm.system.names import AXIS, FRAME_SIGNALS, Names
from fusesoc_firm.system.sides import accelerator_ports, side_ports

ERROR_CODE_BITS = 4


def subscriber_instance(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """A subscriber: from the Manager to its message side."""
    number = converter.id
    ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
    return {
        **_instance(names, converter.block, subscriber_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": number,
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                ("s_axis_tdata", "sub_axis_tdata"),
                ("s_axis_tkeep", "sub_axis_tkeep"),
                ("s_axis_tvalid", f"sub_axis_tvalid({number})"),
                ("s_axis_tlast", "sub_axis_tlast"),
                ("s_axis_tready", f"sub_axis_tready({number})"),
                *((port.name, names.port(converter.block, port.name)) for port in ports),
                *_errors(converter, system),
            ]
        ),
    }


def publisher_instance(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """A publisher, with the buffer behind it if it stores frames whole."""
    ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
    frame = _frame_out(converter, system.width)
    errors = [] if converter.frame.is_fixed_size else _errors(converter, system)
    if converter.buffer:
        frame = [(f"m_axis_{word}", names.frame(converter.block, word)) for word in AXIS]
        errors = [(f"frame_{word}", names.frame(converter.block, word)) for word in ("error", "error_code")]
    return {
        **_instance(names, converter.block, publisher_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": converter.id,
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                *((port.name, names.port(converter.block, port.name)) for port in ports),
                *frame,
                *errors,
            ]
        ),
        "buffer": _buffer(names, converter, system) if converter.buffer else None,
    }


def _frame_out(converter: Converter, width: int) -> list[tuple[str, str]]:
    """Where a publisher's frames go: its part of what the Manager takes."""
    number, lanes = converter.id, width // 8
    return [
        ("m_axis_tdata", f"pub_axis_tdata({width * (number + 1) - 1} downto {width * number})"),
        ("m_axis_tkeep", f"pub_axis_tkeep({lanes * (number + 1) - 1} downto {lanes * number})"),
        ("m_axis_tvalid", f"pub_axis_tvalid({number})"),
        ("m_axis_tlast", f"pub_axis_tlast({number})"),
        ("m_axis_tready", f"pub_axis_tready({number})"),
    ]


def _errors(converter: Converter, system: DerivedSystem) -> list[tuple[str, str]]:
    """Where a converter's errors go: its part of the system's."""
    bit = system.error_blocks.index(converter.block)
    low, high = ERROR_CODE_BITS * bit, ERROR_CODE_BITS * (bit + 1) - 1
    return [("frame_error", f"frame_error({bit})"), ("frame_error_code", f"frame_error_code({high} downto {low})")]


def _buffer(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """The buffer behind a publisher."""
    block, lanes = converter.block, system.width // 8
    types = [vhdl_type(system.width), vhdl_type(lanes), *[vhdl_type(None)] * 4, vhdl_type(ERROR_CODE_BITS)]
    declared = [names.frame(block, word.removeprefix("frame_")) for word in FRAME_SIGNALS]
    column = max(map(len, declared))
    return {
        "block": block,
        "label": names.label(block, "buffer"),
        "width": system.width,
        "depth": max(2, -(-(ID_BYTES + LENGTH_BYTES + converter.buffer) // lanes)),
        "signals": [{"name": name.ljust(column), "type": type_} for name, type_ in zip(declared, types, strict=True)],
        "ports": port_map(
            [
                ("clk", "clk"),
                ("rst_n", "rst_n"),
                *((f"s_axis_{word}", names.frame(block, word)) for word in AXIS),
                *_frame_out(converter, system.width),
                ("s_frame_error", names.frame(block, "error")),
                ("s_frame_error_code", names.frame(block, "error_code")),
                *_errors(converter, system),
            ]
        ),
    }


def accelerator_instance(names: Names, block: AcceleratorBlock, system: DerivedSystem) -> dict[str, Any]:
    """An accelerator with its message sides and pins."""
    clock = system.clock_of(block.block)
    differences = [clock.port] if clock else []
    differences += [f"{block.type.width} bits"] if block.type.width != system.width else []
    formals = [f"{prefix}{port.name}" for prefix, port in accelerator_ports(block.type)]
    formals += [str(pin.name) for pin in block.type.accelerator.pins]
    return {
        **_instance(names, block.block, block.type.entity),
        "unit": f"component {block.type.entity}" if block.type.is_component else f"entity work.{block.type.entity}",
        "has_width": block.type.has_width,
        "width": block.type.width,
        "differences": {"words": ", ".join(differences)} if differences else None,
        "ports": port_map(
            [
                ("clk", clock.port if clock else "clk"),
                ("rst_n", clock.reset if clock else "rst_n"),
                *((formal, names.port(block.block, formal)) for formal in formals),
            ]
        ),
    }


def component(type_: AcceleratorType) -> dict[str, Any]:
    """The declaration of an accelerator that is no entity."""
    ports: list[tuple[str, bool, int | None]] = [("clk", False, None), ("rst_n", False, None)]
    ports += [(f"{prefix}{port.name}", port.is_output, port.width) for prefix, port in accelerator_ports(type_)]
    ports += [(str(pin.name), pin.direction == "out", pin.bits) for pin in type_.accelerator.pins]
    column = max(len(name) for name, *_ in ports)
    return {
        "entity": type_.entity,
        "has_width": type_.has_width,
        "declarations": [
            {
                "name": name.ljust(column),
                "direction": "out" if is_output else "in ",
                "type": vhdl_type(bits),
                "semicolon": ";" if number < len(ports) - 1 else "",
            }
            for number, (name, is_output, bits) in enumerate(ports)
        ],
    }


def _instance(names: Names, block: str, entity: str) -> dict[str, Any]:
    return {"block": block, "label": names.label(block), "entity": entity}
