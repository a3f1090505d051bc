"""A picture of a system: blocks, messages, widths and ids, drawn by Graphviz."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from fusesoc_firm.diagnostics import fail
from fusesoc_firm.system.crossings import crossings
from fusesoc_firm.system.derived import AcceleratorBlock, Connection, Converter, DerivedSystem
from fusesoc_firm.system.sides import side_ports

if TYPE_CHECKING:
    from graphviz import Digraph

# What Graphviz makes of it; `dot` is its own language.
FORMATS = ("svg", "dot")

_HOST, _MANAGER = "host", "manager"
_CONVERTER = {"shape": "box", "style": "filled", "fillcolor": "#dae8fc"}
_ACCELERATOR = {"shape": "box", "style": "filled,rounded", "fillcolor": "#d5e8d4"}
_STREAM = {"penwidth": "2"}
_CROSSING = {"style": "dashed"}


def diagram(system: DerivedSystem, output_format: str) -> str:
    """The system as text in one of `FORMATS`. Raises `InputError` if Graphviz is missing."""
    try:
        import graphviz
    except ModuleNotFoundError:
        fail("pictures need the Python package graphviz", hint="pip install 'fusesoc-firm[diagram]'")
    graph = graphviz.Digraph(system.name, node_attr={"fontname": "sans-serif"}, edge_attr={"fontname": "sans-serif"})
    graph.attr(rankdir="LR", label=f"{system.name}: streams of {system.width} bits", fontname="sans-serif")
    _draw_streams(graph, system)
    for block in system.accelerators:
        accelerator = block.type.accelerator
        label = f"{block.block}\n{accelerator.name} ({accelerator.type}){_differences(system, block)}"
        graph.node(_node(block.block), label, **_ACCELERATOR)
    for connection in system.connections:
        _draw_connection(graph, connection, system)
    if output_format == "dot":
        return str(graph.source)
    try:
        return str(graph.pipe(format=output_format, encoding="utf-8"))
    except graphviz.ExecutableNotFound:
        fail("pictures need the program 'dot' of Graphviz", hint="Debian and Ubuntu: apt install graphviz")


def _draw_streams(graph: Digraph, system: DerivedSystem) -> None:
    """The host, the Manager on both its ways, and the converters with their ids."""
    graph.node(f"{_HOST}_out", "host", shape="oval")
    graph.node(f"{_HOST}_in", "host", shape="oval")
    graph.node(f"{_MANAGER}_in", "Manager", shape="box")
    graph.node(f"{_MANAGER}_out", f"Manager\n{system.scheduling.policy}", shape="box")
    graph.edge(f"{_HOST}_out", f"{_MANAGER}_in", **_STREAM)
    graph.edge(f"{_MANAGER}_out", f"{_HOST}_in", **_STREAM)
    for converter in system.subscribers:
        _draw_converter(graph, converter)
        graph.edge(f"{_MANAGER}_in", _node(converter.block), label=f"id {converter.id}", **_STREAM)
    for converter in system.publishers:
        _draw_converter(graph, converter)
        graph.edge(_node(converter.block), f"{_MANAGER}_out", label=f"id {converter.id}", **_STREAM)


def _draw_converter(graph: Digraph, converter: Converter) -> None:
    label = f"{converter.block}\n{converter.frame.message}\nROS {converter.frame.ros}"
    graph.node(_node(converter.block), label, **_CONVERTER)


def _differences(system: DerivedSystem, block: AcceleratorBlock) -> str:
    """In what a block is not as the system, a line each."""
    clock = system.clock_of(block.block)
    at_clock = f"\n{clock.port}: {float(clock.frequency / 10**6):g} MHz" if clock else ""
    return at_clock + (f"\n{block.type.width} bits" if block.type.width != system.width else "")


def _draw_connection(graph: Digraph, connection: Connection, system: DerivedSystem) -> None:
    for sink, frame, crossing in zip(connection.sinks, connection.frames, crossings(system, connection), strict=True):
        ports = side_ports(frame, system.width, gives=True, has_valid=False)
        streams = [port.name.removesuffix("_axis_tdata") for port in ports if port.name.endswith("_axis_tdata")]
        bits = sum(port.width or 1 for port in ports if "_axis_t" not in port.name and not _is_handshake(port.name))
        label = f"{frame.message}\n{bits} bits{_with(streams)}"
        way = "".join(f"\n{words}" for words in (crossing.clocks, crossing.widths) if words) if crossing else ""
        style = _CROSSING if crossing else {}
        graph.edge(_node(connection.source.block), _node(sink.block), label=f"{label}{way}", **style)


def _is_handshake(port: str) -> bool:
    return port.endswith(("_valid", "_ready", "_last"))


def _with(streams: Iterable[str]) -> str:
    names = ", ".join(streams)
    return f"\nand streams: {names}" if names else ""


def _node(block: str) -> str:
    """A block's node: none of these is called like the host's or the Manager's."""
    return f"block {block}"
