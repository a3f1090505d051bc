"""YAML that remembers where everything stands.

PyYAML's own nodes hold the marks; here they become `SourceRef`s, and what a reader takes out of a file stays
tied to its place: `Text` is a string that knows it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from fusesoc_firm.diagnostics import Diagnostics, SourceRef, fail


class Text(str):
    """A string of a file and the place where it was written."""

    __slots__ = ("source",)

    source: SourceRef | None

    def __new__(cls, value: str, source: SourceRef | None = None) -> Text:
        """`value`, written at `source`; None where it was written nowhere (a default)."""
        text = super().__new__(cls, value)
        text.source = source
        return text


@dataclass(frozen=True)
class YamlText:
    """A YAML file's lines and its root node; `file` is how it is called in messages."""

    file: str
    lines: tuple[str, ...]
    root: yaml.Node | None

    def source(self, node: yaml.Node) -> SourceRef:
        """The place of a node; a node of several lines is shown by its first."""
        start, end = node.start_mark, node.end_mark
        text = self.lines[start.line] if start.line < len(self.lines) else ""
        last = end.column if end.line == start.line else len(text.rstrip())
        return SourceRef(self.file, start.line + 1, start.column + 1, text, max(1, last - start.column))

    def text(self, node: yaml.ScalarNode) -> Text:
        """A scalar's characters, whatever type YAML takes them for."""
        return Text(str(node.value), self.source(node))


def read_yaml(path: Path, file: str | None = None) -> YamlText:
    """Read a file. Raises `InputError` if it cannot be read or is no YAML."""
    name = file or str(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        fail(f"cannot read {name}: {error.strerror}")
    except UnicodeDecodeError as error:
        fail(f"{name} is not UTF-8: byte {error.start} is 0x{error.object[error.start]:02x}")
    return parse_yaml(text, name)


def parse_yaml(text: str, file: str) -> YamlText:
    """The nodes of a YAML text. Raises `InputError` at the place where it stops being YAML."""
    lines = tuple(text.splitlines())
    try:
        return YamlText(file, lines, yaml.compose(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line, mark.column) if mark else (0, 0)
        shown = lines[line] if line < len(lines) else ""
        context = f" ({error.context})" if error.context else ""
        fail(f"this is not YAML: {error.problem}{context}", SourceRef(file, line + 1, column + 1, shown))
    except yaml.YAMLError as error:
        fail(f"{file} is not YAML: {' '.join(str(error).split())}")


def is_null(node: yaml.Node) -> bool:
    """Tell whether a key was written without a value, as listing 6.1 of the dissertation does with `type:`."""
    return isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:null"


def items(
    yaml_text: YamlText, node: yaml.MappingNode, faults: Diagnostics
) -> Iterator[tuple[Text, yaml.ScalarNode, yaml.Node]]:
    """Key text, key node and value node of each item; a key that is no scalar, or comes twice, is a fault."""
    seen: set[str] = set()
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            faults.error("a key must be a word", yaml_text.source(key))
        elif key.value in seen:
            faults.error(f"key '{key.value}' is given twice", yaml_text.source(key))
        else:
            seen.add(key.value)
            yield yaml_text.text(key), key, value
