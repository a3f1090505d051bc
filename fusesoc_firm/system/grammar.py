"""Typed sections of a YAML file: what a key is called, takes and means is said once, at its dataclass field.

`read` turns a node into a section and reports whatever does not fit, with the place and what is legal. It goes
on behind a fault, so that all faults of a file come at once.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, TypeVar

import yaml

from fusesoc_firm.diagnostics import Diagnostics, SourceRef, nearest
from fusesoc_firm.yaml_text import Text, YamlText, is_null, items

S = TypeVar("S", bound="Section")


@dataclass(frozen=True)
class Section:
    """A mapping of the file; `source` is its place and no key."""

    source: SourceRef


@dataclass(frozen=True)
class Key:
    """What the grammar says of a key.

    `form` is "text", "integer", "texts" (one or a list), "section" or "sections" (a list), the last two of type
    `section`. `aliases` are other spellings of the key. `choices` are all legal values, if they can be listed.
    """

    meaning: str
    form: str = "text"
    name: str = ""
    aliases: tuple[str, ...] = ()
    is_required: bool = False
    choices: tuple[str | int, ...] = ()
    section: type[Section] | None = None


def key(meaning: str, *, default: Any = None, **facts: Any) -> Any:
    """A field of a section; without `is_required` it has `default` where the key is not given."""
    made = Key(meaning, **facts)
    if made.form in ("sections", "texts"):
        default = ()
    return dataclasses.field(default=default, metadata={"key": made})


def keys_of(section: type[Section]) -> dict[str, tuple[str, Key]]:
    """Field name and key by the key's name in the file, in the grammar's order."""
    return {
        (field.metadata["key"].name or field.name): (field.name, field.metadata["key"])
        for field in dataclasses.fields(section)
        if "key" in field.metadata
    }


def read(section: type[S], node: yaml.Node, file: YamlText, faults: Diagnostics, what: str) -> S | None:
    """The section that a node holds, or None if a required key is missing or the node is no mapping.

    `what` names the section in messages: "a block".
    """
    if not isinstance(node, yaml.MappingNode):
        faults.error(f"{what} must be a mapping of keys to values, not {_kind(node)}", file.source(node))
        return None
    known = keys_of(section)
    spellings = {spelling: name for name, (_, entry) in known.items() for spelling in (name, *entry.aliases)}
    found: dict[str, Any] = {}
    for text, key_node, value in items(file, node, faults):
        if text not in spellings:
            faults.error(f"{what} has no key '{text}'", file.source(key_node), nearest(text, known))
            continue
        field, entry = known[spellings[text]]
        if not (is_null(value) and not entry.is_required):
            found[field] = _value(entry, value, file, faults, text)
    missing = [name for name, (field, entry) in known.items() if entry.is_required and field not in found]
    for name in missing:
        faults.error(f"{what} needs the key '{name}': {known[name][1].meaning}", file.source(node))
    invalid = [name for name, (field, entry) in known.items() if entry.is_required and found.get(field, 0) is None]
    if missing or invalid:
        return None
    return section(source=file.source(node), **{field: value for field, value in found.items() if value is not None})


def _value(entry: Key, node: yaml.Node, file: YamlText, faults: Diagnostics, name: str) -> Any:
    """The value of a key in its form, or None if it does not fit."""
    match entry.form:
        case "section":
            return read(_section_type(entry), node, file, faults, f"'{name}'")
        case "sections":
            return _sections(entry, node, file, faults, name)
        case "texts":
            nodes = node.value if isinstance(node, yaml.SequenceNode) else [node]
            texts = [_text(item, file, faults, name) for item in nodes]
            return tuple(text for text in texts if text is not None)
        case "integer":
            return _chosen(entry, _integer(node, file, faults, name), node, file, faults, name)
        case _:
            return _chosen(entry, _text(node, file, faults, name), node, file, faults, name)


def _sections(entry: Key, node: yaml.Node, file: YamlText, faults: Diagnostics, name: str) -> tuple[Section, ...]:
    if not isinstance(node, yaml.SequenceNode):
        faults.error(f"'{name}' must be a list, one '- ' an item, not {_kind(node)}", file.source(node))
        return ()
    singular = f"an item of '{name}'"
    read_items = [read(_section_type(entry), item, file, faults, singular) for item in node.value]
    return tuple(item for item in read_items if item is not None)


def _text(node: yaml.Node, file: YamlText, faults: Diagnostics, name: str) -> Text | None:
    if isinstance(node, yaml.ScalarNode) and node.value and not is_null(node):
        return file.text(node)
    faults.error(f"'{name}' must be a word, not {_kind(node)}", file.source(node))
    return None


def _integer(node: yaml.Node, file: YamlText, faults: Diagnostics, name: str) -> int | None:
    if isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:int":
        return int(yaml.safe_load(node.value))
    faults.error(f"'{name}' must be an integer, not {_kind(node)}", file.source(node))
    return None


def _chosen(entry: Key, value: Any, node: yaml.Node, file: YamlText, faults: Diagnostics, name: str) -> Any:
    if value is None or not entry.choices or value in entry.choices:
        return value
    choices = [str(choice) for choice in entry.choices]
    hint = nearest(str(value), choices) if isinstance(value, str) else f"legal here: {', '.join(choices)}"
    faults.error(f"'{name}' cannot be '{value}'", file.source(node), hint)
    return None


def _section_type(entry: Key) -> type[Section]:
    assert entry.section is not None, "a section's key names its type"
    return entry.section


def _kind(node: yaml.Node) -> str:
    if is_null(node):
        return "nothing"
    if isinstance(node, yaml.MappingNode):
        return "a mapping"
    return "a list" if isinstance(node, yaml.SequenceNode) else f"'{node.value}'"
