"""Accelerators written as a C++ function for high-level synthesis.

Such an accelerator is a kernel with the `ap_ctrl_hs` handshake that HLS tools give a function, and a wrapper that
gives it the message sides of an accelerator. In synthesis the kernel is what the HLS tool makes. In simulation it is
an entity of the same name and ports that calls the user's function itself, compiled to a shared library.

The function is called after its file. It takes the inputs' fields by value, then the outputs' by pointer or
reference, in wire order; its parameters should be called `<field>_in` and `<field>_out`, which become the ports.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.diagnostics import Diagnostics, InputError
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.naming import distinct_identifiers, identifier
from fusesoc_firm.system.derived import AcceleratorType, MessageSide
from fusesoc_firm.system.maps import port_map
from fusesoc_firm.system.sides import accelerator_ports

Configuration = dict[str, Any]

WRAPPER_TEMPLATE = "vhdl/hls_wrapper.vhd"
KERNEL_TEMPLATE = "vhdl/hls_kernel.vhd"
SHIM_TEMPLATE = "hls/kernel.cpp"

_WORD_BITS = 32
_CPP_TYPES = {
    "bool": "bool",
    "float32": "float",
    "float64": "double",
    **{f"{sign}int{bits}": f"std::{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_AP_PORTS = ("ap_clk", "ap_rst", "ap_start", "ap_done", "ap_idle", "ap_ready")


@dataclass(frozen=True)
class Argument:
    """A parameter of the C++ function.

    `port` is the kernel's, `signal` the accelerator's; `word` is the first of the words of 32 bits that carry it.
    """

    port: str
    signal: str
    field: FieldPort
    word: int

    @property
    def bits(self) -> int:
        """Bits of the kernel's port."""
        return self.field.width or 1

    @property
    def words(self) -> int:
        """Words of 32 bits that carry it."""
        return -(-self.bits // _WORD_BITS)


def function_name(accelerator: AcceleratorType) -> str:
    """The C++ function: named after the first source file."""
    return PurePosixPath(accelerator.accelerator.sources[0]).stem


def kernel_entity(accelerator: AcceleratorType) -> str:
    """The entity around the function, which the wrapper instantiates: an IP, or in simulation what calls the C++.

    Not the function's own name: that is a module within the IP.
    """
    return f"{function_name(accelerator)}_kernel"


def library_name(accelerator: AcceleratorType) -> str:
    """The shared library that simulation loads from its work folder."""
    return f"lib{function_name(accelerator)}.so"


def arguments(accelerator: AcceleratorType) -> tuple[list[Argument], list[Argument]]:
    """The function's inputs and outputs, of an accelerator that `check_kernel` has no fault to note in."""
    inputs = [(side, field) for side in accelerator.inputs for field in field_ports(side.frame)]
    outputs = [(side, field) for side in accelerator.outputs for field in field_ports(side.frame)]
    # `in_` gives `x_in`, and `in1_` gives `x_in1`.
    names = distinct_identifiers([(field.name, side.prefix) for side, field in inputs + outputs], _AP_PORTS)
    return _arguments(inputs, names), _arguments(outputs, names[len(inputs) :])


def _arguments(fields: Sequence[tuple[MessageSide, FieldPort]], names: Sequence[str]) -> list[Argument]:
    found: list[Argument] = []
    for (side, field), name in zip(fields, names, strict=False):
        word = found[-1].word + found[-1].words if found else 0
        found.append(Argument(name, f"{side.prefix}{field.name}", field, word))
    return found


def prototype(accelerator: AcceleratorType) -> str:
    """The function as it must be declared."""
    inputs, outputs = arguments(accelerator)
    parameters = [f"{_cpp_type(item)} {item.port}" for item in inputs]
    parameters += [f"{_cpp_type(item)} *{item.port}" for item in outputs]
    return f"void {function_name(accelerator)}({', '.join(parameters)})"


def check_kernel(accelerator: AcceleratorType, faults: Diagnostics) -> None:
    """Note what keeps an accelerator from being a function: its name, or messages that no plain parameters carry."""
    name, sources = accelerator.accelerator.name, accelerator.accelerator.sources
    function = function_name(accelerator)
    if identifier(function) != function:
        hint = "letters, digits and single '_' between them, and no keyword of VHDL or Verilog"
        message = f"the function is called after its file, and '{function}' cannot be its name"
        faults.error(message, sources[0].source, hint)
    if not accelerator.inputs or not accelerator.outputs:
        lacking = "output" if accelerator.inputs else "input"
        message = f"'{name}' is of type HLS, which needs at least one input and one output"
        faults.error(message, name.source, f"its interface has no '{lacking}'")
    interface = accelerator.accelerator.interface
    for side, item in zip(
        (*accelerator.inputs, *accelerator.outputs), (*interface.input, *interface.output), strict=True
    ):
        for problem in _problems(side.frame):
            message = f"'{name}' is of type HLS, which takes {problem}"
            faults.error(message, item.message.source, "write this accelerator in VHDL")


def _problems(frame: Frame) -> list[str]:
    """What of a message no parameter carries, behind what one does."""
    try:
        check_fixed_size(frame)
    except InputError as error:
        return [f"messages of fixed size, but {fault.message}" for fault in error.diagnostics]
    return [f"single values, not the array {port.comment}" for port in field_ports(frame) if port.field.is_array]


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
    column = max(len(name) for name in [*_AP_PORTS, *(f"{argument.port}_ap_vld" for argument in [*inputs, *outputs])])
    return {
        "function": function_name(accelerator),
        "kernel": kernel_entity(accelerator),
        "source": str(PurePosixPath(accelerator.accelerator.sources[0]).name),
        "library": library_name(accelerator),
        "inputs": [_argument(argument, column) for argument in inputs],
        "outputs": [_argument(argument, column) for argument in outputs],
        **{name: name.ljust(column) for name in _AP_PORTS},
        "input_words": max(1, sum(argument.words for argument in inputs)),
        "output_words": max(1, sum(argument.words for argument in outputs)),
        "calls": [
            {"code": code, "comma": "," if number < len(inputs) + len(outputs) - 1 else ""}
            for number, code in enumerate(
                [f"take<{_cpp_type(argument)}>({argument.word})" for argument in inputs]
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
        "cpp_type": _cpp_type(argument),
        "word": argument.word,
        "words": [
            {
                "port": argument.port,
                "index": argument.word + number,
                "high": min(argument.bits, _WORD_BITS * (number + 1)) - 1,
                "low": _WORD_BITS * number,
                "bits": min(argument.bits - _WORD_BITS * number, _WORD_BITS),
            }
            for number in range(argument.words)
        ],
    }


def _cpp_type(argument: Argument) -> str:
    return _CPP_TYPES[argument.field.field.type.name]
