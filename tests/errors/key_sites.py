"""Finds every key of a specification by the grammar, and makes faulty texts from it.

A faulty text lacks the key, misspells it, indents it differently, or ends at it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import yaml

from fusesoc_firm.text.yaml_sections import Key, Section, keys_of


@dataclass(frozen=True)
class KeySite:
    """A key of `text`: its section's grammar and node, the nodes of key and value, and the next key, if any.

    `parents` are the lines, from 1, and the words by which messages may refer to the section: keys that lead to it,
    names.
    """

    text: str
    section: type[Section]
    node: yaml.MappingNode
    key_node: yaml.ScalarNode
    value: yaml.Node
    next_key: yaml.Node | None
    previous_value: yaml.Node | None
    parents: Mapping[str, int]

    @property
    def name(self) -> str:
        """The key as written in the file."""
        return str(self.key_node.value)

    @property
    def entry(self) -> Key:
        """The grammar's entry for the key."""
        return keys_of(self.section)[spellings_of(self.section)[self.name]][1]

    @property
    def is_needed(self) -> bool:
        """Whether the key is required, given the other keys of its section."""
        names = spellings_of(self.section)
        others = {names[key.value]: value.value for key, value in self.node.value if key is not self.key_node}
        return self.entry.is_needed(others)

    @property
    def line(self) -> int:
        """The line of the key, from 1."""
        return self.key_node.start_mark.line + 1

    @property
    def lines(self) -> range:
        """The lines of its section, from 1."""
        return range(self.node.start_mark.line + 1, _end(self.node).line + 2)

    def __str__(self) -> str:
        return f"'{self.name}' at line {self.line}"

    def without(self) -> str:
        """The text without the key and its value; the rest of the section moves up."""
        start, end = self.key_node.start_mark.index, _end(self.value).index
        if self.next_key:
            end = self.next_key.start_mark.index
        elif self.previous_value and self.node.flow_style:
            start = _end(self.previous_value).index
        return self.text[:start] + self.text[end:]

    def spelt(self, word: str) -> str:
        """The text with another word for the key."""
        start, end = self.key_node.start_mark.index, self.key_node.end_mark.index
        return self.text[:start] + word + self.text[end:]

    def shifted(self, shift: int) -> str | None:
        """The text with the key's line indented by `shift` more; None if other text precedes the key in its line."""
        start = self.key_node.start_mark
        margin = self.text[start.index - start.column : start.index]
        if margin.strip() or len(margin) + shift < 0:
            return None
        return self.text[: start.index - start.column] + " " * (len(margin) + shift) + self.text[start.index :]

    def cut(self, shift: int) -> str | None:
        """Like `shifted`, up to the end of the key's line."""
        shifted = self.shifted(shift)
        return shifted and "".join(shifted.splitlines(keepends=True)[: self.line])


def key_sites(text: str, grammar: type[Section]) -> list[KeySite]:
    """Every key of a valid file, outer ones first."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert isinstance(root, yaml.MappingNode)
    return list(_sites(text, root, grammar, {}))


def spellings_of(section: type[Section]) -> dict[str, str]:
    """The key of each legal spelling."""
    return {spelling: name for name, (_, entry) in keys_of(section).items() for spelling in (name, *entry.aliases)}


def misspellings(word: str) -> list[str]:
    """The word with a letter dropped or doubled, or with two letters swapped, at every position."""
    made = [word[:i] + word[i + 1 :] for i in range(len(word))]
    made += [word[: i + 1] + word[i:] for i in range(len(word))]
    made += [word[:i] + word[i + 1] + word[i] + word[i + 2 :] for i in range(len(word) - 1)]
    return [other for other in dict.fromkeys(made) if other not in ("", word)]


def _sites(text: str, node: yaml.MappingNode, section: type[Section], above: Mapping[str, int]) -> Iterator[KeySite]:
    keys = {spelling: keys_of(section)[name][1] for spelling, name in spellings_of(section).items()}
    own = {value.value: value.start_mark.line + 1 for key, value in node.value if key.value == "name"}
    for number, (key, value) in enumerate(node.value):
        next_key = node.value[number + 1][0] if number + 1 < len(node.value) else None
        previous_value = node.value[number - 1][1] if number else None
        yield KeySite(text, section, node, key, value, next_key, previous_value, {**above, **own})
        inner = keys[key.value].section
        if inner:
            parents = {**above, **own, key.value: key.start_mark.line + 1}
            for part in value.value if isinstance(value, yaml.SequenceNode) else [value]:
                yield from _sites(text, part, inner, parents)


def _end(node: yaml.Node) -> yaml.Mark:
    """The position after a node's last character; PyYAML ends a block where the next token begins."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return node.end_mark
