"""Message -> Frame: walks a definition in wire order and notes where every element of every leaf lies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fusesoc_firm.diagnostics import Diagnostics, SourceRef
from fusesoc_firm.frame.cdr import CDR_RULES
from fusesoc_firm.frame.model import Frame, FrameField, Run, Step, WireType
from fusesoc_firm.frame.ros1 import ROS1_RULES
from fusesoc_firm.frame.rules import WireRules
from fusesoc_firm.message.model import (
    ArrayType,
    Field,
    MessageDefinition,
    MessageName,
    MessageType,
    PrimitiveType,
    RosVersion,
)

RULES: Mapping[RosVersion, WireRules] = {RosVersion.ROS1: ROS1_RULES, RosVersion.ROS2: CDR_RULES}


def frame_of(name: MessageName, definitions: Mapping[MessageName, MessageDefinition]) -> Frame:
    """The frame of message `name`; `definitions` holds it and every message below it.

    Raises `InputError` that names every field of variable size: a frame of fixed size cannot hold one.
    """
    definition = definitions[name]
    rules = RULES[definition.ros]
    walk = _Walk(rules, definitions)
    walk.message(definition, ())
    walk.diagnostics.raise_if_any()
    return Frame(
        message=name,
        ros=definition.ros,
        prefix=rules.prefix,
        checked_prefix=rules.checked_prefix,
        fields=tuple(FrameField(path, type_, tuple(runs)) for path, (type_, runs) in walk.leaves.items()),
        payload_bytes=len(rules.prefix) + walk.cursor,
        trailing_bytes=rules.trailing_bytes,
    )


@dataclass
class _Walk:
    """The cursor of one walk and what it found; `cursor` counts from behind the prefix, as alignment does."""

    rules: WireRules
    definitions: Mapping[MessageName, MessageDefinition]
    cursor: int = 0
    leaves: dict[tuple[Step, ...], tuple[WireType, list[Run]]] = field(default_factory=dict)
    diagnostics: Diagnostics = field(default_factory=Diagnostics)

    def message(self, definition: MessageDefinition, path: tuple[Step, ...]) -> None:
        if not definition.fields:
            self.cursor += self.rules.empty_bytes
        for member in definition.fields:
            self.member(member, path)

    def member(self, member: Field, path: tuple[Step, ...]) -> None:
        is_array = isinstance(member.type, ArrayType)
        element = member.type.element if isinstance(member.type, ArrayType) else member.type
        count = member.type.length if isinstance(member.type, ArrayType) else None
        here = (*path, Step(member.name, count))
        if isinstance(element, MessageType):
            for _ in range(count if is_array and count is not None else 1):
                self.message(self.definitions[element.name], here)
        elif isinstance(element, PrimitiveType):
            self.primitive(element.name, here, count)
        else:
            self.variable(member, path)

    def primitive(self, name: str, path: tuple[Step, ...], count: int | None) -> None:
        parts = self.rules.compounds.get(name)
        if parts is None:
            self.values(self.rules.scalars[name], path, 1 if count is None else count)
            return
        for _ in range(1 if count is None else count):
            for part, type_ in parts:
                self.values(type_, (*path, Step(part)), 1)

    def values(self, type_: WireType, path: tuple[Step, ...], count: int) -> None:
        """Note `count` values side by side at the cursor."""
        runs = self.leaves.setdefault(path, (type_, []))[1]
        if count == 0:
            return
        self.cursor = self.rules.align(self.cursor, type_.size)
        offset = len(self.rules.prefix) + self.cursor
        if runs and runs[-1].offset + runs[-1].count * type_.size == offset:
            runs[-1] = Run(runs[-1].offset, runs[-1].count + count)
        else:
            runs.append(Run(offset, count))
        self.cursor += count * type_.size

    def variable(self, member: Field, path: tuple[Step, ...]) -> None:
        name = ".".join([step.name for step in path] + [member.name])
        self.diagnostics.error(
            f"field '{name}' of type '{member.type}' has no fixed size",
            _known(member.source),
            "converters take messages of fixed size: numbers, time, duration, fixed arrays and messages of these",
        )


def _known(source: SourceRef) -> SourceRef | None:
    return source if source.line else None
