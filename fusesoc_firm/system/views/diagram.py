"""A picture of a system: blocks, messages, widths and ids, as a graph for Graphviz."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING
from urllib.parse import quote

from fusesoc_firm.system.derived.model import AcceleratorBlock, Connection, Converter, DerivedSystem, Scheduling
from fusesoc_firm.system.derived.sides import side_ports
from fusesoc_firm.system.hardware.crossings import crossings
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.quoting import dot_text

if TYPE_CHECKING:
    from graphviz import Digraph

_HOST, _MANAGER = "host", "manager"
_CONVERTER = {"shape": "box", "style": "filled", "fillcolor": "#dae8fc"}
_ACCELERATOR = {"shape": "box", "style": "filled,rounded", "fillcolor": "#d5e8d4"}
_SOFTWARE = {"shape": "box", "style": "filled,rounded", "fillcolor": "#ffe6cc"}
_FPGA = {"name": "cluster_fpga", "graph_attr": {"label": "FPGA", "style": "dashed"}}
_STREAM = {"penwidth": "2"}
_CROSSING = {"style": "dashed"}


def diagram(system: DerivedSystem) -> str:
    """Return the system in Graphviz's language DOT; raise `InputError` if the package graphviz is missing."""
    try:
        import graphviz
    except ModuleNotFoundError:
        fail("pictures require the Python package graphviz", hint="pip install 'fusesoc-firm[diagram]'")
    graph = graphviz.Digraph(system.name, node_attr={"fontname": "sans-serif"}, edge_attr={"fontname": "sans-serif"})
    graph.attr(rankdir="LR", label=f"{system.name}: streams of {system.width} bits", fontname="sans-serif")
    with graph.subgraph(**_FPGA) as fpga:
        _draw_blocks(fpga, system)
    _draw_streams(graph, system)
    for connection in system.connections:
        _draw_connection(graph, connection, system)
    _draw_software(graph, system)
    return str(graph.source)


def _draw_blocks(graph: Digraph, system: DerivedSystem) -> None:
    """Draw the Manager in both directions, the converters and the accelerators."""
    graph.node(f"{_MANAGER}_in", "Manager", shape="box")
    graph.node(f"{_MANAGER}_out", f"Manager\n{_scheduler(system.scheduling)}", shape="box")
    for converter in (*system.subscribers, *system.publishers):
        label = (
            f"{dot_text(converter.block)}\n{converter.frame.message}\n{converter.frame.ros.title}{_queue(converter)}"
        )
        graph.node(_node(converter.block), label, **_CONVERTER)
    for block in system.accelerators:
        graph.node(_node(block.block), _accelerator(block) + _differences(system, block), **_ACCELERATOR)


def _scheduler(scheduling: Scheduling) -> str:
    """Return the policy, followed by those of the groups if there are any."""
    groups = ", ".join(group.policy for group in scheduling.groups)
    return f"{scheduling.policy}\namong {groups}" if groups else scheduling.policy


def _queue(converter: Converter) -> str:
    return f"\nqueue: {converter.queue.frames} frames" if converter.queue else ""


def _accelerator(block: AcceleratorBlock) -> str:
    accelerator = block.type.accelerator
    return f"{dot_text(block.block)}\n{dot_text(accelerator.name)} ({accelerator.type})"


def _draw_streams(graph: Digraph, system: DerivedSystem) -> None:
    """Draw the host, the streams between host and Manager, and the converters' streams with their ids."""
    graph.node(f"{_HOST}_out", "host", shape="oval")
    graph.node(f"{_HOST}_in", "host", shape="oval")
    graph.edge(f"{_HOST}_out", f"{_MANAGER}_in", **_STREAM)
    graph.edge(f"{_MANAGER}_out", f"{_HOST}_in", **_STREAM)
    for converter in system.subscribers:
        graph.edge(f"{_MANAGER}_in", _node(converter.block), label=f"id {converter.id}", **_STREAM)
    for converter in system.publishers:
        graph.edge(_node(converter.block), f"{_MANAGER}_out", label=f"id {converter.id}", **_STREAM)


def _draw_software(graph: Digraph, system: DerivedSystem) -> None:
    """Draw the blocks on the host, and their messages to and from the Manager, the topics and each other."""
    blocks = {block.block for block in system.software.blocks}
    for block in system.software.blocks:
        graph.node(_node(block.block), _accelerator(block), **_SOFTWARE)
    # All other ends of messages are topics.
    starts = {item.block: f"{_MANAGER}_out" for item in system.publishers} | {name: _node(name) for name in blocks}
    ends = {item.block: f"{_MANAGER}_in" for item in system.subscribers} | {name: _node(name) for name in blocks}
    for connection in system.software.connections:
        source = connection.source.block
        for sink, frame in zip(connection.sinks, connection.frames, strict=True):
            names = [dot_text(name) for name in (source, sink.block) if name not in blocks]
            start, end = starts.get(source, f"{_HOST}_out"), ends.get(sink.block, f"{_HOST}_in")
            graph.edge(start, end, label="\n".join([*names, str(frame.message)]))


def _differences(system: DerivedSystem, block: AcceleratorBlock) -> str:
    """Return the differences between a block and its system, one on each line."""
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
    """Return a block's node name: distinct from host and Manager, and without a colon, which marks a port in DOT."""
    return f"block {quote(block, safe=' ')}"
