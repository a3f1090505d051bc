"""Route the messages of a bag: each topic to the subscribers of a system."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from fusesoc_firm.frame.codec import CodecError, decode, trimmed
from fusesoc_firm.message.bag_reader import BAGS, Bag, Stream, open_bag
from fusesoc_firm.message.joint import signature_of_text
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.bags.calls import with_calls
from fusesoc_firm.runs.bags.goals import with_goals
from fusesoc_firm.system.derived.model import DerivedSystem, Topic, absolute_name
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, fail

AnyTopic = TypeVar("AnyTopic", bound=Topic)
Message = tuple[Middleware, MessageName]


@dataclass(frozen=True)
class Route:
    """A stream's subscribers and, if they cannot accept the stream's messages, the reason."""

    subscribers: tuple[Topic, ...]
    misfit: str = ""


def renamed(topics: Iterable[AnyTopic], names: Mapping[str, str]) -> list[AnyTopic]:
    """Return the topics, with the topics of the blocks in `names` renamed."""
    return [replace(item, given_name=names.get(item.block, item.given_name)) for item in topics]


def routes_of(
    bag: Bag, subscribers: Sequence[Topic], signatures: Mapping[Message, str] | None = None
) -> dict[Stream, Route]:
    """Return the routes by stream; either all streams of a topic have a route, or none of them.

    A topic is routed to all subscribers with the same topic name. A subscriber whose topic is not in the bag receives
    the only topic of its type, if no other subscriber without a topic has this type. `signatures` contains the known
    signatures of the system's messages. Raise `InputError` with every incompatible topic.
    """
    return _Routing(bag, subscribers, signatures or {}).routes()


@dataclass
class _Routing:
    """The computation of routes from a bag's streams and a system's subscribers."""

    bag: Bag
    subscribers: Sequence[Topic]
    signatures: Mapping[Message, str]
    faults: Diagnostics = field(default_factory=Diagnostics)

    def routes(self) -> dict[Stream, Route]:
        takers = {stream.topic: self._named(stream.topic) for stream in self.bag.streams}
        named = {item.block for items in takers.values() for item in items}
        for item in self.subscribers:
            if item.block not in named and (topic := self._only_topic(item, takers)):
                takers[topic] = (item,)
        self._check_versions(takers)
        self._check_foreign(takers)
        self.faults.raise_if_any()
        return {
            stream: Route(takers[stream.topic], self._misfit(stream, takers[stream.topic]))
            for stream in self.bag.streams
            if takers[stream.topic]
        }

    def _named(self, topic: str) -> tuple[Topic, ...]:
        return tuple(item for item in self.subscribers if item.name == absolute_name(topic))

    def _only_topic(self, subscriber: Topic, takers: Mapping[str, Sequence[Topic]]) -> str:
        """Return the only topic that fits a subscriber whose name is not in the bag.

        Return an empty string if there is not exactly one such topic.
        """
        streams = self.bag.streams
        topics = [item.topic for item in streams if not takers[item.topic] and self._fits(item, subscriber)]
        rivals = [item for item in self.subscribers if _meant(item) == _meant(subscriber)]
        found = list(dict.fromkeys(topics))
        if len(found) == len(rivals) == 1:
            return found[0]
        names = ", ".join(item.block for item in rivals)
        hint = "give the topic the name of one of these blocks, or add the key 'topic' to one of them"
        if len(rivals) > 1:
            for topic in found:
                self.faults.error(f"topic {topic} in {self.bag.path} could go to several blocks: {names}", hint=hint)
        elif found:
            self.faults.error(f"several topics in {self.bag.path} could go to {names}: {', '.join(found)}", hint=hint)
        return ""

    def _fits(self, stream: Stream, subscriber: Topic) -> bool:
        return self._is_of(stream, subscriber) and self.bag.form.ros == subscriber.frame.ros

    def _is_of(self, stream: Stream, subscriber: Topic) -> bool:
        """Return whether the messages of a stream and a subscriber have the same name, in either ROS version."""
        name = _message(stream)
        return name is not None and _present(name, self.bag.form.ros) == _meant(subscriber)

    def _check_versions(self, takers: Mapping[str, Sequence[Topic]]) -> None:
        """Add a fault for each topic whose message the system accepts only from the other ROS version."""
        ros = self.bag.form.ros
        for stream in self.bag.streams:
            fitting = [item for item in self.subscribers if self._is_of(stream, item)]
            wrong = [item for item in takers[stream.topic] or fitting if item.frame.ros != ros]
            if wrong and not any(item.frame.ros == ros for item in fitting):
                versions = f"uses {ros.title}, but '{wrong[0].block}' uses {wrong[0].frame.ros.title}"
                self.faults.error(f"topic {stream.topic} in {self.bag.path} {versions}")

    def _check_foreign(self, takers: Mapping[str, Sequence[Topic]]) -> None:
        """Add a fault for each foreign channel whose topic only a subscriber has."""
        for item in self.bag.foreign:
            for subscriber in self._named(item.topic) if item.topic not in takers else ():
                message = f"topic {item.topic} in {self.bag.path} cannot go to '{subscriber.block}': {item.reason}"
                self.faults.error(message, hint="record it with ROS, or give the block another topic")

    def _misfit(self, stream: Stream, subscribers: Sequence[Topic]) -> str:
        """Return the reason why subscribers cannot accept a stream with their topic's name, or an empty string."""
        for item in subscribers:
            wanted = item.frame.message
            if not self._is_of(stream, item):
                return f"its type is {_spelled(stream)}, but '{item.block}' takes {wanted}"
            if item.frame.ros != self.bag.form.ros:
                return f"it uses {self.bag.form.ros.title}, but '{item.block}' uses {item.frame.ros.title}"
            ours, theirs = self.signatures.get((item.frame.ros, wanted)), self._signatures(stream, wanted)
            if ours and theirs and ours not in theirs:
                return f"its definition of {wanted} differs from the one of '{item.block}': {theirs[0]}, not {ours}"
        return ""

    def _signatures(self, stream: Stream, message: MessageName) -> list[str]:
        """Return a message's signatures in the bag: the recorded one and, since it may be wrong, the definition's."""
        said = [stream.signature] if _is_signature(stream.signature) else []
        if stream.definition and (defined := signature_of_text(message, stream.definition, self.bag.form.ros)):
            said.append(defined)
        return said


def _message(stream: Stream) -> MessageName | None:
    """Return the name of a stream's message, or None if a specification cannot contain this name."""
    try:
        return parse_name(stream.type)
    except InputError:
        return None


def _meant(topic: Topic) -> MessageName:
    return _present(topic.frame.message, topic.frame.ros)


def _present(name: MessageName, ros: Middleware) -> MessageName:
    """Return the current name of a message that may have been renamed."""
    return ros.aliases.get(name, name)


def _spelled(stream: Stream) -> str:
    return str(_message(stream) or stream.type)


def _is_signature(text: str) -> bool:
    """Return whether a text is a signature.

    ROS 1 uses `*` for any message, and old ROS 2 bags contain no signatures.
    """
    return text.startswith("RIHS01_") or re.fullmatch(r"[0-9a-f]{32}", text) is not None


def read_bag(
    path: Path,
    subscribers: Sequence[Topic],
    hint: str = BAGS,
    system: DerivedSystem | None = None,
    libraries: Mapping[Middleware, MessageLibrary] | None = None,
) -> Iterator[tuple[Topic, bytes, dict[str, Any]]]:
    """Yield the subscriber, payload and decoded value of each routed message in chronological order.

    The calls of services of `system`, and the goals and cancellations of its actions, are messages, too. May raise
    `InputError`.
    """
    with open_bag(path, hint) as opened:
        names = {item.block: item.name for item in subscribers}
        services, actions = (system.services, system.actions) if system else ((), ())
        calls = with_calls(opened, services, libraries or {}, names, plays_responses=True)
        bag = with_goals(calls, actions, libraries or {}, names, compares=False)
        routes = routes_of(bag, subscribers)
        for stream, route in routes.items():
            if route.misfit:
                fail(f"topic {stream.topic} in {path}: {route.misfit}")
        for recorded in bag.messages({stream.topic for stream in routes}):
            for subscriber in routes[recorded.stream].subscribers:
                try:
                    message = decode(subscriber.frame, recorded.payload)
                except CodecError as error:
                    fail(f"{path}, topic {recorded.stream.topic}: {error}")
                yield subscriber, trimmed(subscriber.frame, recorded.payload), message
