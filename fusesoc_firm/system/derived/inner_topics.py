"""Topics that a system both publishes and subscribes to: publishers and readers meet within the FPGA.

The messages of a publisher go straight from the blocks that feed the publisher to the blocks that the subscriber feeds,
so neither converter is needed for them. Where the messages of several publishers meet, or where several blocks feed one
input, there is a merge. A subscriber with a queue becomes a queue of messages. In place of wires and a merge, a topic
may pass the exchange.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Names, names_in_use, select, with_names_in_use
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.system.derived.connections import Wiring, cycles_of
from fusesoc_firm.system.derived.joins import joins
from fusesoc_firm.system.derived.model import (
    Connection,
    End,
    InnerTopic,
    Junction,
    LengthSource,
    MessageSide,
    Overflow,
    PayloadLength,
)
from fusesoc_firm.system.derived.queue import MOST_FRAMES
from fusesoc_firm.system.derived.topics import TopicUse
from fusesoc_firm.system.written.specification import (
    BLOCK,
    BOTH,
    FABRIC,
    HOST,
    PUBLISHER,
    SUBSCRIBER,
    WIRED,
    Block,
    Project,
)
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import distinct_identifiers, identifier
from fusesoc_firm.text.yaml_text import Text

Sides = Mapping[str, tuple[MessageSide, ...]]

# The keys that describe frames between a converter and the host.
_KEYS_OF_FRAMES = {
    PUBLISHER: ("max_length", "buffer", "period", "wcet", "deadline"),
    SUBSCRIBER: ("max_length",),
}
_WRITTEN = {"max_length": "maxLength"}
# A block in a cycle may hold its message until its answer is taken, so a queue needs room for both.
_LEAST_IN_CYCLE = 2


@dataclass(frozen=True)
class Met:
    """A system after its publishers and readers have met: without their converters, and with junctions between."""

    blocks: Mapping[str, Block]
    inputs: Sides
    outputs: Sides
    connections: tuple[Connection, ...]
    junctions: tuple[Junction, ...] = ()
    topics: tuple[InnerTopic, ...] = ()

    @property
    def merges(self) -> frozenset[str]:
        """The blocks at which messages of several sources meet."""
        return frozenset(item.block for item in self.junctions if item.sources > 1)


def meet(before: Met, uses: Iterable[TopicUse], wiring: Wiring, project: Project, faults: Diagnostics) -> Met:
    """Return the system in which the publishers and readers of each topic meet within the FPGA; note faults.

    `uses` are all uses of topics. Topics of blocks in software pass the host.
    """
    merged = wiring.merged
    is_sound = not faults.found
    topics = _Topics(before.blocks, before.connections, wiring.software, faults)
    met = _by_topic(uses)
    topics.check_loops(met.values())
    found = tuple(topic for uses_of in met.values() if (topic := topics.topic(uses_of)))
    before = replace(before, topics=found)
    inner = [topic for topic in found if topic.readers]
    # The follow-up faults of a faulty data flow are not reported.
    if not is_sound or not (merged or inner):
        return before
    names = _names_of_junctions(before.blocks, inner, merged)
    meeting = _Meeting(_with_merges(before, merged, names), inner, names, project, faults)
    return meeting.met() if meeting.may_meet() else before


def _by_topic(uses: Iterable[TopicUse]) -> dict[tuple[object, str], list[TopicUse]]:
    """Return the uses of each topic; a relative name differs from an absolute one, since nodes may have a namespace."""
    found: dict[tuple[object, str], list[TopicUse]] = {}
    for use in uses:
        found.setdefault((use.topic.frame.ros, use.topic.ros_name), []).append(use)
    return found


@dataclass(frozen=True)
class _Topics:
    """The blocks of a system, which decide the ways of its topics."""

    blocks: Mapping[str, Block]
    connections: Sequence[Connection]
    software: frozenset[str]
    faults: Diagnostics

    def check_loops(self, topics: Iterable[Sequence[TopicUse]]) -> None:
        """Warn of topics with a relative and an absolute name, which are the same for a node without a namespace."""
        met: dict[tuple[object, str], list[Sequence[TopicUse]]] = {}
        for uses in topics:
            met.setdefault((uses[0].topic.frame.ros, uses[0].topic.name), []).append(uses)
        for name, alike in ((name, alike) for (_, name), alike in met.items() if len(alike) > 1):
            for one, other in permutations(alike, 2):
                giving = [use for use in one if use.is_published]
                taking = [use for use in other if not use.is_published]
                if giving and taking:
                    self._warn(name, giving[0], taking[0])

    def topic(self, uses: Sequence[TopicUse]) -> InnerTopic | None:
        """Return the ways of a topic that the system both publishes and subscribes to, else None; note faults."""
        name = uses[0].topic.name
        giving, taking = ([use for use in uses if use.is_published is side] for side in (True, False))
        if not giving or not taking:
            self._check_alone(name, uses)
            return None
        publishers = [use.topic.block for use in giving if self._is_inner(use)]
        readers = [use.topic.block for use in taking if self._is_inner(use)]
        if not publishers or not readers or len({use.topic.frame.message for use in uses}) > 1:
            return self._by_host(name, giving, taking)
        to_host = [item for item in publishers if self.blocks[item].deliver != FABRIC]
        from_host = [item for item in readers if self.blocks[item].deliver == BOTH]
        for block in publishers:
            if block not in to_host:
                self._check_keys(block, PUBLISHER)
        for block in readers:
            self._check_reader(block, is_inner=block not in from_host)
        topic = InnerTopic(name, tuple(publishers), tuple(readers), tuple(to_host), tuple(from_host))
        self._check_echo(topic, giving, taking)
        return topic

    def _is_inner(self, use: TopicUse) -> bool:
        block = self.blocks.get(use.topic.block)
        return block is not None and block.type is None and block.deliver != HOST and not self._is_software(use)

    def _is_software(self, use: TopicUse) -> bool:
        """Whether a block in software is at the other end of a converter's connections, or the use is such a block."""
        name = use.topic.block
        block = self.blocks.get(name)
        if block is None or block.type is not None:
            return True
        ends = {
            end.block
            for item in self.connections
            for pair in ((item.source, sink) for sink in item.sinks)
            if name in {end.block for end in pair}
            for end in pair
        }
        return not self.software.isdisjoint(ends)

    def _check_alone(self, name: str, uses: Iterable[TopicUse]) -> None:
        for use in uses:
            block = self.blocks.get(use.topic.block)
            if block is not None and block.type is None and block.deliver in (FABRIC, BOTH):
                word = "subscribes to" if use.is_published else "publishes on"
                message = (
                    f"'{block.name}' has 'deliver: {block.deliver}', but no block of the system {word} topic {name}"
                )
                self.faults.error(message, block.place("deliver"), "remove the key, or correct the topic")

    def _by_host(self, name: str, giving: Sequence[TopicUse], taking: Sequence[TopicUse]) -> InnerTopic:
        """Return a topic whose messages all pass the host; warn unless the specification says so."""
        reason = "'deliver: host'"
        if any(map(self._is_software, (*giving, *taking))):
            reason = "one of its blocks is connected to software"
            for use in (*giving, *taking):
                block = self.blocks.get(use.topic.block)
                if block is not None and block.type is None and block.deliver in (FABRIC, BOTH):
                    hint = "remove the key: messages of software pass the host"
                    message = f"'{block.name}' cannot have 'deliver: {block.deliver}': {reason}"
                    self.faults.error(message, block.place("deliver"), hint)
            self._warn(name, giving[0], taking[0])
        return InnerTopic(name, reason=reason)

    def _warn(self, name: str, giving: TopicUse, taking: TopicUse) -> None:
        message = f"'{giving.topic.block}' publishes on topic {name}, to which '{taking.topic.block}' subscribes"
        self.faults.warn(message, giving.source, "the system would receive its own messages")

    def _check_echo(self, topic: InnerTopic, giving: Sequence[TopicUse], taking: Sequence[TopicUse]) -> None:
        """Note readers that would receive a message both within the FPGA and from the host."""
        sent = [use for use in giving if use.topic.block not in topic.publishers or use.topic.block in topic.to_host]
        for reader in topic.from_host:
            if topic.to_host:
                block = self.blocks[reader]
                self.faults.error(
                    f"'{reader}' would receive each message of '{topic.to_host[0]}' twice: within the FPGA and from the"
                    " host",
                    block.place("deliver"),
                    f"add 'deliver: fabric' to '{topic.to_host[0]}', or 'deliver: host' to '{reader}'",
                )
        outer = [use for use in taking if use.topic.block not in topic.readers]
        if sent and outer and all(self._written(use) != HOST for use in (*sent, *outer)):
            self._warn(topic.name, sent[0], outer[0])

    def _written(self, use: TopicUse) -> str | None:
        block = self.blocks.get(use.topic.block)
        return None if block is None else block.deliver

    def _check_reader(self, name: str, *, is_inner: bool) -> None:
        block = self.blocks[name]
        if is_inner:
            self._check_keys(name, SUBSCRIBER)
        if block.overflow not in (None, BLOCK) and not _depth_of(block):
            message = f"'{name}' drops messages, but has no 'queue'"
            self.faults.error(message, block.place("overflow"), "add 'queue: <number of messages>'")

    def _check_keys(self, name: str, mode: str) -> None:
        """Note keys that describe frames of the host, if there are none."""
        block = self.blocks[name]
        for key in _KEYS_OF_FRAMES[mode]:
            if getattr(block, key) is not None:
                word = _WRITTEN.get(key, key)
                message = f"'{word}' has no effect: the messages of '{name}' stay within the FPGA"
                self.faults.error(message, block.place(key), "remove the key, or add 'deliver: both'")


def _depth_of(block: Block) -> int:
    """Return the messages in the queue of a reader within the FPGA: `queue`, or else the depth in `qos`, or 0."""
    if block.queue is not None:
        return block.queue
    return block.qos.depth or 0 if block.qos else 0


# The key of a junction: the kind, and the input, the number of the topic, or the reader.
_Key = tuple[str, End | int | str]


def _names_of_junctions(
    blocks: Mapping[str, Block], topics: Sequence[InnerTopic], merged: Collection[End]
) -> dict[_Key, str]:
    """Return a name for each possible junction, which differs from all names of blocks."""
    words: dict[_Key, tuple[str, ...]] = {
        ("input", end): (end.block, end.prefix.rstrip("_"), "merge") for end in sorted(merged, key=str)
    }
    for number, topic in enumerate(topics):
        for kind in ("merge", "exchange"):
            words[kind, number] = (*topic.name.strip("/").split("/"), kind)
        words |= {(kind, reader): (reader, kind) for reader in topic.readers for kind in ("merge", "queue")}
    taken = [identifier(name) for name in blocks]
    return dict(zip(words, distinct_identifiers(words.values(), taken), strict=True))


def _with_merges(before: Met, merged: Collection[End], names: Mapping[_Key, str]) -> Met:
    """Return the system with a merge before each input that several blocks feed."""
    ways = {item.source: dict(zip(item.sinks, item.frames, strict=True)) for item in before.connections}
    junctions = []
    for sink in sorted(merged, key=str):
        sources = [source for source, sinks in ways.items() if sink in sinks]
        name = names["input", sink]
        frame = ways[sources[0]][sink]
        for number, source in enumerate(sources):
            ways[source] = {
                End(name, f"in{number}_") if end == sink else end: given for end, given in ways[source].items()
            }
        junction = Junction(name, frame, sources=len(sources))
        ways[End(name, junction.output.prefix)] = {sink: frame}
        junctions.append(junction)
    connections = tuple(Connection(source, tuple(sinks), tuple(sinks.values())) for source, sinks in ways.items())
    return _with_junctions(replace(before, connections=connections), junctions)


def _with_junctions(before: Met, junctions: Sequence[Junction]) -> Met:
    """Return the system with these junctions as blocks."""
    return replace(
        before,
        blocks={**before.blocks, **{item.block: _block(item, before.blocks) for item in junctions}},
        inputs={**before.inputs, **{item.block: item.inputs for item in junctions}},
        outputs={**before.outputs, **{item.block: item.outputs for item in junctions}},
        junctions=tuple(junctions),
    )


@dataclass(frozen=True)
class _Source:
    """The source of a message, or of a part of it, with the fields that it provides, and its `topic` if it has one."""

    end: End
    names: frozenset[Names]
    topic: str = ""


@dataclass
class _Meeting:
    """The connections of a system, which are replaced by those without converters of inner topics."""

    before: Met
    topics: Sequence[InnerTopic]
    names: Mapping[_Key, str]
    project: Project
    faults: Diagnostics
    junctions: dict[str, Junction] = field(default_factory=dict)
    # For each reader behind a junction, the output of the junction.
    outlets: dict[str, _Source] = field(default_factory=dict)
    links: dict[End, dict[End, frozenset[Names]]] = field(default_factory=dict)
    # The links that are topics, by the names of the topics.
    wires: dict[str, list[tuple[End, End]]] = field(default_factory=dict)

    @cached_property
    def _topic_of(self) -> dict[str, InnerTopic]:
        return {reader: topic for topic in self.topics for reader in topic.readers}

    @cached_property
    def _removed(self) -> set[str]:
        """The converters that do not remain."""
        return {
            name
            for topic in self.topics
            for names, kept in ((topic.publishers, topic.to_host), (topic.readers, topic.from_host))
            for name in names
            if name not in kept
        }

    @cached_property
    def _exchanged(self) -> frozenset[str]:
        """The names of the topics that pass the exchange; strings and arrays are streams, which need few wires."""
        if self.project.fabric in WIRED:
            return frozenset()
        return frozenset(
            topic.name for topic in self.topics if self.before.outputs[topic.readers[0]][0].frame.is_fixed_size
        )

    def _has_merge(self, topic: InnerTopic, reader: str) -> bool:
        """Whether all publishers of a topic must provide the same fields to a reader."""
        return len(topic.publishers) > 1 or reader in topic.from_host or topic.name in self._exchanged

    # --- may they meet? --------------------------------------------------------------------------------------------

    def may_meet(self) -> bool:
        """Return whether no messages wait for each other and all readers get their fields; note faults otherwise."""
        count = len(self.faults.found)
        self._check_cycles()
        for topic in self.topics:
            for reader in topic.readers:
                self._check_fields(topic, reader)
                self._check_queue(reader)
        return len(self.faults.found) == count

    def _check_cycles(self) -> None:
        blocks = self.before.blocks
        graph: dict[str, list[str]] = {}
        for connection in self.before.connections:
            for sink in connection.sinks:
                graph.setdefault(sink.block, []).append(connection.source.block)
        for topic in self.topics:
            for reader in topic.readers:
                if _depth_of(blocks[reader]) < _LEAST_IN_CYCLE:
                    graph.setdefault(reader, []).extend(topic.publishers)
        for way in cycles_of(graph, list(blocks)):
            places = [name for name in way if name in self._topic_of]
            if not places:
                continue
            reader = places[0]
            giving = way[way.index(reader, 1) - 1]
            self.faults.error(
                f"these blocks wait for each other: {' -> '.join(way)}",
                blocks[reader].name.source,
                f"add 'queue: {_LEAST_IN_CYCLE}' or more to '{reader}', or 'deliver: host' to '{giving}'",
            )

    def _check_fields(self, topic: InnerTopic, reader: str) -> None:
        """Note fields that a publisher does not provide; a publisher behind a reader sends defaults for them.

        Where messages of several sources meet, all of them have the same fields.
        """
        needed = self._needs(reader)
        required = needed if self._has_merge(topic, reader) else self._needs(reader, only_accelerators=True)
        for publisher in topic.publishers:
            given = self._given(publisher)
            if missing := sorted(required - given if needed & given else needed):
                self.faults.error(
                    f"'{publisher}' has no source for {', '.join(map(dotted, missing))}, which blocks take from"
                    f" '{reader}'",
                    self.before.blocks[publisher].name.source,
                    f"connect these fields to '{publisher}', or add 'deliver: host' to one of the two",
                )

    def _check_queue(self, reader: str) -> None:
        block = self.before.blocks[reader]
        depth = _depth_of(block)
        if not depth:
            return
        frame = self.before.outputs[reader][0].frame
        place = block.place("queue") if block.queue is not None else block.qos.place("depth") if block.qos else None
        word = "queue" if block.queue is not None else "depth"
        least = 2 if block.overflow == Overflow.DROP_OLDEST.value else 1
        if not frame.is_fixed_size:
            if block.queue is not None:
                message = f"'{reader}' cannot have a queue: {frame.message} has no fixed size"
                hint = "a queue within the FPGA stores messages of fixed size; remove the key, or add 'deliver: host'"
                self.faults.error(message, place, hint)
        elif not least <= depth <= MOST_FRAMES:
            hint = f"legal here: {least} to {MOST_FRAMES}, for messages that stay within the FPGA"
            self.faults.error(f"'{reader}' cannot have '{word}: {depth}'", place, hint)

    # --- the data flow -----------------------------------------------------------------------------------------------

    def met(self) -> Met:
        """Return the system with junctions, and without the converters of messages that stay within the FPGA."""
        self.junctions = {item.block: item for item in self.before.junctions}
        for number, topic in enumerate(self.topics):
            self._make_outlets(topic, number)
        for number, topic in enumerate(self.topics):
            self._feed_junctions(topic, number)
        for connection in self.before.connections:
            for sink, frame in zip(connection.sinks, connection.frames, strict=True):
                if sink.block not in self._removed:
                    self._link(_Source(connection.source, _names(frame)), sink)
        blocks = {name: self._kept(block) for name, block in self.before.blocks.items() if name not in self._removed}
        junctions = [self._with_length(item) for item in self.junctions.values()]
        topics = tuple(replace(item, wires=tuple(self.wires.get(item.name, ()))) for item in self.before.topics)
        after = replace(self.before, blocks=blocks, connections=self._connections(), topics=topics)
        self._warn_of_joins(after)
        return _with_junctions(after, junctions)

    def _kept(self, block: Block) -> Block:
        """Return a block that remains; the queue of a reader is after the merge with the host's messages."""
        is_queued = ("queue", str(block.name)) in self.names and self.names["queue", str(block.name)] in self.junctions
        return replace(block, queue=None, overflow=None) if is_queued else block

    def _warn_of_joins(self, after: Met) -> None:
        """Warn of messages that reach a block on two ways, if the shorter one is a topic without a queue.

        With a merge on one of the ways, the other one may need a message that the merge does not forward yet.
        """
        topics = {sink: topic for topic in after.topics for _, sink in topic.wires}
        merges = {item.block for item in self.junctions.values() if item.sources > 1}
        for join in joins(after.connections, merges):
            shorter, longer = (" -> ".join(way) for way in (join.shorter, join.longer))
            message = f"messages take two ways: {shorter} and {longer}"
            if join.has_merge:
                place = self.before.blocks[join.shorter[-1]].name.source
                self.faults.warn(message, place, f"'{join.shorter[-1]}' waits for ever if it needs both of one message")
            elif topic := topics.get(join.sink):
                reader = next(name for name in topic.readers if join.sink in self._sinks(name))
                hint = "they stop if a block between takes a further message before it answers; add 'queue' to"
                self.faults.warn(message, self.before.blocks[reader].name.source, f"{hint} '{reader}'")

    def _sinks(self, reader: str) -> set[End]:
        return {sink for item in self.before.connections if item.source.block == reader for sink in item.sinks}

    def _make_outlets(self, topic: InnerTopic, number: int) -> None:
        """Make the junctions of a topic, and note for each reader behind one the output from which it receives."""
        outlets: Sequence[_Source | None] = [None] * len(topic.readers)
        if topic.name in self._exchanged:
            outlets = self._outlets(self._exchange(topic, self.names["exchange", number]))
        elif len(topic.publishers) > 1:
            junction = self._junction(self.names["merge", number], topic, topic.readers)
            outlets = [self._make(replace(junction, sources=len(topic.publishers)))] * len(topic.readers)
        for reader, outlet in zip(topic.readers, outlets, strict=True):
            if found := self._make_outlet(topic, reader, outlet):
                self.outlets[reader] = found

    def _make_outlet(self, topic: InnerTopic, reader: str, outlet: _Source | None) -> _Source | None:
        """Make the junctions of a reader after `outlet`, and return its output."""
        block = self.before.blocks[reader]
        if reader in topic.from_host:
            outlet = self._make(replace(self._junction(self.names["merge", reader], topic, [reader]), sources=2))
        frame = self.before.outputs[reader][0].frame
        if frame.is_fixed_size and (depth := _depth_of(block)):
            junction = self._junction(self.names["queue", reader], topic, [reader])
            outlet = self._make(replace(junction, depth=depth, overflow=Overflow(str(block.overflow or BLOCK))))
        return outlet

    def _junction(self, name: str, topic: InnerTopic, readers: Sequence[str]) -> Junction:
        """Return a junction for the fields that blocks take from the readers, if the publishers provide them."""
        needed = frozenset[Names]().union(*map(self._needs, readers))
        names = needed.intersection(*map(self._given, topic.publishers))
        frame = self.before.outputs[topic.readers[0]][0].frame
        return Junction(name, with_names_in_use(select(frame), names), topic.name)

    def _exchange(self, topic: InnerTopic, name: str) -> Junction:
        """Return the topic as a part of the exchange, with an output for each reader."""
        junction = self._junction(name, topic, topic.readers)
        return replace(junction, sources=len(topic.publishers), readers=len(topic.readers))

    def _make(self, junction: Junction) -> _Source:
        return self._outlets(junction)[0]

    def _outlets(self, junction: Junction) -> list[_Source]:
        """Make a junction, and return its outputs."""
        self.junctions[junction.block] = junction
        return self._outputs(junction.block)

    def _feed_junctions(self, topic: InnerTopic, number: int) -> None:
        """Connect the publishers with the junctions of a topic, and these with each other."""
        given = [self._feeds(topic.publishers[0])] * len(topic.readers)
        names = [self.names[kind, number] for kind in ("merge", "exchange")]
        for name in (item for item in names if item in self.junctions):
            junction = self.junctions[name]
            for side, publisher in zip(junction.inputs, topic.publishers, strict=True):
                self._link_all(self._feeds(publisher), End(name, side.prefix))
            outputs = self._outputs(name)
            given = [[item] for item in (outputs if junction.is_exchanged else outputs * len(topic.readers))]
        for reader, feeds in zip(topic.readers, given, strict=True):
            sources = feeds
            merge, queue = self.names["merge", reader], self.names["queue", reader]
            if merge in self.junctions:
                self._link_all(sources, End(merge, "in0_"))
                self._link_end(End(reader), self._needs(reader), End(merge, "in1_"))
                sources = self._outputs(merge)
            if queue in self.junctions:
                self._link_all(sources, End(queue, "in_"))

    def _outputs(self, name: str) -> list[_Source]:
        junction = self.junctions[name]
        return [_Source(End(name, side.prefix), _names(junction.frame)) for side in junction.outputs]

    def _link_all(self, sources: Iterable[_Source], sink: End) -> None:
        for source in sources:
            self._link(source, sink)

    # --- sources ---------------------------------------------------------------------------------------------------

    def _needs(self, reader: str, *, only_accelerators: bool = False) -> frozenset[Names]:
        """Return the fields that blocks, or only accelerators and junctions, take from a reader."""
        return frozenset[Names]().union(
            *(
                _names(frame)
                for item in self.before.connections
                if item.source.block == reader
                for sink, frame in zip(item.sinks, item.frames, strict=True)
                if not only_accelerators or self.before.blocks[sink.block].type is not None
            )
        )

    def _given(self, publisher: str, behind: frozenset[str] = frozenset()) -> frozenset[Names]:
        """Return the fields that a publisher's sources provide; the topics of `behind` are already on the way."""
        found: set[Names] = set()
        for source in self._feeds(publisher):
            topic = self._topic_of.get(source.end.block)
            if topic is None or topic.name in behind:
                found |= source.names
            else:
                given = (self._given(item, behind | {topic.name}) for item in topic.publishers)
                found |= source.names.intersection(*given)
        return frozenset(found)

    def _feeds(self, publisher: str) -> list[_Source]:
        """Return the sources of a publisher's message."""
        return [
            _Source(item.source, _names(frame))
            for item in self.before.connections
            for sink, frame in zip(item.sinks, item.frames, strict=True)
            if sink.block == publisher
        ]

    def _resolved(self, source: _Source) -> Iterator[_Source]:
        """Yield the actual sources of a message: those of the publishers, for a reader without a junction."""
        reader = source.end.block
        if reader not in self._topic_of:
            yield source
        elif reader in self.outlets:
            outlet = self.outlets[reader]
            yield replace(outlet, names=outlet.names & source.names)
        else:
            topic = self._topic_of[reader]
            for given in self._feeds(topic.publishers[0]):
                yield from self._resolved(_Source(given.end, given.names & source.names, topic.name))

    def _link(self, source: _Source, sink: End) -> None:
        junction = self.junctions.get(sink.block)
        wanted = _names(junction.frame) if junction else source.names
        for actual in self._resolved(source):
            if names := actual.names & wanted:
                self._link_end(actual.end, names, sink)
                if actual.topic:
                    self.wires.setdefault(actual.topic, []).append((actual.end, sink))

    def _link_end(self, source: End, names: frozenset[Names], sink: End) -> None:
        sinks = self.links.setdefault(source, {})
        sinks[sink] = sinks.get(sink, frozenset()) | names

    def _side(self, end: End) -> MessageSide:
        if end.block in self.junctions:
            return self.junctions[end.block].output
        (side,) = (side for side in self.before.outputs[end.block] if side.prefix == end.prefix)
        return side

    def _connections(self) -> tuple[Connection, ...]:
        """Return the connections, those of the specification's blocks first."""
        known = [item.source for item in self.before.connections]
        order = sorted(self.links, key=lambda end: known.index(end) if end in known else len(known))
        return tuple(
            Connection(
                source,
                tuple(self.links[source]),
                tuple(with_names_in_use(self._side(source).frame, names) for names in self.links[source].values()),
            )
            for source in order
            if self.links[source]
        )

    # --- lengths ---------------------------------------------------------------------------------------------------

    def _with_length(self, junction: Junction) -> Junction:
        """Return a junction with the source of its payloads' lengths, if they vary."""
        if junction.frame.is_fixed_size:
            return junction
        if self._is_counted(End(junction.block, junction.output.prefix)):
            length = PayloadLength(LengthSource.BUFFERED, "a source of the merge does not provide its length")
        else:
            length = PayloadLength(LengthSource.GIVEN, "all sources of the merge provide their lengths")
        return replace(junction, length=length)

    def _is_counted(self, end: End) -> bool:
        """Return whether the length of a source's payloads must be counted."""
        if end.block in self.junctions:
            sources = [source for source, sinks in self.links.items() if end.block in {sink.block for sink in sinks}]
            return any(map(self._is_counted, sources))
        side = self._side(end)
        if end.prefix:
            return side.length is not None and side.length.source is LengthSource.BUFFERED
        given = frozenset[Names]().union(*self.links[end].values())
        return given != names_in_use(select(side.frame))


def _names(frame: Frame) -> frozenset[Names]:
    return names_in_use(frame) if frame.names else frozenset({()})


def _block(junction: Junction, blocks: Mapping[str, Block]) -> Block:
    """Return the junction as a block of the data flow."""
    first = next(iter(blocks.values()))
    return Block(name=Text(junction.block, first.name.source), source=first.source, type=Text("junction"))
