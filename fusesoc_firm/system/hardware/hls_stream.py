"""Derived System -> template configuration: the wrapper and the kernel of a C++ function with streams."""

from __future__ import annotations

from collections.abc import Sequence

from fusesoc_firm.converter.message_ports import segment_count
from fusesoc_firm.system.derived.cpp_function import AP_PORTS, WORD_BITS, streams
from fusesoc_firm.system.derived.cpp_stream import Channel
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource, MessageSide
from fusesoc_firm.system.hardware.hls_names import named
from fusesoc_firm.system.hardware.instances import declarations
from fusesoc_firm.text.render import Context, Rendering

_WRAPPER_TEMPLATE = "vhdl/hls_stream_wrapper.vhd"
_KERNEL_TEMPLATE = "vhdl/hls_stream_kernel.vhd"
_SHIM_TEMPLATE = "hls/stream_kernel.cpp"


def stream_wrapper(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the wrapper, which adds an accelerator's message sides to the kernel."""
    inputs, outputs = streams(accelerator)
    return Rendering(
        _WRAPPER_TEMPLATE,
        {
            **named(accelerator),
            "width": accelerator.width,
            "message_ports": declarations(accelerator),
            "input_sides": [side.prefix for side in accelerator.inputs],
            "output_sides": [
                _output_side(number, side, [item for item in outputs if item.prefix == side.prefix])
                for number, side in enumerate(accelerator.outputs)
            ],
            "output_count": len(accelerator.outputs),
            "inputs": [_connected(item) for item in inputs],
            "outputs": [_connected(item) for item in outputs],
            "values_in": [_connected(item) for item in inputs if not item.is_stream],
            "streams_in": [_connected(item) for item in inputs if item.is_stream],
            "values_out": [_connected(item) for item in outputs if not item.is_stream],
            "streams_out": [_connected(item) for item in outputs if item.is_stream],
        },
    )


def _connected(item: Channel) -> Context:
    """Return a channel between the kernel and the accelerator's ports."""
    return {
        "port": item.port,
        "signal": item.signal,
        "prefix": item.prefix,
        "segment": item.segment,
        "bits": item.bits,
        "count": item.count,
        "all_bits": item.bits * item.count,
        "lanes": item.bits // 8,
        "is_bit": item.is_bit,
        "length": item.length,
    }


def _output_side(number: int, side: MessageSide, outputs: Sequence[Channel]) -> Context:
    """Return an output's handshake: each segment waits for its values and for the previous segments."""
    is_computed = side.length is not None and side.length.source is LengthSource.COMPUTED
    places = {
        # A length is computed from the lengths of all parts, before the first segment.
        item.port: 0 if item.is_length and is_computed else item.segment
        for item in outputs
        if not item.is_stream
    }
    return {
        "prefix": side.prefix,
        "number": number,
        "is_fixed": side.frame.is_fixed_size,
        "segments": [
            {
                "number": segment,
                "waits": [port for port, place in places.items() if place == segment],
                "after": [segment - 1] if segment else [],
            }
            for segment in range(segment_count(side.frame))
        ],
        "last": segment_count(side.frame) - 1,
    }


def stream_kernel(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the simulated kernel."""
    return Rendering(_KERNEL_TEMPLATE, _simulated(accelerator))


def stream_shim(accelerator: AcceleratorType) -> Rendering:
    """Return the template and configuration of the C++ between the simulated kernel and the function."""
    return Rendering(_SHIM_TEMPLATE, _simulated(accelerator))


def _simulated(accelerator: AcceleratorType) -> Context:
    inputs, outputs = streams(accelerator)
    return {
        **named(accelerator),
        **{name: name for name in AP_PORTS},
        "inputs": [_channel(number, item) for number, item in enumerate(inputs)],
        "outputs": [_channel(number, item) for number, item in enumerate(outputs)],
        "parameters": [item.port for item in inputs + outputs],
    }


def _channel(number: int, item: Channel) -> Context:
    """Return a channel between the simulated kernel and the function; an element has words of 32 bits."""
    return {
        "port": item.port,
        "number": number,
        "cpp_type": item.cpp_type,
        "bits": item.bits,
        "words": [
            {
                "index": word,
                "high": min(item.bits, WORD_BITS * (word + 1)) - 1,
                "low": WORD_BITS * word,
                "bits": min(item.bits - WORD_BITS * word, WORD_BITS),
            }
            for word in range(-(-item.bits // WORD_BITS))
        ],
    }
