"""The legal names of topics, and the types of topics that several blocks of a system share."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef
from fusesoc_firm.text.yaml_text import Text

# The names that both ROS 1 and ROS 2 accept.
_WORD = r"[A-Za-z](?:_?[A-Za-z0-9])*_?"
_NAME = re.compile(rf"/?{_WORD}(?:/{_WORD})*")
_FOREIGN = re.compile(r"[^A-Za-z0-9_/]")
_LEGAL = (
    "legal here: words that begin with a letter and contain letters, digits and single '_', as in /arm/left, or in "
    "arm/left relative to the node's namespace"
)


@dataclass(frozen=True)
class TopicUse:
    """The use of a topic: its name and type, the direction (publish or subscribe), and the place in the file."""

    topic: Topic
    is_published: bool
    source: SourceRef | None


def check_topic_name(name: Text, faults: Diagnostics) -> None:
    """Note a fault if a name is private, or if ROS 1 or ROS 2 does not accept it."""
    if name.startswith("~"):
        message = f"topic '{name}' depends on the node's name, which is unknown before the node starts"
        faults.error(message, name.source, _LEGAL)
    elif not _NAME.fullmatch(name):
        faults.error(f"'{name}' is not a legal topic name: {_broken_rule(name)}", name.source, _LEGAL)


def _broken_rule(name: str) -> str:
    """Return the rule that an illegal name breaks."""
    if foreign := _FOREIGN.search(name):
        return f"it contains '{foreign[0]}'"
    if double := next((item for item in ("//", "__") if item in name), ""):
        return f"it contains '{double}'"
    if name.endswith("/"):
        return "it ends with '/'"
    word = next(item for item in name.removeprefix("/").split("/") if not item[:1].isalpha())
    return f"'{word}' does not begin with a letter"


def check_topics(uses: Iterable[TopicUse], faults: Diagnostics) -> None:
    """Note each topic with two types.

    ROS 1 topics and ROS 2 topics are always distinct. Relative names are compared without a namespace.
    """
    met: dict[tuple[object, str], list[TopicUse]] = {}
    for use in uses:
        met.setdefault((use.topic.frame.ros, use.topic.name), []).append(use)
    for (_, name), (first, *others) in met.items():
        for other in others:
            _check_type(name, first, other, faults)


def _check_type(name: str, first: TopicUse, other: TopicUse, faults: Diagnostics) -> None:
    one, two = (use.topic.frame.message for use in (first, other))
    if one != two:
        message = f"topic {name} has the type {two} at '{other.topic.block}', but {one} at '{first.topic.block}'"
        faults.error(message, other.source, f"a topic has only one type; '{first.topic.block}' is at {first.source}")
