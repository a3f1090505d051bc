"""A first version of an accelerator that has no source yet: the ports that its messages imply, and zeros as answers."""

from __future__ import annotations

from collections.abc import Sequence
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

_TEMPLATES = {"VHDL": "vhdl/skeleton.vhd", "HLS": "hls/skeleton.cpp", SOFTWARE: "python/skeleton.py"}


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
    language = str(type_.accelerator.type)
    if language == SOFTWARE:
        configuration = python_skeleton(type_)
    else:
        configuration = _function(type_) if language == "HLS" else _entity(type_)
    return render(_TEMPLATES[language], {**configuration, "purpose": _purpose(type_)})


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


def _entity(type_: AcceleratorType) -> Configuration:
    ports = accelerator_ports(type_)
    of_side = {
        side.prefix: [port for prefix, port in ports if prefix == side.prefix]
        for side in (*type_.inputs, *type_.outputs)
    }
    pins = type_.accelerator.pins
    return {
        "entity": identifier(type_.accelerator.name),
        "sides": _declarations(type_, of_side, pins),
        "all_valid": " and ".join(f"{side.prefix}msg_valid" for side in type_.inputs) or "'1'",
        "output_high": max(1, len(type_.outputs)) - 1,
        "takes": [{"port": f"{side.prefix}msg_ready"} for side in type_.inputs],
        "gives": [_given(number, side, of_side[side.prefix]) for number, side in enumerate(type_.outputs)],
        "discards": _discards(type_.inputs, of_side),
        "pins": _driven_pins(pins),
    }


def _declarations(
    type_: AcceleratorType, of_side: dict[str, list[SidePort]], pins: Sequence[Pin]
) -> list[Configuration]:
    """The ports of each side, and the pins, as the entity declares them."""
    groups = [
        (
            f"{side.frame.message}",
            [(f"{side.prefix}{port.name}", port.is_output, port.width, port.comment) for port in of_side[side.prefix]],
        )
        for side in (*type_.inputs, *type_.outputs)
    ]
    if pins:
        groups.append(("pins", [(str(pin.name), pin.direction == "out", pin.bits, "") for pin in pins]))
    column = max((len(name) for _, ports in groups for name, *_ in ports), default=0)
    last = groups[-1][1][-1][0] if groups else ""
    return [
        {
            "comment": title,
            "ports": [
                {
                    "name": name.ljust(column),
                    "direction": "out" if is_output else "in ",
                    "type": vhdl_type(bits),
                    "semicolon": "" if name == last else ";",
                    "comment": f"  -- {comment}" if comment else "",
                }
                for name, is_output, bits, comment in ports
            ],
        }
        for title, ports in groups
    ]


def _given(number: int, side: MessageSide, ports: Sequence[SidePort]) -> Configuration:
    """What an output does: its handshake with the message, zeros for the rest."""
    names = {port.name for port in ports}
    own = {"segment_valid", "msg_valid", "msg_ready"}
    return {
        "number": number,
        "ready": f"{side.prefix}msg_ready",
        "segment_valid": f"{side.prefix}segment_valid",
        "valid": [{"port": f"{side.prefix}msg_valid", "number": number}] if "msg_valid" in names else [],
        "zeros": [
            {"port": f"{side.prefix}{port.name}", "zero": _zero(port.width)}
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


def _driven_pins(pins: Sequence[Pin]) -> Configuration | None:
    driven = [{"port": str(pin.name), "zero": _zero(pin.bits)} for pin in pins if pin.direction == "out"]
    return {"ports": driven} if driven else None


def _zero(bits: int | None) -> str:
    return "'0'" if bits is None else "(others => '0')"
