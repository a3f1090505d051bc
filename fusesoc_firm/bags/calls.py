"""The calls of services in bags of ROS 2, whose service introspection records them as events.

A server and a client each publish two events of a call, with its request and its response if they are configured so.
The two ends number their calls differently, so only the events of one end are used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fusesoc_firm.frame.codec import CodecError, decode, encode
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream, open_bag
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind
from fusesoc_firm.message.signature import signature
from fusesoc_firm.system.derived.model import Service, ServiceEnd, absolute_name
from fusesoc_firm.text.diagnostics import InputError, fail

EVENTS = "_service_event"
# The values of `event_type` for a request and a response, by end (service_msgs/ServiceEventInfo); a server's are those
# that the hardware would record.
_ENDS = ((1, 2), (0, 3))
# What tells a call from others: the writer of the request and its number.
_Key = tuple[Any, ...]
# The number of requests that wait for responses of earlier ones; so many later, no response is expected any more.
_MOST_WAITING = 100


class Exchange(NamedTuple):
    """A recorded request, its stamp in ns, and its response if there is one."""

    stamp: int
    request: bytes
    response: bytes | None


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
        events_name, requests, responses = (f"{name.package}/{interface.kind}/{name.name}" for name in names)
        return cls(events_name, requests, responses, signature(names[0], closures[0]), event, request, response)


@dataclass(frozen=True)
class _Kinds:
    """The values of `event_type` of requests and responses; how many requests and invalid events there are."""

    request: int
    response: int
    count: int
    invalid: int


@dataclass(frozen=True)
class _Calls:
    """The recorded calls of a service: its block, the stream of the messages to the hardware, and the events to use."""

    service: Service
    type: EventType
    stream: Stream
    kinds: _Kinds

    @property
    def is_served(self) -> bool:
        """Whether the messages to the hardware are requests."""
        return self.service.end is ServiceEnd.SERVER

    def part_of(self, recorded: Recorded) -> tuple[_Key, bytes | None, bytes | None] | None:
        """Return the key of the call and its request or its response, if the event is valid and has one of them."""
        event = _decoded(recorded, self.type)
        if event is None:
            return None
        key = (*event["info"]["client_gid"], event["info"]["sequence_number"])
        if event["info"]["event_type"] == self.kinds.request and event["request"]:
            return key, encode(self.type.request, event["request"][0]), None
        if event["info"]["event_type"] == self.kinds.response and event["response"]:
            return key, None, encode(self.type.response, event["response"][0])
        return None


@dataclass(frozen=True)
class BagOfCalls(Bag):
    """A bag with calls: a stream of messages to the hardware replaces each stream of events in `calls`.

    These messages are requests to services that the hardware serves, and responses of others. While the messages are
    read, `responses` gets each recorded response of the former, by the stream and the number of its request. The events
    in `asked` are those of services that the hardware calls, by the blocks of their requests.
    """

    calls: Mapping[Stream, _Calls]
    asked: Mapping[str, tuple[Stream, _Calls]]
    responses: dict[tuple[Stream, int], bytes] = field(default_factory=dict)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield messages like `Bag`, and each message of the calls once. Raise `InputError` if the bag is damaged."""
        own = {stream.topic for stream, calls in self.calls.items() if calls.stream.topic in topics}
        numbers: dict[_Key, int] = {}
        counts: Counter[Stream] = Counter()
        for recorded in super().messages({*topics, *own}, stop):
            calls = self.calls.get(recorded.stream)
            if calls is None:
                yield recorded
                continue
            if (part := calls.part_of(recorded)) is None:
                continue
            key, request, response = (calls.stream, *part[0]), *part[1:]
            if request is not None:
                numbers[key] = counts[calls.stream]
                counts[calls.stream] += 1
                if calls.is_served:
                    yield Recorded(calls.stream, numbers[key], recorded.stamp, request)
            elif response is not None and key in numbers:
                number = numbers.pop(key)
                if calls.is_served:
                    self.responses[calls.stream, number] = response
                else:
                    yield Recorded(calls.stream, number, recorded.stamp, response)

    def exchanges(self, block: str, first: int, stop: int | None) -> Iterator[Exchange]:
        """Yield each exchange with a service that the hardware calls, in the order of the requests.

        `block` is that of the requests. They are recorded from `first` on, and both messages before `stop` (in ns).
        Only the events before a damage count, which the replay reports.
        """
        stream, calls = self.asked[block]
        waiting: dict[_Key, Exchange] = {}
        # With one reader for both, this reading would move the place of the replay in some bags.
        with suppress(InputError), open_bag(self.path) as bag:
            for recorded in bag.messages([stream.topic], stop):
                part = calls.part_of(recorded) if recorded.stream == stream else None
                if part is None:
                    continue
                key, request, response = part
                if request is not None and recorded.stamp >= first:
                    waiting[key] = Exchange(recorded.stamp, request, None)
                elif key in waiting:
                    waiting[key] = waiting[key]._replace(response=response)
                while waiting and (_first(waiting).response is not None or len(waiting) > _MOST_WAITING):
                    yield waiting.pop(next(iter(waiting)))
        yield from waiting.values()


def _first(exchanges: Mapping[_Key, Exchange]) -> Exchange:
    return next(iter(exchanges.values()))


def with_calls(
    bag: Bag,
    services: Iterable[Service],
    libraries: Mapping[Middleware, MessageLibrary],
    names: Mapping[str, str],
    *,
    plays_responses: bool,
) -> BagOfCalls:
    """Return the bag with the calls of services; `names` are the topics of the messages to the hardware.

    A stream of these messages has the topic in `names`, or that of the events if no service has its name. With
    `plays_responses`, the responses to calls of the hardware are among the messages of the bag. Events without requests
    remain, and the number of invalid ones. Raise `InputError` if the definition of a service's events differs.
    """
    known = _Known.of(bag, services, libraries, names)
    streams: dict[Stream, int] = {}
    calls: dict[Stream, _Calls] = {}
    asked: dict[str, tuple[Stream, _Calls]] = {}
    for stream, count in bag.streams.items():
        made = known.calls(bag, stream)
        if made is None:
            streams[stream] = count
            continue
        if made.is_served or plays_responses:
            calls[stream] = made
            streams[made.stream] = made.kinds.count
        elif made.service.request in asked:
            streams[stream] = count
        else:
            asked[made.service.request] = stream, made
        if made.kinds.invalid:
            streams[stream] = made.kinds.invalid
    return BagOfCalls(**{**vars(bag), "streams": streams}, calls=calls, asked=asked)


@dataclass(frozen=True)
class _Known:
    """The services of a system whose events a bag contains, by the topics of their events, and the events' types."""

    services: list[Service]
    types: dict[str, EventType]
    events: dict[str, Service]
    names: Mapping[str, str]

    @classmethod
    def of(
        cls,
        bag: Bag,
        services: Iterable[Service],
        libraries: Mapping[Middleware, MessageLibrary],
        names: Mapping[str, str],
    ) -> _Known:
        recorded = {stream.type for stream in bag.streams}
        known = cls([], {}, {}, names)
        for service in services:
            name = _event_name(service)
            if service.ros is not bag.form.ros or name not in recorded:
                continue
            if found := known.types.get(name) or EventType.of(service, libraries[service.ros]):
                known.services.append(service)
                known.types[name] = found
                known.events[absolute_name(f"{service.ros_name}/{EVENTS}")] = service
        return known

    def calls(self, bag: Bag, stream: Stream) -> _Calls | None:
        """Return the calls in a stream, or None if it has none. Raise `InputError` if its definition differs."""
        topic, type_ = absolute_name(stream.topic), self.types.get(stream.type)
        if type_ is None:
            return None
        if stream.signature not in ("", type_.signature):
            if topic in self.events or topic in self.names.values():
                text = f"its definition of {type_.name} differs from the system's"
                fail(f"topic {stream.topic} in {bag.path}: {text}: {stream.signature}, not {type_.signature}")
            return None
        service, kinds = self._service(topic, stream.type), _kinds_in(bag, stream, type_)
        if service is None or kinds is None:
            return None
        given = self.names[_entering(service)] if topic in self.events else stream.topic
        name = type_.request_name if service.end is ServiceEnd.SERVER else type_.response_name
        return _Calls(service, type_, Stream(given, name, "", ""), kinds)

    def _service(self, topic: str, event: str) -> Service | None:
        """Return the service of a topic: that with its name, else that to which it is mapped, else the only one."""
        found = [item for item in self.services if _event_name(item) == event]
        mapped = [item for item in found if self.names[_entering(item)] == topic]
        servers = [item for item in found if item.end is ServiceEnd.SERVER]
        # A topic that could belong to several servers is an error of the routes.
        rest = servers or (found if len(found) == 1 else [])
        return self.events.get(topic) or next(iter(mapped or rest), None)


def _event_name(service: Service) -> str:
    return f"{service.type.package}/{InterfaceKind.SERVICE}/{service.type.name}_Event"


def _entering(service: Service) -> str:
    """Return the block of the messages to the hardware."""
    return service.request if service.end is ServiceEnd.SERVER else service.response


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
