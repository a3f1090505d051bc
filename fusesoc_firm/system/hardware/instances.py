"""The instances of the top level: converters with their buffers, and accelerators."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.vhdl import bit, bits, vhdl_type
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
from fusesoc_firm.system.hardware.maps import instance
from fusesoc_firm.system.hardware.names import (
    ERROR_WORDS,
    OWN_RESET,
    STREAM,
    Names,
    publishers_with_watchdog,
    queue_word,
    reset_of,
)
from fusesoc_firm.system.written.specification import Pin

ERROR_CODE_BITS = 4
_CLOCK = (("clk", "clk"), ("rst_n", OWN_RESET))
# The prefix of internal signals that replace ports of the top level if the status reads or changes them.
INNER = "inner_"


def subscriber_instances(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return a subscriber, with its queue or watchdog between the Manager and the subscriber."""
    block, queue = converter.block, converter.queue
    source = _frame_signals(names.frame, block) if queue else _from_manager(converter.id)
    ports = side_ports(converter.frame, system.width, gives=True, has_valid=True)
    return {
        **_head(converter),
        "instance": instance(
            names.label(block),
            f"entity work.{subscriber_entity(converter.frame, converter.suffix)}",
            [
                *_CLOCK,
                *_stream("s", "", source),
                *((port.name, names.port(block, port.name)) for port in ports),
                *(_own_errors(names, block) if queue else _system_errors(converter, system)),
            ],
            [("MAX_LENGTH", converter.max_length)] if converter.max_length else (),
        ),
        "queue": _queue(names, converter, queue, system) if queue else None,
    }


def _queue(names: Names, converter: Converter, queue: Queue, system: DerivedSystem) -> dict[str, Any]:
    """Return the queue or the watchdog before a subscriber, with the signals between it and the subscriber."""
    block, word = converter.block, queue_word(queue)
    entity, generics = "firm_axis_queue", _memory(queue, system)
    if queue.limit:
        entity, generics = "firm_axis_sink_watchdog", [("WIDTH", system.width), ("LIMIT", queue.limit)]
    return {
        **_frame(names, block, system),
        "unit": word,
        "instance": instance(
            names.label(block, word),
            f"entity firm.{entity}",
            [
                *_CLOCK,
                *_stream("s", "", _from_manager(converter.id)),
                *_stream("m", "", _frame_signals(names.frame, block)),
                *_own_errors(names, block, "s_"),
                *_system_errors(converter, system),
            ],
            generics,
        ),
    }


def _memory(queue: Queue, system: DerivedSystem) -> list[tuple[str, object]]:
    """Return the size of a queue; one beat more than the longest frame detects a longer frame."""
    lanes = system.width // 8
    beats = -(-(ID_BYTES + LENGTH_BYTES + queue.longest) // lanes)
    drop = [] if queue.overflow is Overflow.BLOCK else [(queue.overflow.value.upper(), "true")]
    # The Manager removes a beat that contains only the id.
    further = 0 if lanes == ID_BYTES else 1
    return [("WIDTH", system.width), ("FRAMES", queue.frames), *drop, ("BEATS", beats + further)]


def publisher_instances(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return a publisher, followed by its buffer if it stores whole frames, and by its FIFO for late frames."""
    block = converter.block
    has_watchdog = converter in publishers_with_watchdog(system)
    ports = side_ports(converter.frame, system.width, gives=False, has_valid=False)
    sink = _late_input(names, block) if converter.late_bytes else _to_manager(converter, system)
    frame, errors = _stream("m", "(0)", sink), []
    if converter.buffer:
        frame, errors = _stream("m", "", _frame_signals(names.frame, block)), _own_errors(names, block)
    elif has_watchdog:
        errors = _own_errors(names, block)
    elif converter.may_pause:
        errors = _system_errors(converter, system)
    return {
        **_head(converter),
        "instance": instance(
            names.label(block),
            f"entity work.{publisher_entity(converter.frame, converter.suffix)}",
            [*_CLOCK, *((port.name, names.port(block, port.name)) for port in ports), *frame, *errors],
            [
                *([("MAX_LENGTH", converter.max_length)] if converter.max_length else ()),
                ("ID", converter.id % 256),
            ],
        ),
        "own_error": _own_error(names, converter, system) if has_watchdog else None,
        "buffer": _buffer(names, converter, sink, system) if converter.buffer else None,
        "late": _late(names, converter, system) if converter.late_bytes else None,
    }


def _own_error(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the signals of a publisher's own errors, without the errors that the watchdog detects."""
    return {
        "block": converter.block,
        **{word: names.frame(converter.block, word) for word in ERROR_WORDS},
        "place": system.places[converter.id],
        "out": error_of(converter, system),
    }


def _buffer(names: Names, converter: Converter, sink: Sequence[str], system: DerivedSystem) -> dict[str, Any]:
    """Return the buffer after a publisher, with the signals between publisher and buffer."""
    block, width = converter.block, system.width
    depth = max(2, -(-(ID_BYTES + LENGTH_BYTES + converter.buffer) // (width // 8)))
    return {
        **_frame(names, block, system),
        "instance": instance(
            names.label(block, "buffer"),
            "entity firm.firm_axis_length_buffer",
            [
                *_CLOCK,
                *_stream("s", "", _frame_signals(names.frame, block)),
                *_stream("m", "(0)", sink),
                *_own_errors(names, block, "s_"),
                *_system_errors(converter, system),
            ],
            [("WIDTH", width), ("DEPTH", depth)],
        ),
    }


def _late(names: Names, converter: Converter, system: DerivedSystem) -> dict[str, Any]:
    """Return the FIFO between a publisher and the Manager for late frames."""
    block, width = converter.block, system.width
    signals = _frame_signals(names.late, block)
    return {
        "block": block,
        "bytes": converter.late_bytes,
        **_widths(system),
        **dict(zip(STREAM, signals, strict=True)),
        "instance": instance(
            names.label(block, "late"),
            "entity firm.firm_axis_fifo",
            [*_CLOCK, *_stream("s", "", signals), *_stream("m", "(0)", _to_manager(converter, system))],
            [("WIDTH", width), ("DEPTH", max(2, -(-converter.late_bytes // (width // 8))))],
        ),
    }


def _head(converter: Converter) -> dict[str, Any]:
    return {"block": converter.block, "message": str(converter.frame.message), "id": converter.id}


def _frame(names: Names, block: str, system: DerivedSystem) -> dict[str, Any]:
    """Return the signals between a converter and its queue, watchdog or buffer."""
    return {"block": block, **_widths(system), **{word: names.frame(block, word) for word in (*STREAM, *ERROR_WORDS)}}


def _widths(system: DerivedSystem) -> dict[str, int]:
    return {"width": system.width, "lanes": system.width // 8}


def _stream(side: str, index: str, signals: Iterable[str]) -> list[tuple[str, str]]:
    """Return the map of an AXI4-Stream port; `index` is "(0)" if the signal for tuser is a single bit."""
    formals = (f"{side}_axis_{word}{index if word == 'tuser' else ''}" for word in STREAM)
    return list(zip(formals, signals, strict=True))


def _frame_signals(name: Callable[[str, str], str], block: str) -> list[str]:
    return [name(block, word) for word in STREAM]


def _late_input(names: Names, block: str) -> list[str]:
    return [f"{names.late(block, word)}{'(0)' if word == 'tuser' else ''}" for word in STREAM]


def _from_manager(number: int) -> list[str]:
    """Return the outputs of the Manager to a subscriber; all subscribers see the same beat."""
    signals = {word: f"sub_axis_{word}" for word in STREAM}
    return [*(signals | {word: bit(signals[word], number) for word in ("tvalid", "tready")}).values()]


def _to_manager(converter: Converter, system: DerivedSystem) -> list[str]:
    """Return the part of the Manager's inputs that receives a publisher's frames."""
    place, widths = system.places[converter.id], {"tdata": system.width, "tkeep": system.width // 8}
    return [
        bits(f"pub_axis_{word}", width * (place + 1) - 1, width * place)
        if (width := widths.get(word))
        else bit(f"pub_axis_{word}", place)
        for word in STREAM
    ]


def _own_errors(names: Names, block: str, side: str = "") -> list[tuple[str, str]]:
    return [(f"{side}frame_{word}", names.frame(block, word)) for word in ERROR_WORDS]


def _system_errors(converter: Converter, system: DerivedSystem) -> list[tuple[str, str]]:
    number, scope = system.error_blocks.index(converter.block), INNER if system.status else ""
    code = bits(f"{scope}frame_error_code", ERROR_CODE_BITS * (number + 1) - 1, ERROR_CODE_BITS * number)
    return [("frame_error", bit(f"{scope}frame_error", number)), ("frame_error_code", code)]


def error_of(converter: Converter, system: DerivedSystem) -> dict[str, int | str]:
    """Return the slice of the system's error outputs that reports a converter's errors."""
    number, scope = system.error_blocks.index(converter.block), INNER if system.status else ""
    low = ERROR_CODE_BITS * number
    return {"scope": scope, "bit": number, "high": low + ERROR_CODE_BITS - 1, "low": low}


def accelerator_instance(names: Names, block: AcceleratorBlock, system: DerivedSystem) -> dict[str, Any]:
    """Return the instance of an accelerator, with its message sides and pins."""
    clock, type_ = system.clock_of(block.block), block.type
    differences = [clock.port] if clock else []
    differences += [f"{type_.width} bits"] if type_.width != system.width else []
    sides = [f"{prefix}{port.name}" for prefix, port in accelerator_ports(type_)]
    ports = [(formal, names.port(block.block, formal)) for formal in sides]
    for pin in type_.accelerator.pins:
        signal = names.synced if pin.is_synchronised else names.port
        ports.append((str(pin.name), signal(block.block, pin.name)))
    ports += [(type_.parameter_port(item), names.port(block.block, item.name)) for item in type_.parameters]
    return {
        "differences": ", ".join(differences),
        **instance(
            names.label(block.block),
            f"component {type_.entity}" if type_.is_component else f"entity work.{type_.entity}",
            [("clk", port_of(clock)), ("rst_n", reset_of(clock)), *ports],
            [("WIDTH", type_.width)] if type_.has_width else (),
        ),
    }


def pin_synchroniser(names: Names, block: AcceleratorBlock, pin: Pin, system: DerivedSystem) -> dict[str, Any]:
    """Return the synchroniser of an input pin, in the clock of its block."""
    synced, index = names.synced(block.block, pin.name), "" if pin.bits else "(0)"
    return {
        "synced": synced,
        "type": vhdl_type(pin.bits),
        **instance(
            names.label(block.block, pin.name, "sync"),
            "entity firm.firm_cdc_sync",
            [
                ("clk", port_of(system.clock_of(block.block))),
                (f"level{index}", names.port(block.block, pin.name)),
                (f"synced{index}", synced),
            ],
            [("BITS", pin.bits)] if pin.bits else (),
        ),
    }


def component(type_: AcceleratorType) -> dict[str, Any]:
    """Return the component declaration of an accelerator that is not an entity."""
    ports = [(f"{prefix}{port.name}", port.is_output, port.width) for prefix, port in accelerator_ports(type_)]
    ports += [(str(pin.name), pin.direction == "out", pin.bits) for pin in type_.accelerator.pins]
    ports += [(type_.parameter_port(item), False, item.port_bits) for item in type_.parameters]
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


def parameter_declarations(accelerator: AcceleratorType) -> list[dict[str, Any]]:
    """Return the declarations of the ports of an accelerator's parameters."""
    return [
        {
            "name": accelerator.parameter_port(item),
            "direction": "in",
            "type": vhdl_type(item.port_bits),
            "comment": f"the parameter {item.name}: {item.type.name}",
        }
        for item in accelerator.parameters
    ]
