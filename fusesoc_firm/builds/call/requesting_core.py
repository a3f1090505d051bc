"""Find the places of a generator's parameters in a `.core` file, for reports of faults.

FuseSoC passes only the values, the core's folder and the new core's name, `<core>-<instance>`, so the core file must be
searched for again. If it is not found, or if a parameter is from an inherited section, the place is unknown. A target
may override parameters; since FuseSoC does not name the target, the override with the passed value is the place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from fusesoc_firm.core.core_reader import CoreFile, core_name, pair_of, read_core_once
from fusesoc_firm.text.diagnostics import InputError, SourceRef
from fusesoc_firm.text.yaml_text import data_of

_Pair = tuple[yaml.Node, yaml.Node]


@dataclass(frozen=True)
class RequestingCore:
    """The core file whose entry `called`, under `generate`, requests a core; None if the file was not found."""

    core: CoreFile | None = None
    called: str = ""

    @property
    def name(self) -> str:
        """The requesting core's name, as `vendor:library:name`; empty if the core was not found."""
        found = self.core.item("name") if self.core else None
        return core_name(str(found[1].value)) if found else ""

    @property
    def generator(self) -> str:
        """The name of the called generator; empty if the core was not found."""
        section = self.core.section("generate").get(self.called, {}) if self.core else {}
        return str(section.get("generator", ""))

    def instance(self) -> SourceRef | None:
        """Return the place of the instance's name."""
        return self._place(0)

    def key(self, parameter: str) -> SourceRef | None:
        """Return the place of a parameter's name or, if unknown, of the instance's name."""
        return self._source(self._pairs(parameter), 0) or self.instance()

    def value(self, parameter: str, given: object) -> SourceRef | None:
        """Return the place of a parameter's `given` value or, if unknown, of the instance's name."""
        return self._source(self._with_value(parameter, given), 1) or self.instance()

    def items(self, parameter: str, given: object) -> list[SourceRef]:
        """Return the place of each item in a `given` list, or an empty list if the list was not found."""
        found = next(iter(self._with_value(parameter, given)), None)
        if self.core is None or not found or not isinstance(found[1], yaml.SequenceNode):
            return []
        return [self.core.source(node) for node in found[1].value]

    def _with_value(self, parameter: str, given: object) -> list[_Pair]:
        """Return the nodes of a parameter, those with the given value first."""
        return sorted(self._pairs(parameter), key=lambda pair: _data(pair[1]) != given)

    def _pairs(self, parameter: str) -> list[_Pair]:
        """Return the nodes of a parameter's name and value: of the instance, and of all targets that override it."""
        found = [self._item("parameters", parameter)]
        for target in self.core.section("targets") if self.core else ():
            listed = self.core.item("targets", target, "generate") if self.core else None
            entries = listed[1].value if listed and isinstance(listed[1], yaml.SequenceNode) else ()
            found += [pair_of(entry, self.called, parameter) for entry in entries]
        return [pair for pair in found if pair]

    def _source(self, pairs: Sequence[_Pair], side: int) -> SourceRef | None:
        return self.core.source(pairs[0][side]) if self.core and pairs else None

    def _item(self, *keys: str) -> tuple[yaml.Node, yaml.Node] | None:
        return self.core.item("generate", self.called, *keys) if self.core else None

    def _place(self, side: int, *keys: str) -> SourceRef | None:
        found = self._item(*keys)
        return self.core.source(found[side]) if self.core and found else None


def _data(node: yaml.Node) -> object:
    try:
        return data_of(node)
    except yaml.YAMLError:
        return None


def find_requesting_core(folder: Path, new_core: str) -> RequestingCore:
    """Find the core in `folder` whose generator instance creates the core with this name (`<core>-<instance>`)."""
    for path in sorted(folder.glob("*.core")):
        try:
            core = read_core_once(path, path.stat().st_mtime_ns)
        except InputError:
            continue
        if not (name := core.item("name")):
            continue
        # `vendor:library:name:version`, of which FuseSoC requires only the name.
        parts = str(name[1].value).split(":")
        called = new_core.removeprefix(f"{parts[2] if len(parts) > 2 else parts[-1]}-")
        if core.item("generate", called):
            return RequestingCore(core, called)
    return RequestingCore()
