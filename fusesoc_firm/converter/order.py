"""The order to the generator `firm`: messages, the requested converters for each message, and the converters' names.

An order comes from the parameters of a core, for a message, a service or an action, or from a configuration file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.converter.config_file import MessageInterfaces, read_config
from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.constants import constants_package
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Paths, select
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Definitions, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_full_name, parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, fail
from fusesoc_firm.tools.reads import Input

# The directions, with the function that names the converter's entity in each direction.
ENTITIES = {"subscriber": subscriber_entity, "publisher": publisher_entity}


@dataclass(frozen=True)
class Wanted:
    """A message's frame, with the definitions of the message and all nested messages.

    `interfaces` has a key for each direction in which a converter is requested; the value lists additional names for
    this converter.
    """

    frame: Frame
    definitions: Definitions
    interfaces: Mapping[str, tuple[str, ...]]

    @property
    def message(self) -> MessageName:
        """The name of the message."""
        return self.frame.message

    @property
    def ros(self) -> Middleware:
        """The middleware of the message."""
        return self.frame.ros


@dataclass(frozen=True)
class Order:
    """All requested messages, each once, for streams of `width` bits; `files` are the files that were read.

    `libraries` are the libraries of the messages. `prefix` precedes the names of all design units without a name from
    the user. `pipeline` is one of `PIPELINES`; None selects the default of each message.
    """

    title: str
    width: int
    messages: tuple[Wanted, ...]
    files: tuple[Input, ...]
    libraries: Mapping[Middleware, MessageLibrary]
    prefix: str = ""
    pipeline: str | None = None

    def entity(self, frame: Frame, direction: str) -> str:
        """Return the entity name of a frame's converter in this direction."""
        return ENTITIES[direction](frame, prefix=self.prefix)


@dataclass(frozen=True)
class Selection:
    """The fields of a message that get ports, in the form that `select` expects."""

    include: Paths = field(default_factory=dict)
    exclude: Paths = field(default_factory=dict)


def order_of_message(
    text: str, direction: str, width: int, library: MessageLibrary, selection: Selection | None = None
) -> Order:
    """Return an order for one message, or for all messages of a service or an action.

    `direction` is a key of `ENTITIES`, or "both". `selection` selects fields and requires a single message. May raise
    `InputError`.
    """
    selection = selection or Selection()
    kind, name = parse_full_name(text)
    interface = library.interface(name, kind)
    names = interface.exchanged if interface else (name,)
    definitions = library.joint_closure(names)
    directions = dict.fromkeys(ENTITIES if direction == "both" else (direction,), ())
    if len(names) > 1:
        _check_no_selection(selection, text)
    frames = [select(frame_of(each, definitions), selection.include, selection.exclude) for each in names]
    messages = tuple(Wanted(frame, definitions, directions) for frame in frames)
    facts = [f"{library.ros.title}"]
    if interface is None:
        facts.append(signature(name, definitions))
    elif interface.has_signature:
        facts.append(signature(name, library.joint_closure(interface.messages), interface.kind))
    title = f"{interface or name} ({', '.join(facts)})"
    return Order(title, width, messages, tuple(library.files(definitions)), {library.ros: library})


def _check_no_selection(selection: Selection, text: str) -> None:
    for source in (*selection.include.values(), *selection.exclude.values()):
        fail(
            f"'{text}' consists of several messages, so its fields cannot be selected",
            source,
            "name one of these messages instead",
        )


def order_of_config(path: Path, libraries: Mapping[Middleware, MessageLibrary]) -> Order:
    """Return the order in a configuration file; raise `InputError` with all faults in the file."""
    faults = Diagnostics()
    config = read_config(path, faults)
    found = [(entry, wanted) for entry in config.messages if (wanted := _wanted(entry, libraries, faults))]
    prefix = str(config.project.prefix or "")
    _check_entities(found, prefix, faults)
    faults.raise_if_any()
    messages = _joined(wanted for _, wanted in found)
    files = [file for wanted in messages for file in libraries[wanted.ros].files(wanted.definitions)]
    project, inputs = config.project, (path, *dict.fromkeys(files))
    return Order(str(project.name), project.width, messages, inputs, libraries, prefix)


def _wanted(
    entry: MessageInterfaces, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Wanted | None:
    """Return the requested message of an item in the file, or None after a fault, which is noted."""
    if not entry.type or not entry.name:
        return None
    library = libraries[MIDDLEWARES[entry.type]]
    try:
        message = parse_name(entry.name)
        library.get(message, entry.name.source)
        definitions = library.closure(message)
    except InputError as error:
        faults.take(error, entry.name.source)
        return None
    given = {"subscriber": entry.subscribers, "publisher": entry.publishers}
    interfaces = {direction: tuple(map(str, names)) for direction, names in given.items() if names}
    return Wanted(frame_of(message, definitions), definitions, interfaces)


def _joined(messages: Iterable[Wanted]) -> tuple[Wanted, ...]:
    """Return each message once, with all interfaces that are requested for it."""
    joined: dict[tuple[Middleware, MessageName], Wanted] = {}
    for wanted in messages:
        first = joined.get((wanted.ros, wanted.message))
        interfaces = dict(first.interfaces) if first else {}
        for direction, names in wanted.interfaces.items():
            interfaces[direction] = (*interfaces.get(direction, ()), *names)
        joined[wanted.ros, wanted.message] = Wanted(wanted.frame, wanted.definitions, interfaces)
    return tuple(joined.values())


def _check_entities(found: list[tuple[MessageInterfaces, Wanted]], prefix: str, faults: Diagnostics) -> None:
    """Check that no two entities or packages have the same name, since a tool keeps only one of them."""
    owners: dict[str, tuple[str, Frame]] = {}
    for entry, wanted in found:
        package = constants_package(wanted.message, prefix=prefix)
        _, twin = owners.setdefault(package, ("package", wanted.frame))
        if twin.message != wanted.message:
            message = f"'{wanted.message}' and '{twin.message}' both need the package '{package}'"
            faults.error(message, entry.name.source)
        for direction in wanted.interfaces:
            entity = ENTITIES[direction](wanted.frame, prefix=prefix)
            _, twin = owners.setdefault(entity, (direction, wanted.frame))
            if twin.message == wanted.message and twin.ros is not wanted.ros:
                message = f"'{wanted.message}' already needs the entity '{entity}' for {twin.ros.title}"
                faults.error(
                    message, entry.name.source, "a project can use a message in only one ROS version per direction"
                )
    for entry, wanted in found:
        own = {"subscriber": entry.subscribers, "publisher": entry.publishers}
        for name, direction in ((name, direction) for direction, names in own.items() for name in names):
            what, frame = owners.get(name.lower(), ("", wanted.frame))
            if what and (what, frame) != (direction, wanted.frame):
                faults.error(f"the name '{name}' is already used for the {what} of {frame.message}", name.source)
