"""Where in a `.core` file a generator's parameters stand, so that a fault in one can be shown there.

FuseSoC passes on only the values, the core's folder and the new core's name, `<core>-<instance>`. So the core file is
looked up again. Where it is not found, or a parameter comes from an inherited section or a target, there is no place.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import yaml

from fusesoc_firm.text.diagnostics import InputError, SourceRef
from fusesoc_firm.text.yaml_text import YamlText, read_yaml


@dataclass(frozen=True)
class RequestingCore:
    """The entry under `generate` that asks for a core; `key` and `value` are None where it was not found.

    `name` is the requesting core's, as `vendor:library:name`, "" where it was not found.
    """

    text: YamlText | None = None
    entry: tuple[yaml.Node, yaml.Node] | None = None
    name: str = ""

    def instance(self) -> SourceRef | None:
        """The place of the instance's name."""
        return self._reference(self.entry[0]) if self.entry else None

    def key(self, parameter: str) -> SourceRef | None:
        """The place of a parameter's name, else of the instance's."""
        found = self._parameter(parameter)
        return self._reference(found[0]) if found else self.instance()

    def value(self, parameter: str) -> SourceRef | None:
        """The place of a parameter's value, else of the instance's name."""
        found = self._parameter(parameter)
        return self._reference(found[1]) if found else self.instance()

    def items(self, parameter: str) -> list[SourceRef]:
        """The place of each item of a list; none where it was not found."""
        found = self._parameter(parameter)
        if self.text is None or not found or not isinstance(found[1], yaml.SequenceNode):
            return []
        return [self.text.source(node) for node in found[1].value]

    def _parameter(self, name: str) -> tuple[yaml.Node, yaml.Node] | None:
        parameters = _item(self.entry[1], "parameters") if self.entry else None
        return _item(parameters[1], name) if parameters else None

    def _reference(self, node: yaml.Node) -> SourceRef | None:
        return self.text.source(node) if self.text else None


def find_requesting_core(folder: Path, new_core: str) -> RequestingCore:
    """Find the core in `folder` whose generator instance makes the core of this name (`<core>-<instance>`)."""
    for path in sorted(folder.glob("*.core")):
        try:
            text = _read(path, path.stat().st_mtime_ns)
        except InputError:
            continue
        if entry := _entry(text.root, new_core):
            name = _item(text.root, "name")
            return RequestingCore(text, entry, ":".join(str(name[1].value).split(":")[:3]) if name else "")
    return RequestingCore()


@lru_cache(maxsize=8)
def _read(path: Path, _changed: int) -> YamlText:
    """A core file, which a process that makes many of its instances reads once."""
    return read_yaml(path)


def _entry(root: yaml.Node | None, new_core: str) -> tuple[yaml.Node, yaml.Node] | None:
    name = _item(root, "name")
    instances = _item(root, "generate")
    if not name or not instances:
        return None
    # `vendor:library:name:version`, of which FuseSoC demands only the name.
    parts = str(name[1].value).split(":")
    core = parts[2] if len(parts) > 2 else parts[-1]
    return _item(instances[1], new_core.removeprefix(f"{core}-"))


def _item(node: yaml.Node | None, key: str) -> tuple[yaml.Node, yaml.Node] | None:
    """The key and value nodes of a mapping's item."""
    if not isinstance(node, yaml.MappingNode):
        return None
    return next((pair for pair in node.value if pair[0].value == key), None)
