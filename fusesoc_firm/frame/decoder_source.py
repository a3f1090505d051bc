"""Generate the function that decodes the payloads of a frame.

The function reads each `Fixed` by one call of `struct`, and arrays by NumPy. It raises an exception of any type for a
payload that is not valid; `decoder.field_ranges` finds the reason.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby, islice
from typing import Any

import numpy as np

from fusesoc_firm.frame.model import (
    COUNT_BYTES,
    MOST_EMPTY_ELEMENTS,
    Data,
    DataKind,
    Fixed,
    Frame,
    FrameField,
    Loop,
    Node,
    Pad,
    Path,
    has_bytes,
)
from fusesoc_firm.frame.source import (
    Module,
    array_type,
    block_code,
    block_of,
    indented,
    is_in_block,
    is_plain,
)
from fusesoc_firm.frame.values import text_of, unpacked
from fusesoc_firm.message.wire import WireType

Entry = tuple[Path, FrameField | str]
"""The path to a value, and its expression, or the leaf of a block, whose elements `block` yields."""
_FAULT = "raise UnusualError"


def decoder_of(frame: Frame, has_arrays: bool) -> Callable[[bytes | bytearray], Any]:
    """Return the function from a payload to its message; arrays of numbers are views of the payload, or lists."""
    module = Module()
    body = _Body(_Decoder(frame, module, has_arrays), "", 0)
    body.read(frame.nodes)
    value = body.value()
    lines = ["end = len(payload)"]
    if checked := frame.prefix[: frame.checked_prefix]:
        lines.append(f"if payload[:{len(checked)}] != {checked!r}: {_FAULT}")
    comparison = "<" if frame.trailing_bytes else "!="
    lines += [*body.lines, f"if end {comparison} {body.at()}: {_FAULT}", f"return {value}"]
    module.add("decode", "payload", lines)
    decode: Callable[[bytes | bytearray], Any] = module.compiled("decode")
    return decode


class _Decoder:
    """The properties of the generated module that all its functions share."""

    def __init__(self, frame: Frame, module: Module, has_arrays: bool) -> None:
        self.prefix_bytes = len(frame.prefix)
        self.module = module
        self._has_arrays = has_arrays
        for function in (single, singles, text_of, islice, np.frombuffer):
            module.shared(function)

    def array(self, type_: WireType, count: str, start: str) -> str:
        """Return the expression of an array of numbers in the payload."""
        is_bool = type_.code == "?"
        octets = self.module.constant("octets", np.dtype("u1"))
        found = f"frombuffer(payload, {octets if is_bool else self.module.type(type_)}, {count}, {start})"
        found = f"({found} != 0)" if is_bool else found
        if self._has_arrays:
            return found
        return f"singles({found})" if type_.code == "f" else f"{found}.tolist()"

    def is_octets(self, node: Data) -> bool:
        """Return whether a sequence is decoded to bytes."""
        return not self._has_arrays and node.kind is DataKind.ARRAY and node.element.code == "B"

    def literal(self, entries: Sequence[Entry], depth: int, blocks: Mapping[Path, str]) -> str:
        """Return the expression of the message at the end of `depth` names; `blocks` are the names of iterators."""
        parts = []
        for step, group in groupby(entries, key=lambda entry: entry[0][depth]):
            inner = [*group]
            path, item = inner[0]
            if len(path) == depth + 1:
                value = item if isinstance(item, str) else self._of_block(item)
            elif step.count is None:
                value = self.literal(inner, depth + 1, blocks)
            else:
                block = blocks.get(path[: depth + 1], "block")
                value = f"[{self._element(inner, depth + 1)}({block}) for _ in range({step.count})]"
            parts.append(f"{step.name!r}: {value}")
        return f"{{{', '.join(parts)}}}"

    def _element(self, entries: Sequence[Entry], depth: int) -> str:
        """Return the name of the function that returns an element of a block, from the iterator of its numbers."""
        name = self.module.name("element")
        self.module.add(name, "block", [f"return {self.literal(entries, depth, {})}"])
        return name

    def _of_block(self, leaf: FrameField) -> str:
        """Return the expression of one element of a leaf, or of an array of them, in a block."""
        count = leaf.path[-1].count
        if count is None:
            return "single(next(block))" if leaf.type.code == "f" else "next(block)"
        if self._has_arrays:
            made = self.module.constant(("block", leaf.type.code), _array_maker(leaf.type))
            return f"{made}([*islice(block, {count})])"
        return f"[{'single(n)' if leaf.type.code == 'f' else 'n'} for n in islice(block, {count})]"


class _Body:
    """The statements that read the nodes of a message, or of a loop's element at the end of `depth` names.

    The position in the payload is the value of a variable, which is missing at the start, plus an offset.
    """

    def __init__(self, decoder: _Decoder, position: str, depth: int) -> None:
        self.lines: list[str] = []
        self._decoder = decoder
        self._module = decoder.module
        self._depth = depth
        self._position, self._offset = position, 0
        self._entries: dict[Path, FrameField | str] = {}
        self._blocks: dict[Path, list[str]] = {}
        self._open = Fixed(0, ())

    def at(self, more: int = 0) -> str:
        """Return the expression of the position after `more` bytes."""
        offset = self._offset + more
        return str(offset) if not self._position else f"{self._position} + {offset}" if offset else self._position

    def read(self, nodes: Sequence[Node]) -> None:
        """Add the statements for the nodes."""
        for node in nodes:
            match node:
                case Fixed():
                    self._open = node
                case Pad(alignment):
                    self._unpack()
                    self._move(self._aligned(alignment))
                case Data():
                    self._data(node)
                case Loop():
                    self._loop(node)
        self._unpack()

    def value(self) -> str:
        """Return the expression of the value, after all nodes are read."""
        for path, item in self._entries.items():
            if len(path) == self._depth and isinstance(item, str):
                return item
        names = {path: self._module.name("block") for path in self._blocks}
        for path, pieces in self._blocks.items():
            self.lines.append(f"{names[path]} = iter({' + '.join(pieces) or '()'})")
        return self._decoder.literal([*self._entries.items()], self._depth, names)

    # --- nodes -------------------------------------------------------------------------------------------------

    def _unpack(self, count: str = "") -> None:
        """Read the open `Fixed`, and the count after it if it has a name."""
        fixed, self._open = self._open, Fixed(0, ())
        scalars = {}
        for leaf in fixed.fields:
            if is_in_block(leaf):
                self._blocks.setdefault(block_of(leaf.path), [])
                self._entries.setdefault(leaf.path, leaf)
            elif is_plain(leaf):
                start = self.at(leaf.runs[0].offset if leaf.runs else 0)
                self._enter(leaf.path, self._decoder.array(leaf.type, str(leaf.count), start))
            else:
                scalars[leaf.path] = self._entries[leaf.path] = self._module.name("v")
        self._unpack_numbers(fixed, scalars, count)
        self._offset += fixed.size + (COUNT_BYTES if count else 0)

    def _unpack_numbers(self, fixed: Fixed, scalars: dict[Path, str], count: str) -> None:
        form, targets, end, place = "", [], 0, 0
        pieces: list[tuple[Path, int, int]] = []
        for offset, number, leaf in _numbers(fixed):
            is_scalar = leaf.path in scalars
            form += f"{offset - end}x" * (offset > end)
            form += f"{number}{leaf.type.code if is_scalar else block_code(leaf.type)}"
            end = offset + number * leaf.type.size
            if is_scalar:
                targets.append((scalars[leaf.path], place))
            else:
                pieces.append((block_of(leaf.path), place, place + number))
            place += number
        if count:
            form += f"{fixed.size - end}x" * (fixed.size > end) + "I"
            targets.append((count, place))
        if form:
            self._assign(f"{self._module.unpacker(form)}(payload, {self.at()})", targets, pieces)
        for leaf in fixed.fields:
            if leaf.path in scalars and leaf.type.code == "f":
                name, at = scalars[leaf.path], self.at(leaf.runs[0].offset)
                word = f"{self._module.unpacker('I')}(payload, {at})"
                self.lines.append(f"if {name} != {name}: {name} = single(*{word})")

    def _assign(self, found: str, targets: list[tuple[str, int]], pieces: list[tuple[Path, int, int]]) -> None:
        """Add the assignments of unpacked numbers: `targets` are names and places, `pieces` are parts of blocks."""
        if not pieces:
            self.lines.append(f"{', '.join(name for name, _ in targets)}, = {found}")
            return
        numbers = self._module.name("t")
        self.lines.append(f"{numbers} = {found}")
        self.lines += [f"{name} = {numbers}[{place}]" for name, place in targets]
        for path, parts in groupby(pieces, key=lambda piece: piece[0]):
            all_parts = [*parts]
            self._blocks[path].append(f"{numbers}[{all_parts[0][1]}:{all_parts[-1][2]}]")

    def _data(self, node: Data) -> None:
        count = self._count(node)
        self._pad(count, node.padding, node.alignment)
        start, end = self.at(), self._module.name("p")
        size = node.element.size
        self.lines.append(f"{end} = {start} + {count if size == 1 else f'{count} * {size}'}")
        if node.kind is DataKind.ARRAY and not self._decoder.is_octets(node):
            self._enter(node.path, self._decoder.array(node.element, count, start))
        else:
            self._check_end(node, count, end)
            units = f"payload[{start}:{f'{end} - {node.terminator}' if node.terminator else end}]"
            self._enter(node.path, self._text(node, units))
        self._move(end)

    def _text(self, node: Data, units: str) -> str:
        if node.kind is DataKind.STRING:
            return f"{units}.decode('utf-8', 'surrogateescape')"
        return f"text_of({self._module.constant(node, node)}, {units})" if node.kind is DataKind.WSTRING else units

    def _check_end(self, node: Data, count: str, end: str) -> None:
        """Add the check that the text ends within the payload, with its terminator."""
        if node.terminator:
            # An index behind the end raises an exception, too.
            zeros = " or ".join(f"payload[{end} - {place}]" for place in range(1, node.terminator + 1))
            self.lines.append(f"if {count} < {node.terminator} or {zeros}: {_FAULT}")
        else:
            self.lines.append(f"if {end} > end: {_FAULT}")

    def _loop(self, node: Loop) -> None:
        count = self._count(node) if node.count is None else str(node.count)
        self._unpack()
        if node.number:
            first = node.body[0]
            self._pad(count, None if isinstance(first, Pad) else 0, node.number.type.size)
            self._enter(node.path, self._decoder.array(node.number.type, count, self.at()))
            self._move(f"{self.at()} + {count} * {node.number.type.size}")
            return
        if not has_bytes(node.body):
            self.lines.append(f"if {count} > {MOST_EMPTY_ELEMENTS}: {_FAULT}")
        value, end = self._module.name("v"), self._module.name("p")
        self.lines.append(f"{value}, {end} = {self._reader(node)}(payload, {self.at()}, {count}, end)")
        self._entries[node.path] = value
        self._move(end)

    def _reader(self, node: Loop) -> str:
        """Return the name of the function that reads the elements of a loop."""
        body = _Body(self._decoder, "p", len(node.path))
        body.read(node.body)
        value = body.value()
        name = self._module.name("read")
        lines = [*body.lines, f"values.append({value})", *([f"p = {body.at()}"] if body.at() != "p" else [])]
        self._module.add(
            name,
            "payload, p, count, end",
            ["values = []", "for _ in range(count):", *indented(lines), "return values, p"],
        )
        return name

    # --- parts of nodes ------------------------------------------------------------------------------------------

    def _count(self, node: Data | Loop) -> str:
        count = self._module.name("n")
        self._unpack(count)
        if node.bound is not None:
            terminator = node.terminator if isinstance(node, Data) else 0
            self.lines.append(f"if {count} > {node.bound + terminator}: {_FAULT}")
        return count

    def _pad(self, count: str, padding: int | None, alignment: int) -> None:
        """Move behind the padding before elements, if there are any."""
        if padding == 0:
            return
        moved = self._aligned(alignment) if padding is None else self.at(padding)
        self._move(f"{moved} if {count} else {self.at()}")

    def _aligned(self, alignment: int) -> str:
        """Return the expression of the next position at a multiple of `alignment`, a power of two."""
        past = (self._decoder.prefix_bytes - self._offset) % alignment
        return f"{self.at()} + ({past or ''}-{self._position or 0} & {alignment - 1})"

    def _move(self, position: str) -> None:
        if not position.isidentifier():
            name = self._module.name("p")
            self.lines.append(f"{name} = {position}")
            position = name
        self._position, self._offset = position, 0

    def _enter(self, path: Path, expression: str) -> None:
        name = self._module.name("v")
        self.lines.append(f"{name} = {expression}")
        self._entries[path] = name


def _numbers(fixed: Fixed) -> Iterator[tuple[int, int, FrameField]]:
    """Yield the offset and count of adjacent numbers, in wire order, except for those of plain arrays."""
    found = [(run.offset, run.count, leaf) for leaf in fixed.fields if not is_plain(leaf) for run in leaf.runs]
    yield from sorted(found, key=lambda item: item[0])


def _array_maker(type_: WireType) -> Callable[[list[Any]], np.ndarray[Any, Any]]:
    """Return the function from the unpacked numbers of a block to their array."""
    code = block_code(type_)
    return lambda numbers: np.array(numbers, f"<{code}").view(array_type(type_))


def single(word: int) -> float:
    """Return the float32 with the bits `word`."""
    number: float = unpacked("f", struct.pack("<I", word))[0]
    return number


def singles(numbers: np.ndarray[Any, Any]) -> list[Any]:
    """Return the numbers in an array of float32; the bits of each NaN are kept."""
    return [*unpacked("f", numbers.tobytes())] if np.isnan(numbers).any() else numbers.tolist()
