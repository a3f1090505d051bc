"""A first version of an accelerator without a source: it copies the parts that its messages share, and sends zeros.

`pass_through` determines these parts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.converter.message_ports import message_side
from fusesoc_firm.converter.program import has_bytes
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.length import sent_length_of
from fusesoc_firm.frame.model import Loop, Node
from fusesoc_firm.system.derived.cpp_function import arguments, function_name, prototype
from fusesoc_firm.system.derived.cpp_stream import is_streamed
from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem, MessageSide
from fusesoc_firm.system.derived.sides import PAYLOAD_LENGTH, SidePort, accelerator_ports
from fusesoc_firm.system.scaffold.pass_through import Wires, wires_of
from fusesoc_firm.system.scaffold.python_skeleton import python_skeleton
from fusesoc_firm.system.scaffold.stream_skeleton import STREAM_TEMPLATE, stream_function
from fusesoc_firm.system.written.specification import PYTHON, SOFTWARE
from fusesoc_firm.text.naming import distinct_identifiers, identifier
from fusesoc_firm.text.render import Context, render

_FUNCTION_TEMPLATE = "hls/skeleton.cpp"
_SOFTWARE_TEMPLATE = "python/skeleton.py"


# Names that the architecture or module declares, and that a pin may also have.
_SIGNALS = ("is_there", "is_sent", "sent_r", "done")


@dataclass(frozen=True)
class _Language:
    """The syntax of port declarations in a hardware language."""

    template: str
    directions: tuple[str, str]
    type: Callable[[int | None], str]
    separator: str
    comment: str
    has_types_first: bool = False


_LANGUAGES = {
    "VHDL": _Language(
        template="vhdl/skeleton.vhd",
        directions=("in ", "out"),
        type=vhdl_type,
        separator=";",
        comment="--",
    ),
    "Verilog": _Language(
        template="verilog/skeleton.v",
        directions=("input  wire", "output wire"),
        type=lambda bits: "" if bits is None else f"[{bits - 1}:0] ",
        separator=",",
        comment="//",
        has_types_first=True,
    ),
}


def missing_sources(system: DerivedSystem, folder: Path, *, has_arithmetic: bool = False) -> dict[Path, str]:
    """Return the path and text of a first source for each accelerator whose source file is missing in `folder`.

    With `has_arithmetic`, the system's core depends on the arithmetic in the VHDL library `firm`.
    """
    texts = {}
    for type_ in (*system.accelerator_types, *system.software.types):
        paths = [folder / source for source in type_.accelerator.sources]
        # Software in another program has no sources.
        if paths and not any(path.exists() for path in paths):
            texts[paths[0]] = skeleton(type_.own, has_arithmetic=has_arithmetic)
    return texts


def skeleton(type_: AcceleratorType, *, has_arithmetic: bool = False) -> str:
    """Return the text of an accelerator's source."""
    if language := _LANGUAGES.get(type_.accelerator.type):
        template = language.template
        configuration = {**_entity(type_, language), "has_arithmetic": has_arithmetic}
    elif type_.accelerator.type in (SOFTWARE, PYTHON):
        template, configuration = _SOFTWARE_TEMPLATE, python_skeleton(type_)
    elif is_streamed(type_):
        template, configuration = STREAM_TEMPLATE, stream_function(type_)
    else:
        template, configuration = _FUNCTION_TEMPLATE, _function(type_)
    return render(template, {**configuration, "purpose": _purpose(type_)})


def _purpose(type_: AcceleratorType) -> str:
    taken, given = (
        ", ".join(str(side.frame.message) for side in sides) or "nothing" for sides in (type_.inputs, type_.outputs)
    )
    return f"{taken} in, {given} out"


def _function(type_: AcceleratorType) -> Context:
    inputs, outputs = arguments(type_)
    ports = {item.signal: item.port for item in inputs}
    copied = {name: ports[source] for wires in wires_of(type_) for name, source in wires.ports.items()}
    return {
        "function": function_name(type_),
        "prototype": prototype(type_),
        "inputs": [{"port": item.port, "is_array": item.count is not None} for item in inputs],
        "outputs": [
            {
                "port": item.port,
                "is_array": item.count is not None,
                "count": len(item.elements),
                "value": f"{copied[item.signal]}{'[k]' if item.count else ''}" if item.signal in copied else "0",
            }
            for item in outputs
        ],
    }


def _entity(type_: AcceleratorType, language: _Language) -> Context:
    ports = accelerator_ports(type_)
    of_side = {
        side.prefix: [port for prefix, port in ports if prefix == side.prefix]
        for side in (*type_.inputs, *type_.outputs)
    }
    pins = type_.accelerator.pins
    own_ports = [*(str(pin.name) for pin in pins), *(item.name for item in type_.parameters)]
    names = distinct_identifiers(((name,) for name in _SIGNALS), own_ports)
    own = dict(zip(_SIGNALS, names, strict=True))
    wires = wires_of(type_)
    gives = [_given(number, side, of_side[side.prefix], wires[number]) for number, side in enumerate(type_.outputs)]
    pairs = zip(type_.outputs, wires, strict=True)
    takes = [side.prefix for side in type_.inputs]
    forwards = next((_forwards(type_, side, item) for side, item in pairs if item.carrier), None)
    return {
        **own,
        "entity": identifier(type_.accelerator.name),
        "sides": _declarations(type_, of_side, language),
        "takes": takes,
        "output_count": max(1, len(type_.outputs)),
        "gives": gives,
        "forwards": forwards,
        # A single output that is not forwarded needs no record of sent outputs.
        "single": {"ready": gives[0]["ready"], "takes": takes} if len(gives) == 1 and not forwards else None,
        "has_several": len(gives) != 1 and not forwards,
        "counts": [count for given in gives for count in given["counts"]],
        "discards": _discards(type_.inputs, of_side, {name for item in wires for name in item.ready}),
        "pins": [{"port": str(pin.name), "bits": pin.bits} for pin in pins if pin.direction == "out"],
    }


def _declarations(type_: AcceleratorType, of_side: dict[str, list[SidePort]], language: _Language) -> list[Context]:
    """Return the port declarations of all sides, pins and parameters for the entity or module."""
    groups = [
        (
            f"{side.frame.message}",
            [(f"{side.prefix}{port.name}", port.is_output, port.width, port.comment) for port in of_side[side.prefix]],
        )
        for side in (*type_.inputs, *type_.outputs)
    ]
    if pins := type_.accelerator.pins:
        groups.append(("pins", [(str(pin.name), pin.direction == "out", pin.bits, "") for pin in pins]))
    if type_.parameters:
        ports = [(item.name, False, item.port_bits, item.type.name) for item in type_.parameters]
        groups.append(("parameters, which change between messages", ports))
    declared = [port for _, ports in groups for port in ports]
    names = max((len(name) for name, *_ in declared), default=0)
    types = max((len(language.type(bits)) for *_, bits, _ in declared), default=0) if language.has_types_first else 0
    last = declared[-1][0] if declared else ""
    return [
        {
            "comment": title,
            "ports": [
                {
                    "name": name if language.has_types_first else name.ljust(names),
                    "direction": language.directions[is_output],
                    "type": language.type(bits).ljust(types),
                    "semicolon": "" if name == last else language.separator,
                    "comment": f"  {language.comment} {comment}" if comment else "",
                }
                for name, is_output, bits, comment in ports
            ],
        }
        for title, ports in groups
    ]


def _forwards(type_: AcceleratorType, side: MessageSide, wires: Wires) -> Context:
    """Return the handshakes of an output whose strings and arrays come from an input without storage."""
    assert wires.carrier
    others = [f"{item.prefix}msg_valid" for item in type_.inputs if item is not wires.carrier]
    source = f"{wires.carrier.prefix}segment_valid"
    return {
        "valid": f"{side.prefix}msg_valid",
        "ready": f"{side.prefix}msg_ready",
        "segment_valid": f"{side.prefix}segment_valid",
        "segments": [
            {
                "number": number,
                "waits": [] if place is None else [{"source": source, "place": place}],
                "others": [] if place is None else others,
            }
            for number, place in enumerate(wires.segments)
        ],
        "takes": [item.prefix for item in type_.inputs],
        "streams": [{"port": name, "source": other} for name, other in wires.ready.items()],
    }


def _given(number: int, side: MessageSide, ports: Sequence[SidePort], wires: Wires) -> Context:
    """Return the assignments of an output: the handshake, copies, the length of an all-zero message, and zeros."""
    counts = [] if wires.carrier else _counts(side, number)
    by_name = {f"{side.prefix}{port.name}": port for port in ports}
    length = f"{side.prefix}{PAYLOAD_LENGTH}"
    segments = [f"{side.prefix}segment_valid", *(count["segment_valid"] for count in counts)]
    valid = [f"{side.prefix}msg_valid", *(count["valid"] for count in counts)]
    driven = {length, *segments, *valid, *(count["last"] for count in counts), *wires.ports}
    is_forwarded = wires.carrier is not None
    return {
        "number": number,
        "ready": f"{side.prefix}msg_ready",
        "segments": [
            {"port": name, "bits": by_name[name].width or 1}
            for name in segments
            if name in by_name and not is_forwarded
        ],
        "valid": [name for name in valid if name in by_name and not is_forwarded],
        "length": _length(length, side) if length in by_name and length not in wires.ports else None,
        "copies": [{"port": name, "source": wires.ports[name]} for name in by_name if name in wires.ports],
        "zeros": [
            {"port": name, "bits": port.width}
            for name, port in by_name.items()
            if port.is_output and name not in driven
        ],
        "counts": counts,
    }


def _length(port: str, side: MessageSide) -> Context:
    """Return the length of an all-zero message."""
    value = sent_length_of(side.frame).minimum
    return {"port": port, "value": value, "digits": f"{value:08x}"}


def _counts(side: MessageSide, number: int) -> list[Context]:
    """Return the fixed-size arrays of output `number`; their elements are counted to mark the last element."""
    if side.frame.is_fixed_size:
        return []
    ports = message_side(side.frame)
    found: list[Context] = []
    for loop in _fixed_loops(side.frame.nodes):
        element = ports.element(loop)
        found.append(
            {
                "port": f"{side.prefix}{element.name}",
                "count_r": f"{side.prefix}{element.name}_r",
                "high": (loop.count or 1) - 1,
                "number": number,
                "segment_valid": f"{side.prefix}{element.segment_valid}",
                "valid": f"{side.prefix}{element.valid}",
                "ready": f"{side.prefix}{element.ready}",
                "last": f"{side.prefix}{element.last}",
            }
        )
    return found


def _fixed_loops(nodes: Iterable[Node]) -> Iterator[Loop]:
    """Yield the arrays of fixed size in an all-zero message; arrays of variable size are empty and are skipped."""
    for node in nodes:
        if isinstance(node, Loop) and node.is_used and node.count and has_bytes(node):
            yield node
            yield from _fixed_loops(node.body)


def _discards(
    inputs: Sequence[MessageSide], of_side: dict[str, list[SidePort]], forwarded: Collection[str]
) -> list[str]:
    """Return the streams and elements of inputs that are not forwarded, which must be read to the end."""
    return [
        f"{side.prefix}{port.name}"
        for side in inputs
        for port in of_side[side.prefix]
        if port.is_output and port.name != "msg_ready" and f"{side.prefix}{port.name}" not in forwarded
    ]
