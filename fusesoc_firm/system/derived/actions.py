"""Actions: a server becomes four converters, one each for its goals, cancellations, feedback and results.

The messages are those of ROS with their ids and states, so that bags contain them, too.
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
from fusesoc_firm.system.derived.model import Action
from fusesoc_firm.system.derived.partition import Parts
from fusesoc_firm.system.derived.services import (
    converter,
    interface_blocks,
    interface_of,
    limit_of,
    ros_name_of,
    with_entries,
)
from fusesoc_firm.system.written.specification import PUBLISHER, SERVER, SERVICE_MODES, SUBSCRIBER, Block, Specification
from fusesoc_firm.text.diagnostics import Diagnostics

_ACCEPT_LIMIT = Fraction(1)
_ENDS = {"goal": SUBSCRIBER, "cancel": SUBSCRIBER, "feedback": PUBLISHER, "result": PUBLISHER}
_NONE = dict.fromkeys(_ENDS)


def with_actions(
    specification: Specification, libraries: Mapping[Middleware, MessageLibrary], faults: Diagnostics
) -> Specification:
    """Return the specification with four converters, such as `<name>_goal`, for each server of an action.

    Connections from the server lead from the goals and the cancellations; those to it lead to the feedback and the
    results. Note the faults in keys of actions.
    """
    blocks: list[Block] = []
    entries: dict[str, tuple[str, ...]] = {}
    for block in specification.blocks:
        if block.type is None and block.mode in SERVICE_MODES and block.action is not None:
            messages = _messages_of(block, libraries, faults)
            made = {
                end: converter(block, f"{block.name}_{end}", mode, messages[end], _topic(block, end))
                for end, mode in _ENDS.items()
            }
            # Cancellations are short.
            made["cancel"] = replace(made["cancel"], max_length=None)
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
    """Return the topic on which ROS sends one of the messages of an action, if it is not a call."""
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
        faults.error(message, block.service.source, "a server has either 'service' or 'action'")
    if block.mode and block.mode != SERVER:
        message = f"'{block.name}' cannot be a {block.mode} of an action"
        faults.error(message, block.mode.source, f"legal here: {SERVER}; hardware cannot send goals to other nodes")
        return _NONE
    found = interface_of(block, InterfaceKind.ACTION, libraries, faults)
    return action_messages(found.name, found.ros) if found else _NONE


def _action(block: Block) -> Action:
    assert block.middleware and block.action
    goal, cancel, feedback, result = (f"{block.name}_{end}" for end in _ENDS)
    return Action(
        str(block.name),
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
