"""Select the used fields of a message; unused fields remain on the wire, but need neither ports nor registers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from fusesoc_firm.frame.model import Fixed, Frame, Loop, NameTree, Node, Pad, all_nodes
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, nearest

# Dotted paths, each with its place in the user's file.
Paths = Mapping[str, SourceRef | None]
# The names on the path to a leaf.
Names = tuple[str, ...]


def select(frame: Frame, include: Paths | None = None, exclude: Paths | None = None) -> Frame:
    """Return the frame with its fields marked as used or unused.

    A path (`header.stamp`, `poses.position`) selects the field and all fields below it. Without `include`, all fields
    are used; `exclude` then removes fields. A loop is used if any of its parts is used. Raise `InputError`, with the
    nearest valid path, for a path that does not lead to a value.
    """
    include, exclude = include or {}, exclude or {}
    known = {dotted(names) for names in _all_names(frame.names, ())}
    faults = Diagnostics()
    for path, source in [*include.items(), *exclude.items()]:
        if path not in known:
            faults.error(f"{frame.message} has no field '{path}'", source, nearest(path, known))
    faults.raise_if_any()
    return replace(frame, nodes=_Marking(lambda names: _is_chosen(names, include, exclude)).marked(frame.nodes))


def names_in_use(frame: Frame) -> frozenset[Names]:
    """Return the names of every used leaf."""
    return frozenset(names for node in all_nodes(frame.nodes) for names, is_used in _leaves(node) if is_used)


def with_names_in_use(frame: Frame, names: Collection[Names]) -> Frame:
    """Return the frame with exactly the leaves with these names marked as used."""
    return replace(frame, nodes=_Marking(lambda leaf: leaf in names).marked(frame.nodes))


def used_part(message: Mapping[str, Any], frame: Frame) -> dict[str, Any]:
    """Return the part of a message that consists of used fields."""
    found: dict[str, Any] = _part(message, names_in_use(frame))
    return found


def _part(value: Any, leaves: Collection[Names]) -> Any:
    """Return the part of a value on the paths to the leaves; all elements of an array are treated equally."""
    if () in leaves:
        return value
    if not isinstance(value, Mapping):
        return [_part(item, leaves) for item in value]
    below: dict[str, set[Names]] = {}
    for name, *rest in leaves:
        below.setdefault(name, set()).add(tuple(rest))
    return {name: _part(inner, below[name]) for name, inner in value.items() if name in below}


def _is_chosen(names: Names, include: Collection[str], exclude: Collection[str]) -> bool:
    above = {dotted(names[: length + 1]) for length in range(len(names))}
    return (not include or not above.isdisjoint(include)) and above.isdisjoint(exclude)


@dataclass(frozen=True)
class _Marking:
    """A pass that marks each leaf for which `has` returns true, and the nodes around the leaf."""

    has: Callable[[Names], bool]

    def marked(self, nodes: tuple[Node, ...]) -> tuple[Node, ...]:
        return tuple(self._marked(node) for node in nodes)

    def _marked(self, node: Node) -> Node:
        match node:
            case Pad():
                return node
            case Fixed():
                fields = (replace(leaf, is_used=self.has(leaf.names)) for leaf in node.fields)
                return replace(node, fields=tuple(fields))
            case Loop():
                body = self.marked(node.body)
                inner = [is_used for part in body for is_used in _uses(part)]
                # An array of empty messages has no leaves, so only its count can be used.
                return replace(node, body=body, is_used=any(inner) if inner else self.has(node.names))
        return replace(node, is_used=self.has(node.names))


def _uses(node: Node) -> Iterator[bool]:
    if isinstance(node, Fixed):
        yield from (leaf.is_used for leaf in node.fields)
    elif not isinstance(node, Pad):
        yield node.is_used


def _leaves(node: Node) -> Iterator[tuple[Names, bool]]:
    """Yield the names of the leaves in a node, except those in nested nodes; an array of empty messages is a leaf."""
    if isinstance(node, Fixed):
        yield from ((leaf.names, leaf.is_used) for leaf in node.fields)
    elif not isinstance(node, Pad) and not (
        isinstance(node, Loop) and any(True for part in node.body for _ in _uses(part))
    ):
        yield node.names, node.is_used


def _all_names(tree: NameTree, above: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    for name, below in tree.items():
        yield (*above, name)
        yield from _all_names(below, (*above, name))
