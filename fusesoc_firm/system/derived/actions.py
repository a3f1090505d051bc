"""Actions: a server or client becomes four converters, one each for goals, cancellations, feedback and results.

The messages are ROS's own, with goal ids and states, so bags can contain them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived.model import Action, ServiceEnd
from fusesoc_firm.system.derived.partition import Parts
from fusesoc_firm.system.derived.services import (
    converter,
    interface_blocks,
    interface_of,
    limit_of,
    ros_name_of,
    with_entries,
)
from fusesoc_firm.system.written.specification import (
    CLIENT,
    PUBLISHER,
    SERVER,
    SERVICE_MODES,
    SUBSCRIBER,
    Block,
    Specification,
)
from fusesoc_firm.text.diagnostics import Diagnostics

_ACCEPT_LIMIT = Fraction(1)
# The modes of the converters of a server and of a client.
_ENDS = {
    SERVER: {"goal": SUBSCRIBER, "cancel": SUBSCRIBER, "feedback": PUBLISHER, "result": PUBLISHER},
    CLIENT: {"goal": PUBLISHER, "cancel": PUBLISHER, "feedback": SUBSCRIBER, "result": SUBSCRIBER},
}


def with_actions(
    specification: Specification, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Specification:
    """Return the specification with four converters, such as `<name>_goal`, for each server or client of an action.

    Connections from a server lead from the goals and the cancellations; those to it lead to the feedback and the
    results. For a client, the directions are reversed. Note the faults in keys of actions.
    """
    blocks: list[Block] = []
    entries: dict[str, tuple[str, ...]] = {}
    for block in specification.blocks:
        if block.type is None and block.mode in SERVICE_MODES and block.action is not None:
            messages = _messages_of(block, libraries, faults)
            made = {
                end: converter(block, f"{block.name}_{end}", mode, messages[end], _topic(block, end))
                for end, mode in _ENDS[block.mode].items()
            }
            # Cancellations are short.
            made["cancel"] = replace(made["cancel"], max_length=None, buffer=None)
            entries[block.name] = tuple(item.name for item in made.values() if item.mode == PUBLISHER)
            blocks += made.values()
        else:
            blocks.append(block)
    return with_entries(specification, blocks, entries)


def actions_of(blocks: Mapping[str, Block], parts: Parts, faults: Diagnostics) -> tuple[Action, ...]:
    """Return the actions of a system with these blocks; note each action that accelerators in software use."""
    return tuple(map(_action, interface_blocks(blocks, parts, InterfaceKind.ACTION, faults)))


def action_messages(name: MessageName, ros: Middleware) -> dict[str, MessageName]:
    """Return the names of the messages of goals, cancellations, feedback and results."""
    goal, cancel, feedback, result = (
        ("{}ActionGoal", "actionlib_msgs/GoalID", "{}ActionFeedback", "{}ActionResult")
        if ros is ROS1
        else ("{}_SendGoal_Request", "action_msgs/GoalInfo", "{}_FeedbackMessage", "{}_GetResult_Response")
    )
    own = {"goal": goal, "feedback": feedback, "result": result}
    found = {end: MessageName(name.package, pattern.format(name.name)) for end, pattern in own.items()}
    return {**found, "cancel": parse_name(cancel)}


def _topic(block: Block, end: str) -> str | None:
    """Return the topic on which ROS sends a message of an action, or None if the message is part of a call."""
    if block.middleware is None or not block.name:
        return None
    if MIDDLEWARES[block.middleware] is ROS1:
        return f"{ros_name_of(block)}/{end}"
    return f"{ros_name_of(block)}/_action/{end}" if end == "feedback" else None


def _messages_of(
    block: Block, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Mapping[str, MessageName | None]:
    """Return the names of the messages by their ends; note the faults of the block."""
    if block.service is not None:
        message = f"'{block.name}' has a service and an action"
        faults.error(message, block.service.source, f"a {block.mode} has either 'service' or 'action'")
    if block.mode == CLIENT and block.accept_limit is not None:
        message = f"'acceptLimit' is legal only for servers, but '{block.name}' is a client"
        faults.error(message, block.accept_limit.source, "'timeLimit' limits the silence of the client's server")
    found = interface_of(block, InterfaceKind.ACTION, libraries, faults)
    return action_messages(found.name, found.ros) if found else dict.fromkeys(_ENDS[SERVER])


def _action(block: Block) -> Action:
    assert block.middleware and block.mode and block.action
    goal, cancel, feedback, result = (f"{block.name}_{end}" for end in _ENDS[SERVER])
    return Action(
        str(block.name),
        ServiceEnd(str(block.mode)),
        parse_name(block.action),
        MIDDLEWARES[block.middleware],
        ros_name_of(block),
        goal,
        cancel,
        feedback,
        result,
        limit_of(block.time_limit),
        limit_of(block.accept_limit, _ACCEPT_LIMIT),
    )
