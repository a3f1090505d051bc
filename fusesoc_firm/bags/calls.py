"""The calls of services in bags of ROS 2, whose service introspection records them as events.

A server and a client each publish two events of a call, with its request and its response if they are configured so.
The two ends number their calls differently, so only the events of one end are used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode, encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.model import Service, absolute_name
from fusesoc_firm.text.diagnostics import InputError, fail

EVENTS = "_service_event"
# The values of `event_type` for a request and a response, by end (service_msgs/ServiceEventInfo); a server's are those
# that the hardware would record.
_ENDS = ((1, 2), (0, 3))


@dataclass(frozen=True)
class EventType:
    """The events of a type of service, such as sensor_msgs/srv/SetCameraInfo_Event, and the messages in them."""

    name: str
    request_name: str
    signature: str
    event: Frame
    request: Frame
    response: Frame

    @classmethod
    def of(cls, service: Service, library: MessageLibrary) -> EventType | None:
        """Return the events of a service, or None if its version of ROS has none."""
        interface = library.interface(service.type, InterfaceKind.SERVICE)
        assert interface is not None, "the system could be derived"
        events = [name for name in interface.messages if name not in interface.exchanged]
        if not events:
            return None
        names = (*events, *interface.exchanged)
        closures = [library.closure(name) for name in names]
        event, request, response = map(frame_of, names, closures)
        spelled, requests = (f"{name.package}/{interface.kind}/{name.name}" for name in names[:2])
        return cls(spelled, requests, signature(names[0], closures[0]), event, request, response)


@dataclass(frozen=True)
class _Kinds:
    """The values of `event_type` of requests and responses; how many requests and invalid events there are."""

    request: int
    response: int
    count: int
    invalid: int


@dataclass(frozen=True)
class _Calls:
    """The recorded calls of a service: the stream of their requests, and the events to use."""

    type: EventType
    requests: Stream
    kinds: _Kinds


@dataclass(frozen=True)
class BagOfCalls(Bag):
    """A bag with calls: a stream of requests replaces each stream of events.

    While the messages are read, `responses` gets each recorded response, by the stream and the number of its request.
    """

    calls: Mapping[Stream, _Calls]
    responses: dict[tuple[Stream, int], bytes] = field(default_factory=dict)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield messages like `Bag`, and each request of the calls once. Raise `InputError` if the bag is damaged."""
        own = {stream.topic for stream, calls in self.calls.items() if calls.requests.topic in topics}
        numbers: dict[tuple[Any, ...], int] = {}
        counts: dict[Stream, int] = {}
        for recorded in super().messages({*topics, *own}, stop):
            calls = self.calls.get(recorded.stream)
            if calls is None:
                yield recorded
                continue
            event = _decoded(recorded, calls.type)
            if event is None:
                continue
            key = (calls.requests, *event["info"]["client_gid"], event["info"]["sequence_number"])
            if event["info"]["event_type"] == calls.kinds.request and event["request"]:
                number = numbers[key] = counts[calls.requests] = counts.get(calls.requests, -1) + 1
                payload = encode(calls.type.request, event["request"][0])
                yield Recorded(calls.requests, number, recorded.stamp, payload)
            elif event["info"]["event_type"] == calls.kinds.response and event["response"] and key in numbers:
                payload = encode(calls.type.response, event["response"][0])
                self.responses[calls.requests, numbers.pop(key)] = payload


def with_calls(
    bag: Bag, services: Iterable[Service], libraries: Mapping[Middleware, MessageLibrary], names: Mapping[str, str]
) -> BagOfCalls:
    """Return the bag with the calls of services that the hardware serves; `names` are the topics of their requests.

    A stream of requests has the topic of its service's requests, or that of the events if no service has its name.
    Events without requests remain, and the number of invalid ones. Raise `InputError` if the definition of a service's
    events differs.
    """
    types: dict[str, EventType] = {}
    topics: dict[str, str] = {}
    recorded = {stream.type for stream in bag.streams}
    for service in services:
        name = f"{service.type.package}/{InterfaceKind.SERVICE}/{service.type.name}_Event"
        if name in recorded and (found := EventType.of(service, libraries[service.ros])):
            types[name] = found
            topics[absolute_name(f"{service.ros_name}/{EVENTS}")] = names[service.request]
    streams: dict[Stream, int] = {}
    calls: dict[Stream, _Calls] = {}
    for stream, count in bag.streams.items():
        type_ = types.get(stream.type)
        if type_ and stream.signature not in ("", type_.signature):
            if absolute_name(stream.topic) in topics or stream.topic in names.values():
                text = f"its definition of {type_.name} differs from the system's"
                fail(f"topic {stream.topic} in {bag.path}: {text}: {stream.signature}, not {type_.signature}")
            type_ = None
        kinds = _kinds_in(bag, stream, type_) if type_ else None
        if type_ and kinds:
            requests = Stream(topics.get(absolute_name(stream.topic), stream.topic), type_.request_name, "", "")
            calls[stream] = _Calls(type_, requests, kinds)
            streams[requests] = kinds.count
            if kinds.invalid:
                streams[stream] = kinds.invalid
        else:
            streams[stream] = count
    return BagOfCalls(**{**vars(bag), "streams": streams}, calls=calls)


def _kinds_in(bag: Bag, stream: Stream, type_: EventType) -> _Kinds | None:
    """Return which events of a stream to use, or None if no event contains its request.

    Only the events before a damage count, which the replay reports.
    """
    told: Counter[int] = Counter()
    invalid = 0
    with suppress(InputError):
        for recorded in bag.messages([stream.topic]):
            if recorded.stream != stream:
                continue
            if (event := _decoded(recorded, type_)) is None:
                invalid += 1
            elif event["request"]:
                told[event["info"]["event_type"]] += 1
    return next((_Kinds(*end, told[end[0]], invalid) for end in _ENDS if told[end[0]]), None)


def _decoded(recorded: Recorded, type_: EventType) -> dict[str, Any] | None:
    """Return an event, or None if its payload is invalid."""
    try:
        return decode(type_.event, recorded.payload)
    except CodecError:
        return None
