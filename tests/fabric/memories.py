"""The memories of a node in fabric, as files for a test's hardware."""

from __future__ import annotations

from pathlib import Path

from fusesoc_firm.fabric.control import Sizes, generics_of, memory_of_control
from fusesoc_firm.fabric.names import memory_of_names
from fusesoc_firm.fabric.node import Node
from fusesoc_firm.fabric.packets import memory_of
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Generic


def memories(node: Node, top: str, folder: Path, sizes: Sizes) -> list[Path]:
    """The entities `<top>_packets`, `<top>_names` and `<top>_control`."""
    written = []
    for rendering in (
        memory_of(node, f"{top}_packets"),
        memory_of_names(node.compared, f"{top}_names"),
        memory_of_control(node, f"{top}_control", sizes),
    ):
        written.append(folder / f"{rendering.context['entity']}.vhd")
        written[-1].write_text(render(rendering.template, rendering.context), encoding="utf-8")
    return written


def bits(node: Node) -> dict[str, Generic]:
    """The generics that tell the qualities of a node's endpoints."""
    qualities = [item.quality for item in node.compared]
    return {
        "RELIABLE": sum(item.is_reliable << place for place, item in enumerate(qualities)),
        "TRANSIENT": sum(item.is_transient_local << place for place, item in enumerate(qualities)),
    }


def generics(node: Node, sizes: Sizes) -> dict[str, Generic]:
    """The generics of the hardware of a node, and those that tell the qualities of its endpoints."""
    return {**generics_of(node, sizes), **bits(node)}
