"""The calls of services in bags of ROS 2, whose service introspection records them as events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import InterfaceKind
from fusesoc_firm.runs.bags.events import EVENTS, Events, EventType, Key, events_in
from fusesoc_firm.system.derived.model import Service, ServiceEnd, absolute_name

# A request without a response is given up after this number of later requests.
_MOST_WAITING = 100


class Exchange(NamedTuple):
    """A recorded request, its stamp in ns, and its response if there is one."""

    stamp: int
    request: bytes
    response: bytes | None


@dataclass(frozen=True)
class _Calls:
    """The recorded calls of a service: its block, the stream of the messages to the hardware, and the events to use."""

    service: Service
    stream: Stream
    events: Events

    @property
    def is_served(self) -> bool:
        """True if the messages to the hardware are requests."""
        return self.service.end is ServiceEnd.SERVER


@dataclass(frozen=True)
class BagOfCalls(Bag):
    """A bag with calls: a stream of messages to the hardware replaces each stream of events in `calls`.

    These messages are requests to services that the hardware serves, and responses of others. While the messages are
    read, `responses` receives each recorded response of served services, by the stream and the number of its request.
    The events in `asked` are those of services that the hardware calls, by the blocks of their requests.
    """

    calls: Mapping[Stream, _Calls]
    asked: Mapping[str, tuple[Stream, _Calls]]
    responses: dict[tuple[Stream, int], bytes] = field(default_factory=dict)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield messages like `Bag`, and each message of the calls once. Raise `InputError` if the bag is damaged."""
        own = {stream.topic for stream, calls in self.calls.items() if calls.stream.topic in topics}
        numbers: dict[Key, int] = {}
        counts: Counter[Stream] = Counter()
        for recorded in super().messages({*topics, *own}, stop):
            calls = self.calls.get(recorded.stream)
            if calls is None:
                yield recorded
                continue
            if (part := calls.events.part_of(recorded)) is None:
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

        `block` is the block of the requests. Requests are recorded from `first` on, and all messages before `stop` (in
        ns).
        """
        stream, calls = self.asked[block]
        waiting: dict[Key, Exchange] = {}
        for recorded in super().messages([stream.topic], stop):
            part = calls.events.part_of(recorded) if recorded.stream == stream else None
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


def _first(exchanges: Mapping[Key, Exchange]) -> Exchange:
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
            streams[made.stream] = made.events.count
        elif made.service.request in asked:
            streams[stream] = count
        else:
            asked[made.service.request] = stream, made
        if made.events.invalid:
            streams[stream] = made.events.invalid
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
            if found := known.types.get(name) or _events_of(service, libraries[service.ros]):
                known.services.append(service)
                known.types[name] = found
                known.events[absolute_name(f"{service.ros_name}/{EVENTS}")] = service
        return known

    def calls(self, bag: Bag, stream: Stream) -> _Calls | None:
        """Return the calls in a stream, or None if it has none. Raise `InputError` if its definition differs."""
        topic, type_ = absolute_name(stream.topic), self.types.get(stream.type)
        if type_ is None:
            return None
        if topic in self.events or topic in self.names.values():
            type_.check(bag, stream)
        elif not type_.fits(stream):
            return None
        service, events = self._service(topic, stream.type), events_in(bag, stream, type_)
        if service is None or events is None:
            return None
        given = self.names[_entering(service)] if topic in self.events else stream.topic
        name = type_.request_name if service.end is ServiceEnd.SERVER else type_.response_name
        return _Calls(service, Stream(given, name, "", ""), events)

    def _service(self, topic: str, event: str) -> Service | None:
        """Return the service of a topic: the one with its name, else the one it is mapped to, else the only one."""
        found = [item for item in self.services if _event_name(item) == event]
        mapped = [item for item in found if self.names[_entering(item)] == topic]
        servers = [item for item in found if item.end is ServiceEnd.SERVER]
        # A topic that could belong to several servers is an error of the routes.
        rest = servers or (found if len(found) == 1 else [])
        return self.events.get(topic) or next(iter(mapped or rest), None)


def _events_of(service: Service, library: MessageLibrary) -> EventType | None:
    """Return the events of a service, or None if its version of ROS has none."""
    interface = library.interface(service.type, InterfaceKind.SERVICE)
    assert interface is not None, "the system could be derived"
    if len(interface.messages) == len(interface.exchanged):
        return None
    return EventType.of(service.type, interface.kind, library.joint_closure(interface.messages))


def _event_name(service: Service) -> str:
    return f"{service.type.package}/{InterfaceKind.SERVICE}/{service.type.name}_Event"


def _entering(service: Service) -> str:
    """Return the block of the messages to the hardware."""
    return service.request if service.end is ServiceEnd.SERVER else service.response
