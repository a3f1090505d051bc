"""Decide what a replay does before it begins: which messages go where, and what is recorded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.bags.goals import BagOfGoals, Told
from fusesoc_firm.runs.bags.routes import Route, renamed, routes_of
from fusesoc_firm.runs.bags.writer import RecordedTopic
from fusesoc_firm.runs.replay.exchanges import asked_actions, ended_in, missing_in, with_exchanges
from fusesoc_firm.runs.replay.hardware_run import published
from fusesoc_firm.runs.replay.options import Source
from fusesoc_firm.runs.simulation.software_run import stimulated
from fusesoc_firm.system.derived.model import Topic, absolute_name
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, fail, nearest


@dataclass(frozen=True)
class Plan:
    """A replay before it begins: the part of a bag, the routes of its streams, and the topics to record by block.

    `ended` are the ids of goals with results in the bag, by the blocks of the actions to which the hardware sends
    goals. `silent` are the topics that have a route and no messages.
    """

    source: Source
    bag: BagOfGoals
    routes: Mapping[Stream, Route]
    topics: Mapping[str, RecordedTopic]
    ended: Mapping[str, set[bytes]]
    silent: Sequence[str]
    warnings: Sequence[Diagnostic]

    @classmethod
    def of(cls, opened: Bag, source: Source, loaded: LoadedSystem, names: Mapping[str, str]) -> Plan:
        """Return the plan for an open bag; `names` renames topics of blocks.

        Raise `InputError` if there is no route, or if the bag and the system do not fit.
        """
        _check_names(names, [item.block for item in (*stimulated(loaded.system), *published(loaded.system))])
        subscribers = renamed(stimulated(loaded.system), names)
        bag = with_exchanges(opened, loaded, subscribers)
        routes = _routes(bag, loaded, subscribers, names)
        ended = ended_in(bag, loaded.system, source.window(bag)[1])
        topics = {item.block: _recorded(item, loaded) for item in renamed(published(loaded.system), names)}
        missing = missing_in(bag, loaded.system, ended)
        return cls(source, bag, routes, topics, ended, _silent(opened, routes), missing)

    @property
    def count(self) -> int:
        """The number of messages to replay, at most."""
        found = sum(count for stream, count in self.bag.streams.items() if stream in self.routes)
        return found if self.source.limit is None else min(found, self.source.limit)

    @property
    def window(self) -> tuple[int, int | None]:
        """The stamps in ns from which on and before which messages are selected."""
        return self.source.window(self.bag)

    def items(self) -> Iterator[Recorded | Told]:
        """Yield the messages to replay, and the bag's records of goals in between."""
        return self.source.items(self.bag, {stream.topic for stream in self.routes})


def _silent(opened: Bag, routes: Iterable[Stream]) -> list[str]:
    """Return the topics with routes that have no messages. Streams from the events of services may be empty."""
    counts = Counter[str]()
    for stream in routes:
        if stream in opened.streams:
            counts[stream.topic] += opened.streams[stream]
    return [topic for topic, count in counts.items() if not count]


def _recorded(topic: Topic, loaded: LoadedSystem) -> RecordedTopic:
    return RecordedTopic.of(topic.name, loaded.libraries[topic.frame.ros].closure(topic.frame.message))


def _check_names(names: Mapping[str, str], blocks: Sequence[str]) -> None:
    faults = Diagnostics()
    for block in names:
        if block not in blocks:
            faults.error(f"the system has no subscriber or publisher '{block}'", hint=nearest(block, blocks))
    faults.raise_if_any()


def _routes(
    bag: BagOfGoals, loaded: LoadedSystem, subscribers: Sequence[Topic], names: Mapping[str, str]
) -> dict[Stream, Route]:
    """Return the route of each stream. Raise `InputError` if there is no route, or if a requested topic is missing."""
    faults = Diagnostics()
    asked = [stream for stream, _ in bag.asked.values()]
    topics = {absolute_name(stream.topic) for stream in (*bag.streams, *asked, *bag.goals)}
    for item in subscribers:
        if item.block in names and item.name not in topics:
            faults.error(f"{bag.path} has no topic {item.name} for '{item.block}'", hint=nearest(item.name, topics))
    faults.raise_if_any()
    # Exclude feedback and results of the hardware's goals, so that no topic with another name replaces them.
    asking = [action for action in asked_actions(loaded.system) if action.goal in bag.blocks_of(action)]
    told = {block for action in asking for block in (action.feedback, action.result)}
    others = [item for item in subscribers if item.block not in told]
    routes = routes_of(bag, others, _signatures(loaded, others))
    if not routes:
        wanted = ", ".join(f"{item.name} ({item.frame.message})" for item in subscribers)
        there = [f"{stream.topic} ({stream.type})" for stream in bag.streams]
        there += [f"{item.topic} ({item.type or 'no type'}: {item.reason})" for item in bag.foreign]
        hint = f"the bag contains {', '.join(there) or 'nothing'}"
        fail(f"{bag.path} contains no topic for the system, which takes {wanted}", hint=hint)
    return routes


def _signatures(loaded: LoadedSystem, topics: Sequence[Topic]) -> dict[tuple[Middleware, MessageName], str]:
    frames = dict.fromkeys((item.frame.ros, item.frame.message) for item in topics)
    return {(ros, name): signature(name, loaded.libraries[ros].closure(name)) for ros, name in frames}
