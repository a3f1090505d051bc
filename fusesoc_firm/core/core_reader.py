"""Read a `.core` file with the positions of its contents; all other modules read cores through this module.

`building` uses FuseSoC's own reader, which includes dependencies and a target's flags.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.text.diagnostics import SourceRef, fail
from fusesoc_firm.text.yaml_text import LARGE, YamlText, data_of, read_yaml


@dataclass(frozen=True)
class CoreFile:
    """A `.core` file that has been read."""

    path: Path
    text: YamlText

    @cached_property
    def data(self) -> Mapping[str, Any]:
        """The file's content with YAML's inheritance resolved, empty if it is not a mapping. May raise `InputError`."""
        try:
            data = data_of(self.text.root)
        except yaml.YAMLError as error:
            fail(f"cannot read {self.path}: {error}")
        return data if isinstance(data, dict) else {}

    def section(self, name: str) -> dict[str, dict[str, Any]]:
        """Return the items of a section by name, including empty items. May raise `InputError`."""
        section = self.data.get(name)
        items = section.items() if isinstance(section, dict) else ()
        return {str(key): item if isinstance(item, dict) else {} for key, item in items}

    def parameters(self, instance: str) -> dict[str, Any]:
        """Return the parameters of a generator instance in the core. May raise `InputError`."""
        parameters = self.section("generate").get(instance, {}).get("parameters")
        return parameters if isinstance(parameters, dict) else {}

    def replaced(self, target: str, instance: str) -> dict[str, Any]:
        """Return the parameters of a generator instance that a target replaces. May raise `InputError`."""
        uses = self.section("targets").get(target, {}).get("generate") or ()
        found = [use[instance] for use in uses if isinstance(use, dict) and isinstance(use.get(instance), dict)]
        return found[0] if found else {}

    def item(self, *keys: str) -> tuple[yaml.Node, yaml.Node] | None:
        """Return the key and value nodes of an item in nested mappings, as written, or None if it is missing."""
        return pair_of(self.text.root, *keys)

    def source(self, node: yaml.Node) -> SourceRef:
        """Return the place of a node."""
        return self.text.source(node)

    def place_of(self, word: str) -> SourceRef:
        """Return the place of the first text that is a word, or else contains it, or of the beginning."""
        texts = [*self._texts()]
        found = [node for node in texts if node.value == word] or [node for node in texts if word in node.value]
        return self.source(found[0]) if found else SourceRef(str(self.path), 1, 1)

    def _texts(self) -> Iterator[yaml.ScalarNode]:
        """Yield all texts of the file, in their order."""
        waiting: list[yaml.Node] = [self.text.root] if self.text.root else []
        seen: set[int] = set()
        while waiting:
            node = waiting.pop(0)
            if isinstance(node, yaml.ScalarNode):
                yield node
            # An alias may refer to a node that contains it.
            if id(node) not in seen and isinstance(node, yaml.CollectionNode):
                seen.add(id(node))
                items = node.value
                inner = [part for pair in items for part in pair] if isinstance(node, yaml.MappingNode) else items
                waiting[:0] = inner


def pair_of(node: yaml.Node | None, *keys: str) -> tuple[yaml.Node, yaml.Node] | None:
    """Return the key and value nodes of an item in nested mappings, as written, or None if it is missing."""
    found = None
    for key in keys:
        pairs = node.value if isinstance(node, yaml.MappingNode) else ()
        if (found := next((pair for pair in pairs if pair[0].value == key), None)) is None:
            return None
        node = found[1]
    return found


def read_core(path: Path) -> CoreFile:
    """Read a `.core` file. Raise `InputError`, at the place of the fault, if it is unreadable or not YAML."""
    return CoreFile(path, read_yaml(path, bounds=LARGE))


@lru_cache(maxsize=8)
def read_core_once(path: Path, _changed: int) -> CoreFile:
    """Cache `read_core`, for a process that generates many instances of one core."""
    return read_core(path)


def core_name(vlnv: str) -> str:
    """Return the name of a core without its version."""
    return ":".join(vlnv.split(":")[:3])
