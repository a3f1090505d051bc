"""Find definitions: first in the user's folders, then in a sourced ROS, then in the distributions of rosbags.

A library reads and parses each definition once, on request. It reads no environment variables, so equal arguments and
files always result in equal definitions.
"""

from __future__ import annotations

import copy
import difflib
import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.message import ROS2
from fusesoc_firm.message.bounds import MOST_FILE_BYTES, MOST_LEVELS, Extent, check_extents
from fusesoc_firm.message.folders import InterfaceFiles, interface_files, is_idl
from fusesoc_firm.message.idl.names import declared_in
from fusesoc_firm.message.idl.parser import parse_idl
from fusesoc_firm.message.joint import INTERFACES, Language
from fusesoc_firm.message.middleware import MessageDefinition, Middleware, known_suffixes, middlewares
from fusesoc_firm.message.model import InterfaceKind, MessageName, nested_message
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.printer import to_text
from fusesoc_firm.message.services import EVENT_INFO, Interface
from fusesoc_firm.message.unsupported import unsupported_word
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, SourceRef, byte_place, fail, nearest
from fusesoc_firm.text.files import read_regular
from fusesoc_firm.tools.reads import Input, Part

if TYPE_CHECKING:
    from fusesoc_firm.message.bag_reader import BagDefinitions

# The hint about additional sources.
_FURTHER = "; source its ROS workspace, or add its folder with 'paths' in the specification or core, or with --path"
# The number of unknown messages for which a similar name is searched, which takes tens of milliseconds each.
_MOST_SEARCHED = 20
_WORDS = {InterfaceKind.SERVICE: "service", InterfaceKind.ACTION: "action"}


@dataclass(frozen=True)
class _Source:
    """The files that define a message, which must be equal, and the service or action that they define, if any.

    For a bag, `texts` holds its definitions of the message, which must be equivalent. An `.idl` text may define several
    messages.
    """

    paths: tuple[Path, ...]
    interface: Interface | None = None
    texts: tuple[str, ...] = ()
    is_idl: bool = False


class MessageLibrary:
    """All messages that one middleware knows, including the messages of services and actions.

    `paths` are folders and bags in order of precedence. `environment` is a mapping like `os.environ`; None ignores an
    installed ROS. `store` names the distribution with the lowest precedence (`noetic`, `jazzy`, ...). A message's
    definition is that of the first source that contains the message; within a source, a `.msg` file takes precedence
    over messages derived from a `.srv` or `.action` file. Raises `InputError` for a folder that is missing or contains
    no file of any middleware, and for a bag without definitions.
    """

    def __init__(
        self,
        ros: Middleware,
        paths: Sequence[Path] = (),
        environment: Mapping[str, str] | None = None,
        store: str | None = None,
    ) -> None:
        self.ros = ros
        self._store = self.ros.store(store)
        self._places: list[Path] = []
        self._sources: dict[MessageName, _Source] = {}
        self._interfaces: dict[Interface, Path] = {}
        self._messages: set[MessageName] = set()
        # The definition or None, and the faults in the text, which are reported on every request.
        self._parsed: dict[MessageName, tuple[MessageDefinition | None, Diagnostics]] = {}
        self._extents: dict[MessageName, Extent] = {}
        # The most likely meanings of unknown messages.
        self._similar: dict[MessageName, str] = {}
        self._put_before(dict.fromkeys(paths), self.ros.folders(environment) if environment is not None else [])

    def before(self, paths: Mapping[Path, SourceRef | None]) -> MessageLibrary:
        """Return a copy in which additional folders and bags, each with its source reference, take precedence.

        Raise `InputError` like the constructor.
        """
        if not paths:
            return self
        other = copy.copy(self)
        other._put_before(paths)  # noqa: SLF001 - the same class
        return other

    def names(self) -> list[MessageName]:
        """Return all known messages, sorted."""
        return sorted(self._store.names | self._sources.keys())

    def interfaces(self) -> dict[Interface, Path]:
        """Return the files of all known services and actions, sorted by full name."""
        return dict(sorted(self._interfaces.items(), key=lambda item: str(item[0])))

    def interface(self, name: MessageName, kind: InterfaceKind | None = None) -> Interface | None:
        """Return the service or action with this name, or None.

        Without `kind`, a message with this name takes precedence.
        """
        if kind is None and self._is_message(name):
            return None
        kinds = (InterfaceKind.SERVICE, InterfaceKind.ACTION) if kind is None else (kind,)
        named = (Interface(name, kind, self.ros, self._has_events) for kind in kinds)
        return next((interface for interface in named if interface in self._interfaces), None)

    def get(self, name: MessageName, source: SourceRef | None = None) -> MessageDefinition:
        """Return the definition of a message that `source` requests; raise `InputError` with all faults in its file."""
        diagnostics = Diagnostics()
        definition = self.find(name, diagnostics, source)
        diagnostics.raise_if_any()
        assert definition is not None, "find() notes a fault where it finds nothing"
        return definition

    def find(
        self, name: MessageName, diagnostics: Diagnostics, source: SourceRef | None = None
    ) -> MessageDefinition | None:
        """Return the definition like `get`, but add faults to `diagnostics` and return the valid part, or None."""
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
        """Return the definitions of a message and of all nested messages, each after the messages that it contains.

        Raise `InputError` with every fault in every file, every unknown message and every cycle, and for a message
        that exceeds the limits in `bounds`.
        """
        return self.joint_closure((name,), source)

    def joint_closure(
        self, names: Iterable[MessageName], source: SourceRef | None = None
    ) -> dict[MessageName, MessageDefinition]:
        """Return the definitions like `closure`, but for several messages, such as the messages of a service."""
        diagnostics = Diagnostics()
        closure: dict[MessageName, MessageDefinition] = {}
        for name in names:
            self._collect(name, source, (), closure, diagnostics)
        diagnostics.raise_if_any()
        check_extents(closure, self._extents)
        return closure

    def origin(self, name: MessageName) -> str:
        """Return a text for users that names the file or distribution with a known message's definition."""
        return str(self._sources[name].paths[0]) if name in self._sources else self._store.title

    def content(self, name: MessageName) -> bytes:
        """Return the unchanged source of a known message: the file's bytes, or the text in a bag or distribution."""
        if source := self._sources.get(name):
            return source.texts[0].encode() if source.texts else read_regular(source.paths[0], MOST_FILE_BYTES)
        return self._store.text(name).encode()

    def files(self, names: Iterable[MessageName]) -> list[Input]:
        """Return the files of these messages, sorted by message name; messages in a distribution have no files.

        For a bag, the result contains only the part with the message's definition.
        """
        known = [(name, self._sources[name]) for name in sorted(set(names)) if name in self._sources]
        found = [_part(name, source) if source.texts else source.paths[0] for name, source in known]
        return list(dict.fromkeys(found))  # the messages of a service share its file

    @cached_property
    def _has_events(self) -> bool:
        # Only services read this, since loading the distribution takes time; ROS 1 does not need it.
        return self.ros is ROS2 and (EVENT_INFO in self._messages or EVENT_INFO in self._store.names)

    def _is_message(self, name: MessageName) -> bool:
        return name in self._sources or name in self._store.names

    def _put_before(self, paths: Mapping[Path, SourceRef | None], installed: Sequence[Path] = ()) -> None:
        """Add folders and bags before the existing sources: the user's `paths` first, then the `installed` folders."""
        faults = Diagnostics()
        places = [*paths, *installed]
        found = {place: interface_files(place, self.ros.suffixes) for place in places}
        # New dictionaries: a copy of this library may share the old ones.
        self._sources, self._interfaces, self._parsed = dict(self._sources), dict(self._interfaces), {}
        self._extents, self._similar = {}, {}
        self._messages = self._messages | {name for files in found.values() for name in files[InterfaceKind.MESSAGE]}
        bags = {place: self._bag(place, paths[place], faults) for place in paths if not any(found[place].values())}
        faults.raise_if_any()
        for place in reversed(places):
            self._add(found[place])
            if bag := bags.get(place):
                self._add_bag(place, bag)
        self._places = [*places, *self._places]

    def _bag(self, path: Path, source: SourceRef | None, faults: Diagnostics) -> BagDefinitions | None:
        """Return the definitions in a bag of this library's middleware, or None.

        If `path` is not a bag, check that another middleware's library can use it.
        """
        # Imported only for bags: rosbags' readers are slow to import.
        from fusesoc_firm.message.bag_reader import definitions_in, is_bag

        if not is_bag(path):
            _check_folder(path, source, faults)
            return None
        try:
            bag = definitions_in(path)
        except InputError as error:
            faults.take(error, source)
            return None
        if not bag.texts and not bag.empty:
            faults.error(
                f"message path '{path}' is a bag without message definitions",
                source,
                "give the folder with the message definitions",
            )
        return bag if bag.ros == self.ros else None

    def _add(self, files: InterfaceFiles) -> None:
        """Add the files of a folder before the existing files."""
        for kind in (InterfaceKind.ACTION, InterfaceKind.SERVICE, InterfaceKind.MESSAGE):
            for name, paths in files[kind].items():
                self._add_source(kind, name, _Source(tuple(paths), is_idl=is_idl(paths[0])))

    def _add_bag(self, path: Path, bag: BagDefinitions) -> None:
        """Add the definitions in a bag before the existing ones, except for empty ones of known messages."""
        found: dict[InterfaceKind, dict[MessageName, _Source]] = {kind: {} for kind in InterfaceKind}
        for (language, name), texts in bag.texts.items():
            source = _Source((path,), texts=texts, is_idl=language is Language.IDL)
            for kind, declared in _declared(language, name, texts[0]):
                found[kind].setdefault(declared, source)
        for kind in (InterfaceKind.ACTION, InterfaceKind.SERVICE, InterfaceKind.MESSAGE):
            for name, source in found[kind].items():
                self._add_source(kind, name, source)
        for name in bag.empty:
            if not self._is_message(name):
                self._sources[name] = _Source((path,), texts=("",))

    def _add_source(self, kind: InterfaceKind, name: MessageName, source: _Source) -> None:
        """Add the source of a message, or of all messages of a service or action."""
        if kind is InterfaceKind.MESSAGE:
            self._sources[name] = source
            return
        interface = Interface(name, kind, self.ros, self._has_events)
        self._interfaces[interface] = source.paths[0]
        self._sources |= dict.fromkeys(interface.messages, replace(source, interface=interface))

    def _parse(self, name: MessageName) -> None:
        """Parse the definition of a message, and all other messages in the same file, into `_parsed`."""
        faults = Diagnostics()
        source = self._sources.get(name)
        interface = source.interface if source else None
        if source and source.texts:
            file, text = f"<{source.paths[0]}>/{interface or name}", source.texts[0]
            self._check_equal(name, source, file, faults)
        elif source:
            file, text = str(source.paths[0]), _read(str(interface or name), source.paths, faults)
        else:
            file, text = self._store.file(name), self._store.text(name)
        found: dict[MessageName, MessageDefinition] = {}
        if not faults.found:
            found = self._definitions(name, source, text, file, faults)
        for each in {name, *found, *(interface.messages if interface else ())}:
            # A service's message may also have a separate `.msg` file, which takes precedence.
            if self._sources.get(each) == source:
                self._parsed[each] = (found.get(each), faults)

    def _definitions(
        self, name: MessageName, source: _Source | None, text: str, file: str, faults: Diagnostics
    ) -> dict[MessageName, MessageDefinition]:
        """Return all messages that the text of a source defines, among which is `name` unless there are faults."""
        if source and source.interface:
            return source.interface.parse(text, file, faults, source.is_idl)
        if not source or not source.is_idl:
            return {name: self.ros.parse(text, name, self.ros, file, faults)}
        found = parse_idl(text, name.package, self.ros, file, faults)
        if name not in found and not faults.found:
            hint = f"the message is the struct '{name.name}' in the modules '{name.package}' and 'msg'"
            faults.error(f"the file does not define '{name}'", SourceRef(file, 1, 1), hint)
        return found

    def _check_equal(self, name: MessageName, source: _Source, file: str, faults: Diagnostics) -> None:
        """Report a fault if a bag's definitions of a message are not equivalent."""
        parsed = (self._definitions(name, source, text, file, Diagnostics()) for text in source.texts)
        if len({tuple(map(to_text, definitions.values())) for definitions in parsed}) > 1:
            faults.error(
                f"the bag has different definitions of '{name}'",
                SourceRef(file, 1, 1),
                "give the folder with the right definition",
            )

    def _collect(
        self,
        name: MessageName,
        source: SourceRef | None,
        above: tuple[MessageName, ...],
        closure: dict[MessageName, MessageDefinition],
        diagnostics: Diagnostics,
    ) -> None:
        """Add `name` and its nested messages to `closure`; `above` are the messages around it, outermost first."""
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
            return f"'{name}' is a {_WORDS[interface.kind]} with the messages {', '.join(map(str, interface.messages))}"
        places = ", ".join([*map(str, self._places), self._store.title])
        if feature := unsupported_word(name.name):
            return f"looked in: {places}; {feature.fault}: {feature.hint}"
        if name not in self._similar and len(self._similar) < _MOST_SEARCHED:
            self._similar[name] = self._nearest(name)
        nearest = self._similar.get(name)
        return (f"did you mean '{nearest}'? " if nearest else "") + f"looked in: {places}{_FURTHER}"

    def _nearest(self, name: MessageName) -> str:
        """Return the most likely meaning: the same type in another package, a misspelt primitive, or a similar name."""
        same_type = [known for known in self.names() if known.name == name.name]
        if same_type:
            return str(same_type[0])
        builtin_types = sorted(self.ros.builtin_types)
        primitives = difflib.get_close_matches(name.name, builtin_types, n=1, cutoff=0.8)
        known = [*self.names(), *(interface.name for interface in self._interfaces)]
        # Two names of packages are always similar, and the types of an unknown package are probably not known.
        cutoff = 0.6 if name.package in {item.package for item in known} else 0.7
        types = difflib.get_close_matches(name.name, sorted({item.name for item in known}), n=1, cutoff=cutoff)
        names = [str(item) for item in known if item.name in types]
        return next(iter(primitives or difflib.get_close_matches(str(name), names, n=1, cutoff=0)), "")

    def parse(self, text: str) -> MessageName:
        """Parse a name like `parse_name`; the hint about an invalid one contains the nearest known message."""
        try:
            return parse_name(text)
        except InputError as error:
            words = [word.lower() for word in re.findall(r"\w+", text)]
            known = [item for item in self.names() if item.name.lower() in words[-1:]]
            near = next((item for item in known if item.package in words), next(iter(known), None))
            fault = error.diagnostics[0]
            fail(fault.message, hint=f"did you mean '{near}'?" if near else fault.hint)


class Libraries(Mapping[Middleware, MessageLibrary]):
    """The library of each middleware, created on first access, which may raise `InputError` like the constructor."""

    def __init__(self, makers: Mapping[Middleware, Callable[[], MessageLibrary]]) -> None:
        self._makers = makers
        self._made: dict[Middleware, MessageLibrary] = {}

    def __getitem__(self, ros: Middleware) -> MessageLibrary:
        """Return the library of a middleware."""
        if ros not in self._made:
            self._made[ros] = self._makers[ros]()
        return self._made[ros]

    def __iter__(self) -> Iterator[Middleware]:
        """Return an iterator over all middlewares."""
        return iter(self._makers)

    def __len__(self) -> int:
        """Return the number of middlewares."""
        return len(self._makers)


def libraries(paths: Sequence[Path], environment: Mapping[str, str] | None, store: str | None) -> Libraries:
    """Return the libraries of all middlewares.

    `store` is a distribution of one middleware; the other middlewares keep their defaults. Raise `InputError` for an
    unknown distribution.
    """
    known = {ros: ros.distributions() for ros in middlewares()}
    if store is not None and not any(store in names for names in known.values()):
        fail(f"unknown ROS distribution '{store}'", hint=nearest(store, itertools.chain(*known.values())))
    return Libraries(
        {
            ros: partial(MessageLibrary, ros, paths, environment, store if store in names else None)
            for ros, names in known.items()
        }
    )


def _read(name: str, paths: Sequence[Path], faults: Diagnostics) -> str:
    """Return the text that all files share.

    Add a fault if a file is unreadable, differs from the first, or is not UTF-8.
    """
    contents = [_content(path, faults) for path in paths]
    if faults.found:
        return ""
    first, data = paths[0], contents[0]
    for other, content in zip(paths, contents, strict=True):
        if content != data:
            faults.error(
                f"the definition of '{name}' differs from the one in {other}",
                SourceRef(str(first), 1, 1),
                "give the folder with the right definition",
            )
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as fault:
        faults.error(f"byte 0x{data[fault.start]:02x} is not UTF-8", byte_place(str(first), data, fault.start))
        return ""


def _content(path: Path, faults: Diagnostics) -> bytes:
    """Return the bytes of a file; if the file cannot be read, add a fault and return empty bytes."""
    try:
        return read_regular(path, MOST_FILE_BYTES)
    except OSError as error:
        faults.error(f"cannot read {path}: {error.strerror}", SourceRef(str(path), 1, 1))
        return b""


def _note_depth(top: MessageName, name: MessageName, source: SourceRef | None, faults: Diagnostics) -> None:
    hint = f"legal here: up to {MOST_LEVELS} levels of nested messages"
    faults.error(f"'{top}' contains '{name}' {MOST_LEVELS + 1} levels deep", source, hint)


def _part(name: MessageName, source: _Source) -> Part:
    return Part(source.paths[0], str(name), source.texts[0].encode())


def _declared(language: Language, name: MessageName, text: str) -> Sequence[tuple[InterfaceKind, MessageName]]:
    """Return the interfaces that a definition in a bag declares."""
    if language is Language.IDL:
        return declared_in(text, name.package, (InterfaceKind.MESSAGE, name))
    return [(INTERFACES.get(language, InterfaceKind.MESSAGE), name)]


def _check_folder(path: Path, source: SourceRef | None, faults: Diagnostics) -> None:
    """Add a fault if none of the libraries can use the folder."""
    suffixes = known_suffixes()
    if any(interface_files(path, suffixes).values()):
        return
    *others, last = (f".{suffix}" for suffix in suffixes)
    reason = f"contains no {', '.join(others)} or {last} file" if path.is_dir() else "is neither a folder nor a bag"
    faults.error(
        f"message path '{path}' {reason}", source, "legal here: a package, a workspace, a folder of packages or a bag"
    )
