"""Edit the text of a YAML file in place: each edit changes only its own characters, so comments, order and style stay.

An edit finds its place by the marks of PyYAML's nodes. The result is parsed again and compared with the expected data,
so an edit is either correct or raises `EditError` (aliases, explicit keys and other rare forms of YAML).
"""

from __future__ import annotations

import json
import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import yaml

from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.text.yaml_text import LINE_END, LONGEST_NUMBER, data_of, is_null, parse_yaml

Path = Sequence[str | int]
"""The keys and indices (from 0) that lead from a file's root to a value."""

# The separator of two items of a list in brackets: blanks, line ends and comments, with one comma.
_BETWEEN = re.compile(r"(?P<before>(?:\s|(?<=\s)#[^\n]*)*),[ \t]*")


class EditError(ValueError):
    """An edit that this module cannot make; `str()` is the reason."""


@dataclass(frozen=True)
class _Change:
    """The replacement of the characters from `start` up to `end`."""

    start: int
    end: int
    new: str = ""


def put(text: str, path: Path, value: Any, order: Sequence[str] = ()) -> str:
    """Return the text with a new value of a key or of a list's item.

    A missing key is added after the keys that precede it in `order`. Raise `EditError` for an invalid path.
    """
    source = _Source(text)
    expected = source.data()
    try:
        _inside(expected, path[:-1])[path[-1]] = _plain(value)
    except (LookupError, TypeError):
        raise EditError(f"there is no {_name(path)}") from None
    return source.changed(source.put(path, value, order), expected)


def insert(text: str, path: Path, index: int, value: Any) -> str:
    """Return the text with a further item at an index of the list at `path`. Raise `EditError` without such a list."""
    source = _Source(text)
    expected = source.data()
    items = _inside(expected, path)
    if not isinstance(items, list):
        raise EditError(f"{_name(path)} is not a list")
    index = min(index, len(items))
    items.insert(index, _plain(value))
    return source.changed(source.insert(path, index, value), expected)


def remove(text: str, path: Path) -> str:
    """Return the text without a key or an item. Raise `EditError` for an invalid path."""
    source = _Source(text)
    expected = source.data()
    try:
        del _inside(expected, path[:-1])[path[-1]]
    except (LookupError, TypeError):
        raise EditError(f"there is no {_name(path)}") from None
    return source.changed(source.remove(path), expected)


def document(data: Mapping[str, Any]) -> str:
    """Return the text of a new file, with one line per key and per item of a list of mappings."""
    return "".join(f"{line}\n" for key, value in data.items() for line in _key_lines(key, value, 0, _Style()))


def word(answer: str) -> str:
    """Return a text as a scalar, in quotes if YAML would otherwise misread it, alone or in a list."""
    if is_number(answer):
        # A number is also legal as a word, and is easier to read without quotes.
        return answer
    try:
        is_plain = yaml.safe_load(f"[{answer}]") == [answer] and yaml.safe_load(f"a: {answer}") == {"a": answer}
    except (yaml.YAMLError, ValueError):
        is_plain = False
    return answer if is_plain and answer.isprintable() else json.dumps(answer)


def path_at(node: yaml.Node | None, line: int, column: int) -> list[str | int]:
    """Return the path, below a file's root, of the last value that starts at or before a place, counted from 1."""
    found: list[str | int] = []
    while isinstance(node, yaml.CollectionNode):
        number = bisect_right(node.value, (line - 1, column - 1), key=_start) - 1
        if number < 0:
            break
        item = node.value[number]
        part, node = (str(item[0].value), item[1]) if isinstance(item, tuple) else (number, item)
        found.append(part)
    return found


def _start(item: yaml.Node | tuple[yaml.Node, yaml.Node]) -> tuple[int, int]:
    """Return the place of a key or of a list's item."""
    mark = (item[0] if isinstance(item, tuple) else item).start_mark
    return mark.line, mark.column


def is_number(answer: str) -> bool:
    """Return whether a text is a decimal integer that YAML reads as the same number."""
    return answer.isdecimal() and len(answer) <= LONGEST_NUMBER and str(int(answer)) == answer


def _plain(value: Any) -> Any:
    """Return a new value as YAML reads it."""
    return yaml.safe_load(_flow(value))


def _flow(value: Any) -> str:
    """Return a value on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{word(str(key))}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    return word(str(value))


def _name(path: Path) -> str:
    return ".".join(map(str, path)) or "the file"


def _root(text: str) -> yaml.Node:
    faults = Diagnostics()
    try:
        found = parse_yaml(text, "the file", faults)
        faults.raise_if_any()
    except InputError as error:
        raise EditError(str(error)) from error
    if found.root is None:
        raise EditError("the file is empty")
    return found.root


def _separate(data: Any) -> Any:
    """Return data without shared values; an anchor and its aliases share a value."""
    if isinstance(data, dict):
        return {key: _separate(value) for key, value in data.items()}
    return [*map(_separate, data)] if isinstance(data, list) else data


def value_at(data: Any, path: Path) -> Any:
    """Return the value at a path. Raise `EditError` for an invalid path."""
    for step, part in enumerate(path):
        try:
            data = data[part]
        except (LookupError, TypeError):
            raise EditError(f"there is no {_name(path[: step + 1])}") from None
    return data


def _inside(data: Any, path: Path) -> Any:
    """Return the mapping or list at a path."""
    data = value_at(data, path)
    if not isinstance(data, dict | list):
        raise EditError(f"{_name(path)} is neither a mapping nor a list")
    return data


class _Source:
    """A text with its nodes; a place is an offset in characters from the start."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._root = _root(text)
        ends = list(LINE_END.finditer(text))
        self._starts = [0, *(end.end() for end in ends)]
        self._line_end = ends[0].group() if ends else "\n"
        # New lists are indented like the first list of the file.
        self._style = next(_styles(self._root), _Style())

    def data(self) -> Any:
        """Return the data in the text. Raise `EditError` for invalid values."""
        try:
            # The construction of data moves merged keys in the nodes, so it uses separate nodes.
            return _separate(data_of(_root(self._text)))
        except yaml.YAMLError as error:
            raise EditError(str(error)) from error

    def changed(self, changes: Iterator[_Change], expected: Any) -> str:
        """Return the changed text. Raise `EditError` unless it has the expected data."""
        made = self._text
        for change in sorted(changes, key=lambda item: item.start, reverse=True):
            made = made[: change.start] + change.new + made[change.end :]
        try:
            is_right = _Source(made).data() == expected
        except EditError:
            is_right = False
        if not is_right:
            raise EditError("this place is written in a form that can be edited only by hand")
        return made

    # --- edits -----------------------------------------------------------------------------------------------------

    def put(self, path: Path, value: Any, order: Sequence[str]) -> Iterator[_Change]:
        """Yield the changes for a new value."""
        parent = self._collection(path[:-1])
        old = _child(parent, path[-1])
        if old is None:
            yield from self._add_key(parent, str(path[-1]), value, order)
        elif is_null(old) and not old.value:
            yield from self._replace_nothing(old, value)
        elif isinstance(old, yaml.SequenceNode) and not old.flow_style and isinstance(value, list | tuple):
            yield from [self._replace_items(old, value)] if value else self._empty(path, old)
        elif isinstance(old, yaml.ScalarNode) and old.style in ("'", '"') and isinstance(_plain(value), str):
            yield _Change(*self._extent(old), _quoted(str(value), old.style))
        else:
            yield _Change(*self._extent(old), _flow(value))

    def insert(self, path: Path, index: int, value: Any) -> Iterator[_Change]:
        """Yield the changes for a further item of a list."""
        node = self._collection(path)
        if node.flow_style:
            yield self._insert_between(node, index, _flow(value))
        else:
            yield self._insert_items(node, index, [value])

    def remove(self, path: Path) -> Iterator[_Change]:
        """Yield the changes for the removal of a key or an item."""
        parent = self._collection(path[:-1])
        parts = self._parts(parent)
        index = _index(parent, path[-1])
        if parent.flow_style:
            yield from self._remove_between(parts, index)
        elif len(parts) == 1:
            yield from self._empty(path[:-1], parent)
        elif isinstance(parent, yaml.SequenceNode):
            yield self._lines(self._dash(parent, index), parts[index][1])
        else:
            yield self._remove_key(parent, parts, index)

    def _empty(self, path: Path, node: yaml.CollectionNode) -> Iterator[_Change]:
        """Yield the changes that empty a mapping or a list with one line per item."""
        empty = "{}" if isinstance(node, yaml.MappingNode) else "[]"
        start, end = self._extent(node)
        above = self._node(path[:-1])
        if not path or not isinstance(above, yaml.MappingNode):
            yield _Change(start, end, empty)
            return
        key = next(key for key, _ in above.value if key.value == path[-1])
        colon = self._text.index(":", key.end_mark.index) + 1
        yield _Change(colon, colon, f" {empty}")
        yield self._lines(start, end)

    # --- mappings --------------------------------------------------------------------------------------------------

    def _add_key(self, parent: yaml.CollectionNode, name: str, value: Any, order: Sequence[str]) -> Iterator[_Change]:
        if not isinstance(parent, yaml.MappingNode):
            raise EditError("a list has no keys")
        names = [key.value for key, _ in parent.value]
        before = {*order[: order.index(name)]} if name in order else set(names)
        # The dash of a list's item may precede the first key, so nothing is inserted there.
        index = max((place + 1 for place, other in enumerate(names) if other in before), default=1)
        if parent.flow_style:
            yield self._insert_between(parent, min(index, len(names)), f"{name}: {_flow(value)}")
        else:
            end = self._parts(parent)[index - 1][1]
            yield self._new_lines(end, _key_lines(name, value, parent.start_mark.column, self._style))

    def _remove_key(self, parent: yaml.Node, parts: Sequence[tuple[int, int]], index: int) -> _Change:
        start, end = parts[index]
        if self._text[self._line_start(start) : start].strip():
            # The key shares its line with the dash of a list's item: the next key takes its place.
            following = parts[index + 1][0]
            between = self._text[end:following]
            return _Change(start, end) if "#" in between else _Change(start, following)
        return self._lines(start, end)

    def _replace_nothing(self, old: yaml.Node, value: Any) -> Iterator[_Change]:
        place = old.start_mark.index
        yield _Change(place, place, ("" if self._text[place - 1 : place] == " " else " ") + _flow(value))

    # --- lists -----------------------------------------------------------------------------------------------------

    def _replace_items(self, node: yaml.CollectionNode, values: Sequence[Any]) -> _Change:
        """Return the change that replaces the items from the first to the last difference."""
        old = [item.value for item in node.value]
        new = [str(value) for value in values]
        first = _common(old, new)
        last = min(_common(old[::-1], new[::-1]), len(old) - first, len(new) - first)
        added = values[first : len(new) - last]
        if first == len(old) - last:
            return self._insert_items(node, first, added)
        removed = self._lines(self._dash(node, first), self._extent(node.value[len(old) - last - 1])[1])
        return _Change(removed.start, removed.end, self._whole(self._items_lines(node, added)))

    def _insert_items(self, node: yaml.CollectionNode, index: int, values: Sequence[Any]) -> _Change:
        lines = self._items_lines(node, values)
        if index:
            return self._new_lines(self._extent(node.value[index - 1])[1], lines)
        start = self._line_start(self._dash(node, 0))
        return _Change(start, start, self._whole(lines))

    def _dash(self, node: yaml.CollectionNode, index: int) -> int:
        """Return the place of the dash of an item."""
        column = node.start_mark.column
        line = node.value[index].start_mark.line
        while line > node.start_mark.line and not self._text.startswith("-", self._starts[line] + column):
            line -= 1
        place: int = self._starts[line] + column
        return place

    def _insert_between(self, node: yaml.CollectionNode, index: int, new: str) -> _Change:
        """Return the change for a further item in brackets."""
        parts = self._parts(node)
        if not parts:
            place = node.start_mark.index + 1
            return _Change(place, place, new)
        if index < len(parts):
            place = parts[index][0]
            return _Change(place, place, f"{new}, ")
        place = parts[-1][1]
        return _Change(place, place, f", {new}")

    def _remove_between(self, parts: Sequence[tuple[int, int]], index: int) -> Iterator[_Change]:
        """Yield the changes for the removal of an item in brackets, with the comma after it or before it."""
        start, end = parts[index]
        if len(parts) == 1:
            yield _Change(start, end)
        elif index < len(parts) - 1:
            yield _Change(start, self._comma(end).end())
        else:
            comma = self._comma(parts[index - 1][1])
            place = comma.end("before")
            if comma.end() == start:
                yield _Change(place, end)
            else:
                yield _Change(place, place + 1)
                yield _Change(start, end)

    def _comma(self, end: int) -> re.Match[str]:
        found = _BETWEEN.match(self._text, end)
        if found is None:
            raise EditError("this list can be edited only by hand")
        return found

    # --- new lines -------------------------------------------------------------------------------------------------

    def _items_lines(self, node: yaml.CollectionNode, values: Sequence[Any]) -> list[str]:
        """Return the lines of further items of a list."""
        column = node.start_mark.column
        gap = _gap(node) or self._style.gap
        return [line for value in values for line in _item_lines(value, column, replace(self._style, gap=gap))]

    def _whole(self, lines: Sequence[str]) -> str:
        return "".join(line + self._line_end for line in lines)

    def _new_lines(self, end: int, lines: Sequence[str]) -> _Change:
        """Return the change that adds lines below the line of a place."""
        place = self._next_line(end)
        is_ended = place > 0 and LINE_END.fullmatch(self._text[place - 1]) is not None
        added = self._line_end.join(lines)
        return _Change(place, place, added + self._line_end if is_ended else self._line_end + added)

    # --- places ----------------------------------------------------------------------------------------------------

    def _node(self, path: Path) -> yaml.Node:
        node: yaml.Node | None = self._root
        for part in path:
            node = None if node is None else _child(node, part)
        if node is None:
            raise EditError(f"there is no {_name(path)}")
        return node

    def _collection(self, path: Path) -> yaml.CollectionNode:
        node = self._node(path)
        if not isinstance(node, yaml.CollectionNode):
            raise EditError(f"{_name(path)} is neither a mapping nor a list")
        return node

    def _parts(self, node: yaml.Node) -> list[tuple[int, int]]:
        """Return the start and end of each key with its value, or of each item."""
        if isinstance(node, yaml.MappingNode):
            return [(key.start_mark.index, self._end(key, value)) for key, value in node.value]
        return [self._extent(item) for item in node.value]

    def _end(self, key: yaml.Node, value: yaml.Node) -> int:
        return max(key.end_mark.index, self._extent(value)[1])

    def _extent(self, node: yaml.Node) -> tuple[int, int]:
        """Return the start and end of a node, without the comments after it."""
        start = node.start_mark.index
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            last = node.value[-1]
            return start, self._end(*last) if isinstance(last, tuple) else self._extent(last)[1]
        end = node.end_mark.index
        if isinstance(node, yaml.ScalarNode) and node.style in ("|", ">"):
            end = start + len(self._text[start:end].rstrip())
        return start, end

    def _line_start(self, place: int) -> int:
        return self._starts[bisect_right(self._starts, place) - 1]

    def _next_line(self, place: int) -> int:
        number = bisect_right(self._starts, place)
        return self._starts[number] if number < len(self._starts) else len(self._text)

    def _lines(self, start: int, end: int) -> _Change:
        """Return the change that removes all lines from `start` to `end`."""
        return _Change(self._line_start(start), self._next_line(end))


def _child(node: yaml.Node, part: str | int) -> yaml.Node | None:
    """Return the value of a key or the item at an index, or None if it is missing."""
    if isinstance(node, yaml.MappingNode):
        return next((value for key, value in node.value if key.value == part), None)
    if isinstance(node, yaml.SequenceNode) and isinstance(part, int) and 0 <= part < len(node.value):
        found: yaml.Node = node.value[part]
        return found
    return None


def _index(node: yaml.Node, part: str | int) -> int:
    if isinstance(node, yaml.SequenceNode):
        return int(part)
    found = next((place for place, (key, _) in enumerate(node.value) if key.value == part), None)
    if found is None:
        raise EditError(f"'{part}' comes from another place of the file")
    return found


def _common(one: Sequence[str], other: Sequence[str]) -> int:
    """Return the number of equal items at the start."""
    pairs = zip(one, other, strict=False)
    return next((place for place, (left, right) in enumerate(pairs) if left != right), min(len(one), len(other)))


def _quoted(text: str, style: str) -> str:
    """Return a text in quotes of this style."""
    if style == "'" and text.isprintable():
        return "'" + text.replace("'", "''") + "'"
    return json.dumps(text, ensure_ascii=False) if text.isprintable() else json.dumps(text)


@dataclass(frozen=True)
class _Style:
    """The number of blanks before the dash of a list's item, relative to the list's key, and after the dash."""

    offset: int = 2
    gap: int = 1


def _styles(node: yaml.Node) -> Iterator[_Style]:
    """Yield the style of each list below a key."""
    for item in node.value if isinstance(node, yaml.CollectionNode) else ():
        key, value = item if isinstance(item, tuple) else (None, item)
        if key and isinstance(value, yaml.SequenceNode) and not value.flow_style and value.value:
            yield _Style(value.start_mark.column - key.start_mark.column, _gap(value) or 1)
        yield from _styles(value)


def _gap(node: yaml.CollectionNode) -> int:
    """Return the number of blanks after the dash of a list's first item, or 0 if the item is on another line."""
    first = node.value[0].start_mark
    return int(first.column - node.start_mark.column - 1) if first.line == node.start_mark.line else 0


def _key_lines(name: str, value: Any, column: int, style: _Style) -> list[str]:
    """Return the lines of a key, which begins at a column."""
    lines: list[str] = []
    if isinstance(value, Mapping):
        lines = [line for key, item in value.items() for line in _key_lines(str(key), item, column + 2, style)]
    elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
        lines = [line for item in value for line in _item_lines(item, column + style.offset, style)]
    return [f"{' ' * column}{word(name)}:{'' if lines else f' {_flow(value)}'}", *lines]


def _item_lines(value: Any, column: int, style: _Style) -> list[str]:
    """Return the lines of a list's item, whose dash is at a column."""
    dash = f"{' ' * column}-{' ' * style.gap}"
    if not isinstance(value, Mapping) or not value:
        return [dash + _flow(value)]
    lines = [line for key, item in value.items() for line in _key_lines(str(key), item, len(dash), style)]
    return [dash + lines[0].lstrip(), *lines[1:]]
