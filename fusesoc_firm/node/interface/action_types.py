"""The actions of a system from its node's view: the topics and services of which an action consists."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.node.interface.services import NodeService
from fusesoc_firm.node.interface.topics import NodeTopic, node_topic
from fusesoc_firm.system.derived.actions import action_messages
from fusesoc_firm.system.derived.model import Action, ServiceEnd
from fusesoc_firm.system.system_core import LoadedSystem

# The numbers of an action's topics: those to its server in ROS 1, and those to its clients.
GOAL, CANCEL = range(2)
STATES, FEEDBACK, RESULT = range(3)
# The numbers of an action's services in ROS 2.
SEND_GOAL, CANCEL_GOAL, GET_RESULT = range(3)
_CANCEL_GOAL = "action_msgs/srv/CancelGoal"


@dataclass(frozen=True)
class NodeAction:
    """An action that a node serves, or to which it sends goals: its name in ROS, and the blocks of its converters.

    A server subscribes to the topics of goals in ROS 1 and publishes those to clients; a client does the reverse. In
    ROS 2, `services` replace the topics of goals. All are in the order of the numbers above. If the side with the goal
    is silent about it for `time_limit` seconds, the goal fails; a server accepts it after `accept_limit` seconds.
    `no_result` is the payload of a result without contents.
    """

    block: str
    name: str
    ros: int
    is_server: bool
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
    is_server = action.end is ServiceEnd.SERVER
    to_server = _topics_to_server(action, names, library) if is_first else ()
    to_clients = _topics_to_clients(action, names, library)
    result = frame_of(names["result"], library.closure(names["result"]))
    return NodeAction(
        action.block,
        action.ros_name,
        action.ros.number,
        is_server,
        action.goal,
        action.cancel,
        action.feedback,
        action.result,
        to_server if is_server else to_clients,
        to_clients if is_server else to_server,
        () if is_first else _ros2_services(action, library),
        action.time_limit,
        action.accept_limit,
        encode_used(with_names_in_use(result, set()), {}),
    )


def _topics_to_server(action: Action, names: dict[str, MessageName], library: MessageLibrary) -> tuple[NodeTopic, ...]:
    return tuple(
        node_topic(block, f"{action.ros_name}/{end}", names[end], library)
        for end, block in (("goal", action.goal), ("cancel", action.cancel))
    )


def _topics_to_clients(action: Action, names: dict[str, MessageName], library: MessageLibrary) -> tuple[NodeTopic, ...]:
    is_first = action.ros is ROS1
    folder = action.ros_name if is_first else f"{action.ros_name}/_action"
    states = MessageName("actionlib_msgs" if is_first else "action_msgs", "GoalStatusArray")
    # As rcl_action: late subscribers receive the last states.
    quality: dict[str, Any] = {} if is_first else {"is_transient_local": True, "depth": 1}
    found = [
        # Lost states count as lost feedback.
        replace(node_topic(action.feedback, f"{folder}/status", states, library), **quality),
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
        is_server=action.end is ServiceEnd.SERVER,
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
