"""Which fields of a message are used: the rest keeps its place on the wire, but needs neither port nor register."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

from fusesoc_firm.diagnostics import Diagnostics, SourceRef, nearest
from fusesoc_firm.frame.model import Fixed, Frame, Loop, NameTree, Node, Pad
from fusesoc_firm.frame.values import dotted

# Dotted paths, each with the place where the user wrote it.
Paths = Mapping[str, SourceRef | None]


def select(frame: Frame, include: Paths | None = None, exclude: Paths | None = None) -> Frame:
    """The frame with its fields marked as used or not.

    A path (`header.stamp`, `poses.position`) means the field and all below it. Where `include` names none, all fields
    are used; `exclude` then takes some away. A loop is used if anything in it is. Raises `InputError` for a path that
    leads to no value, with the nearest one that does.
    """
    include, exclude = include or {}, exclude or {}
    known = {dotted(names) for names in _all_names(frame.names, ())}
    faults = Diagnostics()
    for path, source in [*include.items(), *exclude.items()]:
        if path not in known:
            faults.error(f"{frame.message} has no field '{path}'", source, nearest(path, known))
    faults.raise_if_any()
    return replace(frame, nodes=_Selection(include, exclude).marked(frame.nodes))


@dataclass(frozen=True)
class _Selection:
    include: Collection[str]
    exclude: Collection[str]

    def marked(self, nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        return tuple(self._marked(node) for node in nodes)

    def _marked(self, node: Node) -> Node:
        match node:
            case Pad():
                return node
            case Fixed():
                fields = (replace(leaf, is_used=self._has(leaf.names)) for leaf in node.fields)
                return replace(node, fields=tuple(fields))
            case Loop():
                body = self.marked(node.body)
                inner = [is_used for part in body for is_used in _uses(part)]
                # The elements of an array of empty messages hold nothing: only their number can be used.
                return replace(node, body=body, is_used=any(inner) if inner else self._has(node.names))
        return replace(node, is_used=self._has(node.names))

    def _has(self, names: tuple[str, ...]) -> bool:
        above = {dotted(names[: length + 1]) for length in range(len(names))}
        return (not self.include or not above.isdisjoint(self.include)) and above.isdisjoint(self.exclude)


def _uses(node: Node) -> Iterator[bool]:
    if isinstance(node, Fixed):
        yield from (leaf.is_used for leaf in node.fields)
    elif not isinstance(node, Pad):
        yield node.is_used


def _all_names(tree: NameTree, above: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    for name, below in tree.items():
        yield (*above, name)
        yield from _all_names(below, (*above, name))
