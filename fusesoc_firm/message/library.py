"""Where definitions come from: the user's folders first, then a sourced ROS, then the distributions that rosbags ships.

A library reads and parses a definition when it is asked for, once. It reads no environment variable by itself, so
the same arguments and files give the same definitions.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fusesoc_firm.diagnostics import Diagnostics, SourceRef, byte_place, fail, nearest
from fusesoc_firm.files import read_regular
from fusesoc_firm.message.bounds import MOST_FILE_BYTES, MOST_LEVELS, Extent, check_extents
from fusesoc_firm.message.derived import EVENT_INFO, Interface
from fusesoc_firm.message.folders import InterfaceFiles, interface_files
from fusesoc_firm.message.middleware import known_suffixes, middleware_of
from fusesoc_firm.message.model import (
    InterfaceKind,
    MessageDefinition,
    MessageName,
    RosVersion,
    nested_message,
)
from fusesoc_firm.message.unsupported import unsupported_word

_WORDS = {InterfaceKind.SERVICE: "service", InterfaceKind.ACTION: "action"}


@dataclass(frozen=True)
class _Source:
    """The files that define a message (more than one must be equal), and the service or action they are of, if any."""

    paths: tuple[Path, ...]
    interface: Interface | None = None


class MessageLibrary:
    """All messages that one middleware can name, those of services and actions included.

    `paths` are folders in order of precedence. `environment` is a mapping like `os.environ`; None leaves an installed
    ROS aside. `store` names the distribution behind all others (`noetic`, `jazzy`, ...). A message is taken from the
    first place that has it; in one place a `.msg` file goes before what a `.srv` or `.action` file implies. Raises
    `InputError` for a folder that is missing or holds no file that any middleware knows.
    """

    def __init__(
        self,
        ros: RosVersion,
        paths: Sequence[Path] = (),
        environment: Mapping[str, str] | None = None,
        store: str | None = None,
    ) -> None:
        self.ros = ros
        self._middleware = middleware_of(ros)
        self._store = self._middleware.store(store)
        self._folders = [*paths, *(self._middleware.folders(environment) if environment is not None else ())]
        found = {folder: interface_files(folder, self._middleware.suffixes) for folder in self._folders}
        _check_folders(path for path in paths if not any(found[path].values()))
        self._sources: dict[MessageName, _Source] = {}
        self._interfaces: dict[Interface, Path] = {}
        self._messages = {name for files in found.values() for name in files[InterfaceKind.MESSAGE]}
        for folder in reversed(self._folders):
            self._add(found[folder])
        # A definition or None, with the faults of its text: a faulty file is reported on every request.
        self._parsed: dict[MessageName, tuple[MessageDefinition | None, Diagnostics]] = {}
        self._extents: dict[MessageName, Extent] = {}

    def names(self) -> list[MessageName]:
        """Every message there is, sorted."""
        return sorted(self._store.names | self._sources.keys())

    def interfaces(self) -> dict[Interface, Path]:
        """Every service and action there is, sorted by its full name, and its file."""
        return dict(sorted(self._interfaces.items(), key=lambda item: str(item[0])))

    def interface(self, name: MessageName, kind: InterfaceKind | None = None) -> Interface | None:
        """The service or action of this name, if there is one; without a `kind`, a message goes before both."""
        if kind is None and self._is_message(name):
            return None
        kinds = (InterfaceKind.SERVICE, InterfaceKind.ACTION) if kind is None else (kind,)
        named = (Interface(name, kind, self.ros, self._has_events) for kind in kinds)
        return next((interface for interface in named if interface in self._interfaces), None)

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
        if not self._is_message(name):
            diagnostics.error(f"unknown message '{name}'", source, self._hint(name))
            return None
        if name not in self._parsed:
            self._parse(name)
        definition, faults = self._parsed[name]
        for fault in faults.found:
            diagnostics.error(fault.message, fault.source, fault.hint)
        return definition

    def closure(self, name: MessageName, source: SourceRef | None = None) -> dict[MessageName, MessageDefinition]:
        """The message and all messages within it, each behind those that it holds itself.

        Raises `InputError` with every fault in every file, every unknown message and every cycle, and for a message
        beyond the bounds of `bounds`.
        """
        return self.joint_closure((name,), source)

    def joint_closure(
        self, names: Iterable[MessageName], source: SourceRef | None = None
    ) -> dict[MessageName, MessageDefinition]:
        """As `closure`, of several messages, such as those of a service."""
        diagnostics = Diagnostics()
        closure: dict[MessageName, MessageDefinition] = {}
        for name in names:
            self._collect(name, source, (), closure, diagnostics)
        diagnostics.raise_if_any()
        check_extents(closure, self._extents)
        return closure

    def origin(self, name: MessageName) -> str:
        """The file of a known message, or the distribution that has it, for people to read."""
        return str(self._sources[name].paths[0]) if name in self._sources else self._store.title

    def content(self, name: MessageName) -> bytes:
        """What defines a known message, as it stands: a file's bytes, or the text that a distribution has."""
        if name in self._sources:
            return read_regular(self._sources[name].paths[0], MOST_FILE_BYTES)
        return self._store.text(name).encode()

    def files(self, names: Iterable[MessageName]) -> list[Path]:
        """The files that these messages are read from, in the order of names; messages of a distribution have none."""
        paths = [self._sources[name].paths[0] for name in sorted(set(names)) if name in self._sources]
        return list(dict.fromkeys(paths))  # the messages of a service share its file

    @cached_property
    def _has_events(self) -> bool:
        # Only if a service asks: whoever speaks the other ROS does without the time that a distribution takes to load.
        return self.ros is RosVersion.ROS2 and (EVENT_INFO in self._messages or EVENT_INFO in self._store.names)

    def _is_message(self, name: MessageName) -> bool:
        return name in self._sources or name in self._store.names

    def _add(self, files: InterfaceFiles) -> None:
        """Take in what a folder holds; it goes before what is there."""
        for kind in (InterfaceKind.ACTION, InterfaceKind.SERVICE):
            for name, paths in files[kind].items():
                interface = Interface(name, kind, self.ros, self._has_events)
                self._interfaces[interface] = paths[0]
                self._sources |= dict.fromkeys(interface.messages, _Source(tuple(paths), interface))
        self._sources |= {name: _Source(tuple(paths)) for name, paths in files[InterfaceKind.MESSAGE].items()}

    def _parse(self, name: MessageName) -> None:
        """Read what defines a message into `_parsed`, together with the other messages of the same file."""
        faults = Diagnostics()
        source = self._sources.get(name)
        interface = source.interface if source else None
        if source:
            file, text = str(source.paths[0]), _read(str(interface or name), source.paths, faults)
        else:
            file, text = self._store.file(name), self._store.text(name)
        found: dict[MessageName, MessageDefinition] = {}
        if not faults.found:
            if interface:
                found = interface.parse(text, file, faults)
            else:
                found = {name: self._middleware.parse(text, name, self.ros, file, faults)}
        for each in interface.messages if interface else (name,):
            # One of a service's messages may come from a `.msg` file, which goes before the service.
            if self._sources.get(each) is source:
                self._parsed[each] = (found.get(each), faults)

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
        if len(above) == MOST_LEVELS:
            _note_depth(above[0], name, source, diagnostics)
            return
        definition = self.find(name, diagnostics, source)
        if definition is None:
            return
        for field in definition.fields:
            if nested := nested_message(field.type):
                self._collect(nested, field.source, (*above, name), closure, diagnostics)
        closure[name] = definition

    def _hint(self, name: MessageName) -> str:
        if interface := self.interface(name):
            return f"it is a {_WORDS[interface.kind]}; its messages are {', '.join(map(str, interface.messages))}"
        places = ", ".join([*(str(folder) for folder in self._folders), self._store.title])
        if feature := unsupported_word(name.name):
            return f"looked in: {places}; {feature.fault}: {feature.hint}"
        nearest = self._nearest(name)
        return (f"did you mean '{nearest}'? " if nearest else "") + f"looked in: {places}"

    def _nearest(self, name: MessageName) -> str:
        """The likeliest meaning: the same type of another package, a primitive misspelt, or a similar name."""
        same_type = [known for known in self.names() if known.name == name.name]
        if same_type:
            return str(same_type[0])
        builtin_types = sorted(self._middleware.builtin_types)
        primitives = difflib.get_close_matches(name.name, builtin_types, n=1, cutoff=0.8)
        names = [str(known) for known in (*self.names(), *(interface.name for interface in self._interfaces))]
        return next(iter(primitives or difflib.get_close_matches(str(name), names, n=1)), "")


def libraries(
    paths: Sequence[Path], environment: Mapping[str, str] | None, store: str | None
) -> dict[RosVersion, MessageLibrary]:
    """A library of each middleware, for those who speak several.

    `store` is a distribution of one of them; the other keeps its default. Raises `InputError` as `MessageLibrary` does.
    """
    known = {ros: middleware_of(ros).distributions() for ros in RosVersion}
    if store is not None and not any(store in names for names in known.values()):
        fail(f"'{store}' is not a distribution of ROS", hint=nearest(store, itertools.chain(*known.values())))
    return {
        ros: MessageLibrary(ros, paths, environment, store if store in names else None) for ros, names in known.items()
    }


def _read(name: str, paths: Sequence[Path], faults: Diagnostics) -> str:
    """The text of the first file; it is a fault if one cannot be read, or another one differs, or is not UTF-8."""
    contents = [_content(path, faults) for path in paths]
    if faults.found:
        return ""
    first, data = paths[0], contents[0]
    for other, content in zip(paths, contents, strict=True):
        if content != data:
            faults.error(f"'{name}' differs from {other}", SourceRef(str(first), 1, 1), "name the folder of one")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as fault:
        faults.error(f"byte 0x{data[fault.start]:02x} is not UTF-8", byte_place(str(first), data, fault.start))
        return ""


def _content(path: Path, faults: Diagnostics) -> bytes:
    """The bytes of a file; nothing, with the fault noted, if it cannot be read."""
    try:
        return read_regular(path, MOST_FILE_BYTES)
    except OSError as error:
        faults.error(f"cannot read {path}: {error.strerror}", SourceRef(str(path), 1, 1))
        return b""


def _note_depth(top: MessageName, name: MessageName, source: SourceRef | None, faults: Diagnostics) -> None:
    hint = f"legal here: up to {MOST_LEVELS} levels of messages within messages"
    faults.error(f"'{top}' holds '{name}' {MOST_LEVELS + 1} levels deep", source, hint)


def _check_folders(empty: Iterable[Path]) -> None:
    """Raise `InputError` that names every one of the user's folders that gave nothing, nor would to another library."""
    diagnostics = Diagnostics()
    suffixes = known_suffixes()
    *others, last = (f".{suffix}" for suffix in suffixes)
    for path in empty:
        if any(interface_files(path, suffixes).values()):
            continue
        reason = f"holds no {', '.join(others)} or {last} file" if path.is_dir() else "is not a folder"
        diagnostics.error(f"message path '{path}' {reason}", hint="give a package, a workspace or a folder of packages")
    diagnostics.raise_if_any()
