"""The services of a system from its node's view."""

from __future__ import annotations

from dataclasses import dataclass

from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.model import FieldType, InterfaceKind, MessageName, PrimitiveType, StringType
from fusesoc_firm.system.derived.model import Service, ServiceEnd
from fusesoc_firm.system.system_core import LoadedSystem

# The texts of responses that report a failure, and the fields for them, as in std_srvs and sensor_msgs.
_FAILURES = {ServiceEnd.SERVER: "the hardware did not answer", ServiceEnd.CLIENT: "the service did not answer"}
_TEXTS = ("message", "status_message")
_SUCCESS = "success"


@dataclass(frozen=True)
class NodeService:
    """A service that a node serves or calls: its name in ROS, its type, and the blocks of its converters.

    `type` and `signature` are those of the service, in the form of `NodeTopic`; the other types are those of its
    messages. A call is answered within `time_limit` seconds. `failure` is the response to a call that fails, if the
    response has a field `success`; otherwise, it is empty.
    """

    block: str
    name: str
    type: str
    ros: int
    signature: str
    is_server: bool
    request: str
    response: str
    request_type: str
    response_type: str
    time_limit: float
    failure: bytes = b""


def node_service(service: Service, loaded: LoadedSystem) -> NodeService:
    """Describe a service of a system."""
    library = loaded.libraries[service.ros]
    interface = library.interface(service.type, InterfaceKind.SERVICE)
    assert interface is not None, "the system could be derived"
    definitions = library.joint_closure(interface.messages)
    request, response = interface.messages[:2]
    frames = {item.block: item.frame for item in (*loaded.system.subscribers, *loaded.system.publishers)}
    types = {field.name: field.type for field in definitions[response].fields}
    return NodeService(
        service.block,
        service.ros_name,
        _full_name(service.type, service),
        service.ros.number,
        service.ros.signature(service.type, definitions, InterfaceKind.SERVICE) if interface.has_signature else "",
        service.end is ServiceEnd.SERVER,
        service.request,
        service.response,
        _full_name(request, service),
        _full_name(response, service),
        service.time_limit,
        _failure(frames[service.response], types, _FAILURES[service.end]),
    )


def _full_name(name: MessageName, service: Service) -> str:
    return str(name) if service.ros is ROS1 else f"{name.package}/{InterfaceKind.SERVICE}/{name.name}"


def _failure(frame: Frame, types: dict[str, FieldType], reason: str) -> bytes:
    """Return a response with `success: false` and the reason, or nothing without such a field."""
    if types.get(_SUCCESS) != PrimitiveType("bool"):
        return b""
    texts = {name: reason for name in _TEXTS if types.get(name) == StringType()}
    used = with_names_in_use(frame, {(name,) for name in (_SUCCESS, *texts)})
    return encode_used(used, {_SUCCESS: False, **texts})
