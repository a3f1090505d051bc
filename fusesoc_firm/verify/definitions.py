"""Definitions as text that every parser reads, for those who judge."""

from __future__ import annotations

from collections.abc import Mapping

from fusesoc_firm.message.model import MessageDefinition, MessageName

_SEPARATOR = "=" * 80


class NoJudgementError(Exception):
    """A judge cannot say what a message's bytes are; the text is why."""


def plain_text(definition: MessageDefinition) -> str:
    """The fields alone: defaults and constants are not sent, and not every parser reads all of them."""
    return "".join(f"{field.type} {field.name}\n" for field in definition.fields)


def joint_text(name: MessageName, definitions: Mapping[MessageName, MessageDefinition]) -> str:
    """A message and all below it in one text, parted as ROS's own tools do."""
    others = [f"{_SEPARATOR}\nMSG: {other}\n{plain_text(definitions[other])}" for other in definitions if other != name]
    return "\n".join([plain_text(definitions[name]), *others])
