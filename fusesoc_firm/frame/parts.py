"""The message side of a frame: segments of fixed size and the variable parts between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fusesoc_firm.frame.model import Data, Fixed, FrameField, Loop, Node, Pad


@dataclass(frozen=True)
class Segment:
    """What lies between two variable parts. `number` counts segments with a value; None marks one without."""

    number: int | None
    nodes: tuple[Fixed | Pad, ...]

    @property
    def fields(self) -> tuple[FrameField, ...]:
        """Each leaf once: where a `Pad` parts its elements, as the field that holds the first."""
        return _fields(self.nodes)


@dataclass(frozen=True)
class VariablePart:
    """A variable part of a message and its number among them."""

    number: int
    node: Data | Loop


def parts(nodes: Iterable[Node]) -> Iterator[Segment | VariablePart]:
    """The parts of a message, or of a loop's element, in wire order; they hold every node once."""
    pending: list[Fixed | Pad] = []
    segments = variables = 0
    for node in [*nodes, None]:
        if isinstance(node, Fixed | Pad):
            pending.append(node)
            continue
        if pending:
            has_values = any(leaf.count for leaf in _fields(pending))
            yield Segment(segments if has_values else None, tuple(pending))
            segments += has_values
            pending = []
        if node is not None:
            yield VariablePart(variables, node)
            variables += 1


def _fields(nodes: Iterable[Fixed | Pad]) -> tuple[FrameField, ...]:
    return tuple(leaf for node in nodes if isinstance(node, Fixed) for leaf in node.fields if leaf.first == 0)
