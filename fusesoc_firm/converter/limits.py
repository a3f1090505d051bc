"""The limits of converters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fusesoc_firm.frame.model import Data, Frame, Loop, Node
from fusesoc_firm.text.diagnostics import Diagnostics

# A forwarded length may count this number of bytes after a message of variable size, which become zeros.
LONGEST_TAIL = 255


def check_fixed_size(frame: Frame) -> None:
    """Raise `InputError` with all fields of variable size if the message has any."""
    faults = Diagnostics()
    for part in _variable_parts(frame.nodes):
        faults.error(
            f"field '{'.'.join(part.names)}' of type '{part.ros_type}' has no fixed size",
            part.source if part.source and part.source.line else None,
            "legal here: numbers, time, duration, and fixed arrays and messages of these types",
        )
    faults.raise_if_any()


def _variable_parts(nodes: Sequence[Node]) -> Iterator[Data | Loop]:
    """Yield the parts of variable length, including those in the elements of fixed arrays."""
    for node in nodes:
        if isinstance(node, Loop) and node.count is not None:
            yield from _variable_parts(node.body)
        elif isinstance(node, Data | Loop):
            yield node
