"""Definitions for the tests of this room."""

from __future__ import annotations

from collections.abc import Mapping

from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from tests.frame.oracle import parsed

Definitions = dict[MessageName, MessageDefinition]


def standard(ros: Middleware, name: str) -> tuple[MessageName, Definitions]:
    """A message of the default distribution with all below it."""
    return parse_name(name), MessageLibrary(ros).closure(parse_name(name))


def own(ros: Middleware, texts: Mapping[str, str]) -> tuple[MessageName, Definitions]:
    """The last of these messages, named `a_msgs/<key>`."""
    definitions = parsed({f"a_msgs/{name}": text for name, text in texts.items()}, ros)
    return list(definitions)[-1], definitions
