"""A first version of an accelerator that has no source yet: the ports that its messages imply, and zeros as answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusesoc_firm.converter.ports import vhdl_type
from fusesoc_firm.naming import identifier
from fusesoc_firm.render import render
from fusesoc_firm.system.derived import AcceleratorType, DerivedSystem, MessageSide
from fusesoc_firm.system.hls import arguments, function_name, prototype
from fusesoc_firm.system.python_skeleton import python_skeleton
from fusesoc_firm.system.sides import SidePort, accelerator_ports
from fusesoc_firm.system.specification import SOFTWARE, Pin

Configuration = dict[str, Any]

_FUNCTION_TEMPLATE = "hls/skeleton.cpp"
_SOFTWARE_TEMPLATE = "python/skeleton.py"


@dataclass(frozen=True)
class _Language:
    """How a language of hardware says what a first version is made of."""

    template: str
    directions: tuple[str, str]
    type: Callable[[int | None], str]
    zero: Callable[[int | None], str]
    one: str
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
        one="'1'",
        conjunction=" and ",
        separator=";",
        comment="--",
    ),
    "Verilog": _Language(
        template="verilog/skeleton.v",
        directions=("input  wire", "output wire"),
        type=lambda bits: "" if bits is None else f"[{bits - 1}:0] ",
        zero=lambda bits: f"{bits or 1}'b0",
        one="1'b1",
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
    return {
        "entity": identifier(type_.accelerator.name),
        "sides": _declarations(type_, of_side, pins, language),
        "all_valid": language.conjunction.join(f"{side.prefix}msg_valid" for side in type_.inputs) or language.one,
        "output_high": max(1, len(type_.outputs)) - 1,
        "takes": [{"port": f"{side.prefix}msg_ready"} for side in type_.inputs],
        "gives": [_given(number, side, of_side[side.prefix], language) for number, side in enumerate(type_.outputs)],
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


def _given(number: int, side: MessageSide, ports: Sequence[SidePort], language: _Language) -> Configuration:
    """What an output does: its handshake with the message, zeros for the rest."""
    names = {port.name for port in ports}
    own = {"segment_valid", "msg_valid", "msg_ready"}
    return {
        "number": number,
        "ready": f"{side.prefix}msg_ready",
        "segment_valid": f"{side.prefix}segment_valid",
        "segments": next(port.width or 1 for port in ports if port.name == "segment_valid"),
        "valid": [{"port": f"{side.prefix}msg_valid", "number": number}] if "msg_valid" in names else [],
        "zeros": [
            {"port": f"{side.prefix}{port.name}", "zero": language.zero(port.width)}
            for port in ports
            if port.is_output and port.name not in own
        ],
    }


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
