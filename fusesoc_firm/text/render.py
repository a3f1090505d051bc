"""Render strict mustache templates: where mustache would guess, rendering fails with an error.

Mustache was designed for HTML: it escapes `<` and `&`, prints nothing for an unknown key, and looks up missing keys in
outer scopes. In a hardware description, each of these rules may give a result that compiles but is wrong. Therefore
chevron only parses the templates, and this module expands the tree by these rules:

* `{{x}}` prints a string or an integer unchanged. A bool or None is an error, since neither has a standard spelling.
* `{{comment x}}` prints a user's text, quoted for this purpose in the language given by the ending of the template's
  name; `quoting` defines the kinds of each language. A partial is in the language of the including template.
* `{{x-1}}` and `{{x+1}}` print an integer minus or plus a number: `std_logic_vector({{width-1}} downto 0)`.
* A key is looked up only in the innermost scope; `../x` is `x` in the enclosing scope. The key must exist, even in
  an omitted section.
* `{{#x}}` expects a bool (the section or nothing, same scope), a list (the section once per item), or a mapping or None
  (the section in the mapping's scope, or nothing). `{{^x}}` is the section for false, an empty list or None.
* `{{#x?}}` is a section in the same scope, once, unless `x` is false, "", an empty list or None.
* A list holds mappings, each the scope of its iteration, or strings and integers, which `{{.}}` prints. Within the
  section, the bools `@first` and `@last` mark the first and the last iteration.
* `{{|}}` begins a column: in adjacent lines, the text after the tag is aligned. `{{|20}}` begins a column after at
* least 20 characters. `{{|!}}` separates a line from the lines before it. `{{> name}}` includes
* `partials/name.mustache`; if the tag is alone on a line, the tag's indentation applies to every
  included line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

from chevron.tokenizer import ChevronError, tokenize

from fusesoc_firm.text.quoting import QUOTES, Quote

Context = dict[str, Any]
"""The context of a template: plain data."""

TEMPLATES = Path(__file__).resolve().parents[1] / "templates"


class TemplateError(Exception):
    """A mismatch between a template and its context, which is an error in this package, not in the user's input."""


@dataclass(frozen=True)
class Rendering:
    """A template below `TEMPLATES`, with its context."""

    template: str
    context: Mapping[str, object]


@dataclass(frozen=True)
class TracedLine:
    """A line of rendered text, the corresponding line in the template file, and the scope's path in the context."""

    text: str
    template: str
    line: int
    scope: str


_RECORDS: list[dict[str, Rendering]] = []
# Private-use characters, which templates never contain, enclose the place of a line.
_MARK = re.compile("\ue000(?P<file>[^\ue000]*):(?P<line>\\d+):(?P<scope>[^\ue001]*)\ue001")
# A line that is always removed as a whole, regardless of the tag's expansion.
_STANDALONE = re.compile(r"[ \t]*\{\{[#^/!>][^}]*\}\}[ \t]*")
# The start of a column, and the minimum number of characters before it: the tag, and its mark in the text.
_COLUMN_TAG, _COLUMN = re.compile(r"\{\{\|(\d*)\}\}"), re.compile("\ue002(\\d*)\ue003")
_PARTED_TAG, _PARTED = "{{|!}}", "\ue004"
_SUM_KEY = re.compile(r"(?P<name>.+?)(?P<addend>[+-]\d+)")


@dataclass(frozen=True)
class _Value:
    key: str
    quote: str = ""
    addend: int | None = None


@dataclass(frozen=True)
class _Section:
    key: str
    is_inverted: bool
    body: tuple[_Node, ...]
    is_question: bool = False


@dataclass(frozen=True)
class _Partial:
    name: str
    indentation: str


_Node = str | _Value | _Section | _Partial


@dataclass(slots=True)
class _Scope:
    """A scope for key lookup, entered from `outer` by `key`, and by the item's number if that is a list.

    `turn` contains `@first` and `@last` of the innermost list around the scope. A path is computed only for an error
    message, so templates with many scopes expand quickly.
    """

    data: object
    outer: _Scope | None = None
    key: str = ""
    number: int | None = None
    turn: Mapping[str, bool] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """The path from the context's root, such as `ports[3]`."""
        above = self.outer.path_to(self.key) if self.outer else ""
        return above if self.number is None else f"{above}[{self.number}]"

    def path_to(self, key: str) -> str:
        if key == ".":
            return self.path
        if key.startswith("../") and self.outer:
            return self.outer.path_to(key.removeprefix("../"))
        return f"{self.path}.{key}" if self.path else key


def render(template_name: str, context: Mapping[str, object], templates: Path = TEMPLATES) -> str:
    """Return the text of `templates/<template_name>.mustache` for `context`.

    The template can use only values of the types dict, list, str, int, bool and None. If template and context do not
    match, raise `TemplateError`, which names the template, the key and the scope.
    """
    try:
        text = _in_columns(_expanded(Rendering(template_name, context), templates))
    except TemplateError as error:
        raise TemplateError(f"template {template_name}: {error}") from error
    for renderings in _RECORDS:
        renderings[text] = Rendering(template_name, context)
    return text


@contextmanager
def recorded() -> Iterator[dict[str, Rendering]]:
    """Record every text rendered within the `with` block, with its template and its data."""
    renderings: dict[str, Rendering] = {}
    _RECORDS.append(renderings)
    try:
        yield renderings
    finally:
        _RECORDS.remove(renderings)


def traced_lines(rendering: Rendering) -> list[TracedLine]:
    """Return each line of the rendered text, with its origin."""
    lines = _expanded(rendering, TEMPLATES, is_traced=True).removesuffix("\n").split("\n")
    texts = _in_columns(_MARK.sub("", "\n".join(lines))).split("\n")
    traced: list[TracedLine] = []
    place = (f"{rendering.template}.mustache", 1, "")
    for line, text in zip(lines, texts, strict=True):
        # The later lines of a multi-line value, and blank lines, have no mark: they share the place of the line above.
        if found := _MARK.search(line):
            place = (found["file"], int(found["line"]), found["scope"])
        traced.append(TracedLine(text, *place))
    return traced


def template_text(name: str, templates: Path = TEMPLATES) -> str:
    """Return the text of `templates/<name>.mustache`. May raise `OSError`."""
    return (templates / f"{name}.mustache").read_text(encoding="utf-8")


def _expanded(rendering: Rendering, templates: Path, *, is_traced: bool = False) -> str:
    """Return the text before its columns are aligned; if `is_traced` is set, each line begins with its place."""
    # The ending of the name is the template's language: `vhdl/board.vhd`, or `board/pcf`.
    quotes = QUOTES.get(rendering.template.rpartition("/")[2].rpartition(".")[2], {})
    expansion = _Expansion(templates, quotes, is_traced)
    return expansion.expand(_parse(rendering.template, templates, is_traced), _Scope(rendering.context), True)


@dataclass(frozen=True)
class _Expansion:
    """One walk over a parsed template; `quotes` holds the quoting functions of the template's language."""

    templates: Path
    quotes: Mapping[str, Quote]
    is_traced: bool

    def expand(self, nodes: tuple[_Node, ...], scope: _Scope, is_taken: bool) -> str:
        """Return the text of `nodes`; if `is_taken` is false, only look up every key and return no text."""
        text = "".join([self._node(node, scope, is_taken) for node in nodes])
        return text if is_taken else ""

    def _node(self, node: _Node, scope: _Scope, is_taken: bool) -> str:
        # Values and literals are the most frequent nodes.
        if isinstance(node, _Value):
            value = _look_up(node.key, scope)
            return self._printed(node, value, scope) if is_taken else ""
        if isinstance(node, str):
            return node.replace("\ue001", f"{scope.path}\ue001") if self.is_traced else node
        if isinstance(node, _Section):
            return self._section(node, scope, is_taken)
        text = self.expand(_parse(f"partials/{node.name}", self.templates, self.is_traced), scope, is_taken)
        return _indented(text, node.indentation)

    def _printed(self, node: _Value, value: object, scope: _Scope) -> str:
        number = value if node.addend is None else _sum(value, node, scope)
        # Exact types: a bool is an integer, but has no standard spelling.
        if type(number) is not str and type(number) is not int:
            raise TemplateError(
                f"'{scope.path_to(node.key)}' is {_kind(number)}; only a string or an integer can be printed"
            )
        return self._quoted(node.quote, str(number))

    def _quoted(self, quote: str, text: str) -> str:
        if not quote:
            return text
        if quote not in self.quotes:
            known = ", ".join(sorted(self.quotes)) or "none"
            raise TemplateError(f"unknown quoting '{quote}'; the template's language has {known}")
        return self.quotes[quote](text)

    def _section(self, section: _Section, scope: _Scope, is_taken: bool) -> str:
        value = _look_up(section.key, scope)
        if not section.is_question and not isinstance(value, bool | list | dict | None):
            kind, path = _kind(value), scope.path_to(section.key)
            raise TemplateError(f"'{path}' is {kind}; a section takes a bool, a list, a mapping or None")
        return "".join(
            [
                self.expand(section.body, inner, is_taken and is_inner_taken)
                for inner, is_inner_taken in _turns(section, value, scope)
            ]
        )


def _turns(section: _Section, value: object, scope: _Scope) -> Iterator[tuple[_Scope, bool]]:
    """Yield each scope for the expansion of a section's body, and whether the resulting text is used."""
    if section.is_inverted:
        yield scope, not _is_there(value)
    elif section.is_question or isinstance(value, bool):
        yield scope, _is_there(value)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            turn = {"@first": number == 0, "@last": number == len(value) - 1}
            yield _Scope(item, scope, section.key, number, turn), True
    elif value is not None:
        yield _Scope(value, scope, section.key, None, scope.turn), True


def _is_there(value: object) -> bool:
    return not (value is None or value is False or value == [] or value == "")


def _look_up(key: str, scope: _Scope) -> object:
    while key.startswith("../"):
        if scope.outer is None:
            raise TemplateError(f"no scope encloses {scope.path or 'the context'} for '{key}'")
        key, scope = key.removeprefix("../"), scope.outer
    if key == ".":
        return scope.data
    if key in scope.turn:
        return scope.turn[key]
    if isinstance(scope.data, dict) and key in scope.data and "." not in key:
        return scope.data[key]
    value, path = scope.data, scope.path
    for step in key.split("."):
        if not isinstance(value, dict) or step not in value:
            legal = f"it has {', '.join(sorted(value))}" if isinstance(value, dict) else f"it is {_kind(value)}"
            raise TemplateError(f"no '{key}' in {path or 'the context'}; {legal}")
        value, path = value[step], f"{path}.{step}" if path else step
    return value


def _sum(value: object, node: _Value, scope: _Scope) -> int:
    assert node.addend is not None
    if isinstance(value, bool) or not isinstance(value, int):
        path = scope.path_to(node.key)
        raise TemplateError(f"'{path}' is {_kind(value)}; {node.addend} can be added only to an integer")
    return value + node.addend


def _kind(value: object) -> str:
    return "None" if value is None else f"of type {type(value).__name__}"


def _indented(text: str, indentation: str) -> str:
    """Return a text in which every line that is not empty is indented."""
    return "\n".join(indentation + line if line.strip() else line for line in text.split("\n"))


def _in_columns(text: str) -> str:
    """Return a text with aligned columns; each run of lines with columns is aligned independently."""
    if not _COLUMN.search(text):
        return text
    lines: list[str] = []
    rows = (_COLUMN.split(line) for line in text.split("\n"))
    for has_columns, run in groupby(rows, key=lambda row: len(row) > 1):
        block: list[list[str]] = []
        for first, *others in run:
            if _PARTED in first:
                lines += _aligned(block)
                block = []
            block.append([first.replace(_PARTED, ""), *others])
        lines += _aligned(block) if has_columns else [line for (line,) in block]
    return "\n".join(lines)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the aligned lines for rows, in which each cell is followed by its minimum length."""
    widths: dict[int, int] = {}
    for row in rows:
        for number, (cell, least) in enumerate(zip(row[:-1:2], row[1::2], strict=True)):
            widths[number] = max(widths.get(number, 0), len(cell), int(least or 0))
    for row in rows:
        cells = (cell.ljust(widths[number]) for number, cell in enumerate(row[:-1:2]))
        yield ("".join(cells) + row[-1]).rstrip()


@cache
def _parse(name: str, templates: Path, is_traced: bool) -> tuple[_Node, ...]:
    """Return the tree of a template file; if `is_traced` is set, each line that produces output begins with a mark."""
    try:
        text = template_text(name, templates)
    except OSError as error:
        raise TemplateError(f"cannot read {name.rpartition('/')[2]}.mustache: {error.strerror}") from error
    if is_traced:
        lines = enumerate(text.split("\n"), start=1)
        text = "\n".join(f"{_mark(name, number, line)}{line}" for number, line in lines)
    return _tree(name, text)


def _mark(name: str, number: int, line: str) -> str:
    is_empty = not line.strip() or _STANDALONE.fullmatch(line)
    return "" if is_empty else f"\ue000{name}.mustache:{number}:\ue001"


def _tree(name: str, text: str) -> tuple[_Node, ...]:
    try:
        text = _COLUMN_TAG.sub("\ue002\\1\ue003", text.replace(_PARTED_TAG, _PARTED))
        tokens = iter(list(tokenize(text)))
    except ChevronError as error:
        raise TemplateError(f"{name.rpartition('/')[2]}.mustache: {' '.join(str(error).split())}") from error
    return _nodes(tokens)


def _nodes(tokens: Iterator[tuple[str, str]]) -> tuple[_Node, ...]:
    """Return the nodes up to the end of the current section of `tokens`, or of the file."""
    nodes: list[_Node] = []
    for kind, key in tokens:
        match kind:
            case "literal":
                nodes.append(key)
            case "variable" | "no escape":
                nodes.append(_value(key))
            case "section" | "inverted section":
                name, is_inverted = key.removesuffix("?"), kind == "inverted section"
                nodes.append(_Section(name, is_inverted, _nodes(tokens), is_question=name != key))
            case "partial":
                nodes.append(_Partial(key, _take_indentation(nodes)))
            case "end":
                break
    return tuple(nodes)


def _value(key: str) -> _Value:
    """Return the node of a value tag: `x`, `comment x` or `x-1`."""
    quote, _, name = key.rpartition(" ")
    if found := _SUM_KEY.fullmatch(name):
        return _Value(found["name"], quote, int(found["addend"]))
    return _Value(name, quote)


def _take_indentation(nodes: list[_Node]) -> str:
    """Remove and return the indentation of the last line in `nodes` if that line is otherwise empty."""
    match nodes:
        case [*before, str(text)] if not (before and isinstance(before[-1], _Value) and "\n" not in text):
            rest, newline, line = text.rpartition("\n")
            if line.isspace():
                nodes[-1] = rest + newline
                return line
    return ""
