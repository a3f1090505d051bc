"""Derived System -> template configuration: the wrapper and the kernel of an accelerator written for HLS."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePosixPath
from typing import Any

from fusesoc_firm.converter.ports import vhdl_type
from fusesoc_firm.system.derived.cpp_function import (
    AP_PORTS,
    WORD_BITS,
    Argument,
    arguments,
    cpp_type,
    function_name,
    kernel_entity,
    library_name,
)
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.derived.sides import accelerator_ports
from fusesoc_firm.system.hardware.maps import port_map

Configuration = dict[str, Any]

WRAPPER_TEMPLATE = "vhdl/hls_wrapper.vhd"
KERNEL_TEMPLATE = "vhdl/hls_kernel.vhd"
SHIM_TEMPLATE = "hls/kernel.cpp"


def wrapper_configuration(accelerator: AcceleratorType) -> Configuration:
    """The configuration of the wrapper that gives the kernel the message sides of an accelerator."""
    inputs, outputs = arguments(accelerator)
    ports = accelerator_ports(accelerator)
    names = [f"{prefix}{port.name}" for prefix, port in ports]
    column = max(len(name) for name in [*names, "rst_n"])
    return {
        "entity": accelerator.entity,
        "function": function_name(accelerator),
        "kernel": kernel_entity(accelerator),
        "clk": "clk".ljust(column),
        "rst_n": "rst_n".ljust(column),
        "message_ports": [
            {
                "name": name.ljust(column),
                "direction": "out" if port.is_output else "in ",
                "type": vhdl_type(port.width),
                "semicolon": ";" if number < len(ports) - 1 else "",
                "comment": f"  -- {port.comment}" if port.comment else "",
            }
            for number, (name, (_, port)) in enumerate(zip(names, ports, strict=True))
        ],
        "all_valid": " and ".join(f"{side.prefix}msg_valid" for side in accelerator.inputs),
        "input_sides": [{"prefix": side.prefix} for side in accelerator.inputs],
        "output_sides": [{"prefix": side.prefix, "number": n} for n, side in enumerate(accelerator.outputs)],
        "output_high": len(accelerator.outputs) - 1,
        "outputs": [
            {
                "signal": argument.signal,
                "result": f"result_{argument.port}",
                "valid": f"valid_{argument.port}",
                "bits": "(0)" if argument.field.width is None else "",
            }
            for argument in outputs
        ],
        "signals": _kernel_signals(inputs, outputs),
        "ports": port_map(_kernel_map(inputs, outputs)),
        "bits_in": [
            {"name": f"argument_{argument.port}", "signal": argument.signal}
            for argument in inputs
            if argument.field.width is None
        ],
    }


def _kernel_signals(inputs: Sequence[Argument], outputs: Sequence[Argument]) -> list[Configuration]:
    """What the kernel's ports need besides the accelerator's own: a vector for a single bit, and every result."""
    declared = [(f"argument_{item.port}", vhdl_type(1)) for item in inputs if item.field.width is None]
    for argument in outputs:
        declared += [(f"result_{argument.port}", vhdl_type(argument.bits)), (f"valid_{argument.port}", vhdl_type(None))]
    column = max((len(name) for name, _ in declared), default=0)
    return [{"name": name.ljust(column), "type": type_} for name, type_ in declared]


def _kernel_map(inputs: Sequence[Argument], outputs: Sequence[Argument]) -> Iterator[tuple[str, str]]:
    yield from (("ap_clk", "clk"), ("ap_rst", "reset"), ("ap_start", "start"), ("ap_done", "done"))
    yield from (("ap_idle", "open"), ("ap_ready", "ready"))
    for argument in inputs:
        yield argument.port, f"argument_{argument.port}" if argument.field.width is None else argument.signal
    for argument in outputs:
        yield argument.port, f"result_{argument.port}"
        yield f"{argument.port}_ap_vld", f"valid_{argument.port}"


def kernel_configuration(accelerator: AcceleratorType) -> Configuration:
    """The configuration of the kernel that simulation calls the C++ function through, and of the shim between them."""
    inputs, outputs = arguments(accelerator)
    column = max(len(name) for name in [*AP_PORTS, *(f"{argument.port}_ap_vld" for argument in [*inputs, *outputs])])
    return {
        "function": function_name(accelerator),
        "kernel": kernel_entity(accelerator),
        "source": str(PurePosixPath(accelerator.accelerator.sources[0]).name),
        "library": library_name(accelerator),
        "inputs": [_argument(argument, column) for argument in inputs],
        "outputs": [_argument(argument, column) for argument in outputs],
        **{name: name.ljust(column) for name in AP_PORTS},
        "input_words": max(1, sum(argument.words for argument in inputs)),
        "output_words": max(1, sum(argument.words for argument in outputs)),
        "calls": [
            {"code": code, "comma": "," if number < len(inputs) + len(outputs) - 1 else ""}
            for number, code in enumerate(
                [f"take<{cpp_type(argument)}>({argument.word})" for argument in inputs]
                + [argument.port for argument in outputs]
            )
        ],
    }


def _argument(argument: Argument, column: int) -> Configuration:
    return {
        "name": argument.port,
        "padded": argument.port.ljust(column),
        "padded_valid": f"{argument.port}_ap_vld".ljust(column),
        "type": vhdl_type(argument.bits),
        "cpp_type": cpp_type(argument),
        "word": argument.word,
        "words": [
            {
                "port": argument.port,
                "index": argument.word + number,
                "high": min(argument.bits, WORD_BITS * (number + 1)) - 1,
                "low": WORD_BITS * number,
                "bits": min(argument.bits - WORD_BITS * number, WORD_BITS),
            }
            for number in range(argument.words)
        ],
    }
