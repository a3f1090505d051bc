"""The segments of a message of variable size, which determine when each field is valid."""

from __future__ import annotations

from dataclasses import dataclass, field

from fusesoc_firm.converter.program import Block, Header, Open, subscriber_program
from fusesoc_firm.frame.model import Frame, Path


@dataclass
class Segments:
    """The number of each field's segment, and of the segment that precedes each part."""

    fields: dict[Path, int] = field(default_factory=dict)
    parts: dict[Path, int] = field(default_factory=dict)
    count: int = 1


def segments_of(frame: Frame) -> Segments:
    """Return the segments of the fields and parts of a message of variable size, outside of its arrays' elements."""
    found = Segments()
    program = subscriber_program(frame)
    last = 0
    for step in program.steps:
        if isinstance(step, Block) and not step.scope and step.segment:
            found.fields |= {leaf.path: step.segment.number for leaf in step.fields}
        if isinstance(step, Header | Block | Open) and step.completes and not step.completes.scope:
            last = step.completes.number
        if isinstance(step, Open) and not step.scope and step.part.is_used:
            found.parts[step.part.path] = last
    found.count = program.segments()
    return found
