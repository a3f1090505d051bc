"""A first version of a C++ function with streams: it copies the parts that its messages share.

A function that passes on a whole message copies each part as soon as it arrives. Any other function stores its input,
since an output begins with all its lengths.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusesoc_firm.system.derived.cpp_function import function_name, streams
from fusesoc_firm.system.derived.cpp_stream import Channel
from fusesoc_firm.system.derived.model import AcceleratorType, LengthSource
from fusesoc_firm.system.scaffold.pass_through import passes_whole, wires_of
from fusesoc_firm.text.render import Context

STREAM_TEMPLATE = "hls/stream_skeleton.cpp"


def stream_function(type_: AcceleratorType) -> Context:
    """Return the configuration of `STREAM_TEMPLATE`."""
    inputs, outputs = streams(type_)
    ports = {item.signal: item for item in inputs}
    copied = {name: source for wires in wires_of(type_) for name, source in wires.ports.items()}
    sources = {
        item.port: ports[copied[name].removesuffix("_tdata")]
        for item in outputs
        if (name := f"{item.signal}_tdata" if item.is_stream else item.signal) in copied
    }
    passes = _passes(type_)
    return {
        "function": function_name(type_),
        "parameters": [_part(item) for item in inputs + outputs],
        "is_stored": not passes and any(item.is_stream for item in inputs),
        "passes": [_part(item) | {"source": sources[item.port].port} for item in outputs] if passes else [],
        "inputs": [] if passes else [_part(item) for item in inputs],
        "outputs": [] if passes else [_result(item, sources) for item in outputs if not item.is_stream],
        "streams": [] if passes else _streams(outputs, sources),
    }


def _passes(type_: AcceleratorType) -> bool:
    """Whether the function passes on its only input: the whole message, with its length."""
    if len(type_.inputs) != 1 or len(type_.outputs) != 1:
        return False
    (side,), (output,) = type_.inputs, type_.outputs
    is_given = output.length is not None and output.length.source is LengthSource.GIVEN
    return is_given and passes_whole(side, output)


def _part(item: Channel) -> Context:
    is_plain = not item.is_stream and not item.is_length
    return {
        "port": item.port,
        "cpp_type": item.cpp_type,
        "is_value": is_plain and item.count == 1,
        "is_array": is_plain and item.count > 1,
        "is_length": item.is_length,
        "is_stream": item.is_stream,
        "count": item.count,
        "length": item.length,
    }


def _result(item: Channel, sources: Mapping[str, Channel]) -> Context:
    source = sources.get(item.port)
    element = "[k]" if item.count > 1 else ""
    return {**_part(item), "value": f"{source.port}_value{element}" if source else "0"}


def _streams(outputs: Sequence[Channel], sources: Mapping[str, Channel]) -> list[Context]:
    """Return the strings and arrays that are copied; the others are empty."""
    copied = [(item, sources[item.port]) for item in outputs if item.is_stream and item.port in sources]
    return [{"port": item.port, "source": source.port, "length": source.length} for item, source in copied]
