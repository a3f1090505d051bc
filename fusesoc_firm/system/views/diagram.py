"""A picture of a system: topics, blocks, messages, times, clocks and pins, as a graph for Graphviz.

The picture runs from left to right, or downwards if accelerators follow one another. Every kind of block has a class in
SVG, so that a style sheet can give it the colours of a dark page.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import zip_longest
from typing import TYPE_CHECKING
from urllib.parse import quote

from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    Connection,
    Converter,
    DerivedSystem,
    Junction,
    PublisherTimes,
    Scheduling,
)
from fusesoc_firm.system.derived.sides import side_ports
from fusesoc_firm.system.hardware.crossings import crossings
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.quoting import dot_markup

if TYPE_CHECKING:
    from graphviz import Digraph

_HOST, _MANAGER = "host", "manager"
_STREAM = {"penwidth": "2"}
_CROSSING = {"style": "dashed"}
# Pins on one line of a label.
_PINS = 3


@dataclass(frozen=True)
class Theme:
    """The colours of a picture: the fill of each class of nodes, and that of lines and text."""

    ink: str
    line: str
    paper: str
    fills: dict[str, str]


THEMES = {
    "light": Theme(
        "#1f2328",
        "#59636e",
        "#ffffff",
        {
            "host": "#ffffff",
            "manager": "#eaeef2",
            "converter": "#dae8fc",
            "junction": "#fff2cc",
            "accelerator": "#d5e8d4",
            "software": "#ffe6cc",
        },
    ),
    "dark": Theme(
        "#e6edf3",
        "#9198a1",
        "#0d1117",
        {
            "host": "#0d1117",
            "manager": "#2a313c",
            "converter": "#1c3a5e",
            "junction": "#4d4419",
            "accelerator": "#1e4429",
            "software": "#5a3a14",
        },
    ),
}


def dark_style() -> str:
    """Return the style sheet that switches an SVG to dark colours if the reader's setting is dark."""
    dark = THEMES["dark"]
    rules = [
        f"text {{ fill: {dark.ink}; }}",
        f".cluster polygon {{ stroke: {dark.line}; }}",
        f".edge path, .edge polygon {{ stroke: {dark.line}; }}",
        f".edge polygon {{ fill: {dark.line}; }}",
        *(
            f".{name} :is(path, polygon, ellipse) {{ fill: {fill}; stroke: {dark.line}; }}"
            for name, fill in dark.fills.items()
        ),
    ]
    return "@media (prefers-color-scheme: dark) {\n" + "\n".join(f"  {rule}" for rule in rules) + "\n}\n"


def diagram(system: DerivedSystem, theme: str | None = None) -> str:
    """Return the system in Graphviz's language DOT; raise `InputError` if the package graphviz is missing.

    A picture in a `theme` has a background; otherwise the colours are light and the background is the page's.
    """
    try:
        import graphviz
    except ModuleNotFoundError:
        fail("pictures require the Python package graphviz", hint="pip install 'fusesoc-firm[diagram]'")
    colours = THEMES[theme or "light"]
    text = {"fontname": "sans-serif", "fontcolor": colours.ink, "color": colours.line}
    graph = graphviz.Digraph(
        system.name,
        node_attr={**text, "fontsize": "10", "shape": "box", "margin": "0.08,0.05", "height": "0.3"},
        edge_attr={**text, "fontsize": "9", "arrowsize": "0.6"},
    )
    graph.attr(
        bgcolor=colours.paper if theme else "transparent",
        rankdir="TB" if _has_chain(system) else "LR",
        ranksep="0.2",
        nodesep="0.15",
        label=_label([_about(system)]),
        fontsize="10",
        fontname="sans-serif",
        fontcolor=colours.ink,
    )
    painter = _Painter(system, colours)
    fpga = {"label": "FPGA", "labeljust": "l", "style": "dashed", "color": colours.line}
    with graph.subgraph(name="cluster_fpga", graph_attr=fpga) as inner:
        painter.blocks(inner)
    painter.streams(graph)
    for connection in system.connections:
        painter.connection(graph, connection)
    painter.software(graph)
    return str(graph.source)


class _Painter:
    """The nodes and edges of one system in the colours of a theme."""

    def __init__(self, system: DerivedSystem, colours: Theme) -> None:
        self._system = system
        self._colours = colours

    def blocks(self, graph: Digraph) -> None:
        """Draw the Manager in both directions, the converters and the accelerators."""
        system = self._system
        self._node(graph, f"{_MANAGER}_in", "manager", ["Manager"])
        self._node(graph, f"{_MANAGER}_out", "manager", ["Manager", *_scheduler(system.scheduling)])
        for subscriber in system.subscribers:
            self._node(graph, _name(subscriber.block), "converter", [*_converter(subscriber), *_queue(subscriber)])
        for publisher, times in zip_longest(system.publishers, system.scheduling.times):
            lines = [*_converter(publisher), *(_times(times, system.clock) if times else ())]
            self._node(graph, _name(publisher.block), "converter", lines)
        for block in system.accelerators:
            lines = [*_accelerator(block), *_differences(system, block), *_pins(block)]
            self._node(graph, _name(block.block), "accelerator", lines)
        for junction in system.junctions:
            self._node(graph, _name(junction.block), "junction", _junction(junction))

    def streams(self, graph: Digraph) -> None:
        """Draw the host, the streams between host and Manager, and the converters' streams with their ids."""
        self._node(graph, f"{_HOST}_out", "host", ["host"])
        self._node(graph, f"{_HOST}_in", "host", ["host"])
        graph.edge(f"{_HOST}_out", f"{_MANAGER}_in", **_STREAM)
        graph.edge(f"{_MANAGER}_out", f"{_HOST}_in", **_STREAM)
        for converter in self._system.subscribers:
            graph.edge(f"{_MANAGER}_in", _name(converter.block), label=_label([f"id {converter.id}"]), **_STREAM)
        for converter in self._system.publishers:
            graph.edge(_name(converter.block), f"{_MANAGER}_out", label=_label([f"id {converter.id}"]), **_STREAM)

    def connection(self, graph: Digraph, connection: Connection) -> None:
        """Draw the ports of a connection to each of its sinks."""
        ways = crossings(self._system, connection)
        topics = {wire: topic.name for topic in self._system.inner_topics for wire in topic.wires}
        for sink, frame, crossing in zip(connection.sinks, connection.frames, ways, strict=True):
            ports = side_ports(frame, self._system.width, gives=True, has_valid=False)
            streams = sum(port.name.endswith("_axis_tdata") for port in ports)
            bits = sum(port.width or 1 for port in ports if "_axis_t" not in port.name and not _is_handshake(port.name))
            topic = topics.get((connection.source, sink))
            lines = [
                *([topic] if topic else []),
                _amount(bits, "bit"),
                *([_amount(streams, "stream")] if streams else []),
            ]
            lines += [words for words in (crossing.clocks, crossing.widths) if words] if crossing else []
            ends = _name(connection.source.block), _name(sink.block)
            graph.edge(*ends, label=_label(lines), **(_CROSSING if crossing else {}))

    def software(self, graph: Digraph) -> None:
        """Draw the blocks on the host, and their messages to and from the Manager, the topics and each other."""
        software, system = self._system.software, self._system
        blocks = {block.block for block in software.blocks}
        for block in software.blocks:
            self._node(graph, _name(block.block), "software", _accelerator(block))
        # All other ends of messages are topics.
        starts = {item.block: f"{_MANAGER}_out" for item in system.publishers} | {name: _name(name) for name in blocks}
        ends = {item.block: f"{_MANAGER}_in" for item in system.subscribers} | {name: _name(name) for name in blocks}
        for connection in software.connections:
            source = connection.source.block
            for sink, frame in zip(connection.sinks, connection.frames, strict=True):
                names = [name for name in (source, sink.block) if name not in blocks]
                start, end = starts.get(source, f"{_HOST}_out"), ends.get(sink.block, f"{_HOST}_in")
                graph.edge(start, end, label=_label([*names, str(frame.message)]))

    def _node(self, graph: Digraph, name: str, kind: str, lines: Iterable[str]) -> None:
        style = "filled,rounded" if kind in ("accelerator", "software") else "filled"
        graph.node(name, _title(lines), _attributes={"class": kind}, style=style, fillcolor=self._colours.fills[kind])


def _has_chain(system: DerivedSystem) -> bool:
    """Whether an accelerator feeds another accelerator, which makes a picture from left to right too wide."""
    blocks = {block.block for block in (*system.accelerators, *system.software.blocks)}
    blocks |= {junction.block for junction in system.junctions}
    connections = (*system.connections, *system.software.connections)
    return bool(system.software.blocks) or any(
        item.source.block in blocks and any(sink.block in blocks for sink in item.sinks) for item in connections
    )


def _about(system: DerivedSystem) -> str:
    clocks = [("clk", system.clock)] if system.clock else []
    clocks += [(clock.port, clock.frequency) for clock in system.clocks]
    words = [f"{system.name}: {system.width}-bit streams", *(f"{name} {_megahertz(hertz)}" for name, hertz in clocks)]
    return ", ".join([*words, *([f"link: {system.link.kind.value}"] if system.link else [])])


def _scheduler(scheduling: Scheduling) -> list[str]:
    """Return the words of the policy, followed by the policies of the groups if there are any."""
    groups = [group.policy for group in scheduling.groups]
    return [*scheduling.policy.split("_", 2), *(["among", *groups] if groups else [])]


def _converter(converter: Converter) -> list[str]:
    block = [] if converter.name == f"/{converter.block}" else [converter.block]
    kind = f"used by {converter.software.block}" if converter.software else converter.name
    return [kind, *block, str(converter.frame.message), converter.frame.ros.title]


def _junction(junction: Junction) -> list[str]:
    kind = f"queue: {junction.depth} messages" if junction.depth else f"merge of {junction.sources}"
    kind = f"exchange: {junction.sources} to {junction.readers}" if junction.is_exchanged else kind
    return [kind, *([junction.topic] if junction.topic else []), str(junction.frame.message)]


def _queue(converter: Converter) -> list[str]:
    if not converter.queue:
        return []
    queue = converter.queue
    return [f"watchdog: {queue.limit} cycles" if queue.limit else f"queue: {queue.frames} frames"]


def _times(times: PublisherTimes, clock: Fraction | None) -> Iterator[str]:
    """Return the rate and the deadline, in Hz and seconds if the clock's frequency is known, otherwise in cycles."""
    if times.period is not None:
        yield f"{float(clock / times.period):.4g} Hz" if clock else f"every {times.period} cycles"
    if times.deadline is not None:
        yield f"deadline {_time(times.deadline / clock) if clock else f'{times.deadline} cycles'}"


def _time(seconds: Fraction) -> str:
    for unit, factor in (("s", 1), ("ms", 10**3), ("us", 10**6)):
        if seconds * factor >= 1:
            return f"{float(seconds * factor):.4g} {unit}"
    return f"{float(seconds * 10**9):.4g} ns"


def _accelerator(block: AcceleratorBlock) -> list[str]:
    accelerator = block.type.accelerator
    name = f"{accelerator.name} ({accelerator.type})" if accelerator.name != block.block else str(accelerator.type)
    return [block.block, name]


def _differences(system: DerivedSystem, block: AcceleratorBlock) -> Iterator[str]:
    """Return the differences between a block and its system."""
    if clock := system.clock_of(block.block):
        yield f"{clock.port}: {_megahertz(clock.frequency)}"
    if block.type.width != system.width:
        yield f"{block.type.width} bits"


def _pins(block: AcceleratorBlock) -> Iterator[str]:
    """Return the pins of a block by direction, with their numbers of bits if these are not 1."""
    for direction in ("in", "out", "inout"):
        pins = [pin for pin in block.type.accelerator.pins if str(pin.direction) == direction]
        names = [f"{pin.name}({pin.bits})" if pin.bits else str(pin.name) for pin in pins]
        for first in range(0, len(names), _PINS):
            yield f"pins {direction}: {', '.join(names[first : first + _PINS])}"


def _megahertz(hertz: Fraction) -> str:
    return f"{float(hertz / 10**6):.6g} MHz"


def _amount(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _is_handshake(port: str) -> bool:
    return port.endswith(("_valid", "_ready", "_last"))


def _title(lines: Iterable[str]) -> str:
    """Return a node's label in Graphviz's markup, one line below the other, the first one bold."""
    first, *rest = (dot_markup(line) for line in lines)
    return f"<{'<br/>'.join([f'<b>{first}</b>', *rest])}>"


def _label(lines: Iterable[str]) -> str:
    """Return an edge's label in Graphviz's markup, with a distance from the edge."""
    text = "<br/>".join(dot_markup(line) for line in lines)
    return f'<<table border="0" cellspacing="0" cellpadding="4"><tr><td>{text}</td></tr></table>>'


def _name(block: str) -> str:
    """Return a block's node name: distinct from host and Manager, and without a colon, which marks a port in DOT."""
    return f"block {quote(block, safe=' ')}"
