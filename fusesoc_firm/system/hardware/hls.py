"""Derived System -> template configuration: the wrapper and the kernel of an accelerator written for HLS."""

from __future__ import annotations

from collections.abc import Iterable

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.derived.cpp_function import (
    AP_PORTS,
    WORD_BITS,
    Argument,
    Element,
    arguments,
    cpp_type,
)
from fusesoc_firm.system.derived.cpp_stream import is_streamed
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.system.hardware.hls_names import named
from fusesoc_firm.system.hardware.hls_stream import stream_kernel, stream_shim, stream_wrapper
from fusesoc_firm.system.hardware.instances import declarations
from fusesoc_firm.text.render import Context, Rendering

_WRAPPER_TEMPLATE = "vhdl/hls_wrapper.vhd"
_KERNEL_TEMPLATE = "vhdl/hls_kernel.vhd"
_SHIM_TEMPLATE = "hls/kernel.cpp"


def wrapper(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the wrapper, which adds an accelerator's message sides to the kernel."""
    if is_streamed(accelerator):
        return stream_wrapper(accelerator)
    return Rendering(_WRAPPER_TEMPLATE, _wrapper_configuration(accelerator))


def kernel(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the simulated kernel."""
    return stream_kernel(accelerator) if is_streamed(accelerator) else _simulated(accelerator, _KERNEL_TEMPLATE)


def shim(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the C++ between the simulated kernel and the function."""
    return stream_shim(accelerator) if is_streamed(accelerator) else _simulated(accelerator, _SHIM_TEMPLATE)


def _simulated(accelerator: AcceleratorType, template: str) -> Rendering:
    return Rendering(template, _kernel_configuration(accelerator))


def _wrapper_configuration(accelerator: AcceleratorType) -> Context:
    inputs, outputs = arguments(accelerator)
    return {
        **named(accelerator),
        "message_ports": declarations(accelerator),
        "input_sides": [side.prefix for side in accelerator.inputs],
        "output_sides": [{"prefix": side.prefix, "number": n} for n, side in enumerate(accelerator.outputs)],
        "output_count": len(accelerator.outputs),
        "inputs": [_kernel_port(element) for element in _elements(inputs)],
        "outputs": [_kernel_port(element) for element in _elements(outputs)],
    }


def _elements(arguments: Iterable[Argument]) -> list[Element]:
    """Return the values of all arguments, each of which has a port of the kernel."""
    return [element for argument in arguments for element in argument.elements]


def _kernel_port(element: Element) -> Context:
    """Return a port of the kernel, in which a single bit is also a vector."""
    return {"port": element.port, "signal": element.signal, "bits": element.bits, "is_bit": element.is_bit}


def _kernel_configuration(accelerator: AcceleratorType) -> Context:
    inputs, outputs = arguments(accelerator)
    values, results = _elements(inputs), _elements(outputs)
    column = max(len(name) for name in [*AP_PORTS, *(f"{element.port}_ap_vld" for element in [*values, *results])])
    return {
        **named(accelerator),
        "inputs": [_element(element, column) for element in values],
        "outputs": [_element(element, column) for element in results],
        "parameters": [_parameter(argument) for argument in inputs],
        "results": [_parameter(argument) for argument in outputs],
        **{name: name.ljust(column) for name in AP_PORTS},
        "input_words": max(1, *(argument.end for argument in inputs)) if inputs else 1,
        "output_words": max(1, *(argument.end for argument in outputs)) if outputs else 1,
    }


def _parameter(argument: Argument) -> Context:
    """Return a parameter of the C++ function and the words of its values."""
    first = argument.elements[0]
    return {
        "name": argument.port,
        "cpp_type": cpp_type(argument),
        "is_array": argument.count is not None,
        "count": len(argument.elements),
        "word": first.word,
        "words": first.words,
    }


def _element(element: Element, column: int) -> Context:
    return {
        "name": element.port,
        "padded": element.port.ljust(column),
        "padded_valid": f"{element.port}_ap_vld".ljust(column),
        "type": vhdl_type(element.bits),
        "words": [
            {
                "index": element.word + number,
                "high": min(element.bits, WORD_BITS * (number + 1)) - 1,
                "low": WORD_BITS * number,
                "bits": min(element.bits - WORD_BITS * number, WORD_BITS),
            }
            for number in range(element.words)
        ],
    }
