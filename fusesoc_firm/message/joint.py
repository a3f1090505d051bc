"""Convert a message with its nested messages to one text, as in bags and ROS 1 connections, and back.

Lines of 80 `=` separate the definitions. Each definition except the first begins with `MSG: ` and the message's name.
rosbag2 also writes whole files: after `IDL: ` an `.idl` file, after `SRV: ` and `ACTION: ` the file of a service or an
action, from which ROS 2 derives the message. Such a text begins with the header of its first file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from enum import Enum
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.bounds import check_extents
from fusesoc_firm.message.idl.parser import parse_idl
from fusesoc_firm.message.idl.printer import to_idl
from fusesoc_firm.message.middleware import Definitions, MessageDefinition, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName, nested_message
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.printer import to_text
from fusesoc_firm.message.services import Interface
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

_LINE = "=" * 80
_PARTING = re.compile(rf"^{_LINE}\s*\n\s*(MSG|IDL|SRV|ACTION):\s*(\S+)[^\S\n]*(?:\n|\Z)", re.MULTILINE)


class Language(Enum):
    """The language of a definition; the values are the words in the headers."""

    MSG = "MSG"
    IDL = "IDL"
    SERVICE = "SRV"
    ACTION = "ACTION"


class Heading(NamedTuple):
    """The header of a definition: its language, and the name of the message, service or action."""

    language: Language
    name: MessageName


INTERFACES = {Language.SERVICE: InterfaceKind.SERVICE, Language.ACTION: InterfaceKind.ACTION}


def joint_text(name: MessageName, definitions: Definitions) -> str:
    """Return the joint text: the message first, then all other messages in `definitions`.

    If one of them is from an `.idl` file, all are printed as `.idl` files.
    """
    others = [definition for other, definition in definitions.items() if other != name]
    if any(definition.is_idl for definition in definitions.values()):
        ordered = [definitions[name], *reversed(others)]
        return "".join(f"{header(Language.IDL, item.full_name)}{to_idl(item, definitions)}" for item in ordered)
    parts = [to_text(definitions[name]), *(f"MSG: {item.name}\n{to_text(item)}" for item in reversed(others))]
    return f"{_LINE}\n".join(parts)


def encoding_of(text: str, ros: Middleware) -> str:
    """Return the encoding of a joint text in schemas of MCAP and Foxglove."""
    if ros is ROS1:
        return "ros1msg"
    return "ros2idl" if text.startswith(f"{_LINE}\n{Language.IDL.value}: ") else "ros2msg"


def header(language: Language, name: str) -> str:
    """Return the lines before a definition."""
    return f"{_LINE}\n{language.value}: {name}\n"


def separate_texts(name: MessageName, text: str) -> dict[Heading, str]:
    """Return the text of each definition in the joint text of the message `name`.

    Raise `InputError` for an illegal name.
    """
    first, *others = _PARTING.split(text)
    triples = zip(others[::3], others[1::3], others[2::3], strict=True)
    found = {Heading(Language(word), parse_name(other)): part for word, other, part in triples}
    # The definition of a message without fields is empty, as is the text before a header.
    is_headed = any(heading.language is not Language.MSG or heading.name == name for heading in found)
    return found if is_headed and not first.strip() else {Heading(Language.MSG, name): first} | found


def interface_of(heading: Heading, ros: Middleware, has_events: bool) -> Interface | None:
    """Return the service or action that a definition describes, or None for messages."""
    kind = INTERFACES.get(heading.language)
    return Interface(heading.name, kind, ros, has_events) if kind else None


def signature_of_text(name: MessageName, text: str, ros: Middleware) -> str | None:
    """Return the signature of the message that a joint text defines, or None if the text is faulty or incomplete."""
    faults = Diagnostics()
    definitions: dict[MessageName, MessageDefinition] = {}
    try:
        for heading, part in separate_texts(name, text).items():
            definitions |= _parsed(heading, part, ros, faults)
        faults.raise_if_any()
        check_extents({each: definitions[each] for each in _inner_first(definitions)}, {})
        return signature(name, definitions)
    except (InputError, KeyError, CycleError):
        return None


def _parsed(heading: Heading, text: str, ros: Middleware, faults: Diagnostics) -> Definitions:
    file = str(heading.name)
    if interface := interface_of(heading, ros, has_events=True):
        return interface.parse(text, file, faults)
    if heading.language is Language.IDL:
        return parse_idl(text, heading.name.package, ros, file, faults)
    return {heading.name: ros.parse(text, heading.name, ros, file, faults)}


def _inner_first(definitions: Definitions) -> Iterable[MessageName]:
    """Return the names in an order in which nested messages precede the messages that contain them.

    May raise `CycleError`.
    """
    within = {
        name: [nested for field in definition.fields if (nested := nested_message(field.type))]
        for name, definition in definitions.items()
    }
    return TopologicalSorter(within).static_order()
