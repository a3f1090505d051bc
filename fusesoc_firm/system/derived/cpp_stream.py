"""Accelerators written as C++ functions whose messages have variable size: each parameter is an `hls::stream`.

The lengths and later fields of such a message become valid one after the other. The function therefore reads all fields
in wire order, as from FIFOs, and writes its results in the same way. A field of fixed size is a stream of one value, or
of its array's elements. A string or an array is a stream of its elements, with a stream of one value for its length.

The kernel has the ports that HLS tools generate for `mode=ap_fifo`: `<name>_dout`, `<name>_empty_n` and `<name>_read`
for an input, `<name>_din`, `<name>_full_n` and `<name>_write` for an output.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from fusesoc_firm.converter.message_ports import LENGTH_BITS, ElementPorts, StreamPorts, message_side
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.frame.model import DataKind, Frame, Loop, all_nodes
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource, MessageSide
from fusesoc_firm.system.derived.sides import PAYLOAD_LENGTH
from fusesoc_firm.text.naming import distinct_identifiers

_LENGTH_TYPE = "std::uint32_t"
_TEXT_TYPES = {DataKind.STRING: "char", DataKind.WSTRING: "std::uint32_t"}


@dataclass(frozen=True)
class Channel:
    """A parameter `hls::stream<cpp_type>` of a C++ function, with elements of `bits` bits.

    `port` is the parameter's name. A value is connected to the accelerator's `signal`, a `std_logic` if `is_bit`, and
    has `count` elements. A string or an array is connected to the AXI-Stream whose signals begin with `signal`, and its
    number of elements is the value of the channel `length`. The accelerator's `segment` contains the value or length.
    """

    port: str
    name: str
    prefix: str
    signal: str
    cpp_type: str
    bits: int
    segment: int
    count: int = 1
    is_bit: bool = False
    is_length: bool = False
    length: str = ""

    @property
    def is_stream(self) -> bool:
        """Whether the channel carries a string or an array of variable size."""
        return bool(self.length)


def is_streamed(accelerator: AcceleratorType) -> bool:
    """Whether the function has streams, since one of its messages has a variable size."""
    return any(not side.frame.is_fixed_size for side in (*accelerator.inputs, *accelerator.outputs))


def channels(
    accelerator: AcceleratorType, types: dict[str, str], reserved: tuple[str, ...]
) -> tuple[list[Channel], list[Channel]]:
    """Return the function's inputs and outputs in wire order; `types` are the C++ types of numbers.

    The accelerator must have passed `stream_problems`.
    """
    is_given = any(side.length and side.length.source is LengthSource.GIVEN for side in accelerator.outputs)
    inputs = [item for side in accelerator.inputs for item in _channels(side, types, has_length=is_given)]
    outputs = [
        item
        for side in accelerator.outputs
        for item in _channels(
            side, types, has_length=side.length is not None and side.length.source is LengthSource.GIVEN
        )
    ]
    # `in_` becomes `x_in`, and `in1_` becomes `x_in1`.
    names = distinct_identifiers([(item.name, item.prefix) for item in inputs + outputs], reserved)
    named = _with_names(inputs + outputs, names)
    return named[: len(inputs)], named[len(inputs) :]


def _with_names(found: list[Channel], names: list[str]) -> list[Channel]:
    """Return the channels with their parameters' names; `length` becomes the name of the length's parameter."""
    by_signal = {item.prefix + item.name: name for item, name in zip(found, names, strict=True)}
    return [
        replace(item, port=name, length=by_signal[item.length] if item.length else "")
        for item, name in zip(found, names, strict=True)
    ]


def _channels(side: MessageSide, types: dict[str, str], *, has_length: bool) -> Iterator[Channel]:
    if side.frame.is_fixed_size:
        yield from (_value(side, port, 0, types) for port in field_ports(side.frame))
        return
    if has_length:
        yield _length(side, PAYLOAD_LENGTH, 0)
    segments = segments_of(side.frame)
    for part in message_side(side.frame).parts:
        match part:
            case FieldPort():
                yield _value(side, part, segments.fields[part.field.path], types)
            case StreamPorts():
                segment = segments.parts[part.part.path]
                yield _length(side, part.length, segment)
                yield _elements(side, part, segment, types)
            case ElementPorts():
                raise AssertionError("the accelerator has passed stream_problems")


def _value(side: MessageSide, port: FieldPort, segment: int, types: dict[str, str]) -> Channel:
    element = port.field.type
    count = port.field.count if port.field.is_array else 1
    signal = side.prefix + port.name
    is_bit = port.width is None
    return Channel("", port.name, side.prefix, signal, types[element.name], element.bits, segment, count, is_bit)


def _length(side: MessageSide, name: str, segment: int) -> Channel:
    return Channel("", name, side.prefix, side.prefix + name, _LENGTH_TYPE, LENGTH_BITS, segment, is_length=True)


def _elements(side: MessageSide, ports: StreamPorts, segment: int, types: dict[str, str]) -> Channel:
    element = ports.part.element
    # A bool of an array is a byte.
    name = "uint8" if element.name == "bool" else element.name
    cpp_type = _TEXT_TYPES.get(ports.part.kind) or types[name]
    signal = f"{side.prefix}{ports.name}_axis"
    length = side.prefix + ports.length
    return Channel("", ports.name, side.prefix, signal, cpp_type, 8 * element.size, segment, length=length)


def stream_problems(frame: Frame) -> list[str]:
    """Return the parts of a message of variable size that streams cannot carry."""
    return [
        f"strings and arrays of numbers, but '{dotted(node.names)}' has the type '{node.ros_type}'"
        for node in all_nodes(frame.nodes)
        if isinstance(node, Loop) and node.is_used
    ]
