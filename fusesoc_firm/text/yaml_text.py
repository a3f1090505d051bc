"""YAML with source positions.

The marks in PyYAML's nodes become `SourceRef`s, and values keep their places; a `Text` is a string with a place.

All YAML is composed here. The numbers of bytes, levels and nodes in a file are limited before any value is built, since
a few lines of aliases can expand to more than the available memory. An alias inside its own value is invalid, so data
are trees.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, byte_place, fail, nearest_file
from fusesoc_firm.text.files import read_regular

MOST_LEVELS = 64
LONGEST_NUMBER = 40
"""The maximum number of characters in a number of a specification."""
# The maximum in other data. Python prints at most 4300 digits, and converts a long number to base 60 in quadratic time.
_LONGEST_INTEGER = 1000
# The maximum number of characters in an invalid text for which PyYAML's slow parser finds a more exact message.
_MOST_REPARSED = 2**17

_CONTROL_CHARACTERS = yaml.reader.Reader.NON_PRINTABLE
_REPLACEMENT = "\ufffd"
_MOST_CONTROL_CHARACTERS = 200
# The errors that PyYAML reports for a line whose indentation does not match any line above.
_INDENTATION_PROBLEMS = ("expected <block end>", "expected '<document start>'", "mapping values are not allowed here")
# A block begins with the dash of a list's item, or with the first word of a line that is not a comment.
_BLOCK_BEGIN = re.compile(r" *(-(?= )|[^\s#:-][^\s:]*)")
# The line ends that PyYAML counts.
LINE_END = re.compile("\r\n|[\r\n\x85\u2028\u2029]")


@dataclass(frozen=True)
class Bounds:
    """The limits for a file; an alias counts as the node that it refers to."""

    bytes: int
    nodes: int


SMALL = Bounds(2**20, 50_000)
"""The limits for a specification, a configuration file or a board file."""
LARGE = Bounds(2**26, 5_000_000)
"""The limits for data, such as stimuli with images, and for files that other programs may generate, such as cores."""


class TooLargeError(Exception):
    """A text exceeds a limit; `what` describes the limit, and `mark` is the place."""

    def __init__(self, what: str, mark: yaml.Mark) -> None:
        super().__init__(f"more than {what}")
        self.mark = mark


@dataclass(frozen=True)
class _Size:
    """The number of nodes and of levels under an anchor."""

    nodes: int
    levels: int


class _Composer(yaml.composer.Composer, yaml.resolver.Resolver):
    """A composer of nodes from a parser's events, which raises `TooLargeError` at the first node beyond the limits."""

    def __init__(self, parser: Any, bounds: Bounds) -> None:
        yaml.composer.Composer.__init__(self)
        yaml.resolver.Resolver.__init__(self)
        self.check_event, self.peek_event, self.get_event = parser.check_event, parser.peek_event, parser.get_event
        self._bounds = bounds
        self._nodes = self._level = self._deepest = 0
        # The sizes of the anchors whose values are complete.
        self._sizes: dict[str, _Size] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event, nodes, deepest = self.peek_event(), self._nodes, self._deepest
        is_alias, anchor = isinstance(event, yaml.AliasEvent), event.anchor or ""
        size = self._alias_size(anchor, event.start_mark) if is_alias else _Size(1, 1)
        self._nodes += size.nodes
        self._deepest = self._level + size.levels
        if self._deepest > MOST_LEVELS:
            raise TooLargeError(f"{MOST_LEVELS} levels", event.start_mark)
        if self._nodes > self._bounds.nodes:
            raise TooLargeError(f"{self._bounds.nodes} values", event.start_mark)
        self._level += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._level -= 1
        if anchor and not is_alias:
            self._sizes[anchor] = _Size(self._nodes - nodes, self._deepest - self._level)
        self._deepest = max(deepest, self._deepest)
        return node

    def _alias_size(self, anchor: str, mark: Any) -> _Size:
        """Return the size of an alias' value, which has to be complete."""
        if anchor in self.anchors and anchor not in self._sizes:
            raise yaml.composer.ComposerError(None, None, f"the alias '*{anchor}' is inside its own value", mark)
        return self._sizes.get(anchor, _Size(1, 1))


class _Constructor(yaml.SafeLoader):
    """A constructor of data, which limits the time that an integer takes."""

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > _LONGEST_INTEGER:
            problem = f"the number has more than {_LONGEST_INTEGER} characters"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
        value: int = super().construct_yaml_int(node)
        return value


_Constructor.add_constructor("tag:yaml.org,2002:int", _Constructor.construct_yaml_int)


class Text(str):
    """A string from a file, with its place."""

    __slots__ = ("source",)

    source: SourceRef | None

    def __new__(cls, value: str, source: SourceRef | None = None) -> Text:
        """Create a text with the place `source`, or None if the text is not in a file (a default)."""
        text = super().__new__(cls, value)
        text.source = source
        return text


@dataclass(frozen=True)
class YamlText:
    """The lines and the root node of a YAML file; `file` is the file's name in messages.

    `is_cut` means that the text contains invalid YAML, and that `root` contains only the part above it.
    """

    file: str
    lines: tuple[str, ...]
    root: yaml.Node | None
    is_cut: bool = False

    def source(self, node: yaml.Node) -> SourceRef:
        """Return the place of a node; the place of a multi-line node is its first line."""
        start, end = node.start_mark, node.end_mark
        text = self.lines[start.line] if start.line < len(self.lines) else ""
        last = end.column if end.line == start.line else len(text.rstrip())
        return SourceRef(self.file, start.line + 1, start.column + 1, text, max(1, last - start.column))

    def text(self, node: yaml.ScalarNode) -> Text:
        """Return a scalar's characters, regardless of its YAML type."""
        return Text(str(node.value), self.source(node))


def read_yaml(
    path: Path, file: str | None = None, faults: Diagnostics | None = None, bounds: Bounds = SMALL
) -> YamlText:
    """Read a YAML file within `bounds`; messages call it `file`.

    Raise `InputError` if the file cannot be read or is not YAML. If `faults` is given, add invalid YAML to `faults`
    instead, and return the part above it.
    """
    name = file or str(path)
    try:
        # Some editors write a byte order mark.
        text = read_regular(path, bounds.bytes).decode("utf-8-sig")
    except OSError as error:
        is_missing = isinstance(error, FileNotFoundError)
        fail(f"cannot read {name}: {error.strerror}", hint=nearest_file(path) if is_missing else "")
    except UnicodeDecodeError as error:
        source = byte_place(name, error.object, error.start)
        fail(f"byte 0x{error.object[error.start]:02x} is not UTF-8", source, "save the file as UTF-8 in the editor")
    noted = Diagnostics() if faults is None else faults
    read = parse_yaml(text, name, noted, bounds)
    if faults is None:
        noted.raise_if_any()
    return read


def parse_yaml(text: str, file: str, faults: Diagnostics, bounds: Bounds = SMALL) -> YamlText:
    """Parse a YAML text; if a part is invalid, report its place and return the part above."""
    lines = tuple(LINE_END.split(text.rstrip()))
    _note_control_characters(text, file, faults)
    text = _CONTROL_CHARACTERS.sub(_REPLACEMENT, text)
    try:
        return YamlText(file, lines, _composed(text, bounds))
    except TooLargeError as error:
        line, column = error.mark.line, error.mark.column
        fail(f"the file is too large: {error}", SourceRef(file, line + 1, column + 1, lines[line]))
    except yaml.MarkedYAMLError as error:
        _note_syntax(error, file, lines, faults)
        return YamlText(file, lines, _composed_above(error, text.splitlines(keepends=True)), is_cut=True)


def _note_control_characters(text: str, file: str, faults: Diagnostics) -> None:
    for found, source in islice(_control_characters(text, file), _MOST_CONTROL_CHARACTERS):
        faults.error(f"invalid YAML: it contains the control character 0x{ord(found):02x}", source)


def _control_characters(text: str, file: str) -> Iterator[tuple[str, SourceRef]]:
    """Yield each control character with its place."""
    for number, line in enumerate(LINE_END.split(text), 1):
        if _CONTROL_CHARACTERS.search(line):
            shown = _CONTROL_CHARACTERS.sub("?", line)
            for found in _CONTROL_CHARACTERS.finditer(line):
                yield found[0], SourceRef(file, number, found.start() + 1, shown)


_WITHOUT_BLANK = re.compile(r"[\s-]*\w+:[^\s/]")
# What PyYAML was reading at a fault, and the probable cure.
_CURES = {
    "while scanning a simple key": "write 'key: value', with a blank after the colon",
    "while scanning an alias": "YAML does not calculate: write the values themselves, or a text in quotation marks",
    "while scanning a quoted scalar": "close the quotation mark",
    "while parsing a flow sequence": "close the list with ']', or separate its items with ','",
    "while parsing a flow mapping": "close the mapping with '}', or separate its items with ','",
}


def _note_syntax(error: yaml.MarkedYAMLError, file: str, lines: tuple[str, ...], faults: Diagnostics) -> None:
    problem = error.problem or error.context or "syntax error"
    context = error.context_mark
    mark = error.problem_mark or context
    # If a colon is missing, or a construct is open at the end, report the start of the construct.
    is_late = problem.startswith("could not find expected ':'") or (mark is not None and mark.line >= len(lines))
    if context is not None and is_late:
        mark, context = context, None
    hint = ""
    if "'\\t'" in problem:
        hint = "indent YAML with blanks, not with tabs"
    elif error.context and context is not None:
        begin = f"{file}:{context.line + 1}:{context.column + 1}"
        cure = _CURES.get(error.context)
        hint = f"{cure}; it begins at {begin}" if cure else f"{error.context}, which begins at {begin}"
    elif error.context and is_late:
        hint = _CURES.get(error.context, error.context)
    line, column = len(lines) - 1, max(0, len(lines[-1]) - 1)
    if mark is not None and mark.line < len(lines):
        line, column = mark.line, mark.column
        if problem.startswith(_INDENTATION_PROBLEMS):
            hint = _indentation_hint(lines, line) or hint
            if not hint and line and _WITHOUT_BLANK.match(lines[line - 1]):
                hint = f"write a blank after the colon in line {line}"
    faults.error(f"invalid YAML: {problem}", SourceRef(file, line + 1, column + 1, lines[line]), hint)


def _indentation_hint(lines: tuple[str, ...], number: int) -> str:
    """Return a hint with the indentations for a line that matches no open block, otherwise an empty string."""
    indent = len(lines[number]) - len(lines[number].lstrip(" "))
    # The first word of each open block by its indentation, the outermost first.
    open_blocks: dict[int, str] = {}
    for above, line in enumerate(lines[:number]):
        for start, word in _block_begins(line):
            open_blocks = {blanks: begin for blanks, begin in open_blocks.items() if blanks <= start}
            open_blocks.setdefault(start, f"{word}, line {above + 1}")
    if indent in open_blocks or not open_blocks:
        return ""
    legal = ", ".join(f"{blanks} ({begin})" for blanks, begin in open_blocks.items())
    return f"the line is indented by {indent}, but the open blocks above are indented by {legal}"


def _block_begins(line: str) -> Iterator[tuple[int, str]]:
    """Yield the column (from 0) and the first word of each block that may begin in a line."""
    position = 0
    while found := _BLOCK_BEGIN.match(line, position):
        yield found.start(1), found[1]
        if found[1] != "-":
            return
        position = found.end()


def _composed(text: str, bounds: Bounds = SMALL) -> yaml.Node | None:
    """Return the root node of a text. Raise `yaml.MarkedYAMLError`, if possible with the message of PyYAML's parser."""
    try:
        return _composed_by(getattr(yaml, "CSafeLoader", yaml.SafeLoader), text, bounds)
    except yaml.YAMLError:
        if len(text) > _MOST_REPARSED:
            raise
    return _composed_by(yaml.SafeLoader, text, bounds)


def _composed_by(loader: Any, text: str, bounds: Bounds) -> yaml.Node | None:
    """Compose a text with one of PyYAML's parsers; the libyaml parser is much faster, but has less exact messages."""
    parser = loader(text)
    try:
        node: yaml.Node | None = _Composer(parser, bounds).get_single_node()
        return node
    finally:
        parser.dispose()


def _composed_above(error: yaml.MarkedYAMLError, lines: list[str]) -> yaml.Node | None:
    """Return the root node of the lines above a fault or the construct open there, or None if there is no node."""
    for mark in (error.problem_mark, error.context_mark):
        if mark is not None:
            with suppress(yaml.YAMLError, TooLargeError):
                return _composed("".join(lines[: mark.line]))
    return None


def integer(text: str) -> int:
    """Return the integer value of a plain scalar of at most `LONGEST_NUMBER` characters. May raise `ValueError`."""
    if len(text) > LONGEST_NUMBER:
        raise ValueError(f"more than {LONGEST_NUMBER} characters")
    value = yaml.safe_load(text)
    if type(value) is not int:
        raise ValueError(f"'{text}' is not an integer")
    return value


def yaml_data(text: str) -> Any:
    """Return the mappings, lists and scalars in a text. Raise `yaml.YAMLError` for invalid values."""
    try:
        return data_of(_composed(text, LARGE))
    except TooLargeError as error:
        raise yaml.YAMLError(str(error)) from error


def data_in(path: Path) -> Any:
    """Return the data in a file. Raise `OSError`, `UnicodeDecodeError`, or `yaml.YAMLError` for invalid values."""
    return yaml_data(read_regular(path, LARGE.bytes).decode("utf-8-sig"))


def data_of(root: yaml.Node | None) -> Any:
    """Return the data in a node and its children. Raise `yaml.YAMLError` for invalid values."""
    try:
        return None if root is None else _Constructor("").construct_document(root)
    except (ValueError, TypeError, LookupError, OverflowError, AttributeError) as error:
        # Causes include a number without digits, an invalid date, a tag that does not fit, and a list as a key.
        raise yaml.YAMLError(str(error)) from error


def yaml_dump(data: Any) -> str:
    """Return data as readable YAML, with keys in the given order."""
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)


def is_null(node: yaml.Node) -> bool:
    """Return whether a node is the missing value of a key, as in `type:` in the dissertation's listing 6.1."""
    return isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:null"


def kind(node: yaml.Node) -> str:
    """Return a description of a node for messages: the scalar in quotes, "a list", "a mapping" or "nothing"."""
    if is_null(node):
        return "nothing"
    if isinstance(node, yaml.MappingNode):
        return "a mapping"
    return "a list" if isinstance(node, yaml.SequenceNode) else f"'{node.value}'"


def items(
    yaml_text: YamlText, node: yaml.MappingNode, faults: Diagnostics
) -> Iterator[tuple[Text, yaml.ScalarNode, yaml.Node]]:
    """Yield the key's text, the key node and the value node of each item.

    Note keys that are repeated or not scalars.
    """
    seen: dict[str, SourceRef] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            faults.error("a key must be a word", yaml_text.source(key))
        elif key.value in seen:
            first = f"the first is at {seen[key.value]}"
            faults.error(f"key '{key.value}' is given twice", yaml_text.source(key), first)
        else:
            seen[key.value] = yaml_text.source(key)
            yield yaml_text.text(key), key, value
