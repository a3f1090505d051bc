"""Derived System -> template configuration: the entity around an accelerator for a part of a message."""

from __future__ import annotations

from fusesoc_firm.converter.message_ports import segment_count
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.segments import segments_of
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.system.derived.bypass import part_segments, whole_ports
from fusesoc_firm.system.derived.model import AcceleratorType, MessageSide
from fusesoc_firm.system.derived.sides import SidePort, side_ports
from fusesoc_firm.system.hardware.instances import component, declarations
from fusesoc_firm.text.render import Context

BYPASS_TEMPLATE = "vhdl/bypass.vhd"
_HANDSHAKE = ("segment_valid", "msg_valid", "msg_ready")


def bypass_configuration(type_: AcceleratorType) -> Context:
    """Return the configuration of `BYPASS_TEMPLATE`."""
    assert type_.inner
    (source,), (sink,) = type_.inputs, type_.outputs
    (part_in,), (part_out,) = type_.inner.inputs, type_.inner.outputs
    segments = segment_count(source.frame)
    last = max(part_segments(source.frame, part_in.frame))
    first = min(part_segments(sink.frame, part_out.frame))
    return {
        "entity": type_.entity,
        "inner": type_.inner.entity,
        "message": str(source.frame.message),
        "components": [component(type_.inner)] if type_.inner.is_component else [],
        "is_component": type_.inner.is_component,
        "has_width": type_.inner.has_width,
        "width": type_.width,
        "ports": [*declarations(type_), *_pins(type_)],
        "pins": [pin["name"] for pin in _pins(type_)],
        "is_fixed": source.frame.is_fixed_size,
        "waits_for_end": last == segments - 1 and not _is_followed(source, last),
        "last": last,
        "segments": [{"number": k, "is_own": k >= first} for k in range(segments)],
        "fields": [
            {"port": port.name, "whole": whole_ports(source)[port.field.path], "type": vhdl_type(port.width)}
            for port in field_ports(part_in.frame)
        ],
        "results": [
            {"port": port.name, "whole": whole_ports(sink)[port.field.path]} for port in field_ports(part_out.frame)
        ],
        "passed": _passed(type_, sink, part_out),
    }


def _is_followed(source: MessageSide, segment: int) -> bool:
    """Whether a string or an array follows a segment.

    The part passes only after the response, so the accelerator cannot wait for a complete and correct message.
    """
    return not source.frame.is_fixed_size and segment in segments_of(source.frame).parts.values()


def _pins(type_: AcceleratorType) -> list[Context]:
    """Return the ports of pins and parameters."""
    ports = [(str(pin.name), str(pin.direction), pin.bits) for pin in type_.accelerator.pins]
    ports += [(type_.parameter_port(item), "in", item.port_bits) for item in type_.parameters]
    return [
        {"name": name, "direction": direction, "type": vhdl_type(bits), "comment": ""}
        for name, direction, bits in ports
    ]


def _passed(type_: AcceleratorType, sink: MessageSide, part: MessageSide) -> list[Context]:
    """Return the wires of all ports except the message's handshakes and the accelerator's results."""
    own = {whole_ports(sink)[port.field.path] for port in field_ports(part.frame)}
    ports = side_ports(sink.frame, type_.width, gives=True, has_valid=False)
    return [_wire(port) for port in ports if port.name not in own and port.name not in _HANDSHAKE]


def _wire(port: SidePort) -> Context:
    names = (f"out_{port.name}", f"in_{port.name}")
    sink, source = names if port.is_output else reversed(names)
    return {"sink": sink, "source": source}
