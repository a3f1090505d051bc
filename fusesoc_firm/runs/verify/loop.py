"""Write the test bench of a Frame: both converters in a loop, with a gate in every handshake between them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.message_ports import MessagePort, message_ports, segment_count
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.text.render import render

ENTITY = "firm_verify_loop"
SUBSCRIBER_ID = 1
PUBLISHER_ID = 2

_TEMPLATE = "verify/loop.vhd"
# The number of cycles without a beat after which the host gives up, and during which it waits for surplus frames.
_WATCHDOG = 5000
_QUIET = 100


@dataclass(frozen=True)
class Gate:
    """A handshake that passes a gate.

    `valid` comes from the source and `ready` from the sink; `assignments` connect both to the other side.
    """

    name: str
    valid: str
    ready: str
    assignments: tuple[tuple[str, str], ...]


def loop_text(frame: Frame, width: int) -> str:
    """Return the bench of a message's converters: entity `ENTITY` with the generics `SEED` and `STALL_PERCENT`."""
    ports = message_ports(frame, width)
    found = gates(ports, segment_count(frame), has_msg_valid=not frame.is_fixed_size)
    # The fields of a fixed-size message form a single segment.
    fields = ports if frame.is_fixed_size else ()
    names = {port.name for port in ports}
    apart = {name for port in ports if port.is_reverse for name in _gated_names(port, names)}
    apart |= {port.name for port in fields}
    streams = [port.name.removesuffix("_axis_tready") for port in ports if _is_stream(port)]
    return render(
        _TEMPLATE,
        {
            "message": str(frame.message),
            "middleware": frame.ros.title,
            "entity": ENTITY,
            "width": width,
            "subscriber": SUBSCRIBER_ID,
            "publisher": PUBLISHER_ID,
            "select_bits": PUBLISHER_ID.bit_length(),
            "watchdog": _WATCHDOG,
            "quiet": _QUIET,
            "subscriber_entity": subscriber_entity(frame),
            "publisher_entity": publisher_entity(frame),
            "has_publisher_errors": not frame.is_fixed_size,
            "gate_count": len(found),
            "gates": [_gate(number, gate) for number, gate in enumerate(found)],
            "ports": [{"name": port.name, "type": port.vhdl_type, "is_apart": port.name in apart} for port in ports],
            "segments": segment_count(frame),
            "fields": [{"name": port.name, "is_bit": port.width is None} for port in fields],
            "streams": [{"name": name} for name in streams],
        },
    )


def gates(ports: Sequence[MessagePort], segments: int, *, has_msg_valid: bool) -> list[Gate]:
    """Return the gates of a message side: for each segment, stream, element, element's segment, and the message.

    A handshake is identified by its `ready`, the only kind of port with the opposite direction.
    """
    by_name = {port.name: port for port in ports}
    found: list[Gate] = []
    for number in range(segments):
        found.append(_segment_gate("", number, "msg_ready", len(found)))
    for port in ports:
        if _is_stream(port):
            name = port.name.removesuffix("_tready")
            found.append(_gate_of(f"{name}_tvalid", port.name, f"sub_{name}_tvalid", "", len(found)))
        elif port.is_reverse:
            found += _element_gates(port.name.removesuffix("_ready"), by_name, len(found))
    if has_msg_valid:
        found.append(_message_gate(segments, len(found)))
    return found


def _is_stream(port: MessagePort) -> bool:
    return port.is_reverse and port.name.endswith("_axis_tready")


def _element_gates(name: str, ports: dict[str, MessagePort], first: int) -> list[Gate]:
    """Return the gates of an array's elements. An element is valid when all its segments are valid."""
    own = ports.get(f"{name}_segment_valid")
    count = own.width if own and own.width else 0
    taken = f"pub_{name}_valid and pub_{name}_ready"
    segments = [_segment_gate(f"{name}_", number, taken, first + number) for number in range(count)]
    shown = "".join(f" and pub_{name}_segment_valid({number})" for number in range(count))
    element = _gate_of(f"{name}_valid", f"{name}_ready", f"sub_{name}_valid{shown}", shown, first + count)
    return [*segments, element]


def _message_gate(segments: int, gate: int) -> Gate:
    """Return the gate of a message, which is valid when all its segments are valid."""
    shown = " and ".join(["sub_msg_valid", *(f"pub_segment_valid({number})" for number in range(segments))])
    return Gate("msg_valid", shown, "msg_ready", (("pub_msg_valid", f"{shown} and is_open({gate})"),))


def _segment_gate(prefix: str, number: int, taken: str, gate: int) -> Gate:
    segment = f"{prefix}segment_valid({number})"
    return Gate(segment, f"sub_{segment}", taken, ((f"pub_{segment}", f"sub_{segment} and is_open({gate})"),))


def _gate_of(valid: str, ready: str, offered: str, shown: str, gate: int) -> Gate:
    return Gate(
        valid,
        offered,
        f"pub_{ready}",
        (
            (f"pub_{valid}", f"{offered} and is_open({gate})"),
            (f"sub_{ready}", f"pub_{ready}{shown} and is_open({gate})"),
        ),
    )


def _gated_names(ready: MessagePort, names: Container[str]) -> Iterator[str]:
    yield ready.name
    if _is_stream(ready):
        yield f"{ready.name.removesuffix('ready')}valid"
        return
    name = ready.name.removesuffix("_ready")
    yield f"{name}_valid"
    if f"{name}_segment_valid" in names:
        yield f"{name}_segment_valid"


def _gate(number: int, gate: Gate) -> dict[str, object]:
    return {
        "number": number,
        "name": gate.name,
        "valid": gate.valid,
        "ready": gate.ready,
        "assignments": [{"target": target, "value": value} for target, value in gate.assignments],
    }
