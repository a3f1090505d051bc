"""Convert a message with its nested messages to one text, as in bags and ROS 1 connections, and back.

Lines of 80 `=` separate the definitions. Each definition except the first begins with `MSG: ` and the message's name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter

from fusesoc_firm.message.bounds import check_extents
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.model import MessageName, nested_message
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.printer import to_text
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

_LINE = "=" * 80
_PARTING = re.compile(rf"^{_LINE}\s*\n\s*MSG:\s*(\S+)\s*?\n", re.MULTILINE)


def joint_text(name: MessageName, definitions: Definitions) -> str:
    """Return the joint text: the message first, then all other messages in `definitions`."""
    others = [definition for other, definition in definitions.items() if other != name]
    parts = [to_text(definitions[name]), *(f"MSG: {item.name}\n{to_text(item)}" for item in reversed(others))]
    return f"{_LINE}\n".join(parts)


def separate_texts(name: MessageName, text: str) -> dict[MessageName, str]:
    """Return the text of each message in the joint text of the message `name`.

    Raise `InputError` for an illegal name.
    """
    first, *others = _PARTING.split(text)
    pairs = zip(others[::2], others[1::2], strict=True)
    return {name: first} | {parse_name(word): part for word, part in pairs}


def signature_of_text(name: MessageName, text: str, ros: Middleware) -> str | None:
    """Return the signature of the message that a joint text defines, or None if the text is faulty or incomplete."""
    faults = Diagnostics()
    parse = ros.parse
    try:
        texts = separate_texts(name, text)
        definitions = {each: parse(part, each, ros, str(each), faults) for each, part in texts.items()}
        faults.raise_if_any()
        check_extents({each: definitions[each] for each in _inner_first(definitions)}, {})
        return signature(name, definitions)
    except (InputError, KeyError, CycleError):
        return None


def _inner_first(definitions: Definitions) -> Iterable[MessageName]:
    """Return the names in an order in which nested messages precede the messages that contain them.

    May raise `CycleError`.
    """
    within = {
        name: [nested for field in definition.fields if (nested := nested_message(field.type))]
        for name, definition in definitions.items()
    }
    return TopologicalSorter(within).static_order()
