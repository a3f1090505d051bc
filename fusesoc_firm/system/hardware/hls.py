"""Derived System -> template configuration: the wrapper and the kernel of an accelerator written for HLS."""

from __future__ import annotations

from pathlib import PurePosixPath

from fusesoc_firm.converter.vhdl import vhdl_type
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
from fusesoc_firm.text.render import Context

WRAPPER_TEMPLATE = "vhdl/hls_wrapper.vhd"
KERNEL_TEMPLATE = "vhdl/hls_kernel.vhd"
SHIM_TEMPLATE = "hls/kernel.cpp"


def wrapper_configuration(accelerator: AcceleratorType) -> Context:
    """Return the configuration of the wrapper, which adds an accelerator's message sides to the kernel."""
    inputs, outputs = arguments(accelerator)
    return {
        "entity": accelerator.entity,
        "function": function_name(accelerator),
        "kernel": kernel_entity(accelerator),
        "message_ports": [
            {
                "name": f"{prefix}{port.name}",
                "direction": "out" if port.is_output else "in",
                "type": vhdl_type(port.width),
                "comment": port.comment,
            }
            for prefix, port in accelerator_ports(accelerator)
        ],
        "input_sides": [side.prefix for side in accelerator.inputs],
        "output_sides": [{"prefix": side.prefix, "number": n} for n, side in enumerate(accelerator.outputs)],
        "output_count": len(accelerator.outputs),
        "inputs": [_kernel_port(argument) for argument in inputs],
        "outputs": [_kernel_port(argument) for argument in outputs],
    }


def _kernel_port(argument: Argument) -> Context:
    """Return a port of the kernel, in which a single bit is also a vector."""
    is_bit = argument.field.width is None
    return {"port": argument.port, "signal": argument.signal, "bits": argument.bits, "is_bit": is_bit}


def kernel_configuration(accelerator: AcceleratorType) -> Context:
    """Return the configuration of the simulated kernel, and of the shim between it and the C++ function."""
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
    }


def _argument(argument: Argument, column: int) -> Context:
    return {
        "name": argument.port,
        "padded": argument.port.ljust(column),
        "padded_valid": f"{argument.port}_ap_vld".ljust(column),
        "type": vhdl_type(argument.bits),
        "cpp_type": cpp_type(argument),
        "word": argument.word,
        "words": [
            {
                "index": argument.word + number,
                "high": min(argument.bits, WORD_BITS * (number + 1)) - 1,
                "low": WORD_BITS * number,
                "bits": min(argument.bits - WORD_BITS * number, WORD_BITS),
            }
            for number in range(argument.words)
        ],
    }
