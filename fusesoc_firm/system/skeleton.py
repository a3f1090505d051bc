"""A first version of an accelerator that has no source yet: the ports that its messages imply, and zeros as answers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.converter.message_ports import message_side
from fusesoc_firm.converter.program import has_bytes
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.length import sent_length_of
from fusesoc_firm.frame.model import Loop, Node
from fusesoc_firm.naming import distinct_identifiers, identifier
from fusesoc_firm.render import render
from fusesoc_firm.system.derived import AcceleratorType, DerivedSystem, MessageSide
from fusesoc_firm.system.hls import arguments, function_name, prototype
from fusesoc_firm.system.python_skeleton import python_skeleton
from fusesoc_firm.system.sides import PAYLOAD_LENGTH, SidePort, accelerator_ports
from fusesoc_firm.system.specification import SOFTWARE, Pin

Configuration = dict[str, Any]

_FUNCTION_TEMPLATE = "hls/skeleton.cpp"
_SOFTWARE_TEMPLATE = "python/skeleton.py"


# What the architecture or module declares; a pin may have such a name.
_SIGNALS = ("is_there", "is_sent", "sent_r", "done")


@dataclass(frozen=True)
class _Language:
    """How a language of hardware says what a first version is made of.

    `zero` is a value of so many bits, `word` a number of 32 bits. `offered` says that a message is there and that this
    output of it has not been sent, by the names of the two signals and the output's number.
    """

    template: str
    directions: tuple[str, str]
    type: Callable[[int | None], str]
    zero: Callable[[int | None], str]
    word: Callable[[int], str]
    offered: Callable[[str, str, int], str]
    conjunction: str
    separator: str
    comment: str
    has_types_first: bool = False


_LANGUAGES = {
    "VHDL": _Language(
        template="vhdl/skeleton.vhd",
        directions=("in ", "out"),
        type=vhdl_type,
        zero=lambda bits: "'0'" if bits is None else "(others => '0')",
        word=lambda value: f'x"{value:08x}"',
        offered=lambda is_there, sent, number: f"{is_there} and not {sent}({number})",
        conjunction=" and ",
        separator=";",
        comment="--",
    ),
    "Verilog": _Language(
        template="verilog/skeleton.v",
        directions=("input  wire", "output wire"),
        type=lambda bits: "" if bits is None else f"[{bits - 1}:0] ",
        zero=lambda bits: f"{bits or 1}'b0",
        word=lambda value: f"32'd{value}",
        offered=lambda is_there, sent, number: f"{is_there} && !{sent}[{number}]",
        conjunction=" && ",
        separator=",",
        comment="//",
        has_types_first=True,
    ),
}


def missing_sources(system: DerivedSystem, folder: Path) -> dict[Path, str]:
    """A text for the first source of each accelerator none of whose sources is in `folder`."""
    texts = {}
    for type_ in (*system.accelerator_types, *system.software.types):
        paths = [folder / source for source in type_.accelerator.sources]
        # Software elsewhere has none.
        if paths and not any(path.exists() for path in paths):
            texts[paths[0]] = skeleton(type_)
    return texts


def skeleton(type_: AcceleratorType) -> str:
    """The text of an accelerator's source."""
    if language := _LANGUAGES.get(type_.accelerator.type):
        template, configuration = language.template, _entity(type_, language)
    elif type_.accelerator.type == SOFTWARE:
        template, configuration = _SOFTWARE_TEMPLATE, python_skeleton(type_)
    else:
        template, configuration = _FUNCTION_TEMPLATE, _function(type_)
    return render(template, {**configuration, "purpose": _purpose(type_)})


def _purpose(type_: AcceleratorType) -> str:
    taken, given = (
        ", ".join(str(side.frame.message) for side in sides) or "nothing" for sides in (type_.inputs, type_.outputs)
    )
    return f"{taken} in, {given} out"


def _function(type_: AcceleratorType) -> Configuration:
    inputs, outputs = arguments(type_)
    return {
        "function": function_name(type_),
        "prototype": prototype(type_),
        "inputs": [item.port for item in inputs],
        "outputs": [item.port for item in outputs],
    }


def _entity(type_: AcceleratorType, language: _Language) -> Configuration:
    ports = accelerator_ports(type_)
    of_side = {
        side.prefix: [port for prefix, port in ports if prefix == side.prefix]
        for side in (*type_.inputs, *type_.outputs)
    }
    pins = type_.accelerator.pins
    names = distinct_identifiers(((name,) for name in _SIGNALS), [str(pin.name) for pin in pins])
    own = dict(zip(_SIGNALS, names, strict=True))
    gives = [_given(number, side, of_side[side.prefix], own, language) for number, side in enumerate(type_.outputs)]
    return {
        **own,
        "entity": identifier(type_.accelerator.name),
        "sides": _declarations(type_, of_side, pins, language),
        # Without a message that it takes, nothing says when to send one.
        "all_valid": language.conjunction.join(f"{side.prefix}msg_valid" for side in type_.inputs)
        or language.zero(None),
        "takes_none": not type_.inputs,
        "output_high": max(1, len(type_.outputs)) - 1,
        "takes": [{"port": f"{side.prefix}msg_ready", "done": own["done"]} for side in type_.inputs],
        "gives": gives,
        "counts": [count for given in gives for count in given["counts"]],
        "discards": _discards(type_.inputs, of_side),
        "pins": _driven_pins(pins, language),
    }


def _declarations(
    type_: AcceleratorType, of_side: dict[str, list[SidePort]], pins: Sequence[Pin], language: _Language
) -> list[Configuration]:
    """The ports of each side, and the pins, as the entity or module declares them."""
    groups = [
        (
            f"{side.frame.message}",
            [(f"{side.prefix}{port.name}", port.is_output, port.width, port.comment) for port in of_side[side.prefix]],
        )
        for side in (*type_.inputs, *type_.outputs)
    ]
    if pins:
        groups.append(("pins", [(str(pin.name), pin.direction == "out", pin.bits, "") for pin in pins]))
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


def _given(
    number: int, side: MessageSide, ports: Sequence[SidePort], own: Mapping[str, str], language: _Language
) -> Configuration:
    """What an output does: its handshake with the message, the length of a message of zeros, zeros for the rest."""
    offered = language.offered(own["is_there"], own["sent_r"], number)
    counts = _counts(side, offered)
    by_name = {f"{side.prefix}{port.name}": port for port in ports}
    length = f"{side.prefix}{PAYLOAD_LENGTH}"
    segments = [f"{side.prefix}segment_valid", *(count["segment_valid"] for count in counts)]
    valid = [f"{side.prefix}msg_valid", *(count["valid"] for count in counts)]
    driven = {length, *segments, *valid, *(count["last"] for count in counts)}
    return {
        "number": number,
        "ready": f"{side.prefix}msg_ready",
        "is_sent": own["is_sent"],
        "sent_r": own["sent_r"],
        "segments": [
            {"port": name, "bits": by_name[name].width or 1, "offered": offered} for name in segments if name in by_name
        ],
        "valid": [{"port": name, "offered": offered} for name in valid if name in by_name],
        "length": {"port": length, "value": language.word(sent_length_of(side.frame).minimum)}
        if length in by_name
        else None,
        "zeros": [
            {"port": name, "zero": language.zero(port.width)}
            for name, port in by_name.items()
            if port.is_output and name not in driven
        ],
        "counts": counts,
    }


def _counts(side: MessageSide, offered: str) -> list[Configuration]:
    """The arrays of fixed size that are sent element by element, whose elements are counted: the last one is marked."""
    if side.frame.is_fixed_size:
        return []
    ports = message_side(side.frame)
    found: list[Configuration] = []
    for loop in _fixed_loops(side.frame.nodes):
        element = ports.element(loop)
        found.append(
            {
                "port": f"{side.prefix}{element.name}",
                "count_r": f"{side.prefix}{element.name}_r",
                "high": (loop.count or 1) - 1,
                "offered": offered,
                "segment_valid": f"{side.prefix}{element.segment_valid}",
                "valid": f"{side.prefix}{element.valid}",
                "ready": f"{side.prefix}{element.ready}",
                "last": f"{side.prefix}{element.last}",
            }
        )
    return found


def _fixed_loops(nodes: Iterable[Node]) -> Iterator[Loop]:
    """The arrays of fixed size that a message of zeros has elements of: no other array is around them."""
    for node in nodes:
        if isinstance(node, Loop) and node.is_used and node.count and has_bytes(node):
            yield node
            yield from _fixed_loops(node.body)


def _discards(inputs: Sequence[MessageSide], of_side: dict[str, list[SidePort]]) -> Configuration | None:
    """The streams and elements of inputs, which must be taken to their ends."""
    ready = [
        f"{side.prefix}{port.name}"
        for side in inputs
        for port in of_side[side.prefix]
        if port.is_output and port.name != "msg_ready"
    ]
    return {"ports": ready} if ready else None


def _driven_pins(pins: Sequence[Pin], language: _Language) -> Configuration | None:
    driven = [{"port": str(pin.name), "zero": language.zero(pin.bits)} for pin in pins if pin.direction == "out"]
    return {"ports": driven} if driven else None
