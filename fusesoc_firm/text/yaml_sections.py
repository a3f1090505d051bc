"""Typed sections of a YAML file: each dataclass field defines a key's name, form and meaning in one place.

`read` converts a node to a section and reports every fault, with its place and the legal values. After a fault, `read`
continues: it always returns a section, with empty values in place of unreadable values, and marks a faulty section as
not sound. All faults in a file are therefore reported together, and callers can distinguish faults from their
consequences.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import yaml

from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, closest, nearest
from fusesoc_firm.text.naming import text_fault
from fusesoc_firm.text.yaml_text import Text, YamlText, integer, is_null, items, kind

# The fault in a text and the legal form, or None if there is no fault.
TextRule = Callable[[str], tuple[str, str] | None]
_WITHOUT_BLANK = re.compile(r"(\w+):(\S+)")
S = TypeVar("S", bound="Section")


@dataclass(frozen=True, kw_only=True)
class Section:
    """A mapping in the file; the fields `source`, `places` and `is_sound` are not keys."""

    source: SourceRef
    is_sound: bool = True
    # The place of the value of each key that is present, by field name.
    places: Mapping[str, SourceRef] = dataclasses.field(default_factory=dict, compare=False, repr=False)

    def place(self, field: str) -> SourceRef:
        """Return the place of the value of a field's key, or the place of the section if the key is missing."""
        return self.places.get(field, self.source)


@dataclass(frozen=True)
class Key:
    """The grammar of a key.

    `form` is "text", "integer", "texts" (a text or a list of texts), "section" or "sections" (a list); `type` is the
    type of a "section" or of each item in "sections". `aliases` are other spellings of the key. `choices` lists all
    legal values, if possible. A required key may be omitted if another key has the value in `unless`. If a section
    describes several kinds of items, `only_of` limits the key to one kind. A text must satisfy the `rule`. The wizard
    does not ask for keys without `is_asked`.
    """

    meaning: str
    form: str = "text"
    name: str = ""
    aliases: tuple[str, ...] = ()
    is_required: bool = False
    unless: tuple[str, str] | None = None
    choices: tuple[str | int, ...] = ()
    section: type[Section] | None = None
    only_of: str = ""
    rule: TextRule = text_fault
    is_asked: bool = True

    def is_needed(self, others: Mapping[str, object]) -> bool:
        """Return whether the key is required, given the values of the `others` as texts."""
        return self.is_required and (self.unless is None or others.get(self.unless[0]) != self.unless[1])


def key(meaning: str, *, default: Any = None, **facts: Any) -> Any:
    """Return a dataclass field for a key; unless `is_required` is set, a missing key has the value `default`."""
    made = Key(meaning, **facts)
    if made.form in ("sections", "texts"):
        default = ()
    return dataclasses.field(default=default, metadata={"key": made})


_KEYS: dict[type[Section], Mapping[str, tuple[str, Key]]] = {}


def keys_of(section: type[Section]) -> Mapping[str, tuple[str, Key]]:
    """Return the field name and `Key` for each key's name in the file, in the grammar's order."""
    if section not in _KEYS:
        _KEYS[section] = {
            (field.metadata["key"].name or field.name): (field.name, field.metadata["key"])
            for field in dataclasses.fields(section)
            if "key" in field.metadata
        }
    return _KEYS[section]


def keys_only_of(section: type[Section], kind: str) -> list[str]:
    """Return the names of the keys that are limited to this kind of item."""
    return [name for name, (_, entry) in keys_of(section).items() if entry.only_of == kind]


def read(section: type[S], node: yaml.Node, file: YamlText, faults: Diagnostics, what: str) -> S:
    """Read a section from a node of `file`, and add all faults in the section to `faults`.

    `what` names the section in messages, such as "a block".
    """
    return _Reader(file, faults, section).section(section, node, what)


@dataclass(frozen=True)
class _Reader:
    """A reader for the nodes of one file, which reports faulty values and reads them as None."""

    file: YamlText
    faults: Diagnostics
    root: type[Section]

    def section(self, section: type[S], node: yaml.Node, what: str) -> S:
        """Return a section with all readable keys; required keys that are missing or unreadable have empty values."""
        before = len(self.faults.found)
        source = self.file.source(node)
        if not isinstance(node, yaml.MappingNode):
            hint = _spaced(node) or _words_of_keys(section)
            self._error(f"{what} must be a mapping of keys to values, not {kind(node)}", node, hint)
            return _empty(section, source)
        known = keys_of(section)
        given = self._given(known, node, what)
        values = {known[name][0]: self._value(known[name][1], value, name) for name, value in given.items()}
        found = {field: value for field, value in values.items() if value is not None}
        blanks = _blanks(section, source)
        needed = {known[name][0] for name in _needed(known, given)}
        # If the file becomes invalid YAML, the keys after that place are unknown.
        is_sound = len(self.faults.found) == before and needed <= found.keys() and not self.file.is_cut
        places = {known[name][0]: self.file.source(value) for name, value in given.items()}
        return section(source=source, is_sound=is_sound, places=places, **(blanks | found))

    def _given(self, known: Mapping[str, tuple[str, Key]], node: yaml.MappingNode, what: str) -> dict[str, yaml.Node]:
        """Return the value nodes of the known keys that have a value, by the keys' main names."""
        spellings = {spelling: name for name, (_, entry) in known.items() for spelling in (name, *entry.aliases)}
        given: dict[str, yaml.Node] = {}
        meant: set[str] = set()
        for text, key_node, value in items(self.file, node, self.faults):
            name = spellings.get(text)
            if name is None:
                near = closest(text, spellings)
                meant |= {spellings[near]} if near else set()
                hint = _elsewhere(text, self.root) or nearest(text, [near] if near else known)
                self._error(f"{what} has no key '{text}'", key_node, hint)
            elif name in given:
                self._error(f"key '{name}' is given twice, here as '{text}'", key_node)
            elif not is_null(value) or (known[name][1].is_required and not self.file.is_cut):
                given[name] = value
        needed = _needed(known, given)
        for name in needed:
            # A misspelt key is not also reported as missing.
            if name not in given and not self.file.is_cut and name not in meant:
                self._error(f"{what} needs the key '{name}': {known[name][1].meaning}", node)
        return {name: value for name, value in given.items() if not is_null(value) or name in needed}

    def _value(self, entry: Key, node: yaml.Node, name: str) -> Any:
        """Return the value of a key in its form, or None if it is invalid."""
        match entry.form:
            case "section":
                return self.section(_section_type(entry), node, f"'{name}'")
            case "sections":
                return self._sections(entry, node, name)
            case "texts" if isinstance(node, yaml.MappingNode):
                self._error(f"'{name}' must be a word or a list of words, not {kind(node)}", node, entry.meaning)
                return None
            case "texts":
                nodes = node.value if isinstance(node, yaml.SequenceNode) else [node]
                texts = [self._text(item, entry, name) for item in nodes]
                if not texts:
                    self._error(f"'{name}' is an empty list", node, entry.meaning)
                return None if None in texts else tuple(texts)
            case "integer":
                return self._chosen(entry, self._integer(node, entry, name), node, name)
            case _:
                return self._chosen(entry, self._text(node, entry, name), node, name)

    def _sections(self, entry: Key, node: yaml.Node, name: str) -> tuple[Section, ...] | None:
        if not isinstance(node, yaml.SequenceNode):
            required = [key for key, (_, item) in keys_of(_section_type(entry)).items() if item.is_required]
            form = f": write [{{{required[0]}: {node.value}}}]" if len(required) == 1 and _is_word(node) else ""
            self._error(f"'{name}' must be a list with one '- ' per item, not {kind(node)}", node, entry.meaning + form)
            return None
        if not node.value and entry.is_required:
            self._error(f"'{name}' is an empty list", node, entry.meaning)
        return tuple(self.section(_section_type(entry), item, f"an item of '{name}'") for item in node.value)

    def _text(self, node: yaml.Node, entry: Key, name: str) -> Text | None:
        if isinstance(node, yaml.ScalarNode) and node.value and not is_null(node):
            if fault := entry.rule(node.value):
                self._error(f"'{name}' {fault[0]}", node, fault[1])
                return None
            return self.file.text(node)
        self._error(f"'{name}' must be a word, not {kind(node)}", node, entry.meaning)
        return None

    def _integer(self, node: yaml.Node, entry: Key, name: str) -> int | None:
        if isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:int":
            # The user may have added the integer tag to any text.
            with suppress(ValueError):
                return integer(node.value)
        self._error(f"'{name}' must be an integer, not {kind(node)}", node, entry.meaning)
        return None

    def _chosen(self, entry: Key, value: Any, node: yaml.Node, name: str) -> Any:
        if value is None or not entry.choices or value in entry.choices:
            return value
        choices = [str(choice) for choice in entry.choices]
        hint = nearest(str(value), choices) if isinstance(value, str) else f"legal here: {', '.join(choices)}"
        self._error(f"'{name}' cannot be '{value}'", node, hint)
        return None

    def _error(self, message: str, node: yaml.Node, hint: str = "") -> None:
        self.faults.error(message, self.file.source(node), hint)


def _is_word(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and not is_null(node)


def _needed(known: Mapping[str, tuple[str, Key]], given: Mapping[str, yaml.Node]) -> list[str]:
    """Return the names of the keys that are required in addition to the given keys."""
    words = {name: value.value for name, value in given.items()}
    return [name for name, (_, entry) in known.items() if entry.is_needed(words)]


def _blanks(section: type[Section], source: SourceRef) -> dict[str, Any]:
    """Return an empty value for each required field."""
    blanks: dict[str, Any] = {}
    for field, entry in keys_of(section).values():
        if entry.is_required:
            blanks[field] = _blank(entry, source)
    return blanks


def _blank(entry: Key, source: SourceRef) -> Any:
    match entry.form:
        case "section":
            return _empty(_section_type(entry), source)
        case "sections" | "texts":
            return ()
        case _:
            return Text("", source)


def _empty(section: type[S], source: SourceRef) -> S:
    return section(source=source, is_sound=False, **_blanks(section, source))


def _spaced(node: yaml.Node) -> str:
    """Return a hint about a text that is a key and a value without a blank between them, or an empty text."""
    found = _WITHOUT_BLANK.fullmatch(node.value) if isinstance(node, yaml.ScalarNode) else None
    return f"write a blank after the colon: '{found[1]}: {found[2]}'" if found else ""


def _words_of_keys(section: type[Section]) -> str:
    """Return a phrase with the keys that a section requires or, if it requires no keys, the keys that it may have."""
    keys = keys_of(section)
    required = [name for name, (_, entry) in keys.items() if entry.is_required]
    return f"required keys: {', '.join(required)}" if required else f"legal keys: {', '.join(keys)}"


def _elsewhere(name: str, root: type[Section]) -> str:
    """Return a hint with the sections of a file that have a key of this name, or an empty text."""
    found = [what for what, section in _sections(root, "the top level") if name in keys_of(section)]
    return f"it is a key of {' and of '.join(found)}" if found else ""


def _sections(section: type[Section], what: str) -> Iterator[tuple[str, type[Section]]]:
    """Yield a section and all sections within it, each with its name in messages."""
    yield what, section
    for name, (_, entry) in keys_of(section).items():
        if entry.section:
            yield from _sections(entry.section, f"{'an item of ' * (entry.form == 'sections')}'{name}'")


def _section_type(entry: Key) -> type[Section]:
    assert entry.section is not None, "a section's key names its type"
    return entry.section
