"""The program of a converter for a message of variable size: a list of steps in wire order.

A subscriber takes the bytes of a frame step by step; a publisher sends them step by step. Both use the same kinds of
steps:

    Header              the payload's length
    Block               bytes of known arrangement
    Padding             padding that depends on the position
    Count, Open         a part's number of elements; the beginning of a part, before its padding
    Stream              the elements of a string or an array of numbers
    Close               the end of an element of an array of messages or strings
    Tail, Drop          the unused rest of the payload: its length, and its bytes
    End                 the end of the message

The index in the list identifies a step. Each step is followed by the next step in the list, with three exceptions whose
targets `Program` computes: `Open` and `Tail` of an empty part, and `Close`.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from fusesoc_firm.frame.defaults import default_elements
from fusesoc_firm.frame.model import COUNT_BYTES, Data, DataKind, Fixed, Frame, FrameField, Loop, Node, Pad, Path, Run
from fusesoc_firm.frame.values import dotted, units_of

# The loops around a step, outermost first.
Scope = tuple[Loop, ...]


@dataclass(frozen=True)
class Segment:
    """Values that become valid together: segment `number` of a message or of a loop's element, counted from 0.

    A segment consists of the used fields of fixed size up to the next variable part, and of this part's length if the
    part is used. The first segment of a message always exists and contains the payload's length. Any other segment
    exists only if it holds a value.
    """

    scope: Scope
    number: int


@dataclass(frozen=True)
class Header:
    """The payload's length; `completes` is segment 0 if that segment contains only the length."""

    completes: Segment | None = None
    segment: Segment | None = None


@dataclass(frozen=True)
class Block:
    """A block of `size` bytes; the runs of `fields` and the offsets of `constants` count from its first byte.

    A constant is a pair (offset, bytes) that a publisher sends. `checks` has the same form: a subscriber compares the
    received bytes with the bytes in `checks`. All other bytes are padding or unused. `completes` is the segment that
    ends with this block; if a `Count` or an `Open` follows, that step completes the segment instead.
    """

    scope: Scope
    size: int
    fields: tuple[FrameField, ...] = ()
    constants: tuple[tuple[int, bytes], ...] = ()
    checks: tuple[tuple[int, bytes], ...] = ()
    segment: Segment | None = None
    completes: Segment | None = None


@dataclass(frozen=True)
class Padding:
    """Padding up to a multiple of `alignment`; positions count from the end of the prefix.

    If it `closes_text`, a text's terminating zero precedes the padding, and both take 1 to `alignment` bytes.
    """

    scope: Scope
    alignment: int
    closes_text: bool = False


@dataclass(frozen=True)
class Count:
    """The four bytes on the wire that hold a part's number of elements."""

    scope: Scope
    part: Data | Loop
    segment: Segment | None = None


@dataclass(frozen=True)
class Open:
    """The beginning of a part with a known number of elements, before its padding.

    It skips an empty part, which has no padding, and completes a segment.
    """

    scope: Scope
    part: Data | Loop
    completes: Segment | None = None


@dataclass(frozen=True)
class Stream:
    """The elements of a string or of an array of numbers."""

    scope: Scope
    part: Data


@dataclass(frozen=True)
class Close:
    """The end of an element of `loop`; `scope` is the element's scope, which includes the loop."""

    scope: Scope
    loop: Loop


@dataclass(frozen=True)
class Tail:
    """The length of the rest of the payload. An empty rest is skipped."""


@dataclass(frozen=True)
class Drop:
    """The bytes of the rest of the payload."""


@dataclass(frozen=True)
class End:
    """The end of the message."""


Step = Header | Block | Padding | Count | Open | Stream | Close | Tail | Drop | End


@dataclass(frozen=True)
class Program:
    """The steps of a converter of `frame`."""

    frame: Frame
    steps: tuple[Step, ...]

    @property
    def streams(self) -> tuple[Data, ...]:
        """All strings and arrays of numbers, in wire order."""
        return tuple(step.part for step in self.steps if isinstance(step, Stream))

    def segments(self, scope: Scope = ()) -> int:
        """The number of segments of the message, or of an element of the innermost loop of `scope`."""
        return self._completed[_path(scope)]

    @cached_property
    def _completed(self) -> Counter[Path]:
        """The number of segments of each scope, by its path."""
        steps = (step for step in self.steps if isinstance(step, Header | Block | Open))
        return Counter(_path(step.completes.scope) for step in steps if step.completes)

    def behind(self, number: int) -> int:
        """The target of an `Open` if its part is empty."""
        opening = self.steps[number]
        assert isinstance(opening, Open)
        if isinstance(opening.part, Data):
            return _stream_behind(self.steps, number) + 1
        return self._closings.get(id(opening.part), number) + 1

    def body(self, number: int) -> int:
        """The target of a `Close` if another element follows."""
        closing = self.steps[number]
        assert isinstance(closing, Close)
        return self._openings[id(closing.loop)] + 1

    @cached_property
    def _openings(self) -> dict[int, int]:
        """The index of each part's `Open`, by the part's identity, since `==` on parts compares contents."""
        return {id(step.part): place for place, step in enumerate(self.steps) if isinstance(step, Open)}

    @cached_property
    def _closings(self) -> dict[int, int]:
        """The index of each loop's `Close`, by the loop's identity."""
        return {id(step.loop): place for place, step in enumerate(self.steps) if isinstance(step, Close)}


def _path(scope: Scope) -> Path:
    """The path of the innermost loop of a scope."""
    return scope[-1].path if scope else ()


def subscriber_program(frame: Frame) -> Program:
    """The program of a subscriber, which skips unused parts."""
    builder = _Builder()
    builder.header(frame)
    builder.nodes(frame.nodes)
    return Program(frame, _cut_behind_last_use(builder.finish()))


def publisher_program(frame: Frame) -> Program:
    """The program of a publisher, which sends unused parts as defaults, zeros or empty arrays."""
    builder = _Builder(is_publisher=True)
    builder.header(frame)
    builder.nodes(frame.nodes)
    return Program(frame, builder.finish())


@dataclass
class _Builder:
    """The state of one walk through the nodes of a message.

    `block` is the current block. `open_steps` are the indices of the current segment's steps, and `is_valued` means
    that this segment holds a value. `numbers` are the next segment numbers, one for each enclosing scope.
    """

    is_publisher: bool = False
    scope: Scope = ()
    steps: list[Step] = field(default_factory=list)
    block: Block = Block((), 0)
    open_steps: list[int] = field(default_factory=list)
    is_valued: bool = False
    numbers: list[int] = field(default_factory=lambda: [0])

    def header(self, frame: Frame) -> None:
        self._append(Header())
        self.is_valued = True
        if frame.prefix:
            checked = frame.prefix[: frame.checked_prefix]
            self.block = replace(self.block, constants=((0, frame.prefix),), checks=((0, checked),))

    def finish(self) -> tuple[Step, ...]:
        self._close_segment()
        self.steps.append(End())
        return tuple(self.steps)

    def nodes(self, nodes: Iterable[Node]) -> None:
        for node in nodes:
            match node:
                case Fixed():
                    self._fixed(node)
                case Pad(alignment):
                    self._pad(alignment)
                case Data() if node.is_used or not self.is_publisher:
                    self._data(node)
                case Loop() if node.is_used or not self.is_publisher:
                    self._loop(node)
                case Data() | Loop():
                    self._constant(node, node.default)

    # --- parts of the message -----------------------------------------------------------------------------------

    def _fixed(self, node: Fixed) -> None:
        start = self.block.size
        for leaf in node.fields:
            if leaf.is_used and leaf.held:
                runs = tuple(Run(start + run.offset, run.count) for run in leaf.runs)
                self.block = replace(self.block, fields=(*self.block.fields, replace(leaf, runs=runs)))
                self.is_valued = True
            else:
                defaults = ((start + offset, data) for offset, data in default_elements(leaf))
                self.block = replace(self.block, constants=(*self.block.constants, *defaults))
        self.block = replace(self.block, size=start + node.size)

    def _pad(self, alignment: int) -> None:
        closes_text = self.block == _terminating(self.scope)
        if closes_text:
            self.block = Block(self.scope, 0)
        self._flush()
        self._append(Padding(self.scope, alignment, closes_text))

    def _data(self, node: Data) -> None:
        self._count(node)
        self._open(node)
        # No segment waits for the padding, which comes before the part.
        if node.padding is None:
            self._append(Padding(self.scope, node.alignment), in_segment=False)
        elif node.padding:
            self._append(Block(self.scope, node.padding), in_segment=False)
        self._append(Stream(self.scope, node), in_segment=False)
        if node.terminator:
            self.block = _terminating(self.scope)

    def _loop(self, node: Loop) -> None:
        if node.count is None:
            self._count(node)
        self._open(node)
        if not has_bytes(node):
            return
        # After an unused loop, the enclosing segment continues.
        outer = self.scope, self.open_steps, self.is_valued
        self.scope, self.open_steps, self.is_valued = (*self.scope, node), [], False
        self.block = Block(self.scope, 0)
        self.numbers.append(0)
        self.nodes(node.body)
        self._close_segment()
        self._append(Close(self.scope, node), in_segment=False)
        self.numbers.pop()
        self.scope, self.open_steps, self.is_valued = outer
        self.block = Block(self.scope, 0)

    def _count(self, part: Data | Loop) -> None:
        self._flush()
        self._append(Count(self.scope, part))
        self.is_valued |= part.is_used

    def _open(self, part: Data | Loop) -> None:
        self._flush()
        self._append(Open(self.scope, part))
        if part.is_used:
            self._close_segment()

    # --- constants for unused parts -----------------------------------------------------------------------------

    def _constant(self, node: Data | Loop, value: Any) -> None:
        if isinstance(node, Data):
            self._constant_data(node, value)
            return
        elements = list(value or [None] * (node.count or 0))
        if node.count is None:
            self._constant_bytes(len(elements).to_bytes(COUNT_BYTES, "little"))
        for element in elements:
            for inner in node.body:
                if isinstance(inner, Data | Loop):
                    self._constant(inner, inner.default if element is None else element)
                else:
                    self.nodes([inner])

    def _constant_data(self, node: Data, value: Any) -> None:
        if node.kind is DataKind.ARRAY:
            data = struct.pack(f"<{len(value or ())}{node.element.code}", *(value or ()))
        else:
            data = bytes(units_of(node, value or ""))
        count = len(data) // node.element.size + node.terminator
        self._constant_bytes(count.to_bytes(COUNT_BYTES, "little"))
        if data and node.padding is None:
            self._flush()
            self._append(Padding(self.scope, node.alignment))
        elif data:
            self._constant_bytes(bytes(node.padding or 0))
        self._constant_bytes(data + bytes(node.terminator))

    def _constant_bytes(self, data: bytes) -> None:
        constants = (*self.block.constants, (self.block.size, data)) if data else self.block.constants
        self.block = replace(self.block, size=self.block.size + len(data), constants=constants)

    # --- blocks and segments ------------------------------------------------------------------------------------

    def _append(self, step: Step, *, in_segment: bool = True) -> None:
        if in_segment:
            self.open_steps.append(len(self.steps))
        self.steps.append(step)

    def _flush(self) -> None:
        if self.block.size:
            self._append(self.block)
        self.block = Block(self.scope, 0)

    def _close_segment(self) -> None:
        """Assign the steps since the last segment to a new segment if they hold a value."""
        self._flush()
        if self.is_valued:
            segment = Segment(self.scope, self.numbers[-1])
            self.numbers[-1] += 1
            last = max(place for place in self.open_steps if _is_valued(self.steps[place]))
            for place in self.open_steps:
                step = self.steps[place]
                if isinstance(step, Header | Block | Count) and place <= last:
                    self.steps[place] = step = replace(step, segment=segment)
                if isinstance(step, Header | Block | Open) and place == last:
                    self.steps[place] = replace(step, completes=segment)
        self.open_steps = []
        self.is_valued = False


def _is_valued(step: Step) -> bool:
    """Whether a segment may end with the step."""
    match step:
        case Header():
            return True
        case Block(fields=fields):
            return bool(fields)
        case Open(part=part):
            return part.is_used
    return False


def _cut_behind_last_use(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Replace the steps after the last used step by a `Tail` and a `Drop`, unless they only close a text."""
    last = max(place for place, step in enumerate(steps) if _is_used(step))
    # A loop always runs to its end.
    closings = {step.loop.path: place for place, step in enumerate(steps) if isinstance(step, Close)}
    scope: Scope = getattr(steps[last], "scope", ())
    if scope:
        last = closings[scope[0].path]
    # Opening a stream counts its bytes and a text's terminating zero, so the cut is after them.
    if opens_data(steps[last]):
        last = _stream_behind(steps, last)
    rest = steps[last + 1 : -1]
    if not any(isinstance(step, Count | Open) or (isinstance(step, Block) and not step.checks) for step in rest):
        return tuple(steps)
    return (*steps[: last + 1], *_terminator(steps[last]), Tail(), Drop(), steps[-1])


def _stream_behind(steps: Sequence[Step], opening: int) -> int:
    """The stream that the step `opening` opens."""
    return next(place for place in range(opening, len(steps)) if isinstance(steps[place], Stream))


def opens_data(step: Step) -> bool:
    """Whether a stream follows the step."""
    return isinstance(step, Open) and isinstance(step.part, Data)


def _terminator(step: Step) -> Iterator[Block]:
    """Yield the step that reads a text's terminating zero, if present, after the text."""
    if isinstance(step, Stream) and step.part.terminator:
        yield _terminating(step.scope)


def _terminating(scope: Scope) -> Block:
    """The terminating zero of a text."""
    zeros = ((0, b"\x00"),)
    return Block(scope, 1, constants=zeros, checks=zeros)


def _is_used(step: Step) -> bool:
    match step:
        case Header():
            return True
        case Block(fields=fields, completes=completes):
            return bool(fields) or completes is not None
        case Open(part=part, completes=completes):
            return part.is_used or completes is not None
        case Stream(part=part):
            return part.is_used
        case Close(loop=loop):
            return loop.is_used
    return False


def has_bytes(loop: Loop) -> bool:
    """Whether the loop's elements have bytes; otherwise, only their number is transferred."""
    return any(not isinstance(node, Fixed) or node.size for node in loop.body)


def comment(step: Step) -> str:
    """A short description of a step, for the list of steps in generated VHDL."""
    match step:
        case Header():
            return "the payload's length"
        case Block(fields=fields):
            return ", ".join(dict.fromkeys(dotted(leaf.names) for leaf in fields))
        case Padding(alignment=alignment, closes_text=closes_text):
            return f"{'a zero and ' if closes_text else ''}padding to a multiple of {alignment}"
        case Count(part=part) | Open(part=part) | Stream(part=part):
            return dotted(part.names)
        case Close(loop=loop):
            return dotted(loop.names)
    return ""
