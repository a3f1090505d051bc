"""The values among which an operator's operands are chosen."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.schedule import Issue

_COMMUTATIVE = ("add", "multiply")

Source = TypeVar("Source", bound=Hashable)


def selected(issues: Sequence[Issue], source: Callable[[Issue, Node], Source]) -> list[dict[Source, list[Issue]]]:
    """Return the sources of each operand of a unit, each with the operations for which it is selected.

    `issues` are all operations of the unit, and `source` tells where an operation reads an operand. The operands of a
    sum or product are exchanged if there are fewer sources then.
    """
    found: list[dict[Source, list[Issue]]] = [{} for _ in issues[0].node.operands]
    for issue in issues:
        given = [source(issue, operand) for operand in issue.node.operands]
        if issue.node.operation in _COMMUTATIVE:
            given = min(given, given[::-1], key=lambda order: _new(found, order))
        for known, item in zip(found, given, strict=True):
            known.setdefault(item, []).append(issue)
    return found


def _new(found: Sequence[dict[Source, list[Issue]]], order: Sequence[Source]) -> int:
    return sum(item not in known for known, item in zip(found, order, strict=True))
