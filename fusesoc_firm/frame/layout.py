"""Compute the Frame of a message: walk the definition in wire order and record the position of every element."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from fusesoc_firm.frame.model import (
    COUNT_BYTES,
    Data,
    DataKind,
    Fixed,
    Frame,
    FrameField,
    Loop,
    Node,
    Pad,
    Path,
    Run,
    Step,
)
from fusesoc_firm.frame.position import Position
from fusesoc_firm.message.bounds import is_streamed
from fusesoc_firm.message.middleware import Definitions, MessageDefinition
from fusesoc_firm.message.model import (
    ArrayType,
    DefaultValue,
    ElementType,
    Field,
    FieldType,
    MessageName,
    MessageType,
    PrimitiveType,
    SequenceType,
    StringType,
)
from fusesoc_firm.message.wire import CHARACTER, WIDE_CHARACTER, WireRules, WireType


def frame_of(name: MessageName, definitions: Definitions) -> Frame:
    """Return the frame of the message `name`; `definitions` contains this message and all nested messages."""
    definition = definitions[name]
    rules = definition.ros.rules
    walk = _Walk(_Types(rules, definitions), Position(rules.max_alignment, frozenset({0})), size=len(rules.prefix))
    walk.message(definition, ())
    return Frame(
        message=name,
        ros=definition.ros,
        prefix=rules.prefix,
        checked_prefix=rules.checked_prefix,
        nodes=walk.finish(),
        trailing_bytes=rules.trailing_bytes,
    )


@dataclass
class _Types:
    """Properties of types, each computed once, since types are nested and may occur many times."""

    rules: WireRules
    definitions: Definitions
    _fixed: dict[MessageName, bool] = field(default_factory=dict)
    _ends: dict[tuple[ElementType, Position], Position] = field(default_factory=dict)

    def has_fixed_size(self, type_: FieldType) -> bool:
        match type_:
            case ArrayType(element, length):
                # An array without elements has no bytes.
                return length == 0 or (self.has_fixed_size(element) and not is_streamed(type_, self.rules))
            case MessageType(name):
                if name not in self._fixed:
                    fields = self.definitions[name].fields
                    self._fixed[name] = all(self.has_fixed_size(member.type) for member in fields)
                return self._fixed[name]
        return isinstance(type_, PrimitiveType)

    def behind(self, element: ElementType, position: Position, member: Field) -> Position:
        """Return the position after an element of `member` that begins at `position`."""
        key = element, position
        if key not in self._ends:
            walk = _Walk(self, position, has_nodes=False)
            walk.element(element, (), 1, member)
            self._ends[key] = walk.position
        return self._ends[key]

    def steady(self, element: ElementType, position: Position, member: Field) -> Position:
        """Return the possible starts of any element in an array that begins at `position`.

        An element starts at the start of the array or at the end of the previous element. The result is the smallest
        set of positions that contains all starts.
        """
        while (known := position.joined(self.behind(element, position, member))) != position:
            position = known
        return position


@dataclass
class _Leaf:
    """A `FrameField` under construction."""

    type: WireType
    first: int
    default: DefaultValue | None
    runs: list[Run] = field(default_factory=list)

    def add(self, run: Run) -> None:
        """Add a run; if it is adjacent to the last run, merge both."""
        last = self.runs[-1] if self.runs else None
        if last and last.offset + last.count * self.type.size == run.offset:
            self.runs[-1] = Run(last.offset, last.count + run.count)
        else:
            self.runs.append(run)


@dataclass
class _Walk:
    """The state of a walk through a message or a loop's element: the current position and the nodes so far.

    `size` and `leaves` belong to the `Fixed` that is still open; `passed` counts the elements of each leaf so far. If
    `has_nodes` is false, only the position is computed.
    """

    types: _Types
    position: Position
    size: int = 0
    nodes: list[Node] = field(default_factory=list)
    leaves: dict[Path, _Leaf] = field(default_factory=dict)
    passed: Counter[Path] = field(default_factory=Counter)
    has_nodes: bool = True

    def message(self, definition: MessageDefinition, path: Path) -> None:
        if not definition.fields:
            self.skip(self.types.rules.empty_bytes)
        for member in definition.fields:
            self.member(member, path)

    def finish(self) -> tuple[Node, ...]:
        """Return the nodes in wire order."""
        if self.size or self.leaves:
            fields = (
                FrameField(path, leaf.type, tuple(leaf.runs), leaf.first, leaf.default)
                for path, leaf in self.leaves.items()
            )
            self.nodes.append(Fixed(self.size, tuple(fields)))
            self.size, self.leaves = 0, {}
        return tuple(self.nodes)

    # --- one field, by its type --------------------------------------------------------------------------------

    def member(self, member: Field, path: Path) -> None:
        match member.type:
            case SequenceType(PrimitiveType(name), bound) if name in self.types.rules.scalars:
                here = (*path, Step(member.name))
                self.data(DataKind.ARRAY, self.types.rules.scalars[name], here, bound, member)
            case SequenceType(element, bound):
                self.loop(element, path, None, bound, member)
            case ArrayType(element, length) if not self.types.has_fixed_size(member.type):
                self.loop(element, path, length, None, member)
            case ArrayType(element, length):
                self.element(element, (*path, Step(member.name, length)), length, member)
            case element:
                self.element(element, (*path, Step(member.name)), 1, member)

    def element(self, element: ElementType, path: Path, count: int, member: Field) -> None:
        """Add `count` adjacent elements; `count` is always 1 for a string."""
        match element:
            case PrimitiveType(name) if name in self.types.rules.scalars:
                self.values(self.types.rules.scalars[name], path, count, member.default)
            case PrimitiveType(name):
                for _ in range(count):
                    for part, type_ in self.types.rules.compounds[name]:
                        self.values(type_, (*path, Step(part)), 1, None)
            case MessageType(name) if self.has_nodes or not path:
                for _ in range(count):
                    self.message(self.types.definitions[name], path)
            case MessageType():
                for _ in range(count):
                    self.position = self.types.behind(element, self.position, member)
            case StringType(is_wide, bound) if count:
                kind = DataKind.WSTRING if is_wide else DataKind.STRING
                self.data(kind, WIDE_CHARACTER if is_wide else CHARACTER, path, bound, member)

    # --- nodes -------------------------------------------------------------------------------------------------

    def skip(self, size: int) -> None:
        self.size += size
        self.position = self.position.advanced(size)

    def align(self, size: int) -> None:
        """Advance to the next legal start of a value of `size` bytes."""
        alignment = self.types.rules.alignment(size)
        padding = self.position.padding(alignment)
        if padding is None:
            self.append(Pad(alignment))
            self.position = self.position.aligned(alignment)
        else:
            self.skip(padding)

    def append(self, node: Node) -> None:
        self.finish()
        self.nodes.append(node)

    def values(self, type_: WireType, path: Path, count: int, default: DefaultValue | None) -> None:
        """Add `count` adjacent values of a leaf."""
        if count:
            self.align(type_.size)
        leaf = self.leaves.setdefault(path, _Leaf(type_, self.passed[path], default))
        if count:
            leaf.add(Run(self.size, count))
        self.passed[path] += count
        self.skip(count * type_.size)

    def data(self, kind: DataKind, element: WireType, path: Path, bound: int | None, member: Field) -> None:
        rules = self.types.rules
        terminator = rules.string_terminator if kind is DataKind.STRING else 0
        # The default of a string array belongs to the loop.
        default = None if _is_array_of_texts(member.type) else member.default
        self.align(COUNT_BYTES)
        behind_count = self.position.advanced(COUNT_BYTES)
        alignment = rules.alignment(element.size)
        padding = behind_count.padding(alignment)
        ros_type = str(member.type)
        self.append(
            Data(path, kind, element, ros_type, bound, terminator, alignment, padding, default, source=member.source)
        )
        some = behind_count.aligned(alignment).repeated(element.size, bound)
        self.position = behind_count.joined(some).advanced(terminator)

    def loop(self, element: ElementType, path: Path, count: int | None, bound: int | None, member: Field) -> None:
        here = (*path, Step(member.name))
        if count is None:
            self.align(COUNT_BYTES)
        start = self.position.advanced(COUNT_BYTES if count is None else 0)
        known = self.types.steady(element, start, member)
        if self.has_nodes:
            walk = _Walk(self.types, known)
            walk.element(element, here, 1, member)
            body = walk.finish()
            self.append(Loop(here, str(member.type), count, bound, body, member.default, source=member.source))
        self.position = known if count is None else self.types.behind(element, known, member)


def _is_array_of_texts(type_: FieldType) -> bool:
    return isinstance(type_, ArrayType | SequenceType) and isinstance(type_.element, StringType)
