"""Where definitions come from: the user's folders first, then a sourced ROS, then the distributions that rosbags ships.

A library reads and parses a definition when it is asked for, once. It reads no environment variable by itself, so
the same arguments and files give the same definitions.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from fusesoc_firm.diagnostics import Diagnostics, SourceRef
from fusesoc_firm.message.dialect import dialect_of
from fusesoc_firm.message.folders import environment_folders, message_files
from fusesoc_firm.message.model import (
    MessageDefinition,
    MessageName,
    RosVersion,
    nested_message,
)
from fusesoc_firm.message.parser import parse_message
from fusesoc_firm.message.stores import DistributionStore


class MessageLibrary:
    """All messages that one version of ROS can name.

    `paths` are folders in order of precedence. `environment` is a mapping like `os.environ`; None leaves an installed
    ROS aside. `store` names the distribution behind all others (`noetic`, `jazzy`, ...). A message is taken from the
    first place that has it. Raises `InputError` for a folder that is missing or holds no `.msg` file.
    """

    def __init__(
        self,
        ros: RosVersion,
        paths: Sequence[Path] = (),
        environment: Mapping[str, str] | None = None,
        store: str | None = None,
    ) -> None:
        self.ros = ros
        self._store = DistributionStore(ros, store)
        self._folders = [*paths, *(environment_folders(ros, environment) if environment is not None else ())]
        self._files: dict[MessageName, list[Path]] = {}
        found = {folder: message_files(folder) for folder in self._folders}
        _check_folders(path for path in paths if not found[path])
        for folder in reversed(self._folders):
            self._files.update(found[folder])
        # A definition or None, with the faults of its text: a faulty file is reported on every request.
        self._parsed: dict[MessageName, tuple[MessageDefinition | None, Diagnostics]] = {}

    def names(self) -> list[MessageName]:
        """Every message there is, sorted."""
        return sorted(self._store.names | self._files.keys())

    def get(self, name: MessageName, source: SourceRef | None = None) -> MessageDefinition:
        """The definition of a message that `source` asks for; raises `InputError` with all faults of its file."""
        diagnostics = Diagnostics()
        definition = self.find(name, diagnostics, source)
        diagnostics.raise_if_any()
        assert definition is not None, "find() notes a fault where it finds nothing"
        return definition

    def find(
        self, name: MessageName, diagnostics: Diagnostics, source: SourceRef | None = None
    ) -> MessageDefinition | None:
        """As `get`, but notes the faults and goes on: with the right part of a faulty definition, or None."""
        if name not in self._files and name not in self._store.names:
            diagnostics.error(f"unknown message '{name}'", source, self._hint(name))
            return None
        if name not in self._parsed:
            self._parsed[name] = self._parse(name)
        definition, faults = self._parsed[name]
        for fault in faults.found:
            diagnostics.error(fault.message, fault.source, fault.hint)
        return definition

    def closure(self, name: MessageName, source: SourceRef | None = None) -> dict[MessageName, MessageDefinition]:
        """The message and all messages within it, each behind those that it holds itself.

        Raises `InputError` with every fault in every file, every unknown message and every cycle.
        """
        diagnostics = Diagnostics()
        closure: dict[MessageName, MessageDefinition] = {}
        self._collect(name, source, (), closure, diagnostics)
        diagnostics.raise_if_any()
        return closure

    def origin(self, name: MessageName) -> str:
        """The file of a known message, or the distribution that has it, for people to read."""
        return str(self._files[name][0]) if name in self._files else self._store.title

    def files(self, names: Iterable[MessageName]) -> list[Path]:
        """The files that these messages are read from, in the order of names; messages of a distribution have none."""
        return [self._files[name][0] for name in sorted(set(names)) if name in self._files]

    def _parse(self, name: MessageName) -> tuple[MessageDefinition | None, Diagnostics]:
        faults = Diagnostics()
        file, text = self._read(name, faults)
        return (None if faults.found else parse_message(text, name, self.ros, file, faults)), faults

    def _read(self, name: MessageName, faults: Diagnostics) -> tuple[str, str]:
        if name not in self._files:
            return self._store.file(name), self._store.text(name)
        first, *others = self._files[name]
        data = first.read_bytes()
        for other in others:
            if other.read_bytes() != data:
                faults.error(f"'{name}' differs from {other}", SourceRef(str(first), 1, 1), "name the folder of one")
        try:
            return str(first), data.decode("utf-8")
        except UnicodeDecodeError as fault:
            line_start = data.rfind(b"\n", 0, fault.start) + 1
            place = SourceRef(str(first), data.count(b"\n", 0, fault.start) + 1, fault.start - line_start + 1)
            faults.error(f"byte 0x{data[fault.start]:02x} is not UTF-8", place)
            return str(first), ""

    def _collect(
        self,
        name: MessageName,
        source: SourceRef | None,
        above: tuple[MessageName, ...],
        closure: dict[MessageName, MessageDefinition],
        diagnostics: Diagnostics,
    ) -> None:
        """Add `name`, which the messages `above` hold, one within the other, and all that it holds."""
        if name in above:
            cycle = " -> ".join(str(step) for step in (*above[above.index(name) :], name))
            diagnostics.error(f"message '{name}' contains itself", source, cycle)
            return
        if name in closure:
            return
        definition = self.find(name, diagnostics, source)
        if definition is None:
            return
        for field in definition.fields:
            if nested := nested_message(field.type):
                self._collect(nested, field.source, (*above, name), closure, diagnostics)
        closure[name] = definition

    def _hint(self, name: MessageName) -> str:
        places = ", ".join([*(str(folder) for folder in self._folders), self._store.title])
        nearest = self._nearest(name)
        return (f"did you mean '{nearest}'? " if nearest else "") + f"looked in: {places}"

    def _nearest(self, name: MessageName) -> str:
        """The likeliest meaning: the same type of another package, a primitive misspelt, or a similar name."""
        same_type = [known for known in self.names() if known.name == name.name]
        if same_type:
            return str(same_type[0])
        builtin_types = dialect_of(self.ros).builtin_types
        primitives = difflib.get_close_matches(name.name, sorted(builtin_types), n=1, cutoff=0.8)
        names = [str(known) for known in self.names()]
        return next(iter(primitives or difflib.get_close_matches(str(name), names, n=1)), "")


def _check_folders(empty: Iterable[Path]) -> None:
    """Raise `InputError` that names every one of the user's folders that gave nothing."""
    diagnostics = Diagnostics()
    for path in empty:
        reason = "holds no .msg file" if path.is_dir() else "is not a folder"
        diagnostics.error(f"message path '{path}' {reason}", hint="give a package, a workspace or a folder of packages")
    diagnostics.raise_if_any()
