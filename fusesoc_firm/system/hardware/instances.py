"""The instances of the top level: converters with their buffers, and accelerators."""

from __future__ import annotations

from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    AcceleratorType,
    Converter,
    DerivedSystem,
    Overflow,
    Queue,
)
from fusesoc_firm.system.derived.sides import accelerator_ports, side_ports
from fusesoc_firm.system.hardware.crossings import port_of
from fusesoc_firm.system.hardware.maps import port_map
from fusesoc_firm.system.hardware.names import (
    ERROR_WORDS,
    FRAME_WORDS,
    LATE_WORDS,
    Names,
    publishers_with_watchdog,
    queue_word,
    reset_of,
)
from fusesoc_firm.system.written.specification import Pin

ERROR_CODE_BITS = 4
# The prefix of internal signals that replace ports of the top level if the status reads or changes them.
INNER = "inner_"


def subscriber_instance(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the instance of a subscriber, with its queue or watchdog between the Manager and the subscriber."""
    ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
    return {
        **_instance(names, converter.block, subscriber_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": converter.id,
        "max_length": converter.max_length,
        "ports": port_map((port.name, names.port(converter.block, port.name)) for port in ports),
        "error": error_of(converter, system),
        "queue": _queue(names, converter, system) if converter.queue else None,
    }


def _queue(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the queue or the watchdog before a subscriber, with the signals between it and the subscriber."""
    assert converter.queue
    block, lanes, queue = converter.block, system.width // 8, converter.queue
    return {
        "block": block,
        "unit": queue_word(queue),
        "label": names.label(block, queue_word(queue)),
        "width": system.width,
        "lanes": lanes,
        "watchdog": {"limit": queue.limit} if queue.limit else None,
        "memory": None if queue.limit else _memory(queue, lanes),
        **{word: names.frame(block, word) for word in FRAME_WORDS},
        "id": converter.id,
        "out": error_of(converter, system),
    }


def _memory(queue: Queue, lanes: int) -> dict[str, Any]:
    """Return the size of a queue; one beat more than the longest frame detects a longer frame."""
    beats = -(-(ID_BYTES + LENGTH_BYTES + queue.longest) // lanes)
    return {
        "frames": queue.frames,
        # The Manager removes a beat that contains only the id.
        "beats": beats + (0 if lanes == ID_BYTES else 1),
        "drop": None if queue.overflow is Overflow.BLOCK else {"generic": queue.overflow.value.upper()},
    }


def publisher_instance(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the instance of a publisher, followed by its buffer if it stores whole frames."""
    ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
    has_watchdog = converter in publishers_with_watchdog(system)
    return {
        **_instance(names, converter.block, publisher_entity(converter.frame, converter.suffix)),
        "message": str(converter.frame.message),
        "id": converter.id,
        "id_byte": converter.id % 256,
        "beats": _beats(names, converter, system),
        "late": _late(names, converter, system) if converter.late_bytes else None,
        "max_length": {"bytes": converter.max_length} if converter.max_length else None,
        "ports": port_map((port.name, names.port(converter.block, port.name)) for port in ports),
        "error": error_of(converter, system) if converter.may_pause and not has_watchdog else None,
        "own_error": _own_error(names, converter, system) if has_watchdog else None,
        "buffer": _buffer(names, converter, system) if converter.buffer else None,
    }


def _own_error(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the signals of a publisher's own errors, without the errors that the watchdog detects."""
    return {
        "block": converter.block,
        **{word: names.frame(converter.block, word) for word in ERROR_WORDS},
        "place": system.places[converter.id],
        "out": error_of(converter, system),
    }


def _beats(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the sink signals for a publisher's frames: the FIFO for late frames if present, else the Manager."""
    if not converter.late_bytes:
        return _manager_beats(converter, system)
    return {**{word: names.late(converter.block, word) for word in LATE_WORDS}, "place": 0, "slice": None}


def _manager_beats(converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the part of the Manager's inputs that receives a publisher's frames."""
    place, width = system.places[converter.id], system.width
    lanes = width // 8
    part = {
        "place": place,
        "data_high": width * (place + 1) - 1,
        "data_low": width * place,
        "keep_high": lanes * (place + 1) - 1,
        "keep_low": lanes * place,
    }
    return {**{word: f"pub_axis_{word}" for word in LATE_WORDS}, "place": place, "slice": part}


def _late(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the FIFO between a publisher and the Manager for late frames."""
    block, lanes = converter.block, system.width // 8
    return {
        "block": block,
        "label": names.label(block, "late"),
        "bytes": converter.late_bytes,
        "width": system.width,
        "lanes": lanes,
        "depth": max(2, -(-converter.late_bytes // lanes)),
        **{word: names.late(block, word) for word in LATE_WORDS},
        "beats": _manager_beats(converter, system),
    }


def error_of(converter: Converter, system: DerivedSystem) -> dict[str, int | str]:
    """Return the slice of the system's error outputs that reports a converter's errors."""
    bit = system.error_blocks.index(converter.block)
    scope = INNER if system.status else ""
    return {"scope": scope, "bit": bit, "high": ERROR_CODE_BITS * (bit + 1) - 1, "low": ERROR_CODE_BITS * bit}


def _buffer(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the buffer after a publisher, with the signals between publisher and buffer."""
    block, lanes = converter.block, system.width // 8
    return {
        "block": block,
        "label": names.label(block, "buffer"),
        "width": system.width,
        "lanes": lanes,
        "depth": max(2, -(-(ID_BYTES + LENGTH_BYTES + converter.buffer) // lanes)),
        **{word: names.frame(block, word) for word in FRAME_WORDS},
        "beats": _beats(names, converter, system),
        "out": error_of(converter, system),
    }


def accelerator_instance(names: Names, block: AcceleratorBlock, system: DerivedSystem) -> dict[str, Any]:
    """Return the instance of an accelerator, with its message sides and pins."""
    clock = system.clock_of(block.block)
    differences = [clock.port] if clock else []
    differences += [f"{block.type.width} bits"] if block.type.width != system.width else []
    sides = [f"{prefix}{port.name}" for prefix, port in accelerator_ports(block.type)]
    ports = [(formal, names.port(block.block, formal)) for formal in sides]
    for pin in block.type.accelerator.pins:
        signal = names.synced if pin.is_synchronised else names.port
        ports.append((str(pin.name), signal(block.block, pin.name)))
    return {
        **_instance(names, block.block, block.type.entity),
        "is_component": block.type.is_component,
        "has_width": block.type.has_width,
        "width": block.type.width,
        "differences": ", ".join(differences),
        "clock": port_of(clock),
        "reset": reset_of(clock),
        "ports": port_map(ports),
    }


def pin_synchroniser(names: Names, block: AcceleratorBlock, pin: Pin, system: DerivedSystem) -> dict[str, Any]:
    """Return the synchroniser of an input pin, in the clock of its block."""
    return {
        "label": names.label(block.block, pin.name, "sync"),
        "bits": pin.bits,
        "type": vhdl_type(pin.bits),
        "clock": port_of(system.clock_of(block.block)),
        "pin": names.port(block.block, pin.name),
        "synced": names.synced(block.block, pin.name),
    }


def component(type_: AcceleratorType) -> dict[str, Any]:
    """Return the component declaration of an accelerator that is not an entity."""
    ports = [(f"{prefix}{port.name}", port.is_output, port.width) for prefix, port in accelerator_ports(type_)]
    ports += [(str(pin.name), pin.direction == "out", pin.bits) for pin in type_.accelerator.pins]
    return {
        "entity": type_.entity,
        "has_width": type_.has_width,
        "ports": [
            {"name": name, "direction": "out" if is_output else "in", "type": vhdl_type(bits)}
            for name, is_output, bits in ports
        ],
    }


def declarations(accelerator: AcceleratorType) -> list[dict[str, Any]]:
    """Return the declarations of the ports of an accelerator's message sides."""
    return [
        {
            "name": f"{prefix}{port.name}",
            "direction": "out" if port.is_output else "in",
            "type": vhdl_type(port.width),
            "comment": port.comment,
        }
        for prefix, port in accelerator_ports(accelerator)
    ]


def _instance(names: Names, block: str, entity: str) -> dict[str, Any]:
    return {"block": block, "label": names.label(block), "entity": entity}
