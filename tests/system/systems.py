"""Specifications as text, for the tests of this folder."""

from __future__ import annotations

import re
from pathlib import Path

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.system.derived.actions import with_actions
from fusesoc_firm.system.derived.derivation import derive
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.system.derived.services import with_services
from fusesoc_firm.system.written.specification import Specification, read_specification
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

LIBRARIES = {ros: MessageLibrary(ros) for ros in (ROS1, ROS2)}

_SHORT = {"Point": "geometry_msgs/Point", "Vector3": "geometry_msgs/Vector3", "Pose": "geometry_msgs/Pose"}


def converter(name: str, mode: str, message: str, *outgoing: str, ros: str = "ROS") -> str:
    """A line of `blocks`; messages as in `_SHORT`."""
    ways = ", ".join(f"{{name: {block}}}" for block in outgoing)
    return (
        f"  - {{name: {name}, middleware: {ros}, mode: {mode}, message: {_SHORT.get(message, message)}"
        f", outgoing: [{ways}]}}\n"
    )


def instance(name: str, type_: str, *outgoing: str) -> str:
    """A line of `blocks`."""
    return f"  - {{name: {name}, type: {type_}, outgoing: [{', '.join(f'{{name: {block}}}' for block in outgoing)}]}}\n"


def accelerator(name: str, inputs: str, outputs: str, kind: str = "VHDL", sources: str = "acc.vhd") -> str:
    """A line of `accelerators`; `inputs` and `outputs` are messages with blanks between."""
    sides = [
        ", ".join(f"{{middleware: ROS, message: {_SHORT.get(word, word)}}}" for word in side.split())
        for side in (inputs, outputs)
    ]
    interface = f"{{input: [{sides[0]}], output: [{sides[1]}]}}"
    return f"  - {{name: {name}, type: {kind}, sources: [{sources}], interface: {interface}}}\n"


def specification(blocks: str, accelerators: str = "", project: str = "{name: robot}") -> str:
    types = f"accelerators:\n{accelerators}" if accelerators else ""
    return f"project: {project}\n{types}blocks:\n{blocks}"


def read(folder: Path, text: str) -> tuple[Specification, Diagnostics]:
    path = folder / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    for name in ("acc.vhd", "acc.cpp", "acc.v"):
        (folder / name).touch()
    faults = Diagnostics()
    return read_specification(path, "spec.yaml", faults), faults


def derived(folder: Path, text: str) -> DerivedSystem:
    found, faults = read(folder, text)
    return derive(with_actions(with_services(found, LIBRARIES, faults), LIBRARIES, faults), folder, LIBRARIES, faults)


_INSTANCE = re.compile(
    r"^  (\w+) : (?:entity|component) [\w.]+\n(.*?)^    port map \(\n(.*?)^    \);", re.DOTALL | re.MULTILINE
)
_ASSOCIATION = re.compile(r"^ +(\S+) +=> (.*?),?$", re.MULTILINE)


def maps(text: str) -> dict[str, tuple[dict[str, str], dict[str, str]]]:
    """The generic and the port map of each instance of a top level, by its label."""
    found = _INSTANCE.findall(text)
    return {
        label: (dict(_ASSOCIATION.findall(given)), dict(_ASSOCIATION.findall(ports))) for label, given, ports in found
    }


def signals(text: str) -> list[str]:
    """The signals that a top level declares."""
    return re.findall(r"^  signal (\w+) ", text, re.MULTILINE)


def targets(text: str) -> list[str]:
    """The targets of the assignments of a top level."""
    return re.findall(r"^  (\S+) +<= ", text, re.MULTILINE)


def connections(system: DerivedSystem) -> list[str]:
    """`block.prefix -> block.prefix, ...` of each connection."""
    return [
        f"{item.source.block}.{item.source.prefix} -> {', '.join(f'{end.block}.{end.prefix}' for end in item.sinks)}"
        for item in system.connections
    ]


def messages(error: InputError) -> list[str]:
    return [diagnostic.message for diagnostic in error.diagnostics]
