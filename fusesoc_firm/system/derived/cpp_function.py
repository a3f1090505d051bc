"""Accelerators written as C++ functions for high-level synthesis.

An accelerator of this type consists of a kernel with the `ap_ctrl_hs` handshake, which HLS tools generate for a
function, and a wrapper with the message sides of an accelerator. In synthesis, the kernel is the output of the HLS
tool. In simulation, the kernel is an entity with the same name and ports that calls the user's function, compiled to a
shared library.

The function has the name of its file. The parameters are the inputs' fields by value, followed by the outputs' fields
by pointer or reference, in wire order. The parameters should be named `<field>_in` and `<field>_out`; these names
become the ports' names. An array of fixed size is a C++ array, of which each element is a port: `<field>_in_0`.

If a message has strings or arrays of variable size, all parameters are streams instead: see `cpp_stream`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.system.derived.cpp_stream import Channel, channels, is_streamed, stream_problems
from fusesoc_firm.system.derived.model import AcceleratorType, MessageSide
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import distinct_identifiers, identifier

AP_PORTS = ("ap_clk", "ap_rst", "ap_start", "ap_done", "ap_idle", "ap_ready")
"""The ports of the `ap_ctrl_hs` handshake."""
WORD_BITS = 32
"""The width in bits of a word that the function and its kernel exchange."""
_CPP_TYPES = {
    "bool": "bool",
    "float32": "float",
    "float64": "double",
    **{f"{sign}int{bits}": f"std::{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}


@dataclass(frozen=True)
class Element:
    """A value of the C++ function that has its own port.

    `port` is the kernel's port and `signal` the accelerator's signal or a part of it; `word` is the index of the first
    32-bit word that carries the value.
    """

    port: str
    signal: str
    bits: int
    is_bit: bool
    word: int

    @property
    def words(self) -> int:
        """The number of 32-bit words that carry the value."""
        return -(-self.bits // WORD_BITS)


@dataclass(frozen=True)
class Argument:
    """A parameter of the C++ function: a value or, with a `count`, an array of `count` values.

    `port` is the parameter's name; `elements` are its values in the order of the array.
    """

    port: str
    signal: str
    field: FieldPort
    elements: tuple[Element, ...]

    @property
    def count(self) -> int | None:
        """The number of elements of an array; None for a single value."""
        return len(self.elements) if self.field.field.is_array else None

    @property
    def end(self) -> int:
        """The index of the first 32-bit word that follows the argument."""
        return self.elements[-1].word + self.elements[-1].words


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter that the function must have; `count` is the number of elements of an array.

    The stream of the elements of a string or an array of variable size `may_be_empty`. `side` is the prefix of the
    ports of a stream's message.
    """

    name: str
    cpp_type: str
    count: int | None = None
    is_output: bool
    is_stream: bool = False
    may_be_empty: bool = False
    side: str = ""

    @property
    def declaration(self) -> str:
        """The declaration in C++; an output may be a reference instead of a pointer."""
        if self.is_stream:
            return f"hls::stream<{self.cpp_type}> &{self.name}"
        if self.count:
            return f"{self.cpp_type} {self.name}[{self.count}]"
        return f"{self.cpp_type} {'*' if self.is_output else ''}{self.name}"

    @property
    def mode(self) -> str:
        """The interface mode from which an HLS tool generates the kernel's ports."""
        if self.is_stream:
            return "ap_fifo"
        return "ap_vld" if self.is_output else "ap_none"


def function_name(accelerator: AcceleratorType) -> str:
    """Return the C++ function's name: the name of the first source file without its suffix."""
    return PurePosixPath(accelerator.accelerator.sources[0]).stem


def kernel_entity(accelerator: AcceleratorType) -> str:
    """Return the name of the entity around the function: an IP or, in simulation, a unit that calls the function.

    The wrapper instantiates this entity. The entity cannot have the function's name, because a module in the IP already
    has this name.
    """
    return f"{function_name(accelerator)}_kernel"


def library_name(accelerator: AcceleratorType) -> str:
    """Return the file name of the shared library that the simulation loads from its work folder."""
    return f"lib{function_name(accelerator)}.so"


def arguments(accelerator: AcceleratorType) -> tuple[list[Argument], list[Argument]]:
    """Return the function's inputs and outputs; the accelerator must have passed `check_kernel`."""
    inputs = [(side, field) for side in accelerator.inputs for field in field_ports(side.frame)]
    outputs = [(side, field) for side in accelerator.outputs for field in field_ports(side.frame)]
    # `in_` becomes `x_in`, and `in1_` becomes `x_in1`.
    names = distinct_identifiers([(field.name, side.prefix) for side, field in inputs + outputs], AP_PORTS)
    return _arguments(inputs, names), _arguments(outputs, names[len(inputs) :])


def streams(accelerator: AcceleratorType) -> tuple[list[Channel], list[Channel]]:
    """Return the inputs and outputs of a function with streams; the accelerator must have passed `check_kernel`."""
    return channels(accelerator, _CPP_TYPES, AP_PORTS)


def _arguments(fields: Sequence[tuple[MessageSide, FieldPort]], names: Sequence[str]) -> list[Argument]:
    found: list[Argument] = []
    for (side, field), name in zip(fields, names, strict=False):
        signal = f"{side.prefix}{field.name}"
        found.append(Argument(name, signal, field, _elements(name, signal, field, found[-1].end if found else 0)))
    return found


def _elements(name: str, signal: str, field: FieldPort, word: int) -> tuple[Element, ...]:
    """Return the values of a parameter; element 0 of an array is in the lowest bits of its signal."""
    bits = field.field.type.bits
    if not field.field.is_array:
        return (Element(name, signal, bits, field.width is None, word),)
    words = -(-bits // WORD_BITS)
    return tuple(
        Element(f"{name}_{k}", f"{signal}({(k + 1) * bits - 1} downto {k * bits})", bits, False, word + k * words)
        for k in range(field.field.count)
    )


def prototype(accelerator: AcceleratorType) -> str:
    """Return the required declaration of the function."""
    return f"void {function_name(accelerator)}({', '.join(item.declaration for item in parameters(accelerator))})"


def parameters(accelerator: AcceleratorType) -> list[Parameter]:
    """Return the required parameters of the function; the accelerator must have passed `check_kernel`."""
    if is_streamed(accelerator):
        return [
            Parameter(
                name=item.port,
                cpp_type=item.cpp_type,
                is_output=is_output,
                is_stream=True,
                may_be_empty=item.is_stream,
                side=item.prefix,
            )
            for is_output, items in zip((False, True), streams(accelerator), strict=True)
            for item in items
        ]
    return [
        Parameter(name=item.port, cpp_type=cpp_type(item), count=item.count, is_output=is_output)
        for is_output, items in zip((False, True), arguments(accelerator), strict=True)
        for item in items
    ]


def check_kernel(accelerator: AcceleratorType, faults: Diagnostics) -> None:
    """Note an illegal function name, and messages that a C++ function cannot take."""
    name, sources = accelerator.accelerator.name, accelerator.accelerator.sources
    function = function_name(accelerator)
    if identifier(function) != function:
        hint = "legal here: letters, digits and single '_' between them, except VHDL and Verilog keywords"
        message = f"the function is named after its file, but '{function}' is not a legal name"
        faults.error(message, sources[0].source, hint)
    if not accelerator.inputs or not accelerator.outputs:
        lacking = "output" if accelerator.inputs else "input"
        message = f"'{name}' has the type HLS, which needs at least one input and one output"
        faults.error(message, name.source, f"the accelerator's interface has no '{lacking}'")
    check_streams(accelerator, faults)


def check_streams(accelerator: AcceleratorType, faults: Diagnostics) -> None:
    """Note messages of a function in C++ that streams cannot carry, and further inputs of variable size."""
    interface = accelerator.accelerator.interface
    name = accelerator.accelerator.name
    sides = (*accelerator.inputs, *accelerator.outputs)
    for side, item in zip(sides, (*interface.input, *interface.output), strict=True):
        for problem in stream_problems(side.frame):
            message = f"'{name}' has the type {accelerator.accelerator.type}, which supports only {problem}"
            hint = "write this accelerator in VHDL, or take messages without arrays of messages or strings"
            faults.error(message, item.message.source, hint)
    check_varying(accelerator, faults)


def check_varying(accelerator: AcceleratorType, faults: Diagnostics) -> None:
    """Note inputs of variable size of a function, except for one."""
    name, type_ = accelerator.accelerator.name, accelerator.accelerator.type
    varying = [number for number, side in enumerate(accelerator.inputs) if not side.frame.is_fixed_size]
    for number in varying[1:]:
        message = f"'{name}' has the type {type_}, which supports only one input of variable size"
        place = accelerator.accelerator.interface.input[number].message.source
        faults.error(message, place, "write this accelerator in VHDL")


def cpp_type(argument: Argument) -> str:
    """Return the C++ type of an argument."""
    return _CPP_TYPES[argument.field.field.type.name]
