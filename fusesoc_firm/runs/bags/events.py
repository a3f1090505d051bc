"""The service events of ROS 2 in bags: the records of calls by the introspection of a server or a client.

Server and client each publish two events per call, which contain the request and the response if so configured. The two
ends number their calls differently, so only the events of one end are used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode, encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.message.middleware import MessageDefinition
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.text.diagnostics import fail

EVENTS = "_service_event"
# The values of `event_type` for a request and a response, by end (service_msgs/ServiceEventInfo); a server's are those
# that the hardware would record.
_ENDS = ((1, 2), (0, 3))
# The identity of a call: the writer of the request and its number.
Key = tuple[Any, ...]


@dataclass(frozen=True)
class EventType:
    """The events of a type of service, such as sensor_msgs/srv/SetCameraInfo_Event, and the messages in them."""

    name: str
    request_name: str
    response_name: str
    signature: str
    event: Frame
    request: Frame
    response: Frame

    @classmethod
    def of(
        cls, service: MessageName, kind: InterfaceKind, definitions: Mapping[MessageName, MessageDefinition]
    ) -> EventType:
        """Return the events of a service; `kind` is the kind of the defining file."""
        ends = ("Event", "Request", "Response")
        names = [MessageName(service.package, f"{service.name}_{end}") for end in ends]
        event, request, response = (frame_of(name, definitions) for name in names)
        told, asked, answered = (f"{name.package}/{kind}/{name.name}" for name in names)
        return cls(told, asked, answered, signature(names[0], definitions), event, request, response)

    def check(self, bag: Bag, stream: Stream) -> None:
        """Raise `InputError` if the definition of a stream of events differs."""
        if not self.fits(stream):
            text = f"its definition of {self.name} differs from the system's"
            fail(f"topic {stream.topic} in {bag.path}: {text}: {stream.signature}, not {self.signature}")

    def fits(self, stream: Stream) -> bool:
        """Return whether the events of a stream have this definition or an unknown one."""
        return stream.signature in ("", self.signature)


@dataclass(frozen=True)
class Events:
    """The events of one end in a stream: the values of `event_type` of requests and of responses.

    `count` is the number of requests, `invalid` the number of invalid events.
    """

    type: EventType
    request: int
    response: int
    count: int
    invalid: int

    def part_of(self, recorded: Recorded) -> tuple[Key, bytes | None, bytes | None] | None:
        """Return the key of the call and its request or its response, if the event is valid and has one of them."""
        event = _decoded(recorded, self.type)
        if event is None:
            return None
        key = (*event["info"]["client_gid"], event["info"]["sequence_number"])
        if event["info"]["event_type"] == self.request and event["request"]:
            return key, encode(self.type.request, event["request"][0]), None
        if event["info"]["event_type"] == self.response and event["response"]:
            return key, None, encode(self.type.response, event["response"][0])
        return None


def events_in(bag: Bag, stream: Stream, type_: EventType) -> Events | None:
    """Return the events of a stream to use, or None if no event contains its request."""
    told: Counter[int] = Counter()
    invalid = 0
    for recorded in bag.messages([stream.topic]):
        if recorded.stream != stream:
            continue
        if (event := _decoded(recorded, type_)) is None:
            invalid += 1
        elif event["request"]:
            told[event["info"]["event_type"]] += 1
    return next((Events(type_, *end, told[end[0]], invalid) for end in _ENDS if told[end[0]]), None)


def _decoded(recorded: Recorded, type_: EventType) -> dict[str, Any] | None:
    """Return an event, or None if its payload is invalid."""
    try:
        return decode(type_.event, recorded.payload)
    except CodecError:
        return None
