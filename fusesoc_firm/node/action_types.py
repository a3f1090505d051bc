"""The actions of a system from its node's view: the topics and services of which ROS makes an action."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.node.services import NodeService
from fusesoc_firm.node.topics import NodeTopic, node_topic
from fusesoc_firm.system.derived.actions import action_messages
from fusesoc_firm.system.derived.model import Action
from fusesoc_firm.system.system_core import LoadedSystem

# The numbers of an action's topics: those of clients of actionlib, and those of the node.
GOAL, CANCEL = range(2)
STATES, FEEDBACK, RESULT = range(3)
# The numbers of an action's services in ROS 2.
SEND_GOAL, CANCEL_GOAL, GET_RESULT = range(3)
_CANCEL_GOAL = "action_msgs/srv/CancelGoal"


@dataclass(frozen=True)
class NodeAction:
    """An action that a node serves: its name in ROS, and the blocks of its converters.

    An action of ROS 1 consists of `subscribers` and `publishers`, one of ROS 2 of `services` and `publishers`; all are
    in the order of the numbers above. If the hardware sends nothing about its goal for `time_limit` seconds, the goal
    fails; after `accept_limit` seconds, it is accepted. `no_result` is the payload of a result without contents.
    """

    block: str
    name: str
    ros: int
    goal: str
    cancel: str
    feedback: str
    result: str
    subscribers: tuple[NodeTopic, ...]
    publishers: tuple[NodeTopic, ...]
    services: tuple[NodeService, ...]
    time_limit: float
    accept_limit: float
    no_result: bytes


def node_action(action: Action, loaded: LoadedSystem) -> NodeAction:
    """Describe an action of a system."""
    library = loaded.libraries[action.ros]
    names = action_messages(action.type, action.ros)
    is_first = action.ros is ROS1
    result = frame_of(names["result"], library.closure(names["result"]))
    return NodeAction(
        action.block,
        action.ros_name,
        action.ros.number,
        action.goal,
        action.cancel,
        action.feedback,
        action.result,
        _ros1_subscribers(action, names, library) if is_first else (),
        _publishers(action, names, library),
        () if is_first else _ros2_services(action, library),
        action.time_limit,
        action.accept_limit,
        encode_used(with_names_in_use(result, set()), {}),
    )


def _ros1_subscribers(action: Action, names: dict[str, MessageName], library: MessageLibrary) -> tuple[NodeTopic, ...]:
    return tuple(
        node_topic(block, f"{action.ros_name}/{end}", names[end], library)
        for end, block in (("goal", action.goal), ("cancel", action.cancel))
    )


def _publishers(action: Action, names: dict[str, MessageName], library: MessageLibrary) -> tuple[NodeTopic, ...]:
    is_first = action.ros is ROS1
    folder = action.ros_name if is_first else f"{action.ros_name}/_action"
    states = MessageName("actionlib_msgs" if is_first else "action_msgs", "GoalStatusArray")
    # As rcl_action: late subscribers receive the last states.
    quality: dict[str, Any] = {} if is_first else {"is_transient_local": True, "depth": 1}
    found = [
        replace(node_topic(action.block, f"{folder}/status", states, library), **quality),
        node_topic(action.feedback, f"{folder}/feedback", names["feedback"], library),
    ]
    if is_first:
        found.append(node_topic(action.result, f"{folder}/result", names["result"], library))
    return tuple(found)


def _ros2_services(action: Action, library: MessageLibrary) -> tuple[NodeService, ...]:
    folder = f"{action.ros_name}/_action"
    type_ = f"{action.type.package}/action/{action.type.name}"
    return (
        _service(action, f"{folder}/send_goal", f"{type_}_SendGoal", _signature(action, "_SendGoal", library)),
        _service(action, f"{folder}/cancel_goal", _CANCEL_GOAL, ""),
        _service(action, f"{folder}/get_result", f"{type_}_GetResult", _signature(action, "_GetResult", library)),
    )


def _service(action: Action, name: str, type_: str, signature: str) -> NodeService:
    return NodeService(
        action.block,
        name,
        type_,
        action.ros.number,
        signature,
        is_server=True,
        request=action.goal,
        response=action.result,
        request_type=f"{type_}_Request",
        response_type=f"{type_}_Response",
        time_limit=action.time_limit,
    )


def _signature(action: Action, suffix: str, library: MessageLibrary) -> str:
    """Return the signature of one of the two services of an action, if ROS defines it."""
    interface = library.interface(action.type, InterfaceKind.ACTION)
    if interface is None or not interface.has_signature:
        return ""
    name = MessageName(action.type.package, f"{action.type.name}{suffix}")
    return action.ros.signature(name, library.joint_closure(interface.messages), InterfaceKind.ACTION)
