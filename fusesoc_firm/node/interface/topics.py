"""The topics of a system from its node's view."""

from __future__ import annotations

from dataclasses import dataclass

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import MessageName, MessageType
from fusesoc_firm.message.printer import closure_text
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.model import Quality

_HEADER = MessageType(MessageName("std_msgs", "Header"))
# The capacity, in messages, of a queue without a topic, and of a topic's queues without `qos`.
DEFAULT_DEPTH = Quality().depth


@dataclass(frozen=True)
class NodeTopic:
    """A topic of a node.

    `block` is the block in the specification, and `id` is the converter's id, if there is a converter.

    A relative `name` is resolved in the node's namespace. `depth` is the capacity of the topic's queues in messages.
    With `is_numbered`, a message begins with its publisher's count, since its first field is a Header of ROS 1.
    `signature` is the definition's signature: the MD5 sum for
    ROS 1, the RIHS01 hash for ROS 2. `definition` is the definition's text with the texts of all nested messages; only
    ROS 1 announces it.
    """

    block: str
    name: str
    type: str
    ros: int
    signature: str
    id: int | None = None
    definition: str = ""
    is_reliable: bool = True
    is_transient_local: bool = False
    depth: int = DEFAULT_DEPTH
    is_numbered: bool = False


def node_topic(block: str, topic: str, name: MessageName, library: MessageLibrary) -> NodeTopic:
    """Return a topic with a message of the library, without a converter."""
    definitions = library.closure(name)
    is_first = library.ros is ROS1
    return NodeTopic(
        block,
        topic,
        str(name) if is_first else f"{name.package}/{definitions[name].kind}/{name.name}",
        library.ros.number,
        signature(name, definitions),
        definition=closure_text(name, definitions) if is_first else "",
        is_numbered=is_first and _begins_with_header(name, definitions),
    )


def _begins_with_header(name: MessageName, definitions: Definitions) -> bool:
    """Return whether a message begins with the field `header`, in whose first bytes ROS 1 numbers messages."""
    fields = definitions[name].fields
    return bool(fields) and (fields[0].name, fields[0].type) == ("header", _HEADER)
