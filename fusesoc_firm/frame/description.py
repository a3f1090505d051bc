"""Describe a Frame as plain data, for users and for other programs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fusesoc_firm.frame.length import length_of
from fusesoc_firm.frame.model import Data, Fixed, Frame, FrameField, Loop, Node, Pad
from fusesoc_firm.frame.values import dotted


def description(frame: Frame) -> dict[str, Any]:
    """Return the frame and its nodes in wire order as plain data; keys without information are omitted."""
    length = length_of(frame)
    return {
        "message": str(frame.message),
        "ros": frame.ros.number,
        "prefix": frame.prefix.hex(),
        "trailing_bytes": frame.trailing_bytes,
        "payload_bytes": {
            "minimum": length.minimum,
            "maximum": length.maximum,
            "from": "counts" if length.is_computed else "counts and what loops hold",
        }
        if not frame.is_fixed_size
        else frame.payload_bytes,
        "nodes": _nodes(frame.nodes),
    }


def _nodes(nodes: Iterable[Node]) -> list[dict[str, Any]]:
    return [_node(node) for node in nodes]


def _node(node: Node) -> dict[str, Any]:
    match node:
        case Fixed(size, fields):
            return {"fixed": size, "fields": [_field(leaf) for leaf in fields]}
        case Pad(alignment):
            return {"pad": alignment}
        case Data():
            found = {"data": dotted(node.names), "type": node.ros_type, "element_bytes": node.element.size}
            padding = {"padding": "at run time" if node.padding is None else node.padding} if node.padding != 0 else {}
            return {**found, **_bound(node), **padding}
        case Loop():
            found = {"loop": dotted(node.names), "type": node.ros_type}
            return {**found, **({"count": node.count} if node.count else _bound(node)), "nodes": _nodes(node.body)}


def _bound(node: Data | Loop) -> dict[str, int]:
    return {} if node.bound is None else {"bound": node.bound}


def _field(leaf: FrameField) -> dict[str, Any]:
    return {
        "path": dotted(leaf.names),
        "type": leaf.type.name,
        **({"count": leaf.count} if leaf.is_array else {}),
        **({"first": leaf.first} if leaf.first else {}),
        "runs": [{"offset": run.offset, "count": run.count} for run in leaf.runs],
    }
