"""Generate the function that encodes the messages of a frame.

The function packs the numbers between two variable parts by one call of `struct`, and joins all parts once. It accepts
complete messages: each mapping has exactly the names of its fields, and arrays are lists, tuples, bytes or NumPy arrays
of the field's type. For other values it raises an exception of any type; `encoder.checked` converts them or finds the
fault.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
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
    UnusualError,
    array_type,
    block_code,
    block_of,
    indented,
    is_in_block,
    is_plain,
)
from fusesoc_firm.frame.values import SignallingNan, packed, units_of
from fusesoc_firm.message.wire import WireType

Entry = tuple[Path, FrameField | Data | Loop]
_FAULT = "raise UnusualError"
_COPIED_BYTES = 4096
"""Up to this size, a copy of an array's bytes takes less time than a view of them."""
_SHORT = 64


def encoder_of(frame: Frame) -> Callable[[Any], bytes]:
    """Return the function from a message to its payload."""
    module = Module()
    body = _Body(_Encoder(frame, module), "", 0)
    body.write(frame.nodes, "message")
    module.add("encode", "message", ["parts = []", *body.lines, "return b''.join(parts)"])
    encode: Callable[[Any], bytes] = module.compiled("encode")
    return encode


class _Encoder:
    """The properties of the generated module that all its functions share."""

    def __init__(self, frame: Frame, module: Module) -> None:
        self.prefix = frame.prefix
        self.module = module
        for function in (word, words):
            module.shared(function)

    def array(self, type_: WireType) -> str:
        """Return the name of the function from an array of numbers to its bytes."""
        return self.module.constant(("array", type_.code), _array_bytes(type_))

    def flattener(self, entries: Sequence[Entry], depth: int, count: int) -> str:
        """Return the name of the function that appends the numbers of a block to a list, in wire order."""
        name = self.module.name("flatten")
        loop = ["for message in values:", *indented(self._flattened(entries, depth, "message"))]
        self.module.add(name, "values, numbers", [list_check("values"), count_check("values", count), *loop])
        return name

    def _flattened(self, entries: Sequence[Entry], depth: int, message: str) -> list[str]:
        lines, fields = [], 0
        for step, group in groupby(entries, key=lambda entry: entry[0][depth]):
            inner = [*group]
            path, leaf = inner[0]
            value, fields = f"{message}[{step.name!r}]", fields + 1
            if len(path) == depth + 1:
                assert isinstance(leaf, FrameField), "a block has only numbers"
                lines += self._flattened_leaf(leaf, value)
            elif step.count is None:
                nested = self.module.name("m")
                lines += [f"{nested} = {value}", *self._flattened(inner, depth + 1, nested)]
            else:
                lines.append(f"{self.flattener(inner, depth + 1, step.count)}({value}, numbers)")
        return [*lines, count_check(message, fields)]

    def _flattened_leaf(self, leaf: FrameField, value: str) -> list[str]:
        count, code = leaf.path[-1].count, leaf.type.code
        name = self.module.name("v")
        if count is None:
            check = [bool_check(name)] if code == "?" else []
            return [f"{name} = {value}", *check, f"numbers.append({f'word({name})' if code == 'f' else name})"]
        numbers = f"words({name})" if code == "f" else name
        check = [f"for number in {name}:", *indented([bool_check("number")])] if code == "?" else []
        return [f"{name} = {value}", list_check(name), count_check(name, count), *check, f"numbers += {numbers}"]


class _Body:
    """The statements that write the nodes of a message, or of a loop's element at the end of `depth` names.

    The position in the payload is the value of a variable, which is missing at the start, plus an offset. `_zeros`
    bytes, and those in the variable `_padding` if it has a name, precede the next part.
    """

    def __init__(self, encoder: _Encoder, position: str, depth: int) -> None:
        self.lines: list[str] = []
        self._encoder = encoder
        self._module = encoder.module
        self._depth = depth
        self._position, self._offset = position, 0
        self._zeros, self._padding, self._most_padding = 0, "", 0
        self._parts: list[str] = []
        self._values: dict[Path, str] = {}
        self._taken: dict[Path, int] = {}

    def at(self) -> str:
        """Return the expression of the position."""
        offset = self._offset
        return str(offset) if not self._position else f"{self._position} + {offset}" if offset else self._position

    def write(self, nodes: Sequence[Node], value: str) -> None:
        """Add the statements that write `value`, the name of the message or element."""
        self._fetch([*_entries(nodes).items()], self._depth, value)
        prefix = "" if self._position else self._module.constant("prefix", self._encoder.prefix)
        open_ = Fixed(0, ())
        for node in nodes:
            match node:
                case Fixed():
                    open_ = node
                    continue
                case Pad(alignment):
                    self._fixed(open_, prefix)
                    self._pad_to(alignment)
                case Data():
                    self._data(node, open_, prefix)
                case Loop():
                    self._loop(node, open_, prefix)
            open_, prefix = Fixed(0, ()), ""
        self._fixed(open_, prefix)
        self._flush()

    # --- values ------------------------------------------------------------------------------------------------

    def _fetch(self, entries: Sequence[Entry], depth: int, message: str) -> None:
        """Assign the values in a message to variables, and check that it has no others."""
        if entries and len(entries[0][0]) == depth:
            self._take(*entries[0], message)
            return
        fields = 0
        for step, group in groupby(entries, key=lambda entry: entry[0][depth]):
            inner = [*group]
            path, item = inner[0]
            value, fields = f"{message}[{step.name!r}]", fields + 1
            if len(path) == depth + 1:
                self._take(path, item, value)
            elif step.count is None:
                nested = self._module.name("m")
                self.lines.append(f"{nested} = {value}")
                self._fetch(inner, depth + 1, nested)
            else:
                block = path[: depth + 1]
                self._values[block] = numbers = self._module.name("block")
                flatten = self._encoder.flattener(inner, depth + 1, step.count)
                self.lines += [f"{numbers} = []", f"{flatten}({value}, {numbers})"]
        self.lines.append(count_check(message, fields))

    def _take(self, path: Path, item: FrameField | Data | Loop, value: str) -> None:
        """Assign a value, or the bytes of a text or array, to a variable; check it as far as `struct` does not."""
        name = self._values[path] = self._module.name("v")
        match item:
            case FrameField():
                count = path[-1].count
                self.lines.append(
                    f"{name} = {value if count is None else f'{self._encoder.array(item.type)}({value})'}"
                )
                if count is not None:
                    self.lines.append(count_check(name, count * item.type.size))
                elif item.type.code == "?":
                    self.lines.append(bool_check(name))
            case Data(kind=DataKind.STRING):
                self.lines.append(f"{name} = {value}.encode('utf-8', 'surrogateescape')")
            case Data(kind=DataKind.WSTRING):
                self._module.shared(units_of)
                self.lines.append(f"{name} = units_of({self._module.constant(item, item)}, {value})")
            case Data():
                self.lines.append(f"{name} = {self._encoder.array(item.element)}({value})")
            case Loop(number=None):
                self.lines += [f"{name} = {value}", list_check(name)]
            case Loop(number=number):
                assert number is not None, "the case before"
                self.lines.append(f"{name} = {self._encoder.array(number.type)}({value})")

    # --- nodes -------------------------------------------------------------------------------------------------

    def _fixed(self, fixed: Fixed, prefix: str = "", count: str = "") -> None:
        """Add the parts of a `Fixed`, and of a count after it."""
        form, end = "", 0
        arguments: list[str] = []
        floats: list[str] = []
        if prefix and self._encoder.prefix:
            form, end = f"{len(self._encoder.prefix)}s", len(self._encoder.prefix)
            arguments.append(prefix)
        for offset, number, leaf in _numbers(fixed):
            gap = f"{offset - end}x" * (offset > end)
            end = offset + number * leaf.type.size
            if is_plain(leaf):
                self._pack(form + gap, arguments, floats)
                self._append(self._values[leaf.path])
                form, arguments, floats = "", [], []
            elif is_in_block(leaf):
                block = block_of(leaf.path)
                taken = self._taken.get(block, 0)
                self._taken[block] = taken + number
                form += f"{gap}{number}{block_code(leaf.type)}"
                arguments.append(f"*{self._values[block]}[{taken}:{taken + number}]")
            else:
                form += gap + leaf.type.code
                name = self._values[leaf.path]
                arguments.append(name)
                floats += [name] if leaf.type.code == "f" else []
        form += f"{fixed.size - end}x" * (fixed.size > end)
        if count:
            form += "I"
            arguments.append(count)
        self._pack(form, arguments, floats)
        self._offset += fixed.size + (COUNT_BYTES if count else 0)

    def _pack(self, form: str, arguments: list[str], floats: list[str]) -> None:
        """Add the part in a `struct` format, with the zeros before it.

        If one of the `floats` is a NaN, all of them are packed as words, since conversion from Python's double would
        lose bits.
        """
        if not form:
            return
        if not arguments:
            self._zeros += struct.calcsize(form)
            return
        given = ", ".join(arguments)
        part = f"{self._packer(form)}({given})"
        if floats:
            as_words = ", ".join(f"word({name})" if name in floats else name for name in arguments)
            is_number = " and ".join(f"{name} == {name}" for name in floats)
            part = f"{part} if {is_number} else {self._packer(form.replace('f', 'I'))}({as_words})"
        self._parts.append(part)
        self._zeros, self._padding = 0, ""

    def _packer(self, form: str) -> str:
        """Return the expression of the function that packs numbers, with the zeros before them."""
        if not self._padding:
            return self._module.packer(f"{self._zeros}x" * bool(self._zeros) + form)
        counts = range(self._zeros, self._zeros + self._most_padding + 1)
        return f"{self._module.packers(form, counts)}[{self._padding}]"

    def _pad_to(self, alignment: int) -> None:
        if self._padding:
            self._flush_padding()
        self._padding, self._most_padding = self._module.name("z"), alignment - 1
        self.lines.append(f"{self._padding} = {self._gap(alignment)}")
        self._advance(self._padding)

    def _data(self, node: Data, fixed: Fixed, prefix: str) -> None:
        data, size, terminator = self._values[node.path], node.element.size, node.terminator
        count = self._module.name("n")
        self.lines.append(f"{count} = len({data}){f' // {size}' if size > 1 else ''}")
        self._check_bound(node, count)
        self._fixed(fixed, prefix, f"{count} + {terminator}" if terminator else count)
        self._pad_elements(count, node.padding, node.alignment)
        self._append(data)
        self._zeros = terminator
        self._advance(f"{count} * {size}" if size > 1 else count, terminator)

    def _loop(self, node: Loop, fixed: Fixed, prefix: str) -> None:
        values = self._values[node.path]
        size = node.number.type.size if node.number else 1
        count = self._module.name("n")
        self.lines.append(f"{count} = len({values}){f' // {size}' if size > 1 else ''}")
        if node.count is not None:
            self.lines.append(f"if {count} != {node.count}: {_FAULT}")
        self._check_bound(node, count)
        self._fixed(fixed, prefix, count if node.count is None else "")
        if node.number:
            self._pad_elements(count, None if isinstance(node.body[0], Pad) else 0, size)
            self._append(values)
            self._advance(f"{count} * {size}")
            return
        if not has_bytes(node.body):
            self.lines.append(f"if {count} > {MOST_EMPTY_ELEMENTS}: {_FAULT}")
        self._flush()
        end = self._module.name("p")
        self.lines.append(f"{end} = {self._writer(node)}({values}, {self.at()}, parts)")
        self._position, self._offset = end, 0

    def _writer(self, node: Loop) -> str:
        """Return the name of the function that writes the elements of a loop."""
        body = _Body(self._encoder, "p", len(node.path))
        body.write(node.body, "value")
        name = self._module.name("write")
        lines = [*body.lines, *([f"p = {body.at()}"] if body.at() != "p" else [])]
        self._module.add(name, "values, p, parts", ["for value in values:", *indented(lines or ["pass"]), "return p"])
        return name

    # --- parts of nodes ------------------------------------------------------------------------------------------

    def _check_bound(self, node: Data | Loop, count: str) -> None:
        if node.bound is not None:
            self.lines.append(f"if {count} > {node.bound}: {_FAULT}")

    def _pad_elements(self, count: str, padding: int | None, alignment: int) -> None:
        """Add the padding before elements, if there are any."""
        if padding == 0:
            return
        self._padding, self._most_padding = self._module.name("z"), alignment - 1 if padding is None else padding
        gap = self._gap(alignment) if padding is None else str(padding)
        self.lines.append(f"{self._padding} = {gap} if {count} else 0")
        self._advance(self._padding)

    def _append(self, part: str) -> None:
        """Add a part that has no `struct` format, with the zeros before it."""
        self._flush_padding()
        self._parts.append(part)

    def _flush_padding(self) -> None:
        if self._padding:
            self._parts.append(f"bytes({self._zeros} + {self._padding})")
        elif self._zeros:
            self._parts.append(repr(bytes(self._zeros)) if self._zeros <= _SHORT else f"bytes({self._zeros})")
        self._zeros, self._padding = 0, ""

    def _flush(self) -> None:
        """Add the statement that appends the parts so far."""
        self._flush_padding()
        if len(self._parts) == 1:
            self.lines.append(f"parts.append({self._parts[0]})")
        elif self._parts:
            self.lines.append(f"parts += {', '.join(self._parts)}")
        self._parts = []

    def _gap(self, alignment: int) -> str:
        """Return the expression of the bytes up to a multiple of `alignment`, a power of two."""
        past = (len(self._encoder.prefix) - self._offset) % alignment
        return f"{past or ''}-{self._position or 0} & {alignment - 1}"

    def _advance(self, variable: str, more: int = 0) -> None:
        name = self._module.name("p")
        self.lines.append(f"{name} = {self.at()} + {variable}")
        self._position, self._offset = name, more


def list_check(name: str) -> str:
    """Return the statement that checks a list."""
    return f"if type({name}) is not list and type({name}) is not tuple: {_FAULT}"


def bool_check(name: str) -> str:
    """Return the statement that checks a bool; `struct` would accept any value."""
    return f"if {name} is not True and {name} is not False: {_FAULT}"


def count_check(name: str, count: int) -> str:
    """Return the statement that checks a length."""
    return f"if len({name}) != {count}: {_FAULT}"


def _entries(nodes: Sequence[Node]) -> dict[Path, FrameField | Data | Loop]:
    """Return the leaves and variable parts of nodes, by their paths."""
    found: dict[Path, FrameField | Data | Loop] = {}
    for node in nodes:
        for part in node.fields if isinstance(node, Fixed) else () if isinstance(node, Pad) else (node,):
            found.setdefault(part.path, part)
    return found


def _numbers(fixed: Fixed) -> Iterator[tuple[int, int, FrameField]]:
    """Yield the offset and count of adjacent numbers, in wire order."""
    found = [(run.offset, run.count, leaf) for leaf in fixed.fields for run in leaf.runs]
    yield from sorted(found, key=lambda item: item[0])


def _array_bytes(type_: WireType) -> Callable[[Any], bytes | memoryview]:
    """Return the function from an array of numbers to its bytes."""
    code, dtype, is_octet, is_bool = type_.code, array_type(type_), type_.code == "B", type_.code == "?"

    def array_bytes(values: Any) -> bytes | memoryview:
        kind = type(values)
        if kind is np.ndarray:
            if values.dtype != dtype or values.ndim != 1:
                raise UnusualError
            if is_bool:
                values = values != 0
            return values.tobytes() if values.nbytes <= _COPIED_BYTES else np.ascontiguousarray(values).data.cast("B")
        if is_octet and (kind is bytes or kind is bytearray):
            return values  # type: ignore[no-any-return]
        if kind is not list and kind is not tuple:
            raise UnusualError
        if is_bool and not {*map(type, values)} <= {bool}:
            raise UnusualError
        return packed(code, values)

    return array_bytes


def word(number: Any) -> int:
    """Return the bits of a float32. May raise the errors of `struct`."""
    if isinstance(number, SignallingNan):
        return number.bits
    bits: int = struct.unpack("<I", struct.pack("<f", number))[0]
    return bits


def words(numbers: Sequence[Any]) -> tuple[int, ...]:
    """Return the bits of numbers of type float32. May raise the errors of `struct`."""
    return struct.unpack(f"<{len(numbers)}I", packed("f", numbers))
