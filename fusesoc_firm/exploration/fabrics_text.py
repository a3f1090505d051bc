"""The ways of topics within the FPGA as text of at most 100 columns, and the map of an exchange as text and picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fusesoc_firm.exploration.fabric_map import FabricMap
from fusesoc_firm.exploration.fabrics import Fabric, traffic
from fusesoc_firm.exploration.tables import WIDTH, aligned, cut
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.quoting import dot_markup

_HEAD = ("way", "LUT4", "FF", "routers", "turns", "hops", "cycles", "interval")


def fabrics_text(found: Sequence[Fabric], chosen: str) -> Iterator[str]:
    """Yield the lines of a table of ways; the one that the system uses is marked."""
    possible = [item for item in found if not item.fault]
    yield from aligned([("", *_HEAD), *(("*" if item.name == chosen else "", *_row(item)) for item in possible)], 2)
    for item in found:
        if item.fault:
            yield cut(f"{item.name}: not possible: {item.fault}", WIDTH)


def _row(fabric: Fabric) -> tuple[str, ...]:
    data = fabric.data()
    hops = f"{data['hops']:.2f}" if "hops" in data else ""
    return (
        fabric.name,
        *(str(data.get(word, "")) for word in ("lut", "ff", "routers", "turns")),
        hops,
        str(fabric.cycles),
        str(fabric.interval),
    )


def traffic_text(found: Sequence[Fabric], chosen: str) -> Iterator[str]:
    """Yield the lines of a table of the ways with much traffic."""
    rows = [("", "way", "rate", "mean", "worst")]
    for item in found:
        if not item.fault:
            result = traffic(item)
            mark = "*" if item.name == chosen else ""
            rows.append((mark, item.name, f"{result.rate:.1f}", f"{result.mean:.1f}", str(result.worst)))
    yield from aligned(rows, 2)


def map_text(found: FabricMap) -> Iterator[str]:
    """Yield the lines of a map: the routers with the blocks at them; a grid as a grid."""
    if found.exchange.network.topology.columns > 1:
        yield from _grid(found)
        return
    after: dict[int, list[int]] = {}
    for source, sink in found.links:
        after.setdefault(source, []).append(sink)
    for router, blocks in enumerate(found.blocks):
        ways = f" -> router {', '.join(map(str, after[router]))}" if router in after else ""
        yield cut(f"router {router}: {', '.join(blocks) or '-'}{ways}", WIDTH)


def _grid(found: FabricMap) -> Iterator[str]:
    """Yield the lines of a grid of routers, with a line where a link is used."""
    columns, blocks = found.exchange.network.topology.columns, found.blocks
    width = max(3, *(len(name) for names in blocks for name in (*names, "")))
    height = max(1, *(len(names) for names in blocks))
    links = {*map(frozenset, found.links)}
    for first in range(0, len(blocks), columns):
        row = range(first, min(first + columns, len(blocks)))
        for line in range(height):
            cells = [(f"{blocks[at][line]}" if line < len(blocks[at]) else "" if line else "-") for at in row]
            parts = [f"[{cell:^{width}}]" for cell in cells]
            text = parts[0]
            for at, part in zip(row, parts[1:], strict=False):
                text += ("--" if frozenset((at, at + 1)) in links and line == 0 else "  ") + part
            yield text.rstrip()
        if first + columns < len(blocks):
            marks = [("|" if frozenset((at, at + columns)) in links else " ") for at in row]
            yield "  ".join(f"{mark:^{width + 2}}" for mark in marks).rstrip()


def map_picture(name: str, found: FabricMap) -> str:
    """Return the map in Graphviz's language DOT; raise `InputError` if the package graphviz is missing."""
    try:
        import graphviz
    except ModuleNotFoundError:
        fail("pictures require the Python package graphviz", hint="pip install 'fusesoc-firm[diagram]'")
    topology = found.exchange.network.topology
    columns = topology.columns or topology.routers
    text = {"fontname": "sans-serif", "fontsize": "10"}
    graph = graphviz.Digraph(name, node_attr={**text, "shape": "box", "margin": "0.08,0.05"}, edge_attr=text)
    graph.attr(label=f"{name}: {found.title}", rankdir="TB", **text)
    for router, blocks in enumerate(found.blocks):
        lines = [f"router {router}", *blocks]
        graph.node(f"r{router}", f"<{'<br/>'.join(map(dot_markup, lines))}>", style="filled", fillcolor="#eaeef2")
    for first in range(0, topology.routers, columns):
        with graph.subgraph() as row:
            row.attr(rank="same")
            for router in range(first, min(first + columns, topology.routers)):
                row.node(f"r{router}")
    for source, sink in found.links:
        graph.edge(f"r{source}", f"r{sink}")
    return str(graph.source)
