"""The reference of a node in fabric: what it sends, and when, as a model that the hardware's control is compared with.

All tables have a fixed size, and time is an input, in milliseconds. A sample is never kept for another one: a reliable
reader takes its samples in order, and asks for what it lacks. Of the samples that one request asks for, only the last
carries a heartbeat, and a request is repeated only after a while. Otherwise each sample would cause a further request
for many samples, and a network that loses packets would be flooded. A peer may answer a request in one datagram, which
needs fragments if the answer is long. Thus few announcements are asked for at once, and what was asked for and has not
come is asked for alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from operator import attrgetter

from fusesoc_firm.fabric import rtps
from fusesoc_firm.fabric.node import Endpoint, Node
from fusesoc_firm.fabric.rtps import (
    PUBLICATIONS_WRITER,
    SUBSCRIPTIONS_WRITER,
    Durability,
    Parameter,
    Reliability,
)
from tests.fabric.messages import (
    AckNack,
    Address,
    Data,
    DataFrag,
    Gap,
    Heartbeat,
    HeartbeatFrag,
    InfoDestination,
    NackFrag,
    Numbers,
    ParameterList,
    Submessage,
    Writer,
    parse,
)
from tests.fabric.participant_tables import (
    DISCOVERY,
    LARGEST,
    Assembly,
    History,
    Limits,
    Peer,
    Sink,
    Source,
    free_slot,
)

FIRST_ANNOUNCEMENTS, SOON, LATER = 5, 100, 3000
# A farewell, in case peers know an earlier life of the node, and the announcements that follow it.
AFTER_FAREWELL = 200
DISCOVERY_REQUEST, DISCOVERY_HEARTBEAT = 200, 500
# A writer that has written nothing may not answer.
USER_REQUEST, UNHEARD_REQUEST, USER_HEARTBEAT = 20, 500, 100
# A request that is repeated waits for twice as long as the one before, up to this.
LONGEST_REQUEST = 320
ASSEMBLY = 1000
MOST_REQUESTED = 8
FRAGMENT_BYTES = 1344
# A sample with a larger number is not taken.
NUMBER_BITS = 48
XCDR1 = 0


class Participant:
    """A node; `take` is called with each sample for a reader, in order.

    What it sends is in `outbox`, as addresses and packets. `counts` tells what was refused, and why.
    """

    def __init__(self, node: Node, take: Callable[[Endpoint, bytes], None], limits: Limits = LARGEST) -> None:
        self.node, self._take, self._limits = node, take, limits
        self.outbox: list[tuple[Address, bytes]] = []
        self.counts: Counter[str] = Counter()
        self.peers: dict[bytes, Peer] = {}
        self.sources: list[Source] = []
        self.sinks: list[Sink] = []
        self.assembly: Assembly | None = None
        # Of this packet: the sample that was put together, the bytes for payloads, whether a sample found none, and
        # whether one is too long.
        self._assembled: tuple[Source, int] | None = None
        self._room = 0
        self._has_lost = self._has_skipped = False
        self.histories = {item.entity: History(item) for item in node.writers}
        self._announced = {
            PUBLICATIONS_WRITER: [node.endpoint_data(item) for item in node.writers],
            SUBSCRIPTIONS_WRITER: [node.endpoint_data(item) for item in node.readers],
        }
        self._group = Address(rtps.MULTICAST, rtps.multicast_port(node.network.domain))
        self._writer = Writer()
        self._started = 0
        self._seconds = 0
        self._announcements = 0
        self._next_announcement = 0
        self._count = 0
        self._now = 0

    # --- life ------------------------------------------------------------------------------------------------------

    def start(self, now: int) -> None:
        """End an earlier life of the node, whose GUID is the same, and begin."""
        self._now = self._started = now
        self.leave()
        self._next_announcement = now + AFTER_FAREWELL
        graph = self.node.writers[0]
        self.histories[graph.entity].add(self.node.graph)

    def leave(self) -> None:
        """Tell all that the node ends."""
        inline, key = self.node.farewell
        ending = Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 2, key, tuple(inline.items()), is_key=True)
        for address in (self._group, *(peer.metatraffic for peer in self.peers.values())):
            self._send(address, ending)

    def publish(self, endpoint: Endpoint, payload: bytes, now: int) -> None:
        """Send a sample."""
        self._now = now
        history = self.histories[endpoint.entity]
        history.add(payload)
        for sink in self.sinks:
            if sink.history is history:
                self._send_sample(sink, history.number)

    def tick(self, now: int) -> None:
        """Do what is due; there may be several milliseconds since the last time."""
        self._now = now
        if now >= self._next_announcement:
            self._announcements += 1
            self._next_announcement += SOON if self._announcements < FIRST_ANNOUNCEMENTS else LATER
            self._announce(self._group)
        passed = (now - self._started) // 1000 - self._seconds
        self._seconds += passed
        for peer in sorted(self.peers.values(), key=attrgetter("slot")):
            peer.left -= passed
            if peer.left <= 0:
                self.counts["leases that ended"] += 1
                self._forget(peer)
            else:
                self._tick_peer(peer)
        if self.assembly and now - self.assembly.touched >= ASSEMBLY:
            self.assembly = None
        for source in self.sources:
            self._tick_source(source)
        for sink in self.sinks:
            if sink.is_reliable and sink.is_behind and now >= sink.next_heartbeat:
                self._send_heartbeat(sink)

    def _tick_peer(self, peer: Peer) -> None:
        if self._now >= peer.next_request:
            peer.next_request = self._now + DISCOVERY_REQUEST
            if not any(window.is_heard for window in peer.windows.values()):
                self._announce(peer.metatraffic)
            for writer, window in peer.windows.items():
                if not window.is_heard or window.is_behind:
                    self._request_discovery(peer, writer)
        if self._now >= peer.next_heartbeat:
            peer.next_heartbeat = self._now + DISCOVERY_HEARTBEAT
            for writer in DISCOVERY:
                if writer not in peer.acknowledged:
                    self._send_to(peer, peer.metatraffic, self._discovery_heartbeat(writer))

    def _tick_source(self, source: Source) -> None:
        is_behind = not source.is_heard or source.last >= source.expected
        if source.is_reliable and is_behind and self._now >= source.next_request:
            self._request(source)

    # --- sending ---------------------------------------------------------------------------------------------------

    def _send(self, address: Address, *items: Submessage) -> None:
        self.outbox.append((address, self._writer.message(self.node.prefix, *items)))

    def _send_to(self, peer: Peer, address: Address, *items: Submessage) -> None:
        self._send(address, InfoDestination(peer.prefix), *items)

    def _next_count(self) -> int:
        self._count += 1
        return self._count

    def _announce(self, address: Address) -> None:
        self._send(address, Data(rtps.NO_ENTITY, rtps.PARTICIPANT_WRITER, 1, self.node.participant_data))

    def _discovery_heartbeat(self, writer: bytes) -> Heartbeat:
        return Heartbeat(DISCOVERY[writer], writer, 1, len(self._announced[writer]), self._next_count())

    def _request_discovery(self, peer: Peer, writer: bytes) -> None:
        window = peer.windows[writer]
        request = AckNack(DISCOVERY[writer], writer, window.ask(), self._next_count(), is_final=window.is_heard)
        self._send_to(peer, peer.metatraffic, request)

    def _heartbeat(self, sink: Sink) -> Heartbeat:
        sink.next_heartbeat = self._now + USER_HEARTBEAT
        writer = sink.endpoint.entity
        return Heartbeat(sink.entity, writer, *sink.told, self._next_count())

    def _send_heartbeat(self, sink: Sink) -> None:
        self._send_to(sink.peer, sink.address, self._heartbeat(sink))

    def _send_sample(self, sink: Sink, number: int, *, is_last: bool = True) -> None:
        payload = sink.history.samples[number]
        ends = sink.entity, sink.endpoint.entity, number
        parts: list[Submessage] = [Data(*ends, payload)]
        if len(payload) > FRAGMENT_BYTES:
            count = -(-len(payload) // FRAGMENT_BYTES)
            parts = [_fragment(ends, payload, place) for place in range(1, count + 1)]
        for place, part in enumerate(parts, 1):
            told = [self._heartbeat(sink)] if sink.is_reliable and is_last and place == len(parts) else []
            self._send_to(sink.peer, sink.address, part, *told)

    def _request(self, source: Source) -> None:
        """Ask for what is missing, or for a heartbeat if the writer has not told what it has."""
        part = self._part_of(source) if source.is_heard else None
        repeats = source.requested == source.expected and not (part and self._has_come(source, part))
        most = 1 if repeats else MOST_REQUESTED
        source.patience = min(2 * source.patience, LONGEST_REQUEST) if repeats else USER_REQUEST
        source.requested = source.expected
        source.next_request = self._now + (source.patience if source.is_heard else UNHEARD_REQUEST)
        ends = source.endpoint.entity, source.entity
        if part:
            missing = part.missing(most)
            source.asked = part.fragment + missing.size
            self._send_to(
                source.peer,
                source.address,
                AckNack(*ends, Numbers(source.expected), self._next_count(), is_final=True),
                NackFrag(*ends, source.expected, missing, self._next_count()),
            )
            return
        if source.is_heard:
            source.asked = 0
        wanted = range(source.expected, min(source.last + 1, source.expected + most))
        numbers = Numbers.of(wanted, source.expected) if source.is_heard else Numbers(source.expected)
        request = AckNack(*ends, numbers, self._next_count(), is_final=source.is_heard)
        self._send_to(source.peer, source.address, request)

    # --- receiving -------------------------------------------------------------------------------------------------

    def receive(self, packet: bytes, now: int) -> None:
        """Take a packet; whatever its bytes are, it leaves the node alive."""
        self._now = now
        message = parse(packet)
        if message is None or message.prefix == self.node.prefix:
            self.counts["packets of others"] += 1
            return
        self.counts["faulty packets"] += not message.is_whole
        self._assembled, self._room = None, self._limits.waiting
        self._has_lost = self._has_skipped = False
        for source in self.sources:
            source.before = source.expected
        if peer := self.peers.get(message.prefix):
            peer.left = peer.lease
        is_mine = True
        for item in message.submessages:
            if isinstance(item, InfoDestination):
                is_mine = item.prefix in (self.node.prefix, bytes(12))
            elif is_mine:
                self._submessage(message.prefix, item)
        self.counts["packets with samples without room"] += self._has_lost
        self.counts["packets with samples that are too long"] += self._has_skipped

    def _submessage(self, prefix: bytes, item: Submessage) -> None:
        if isinstance(item, Data) and item.writer == rtps.PARTICIPANT_WRITER:
            self._participant(prefix, item)
        elif peer := self.peers.get(prefix):
            match item:
                case Data() if item.writer in DISCOVERY:
                    self._endpoint(peer, item)
                case Heartbeat() if item.writer in DISCOVERY:
                    self._discovery_told(peer, item)
                case AckNack() if item.writer in DISCOVERY:
                    self._discovery_asked(peer, item)
                case Gap() if item.writer in DISCOVERY:
                    self._discovery_gap(peer, item)
                case Data() | DataFrag() | Heartbeat() | HeartbeatFrag() | Gap():
                    self._from_writer(peer, item)
                case AckNack() | NackFrag():
                    self._from_reader(peer, item)

    def _participant(self, prefix: bytes, item: Data) -> None:
        if item.status & (rtps.DISPOSED | rtps.UNREGISTERED):
            if peer := self.peers.get(prefix):
                self._forget(peer)
            return
        facts = ParameterList.of(item.payload or b"")
        metatraffic = facts.address(Parameter.METATRAFFIC_UNICAST_LOCATOR)
        if prefix in self.peers or metatraffic is None or facts.all(Parameter.PARTICIPANT_GUID)[:1] != [_guid(prefix)]:
            return
        if len(self.peers) == self._limits.peers:
            self.counts["peers without room"] += 1
            return
        seconds, _ = facts.integers(Parameter.LEASE_DURATION, "II") or (100, 0)
        user = facts.address(Parameter.DEFAULT_UNICAST_LOCATOR) or metatraffic
        # The first second may be short.
        lease = min(max(1, seconds), 65534) + 1
        slot = free_slot(self.peers.values())
        peer = self.peers[prefix] = Peer(slot, prefix, metatraffic, user, lease, lease)
        self._tick_peer(peer)

    def _forget(self, peer: Peer) -> None:
        del self.peers[peer.prefix]
        self.sources = [item for item in self.sources if item.peer is not peer]
        self.sinks = [item for item in self.sinks if item.peer is not peer]
        self._give_up()

    def _give_up(self) -> None:
        """Give up the sample in fragments of a writer that is forgotten."""
        if self.assembly and self.assembly.source not in self.sources:
            self.assembly = None

    def _discovery_told(self, peer: Peer, item: Heartbeat) -> None:
        window = peer.windows[item.writer]
        window.is_heard = True
        window.begin(item.first)
        window.last = max(window.last, item.last)
        # What is under way is not asked for again: each answer comes with a heartbeat.
        if not window.is_under_way if window.is_behind else not item.is_final:
            self._request_discovery(peer, item.writer)

    def _discovery_gap(self, peer: Peer, item: Gap) -> None:
        window = peer.windows[item.writer]
        if item.start <= window.expected:
            window.begin(item.others.base)

    def _discovery_asked(self, peer: Peer, item: AckNack) -> None:
        announced = self._announced[item.writer]
        if item.missing.base > len(announced):
            peer.acknowledged.add(item.writer)
        else:
            peer.acknowledged.discard(item.writer)
        wanted = [number for number in item.missing if 1 <= number <= len(announced)]
        for number in wanted:
            self._send_to(
                peer, peer.metatraffic, Data(DISCOVERY[item.writer], item.writer, number, announced[number - 1])
            )
        if item.writer not in peer.acknowledged:
            self._send_to(peer, peer.metatraffic, self._discovery_heartbeat(item.writer))

    # --- matching --------------------------------------------------------------------------------------------------

    def _endpoint(self, peer: Peer, item: Data) -> None:
        window = peer.windows[item.writer]
        if not window.take(item.number):
            return
        if window.has_answer and window.is_behind:
            self._request_discovery(peer, item.writer)
        facts = ParameterList.of(item.payload or b"")
        guid = next(iter(facts.all(Parameter.ENDPOINT_GUID)), item.key) or b""
        if guid[:12] != peer.prefix or len(guid) != 16:
            return
        if item.status & (rtps.DISPOSED | rtps.UNREGISTERED):
            self.sources = [other for other in self.sources if not other.is_of(peer, guid[12:])]
            self.sinks = [other for other in self.sinks if not other.is_of(peer, guid[12:])]
            self._give_up()
            return
        is_writer = item.writer == PUBLICATIONS_WRITER
        name = facts.string(Parameter.TOPIC_NAME)
        for endpoint in self.node.readers if is_writer else self.node.writers:
            if endpoint.topic == name and self._is_compatible(endpoint, facts):
                self._match(peer, endpoint, guid[12:], facts)

    def _is_compatible(self, endpoint: Endpoint, facts: ParameterList) -> bool:
        """Whether type, hash, encoding and quality of service agree; otherwise, the reason is counted."""
        hash_ = _type_hash(facts)
        ours = endpoint.quality.is_reliable, endpoint.quality.is_transient_local
        theirs = _quality(facts, is_writer=not endpoint.is_writer)
        offered, requested = (ours, theirs) if endpoint.is_writer else (theirs, ours)
        reasons = {
            "other types": facts.string(Parameter.TYPE_NAME) != endpoint.type,
            "other hashes": hash_ not in ("", endpoint.hash),
            "other encodings": XCDR1 not in _encodings(facts),
            "other partitions": bool(sum(facts.integers(Parameter.PARTITION, "I") or ())),
            "other qualities": any(wanted and not given for wanted, given in zip(requested, offered, strict=True)),
        }
        reason = next((name for name, applies in reasons.items() if applies), None)
        self.counts.update([reason] if reason else [])
        return reason is None

    def _match(self, peer: Peer, endpoint: Endpoint, entity: bytes, facts: ParameterList) -> None:
        known: list[Source | Sink] = [*self.sources, *self.sinks]
        # A known endpoint keeps the topic with which it was announced first.
        same = [item.endpoint for item in known if item.is_of(peer, entity)]
        if any(ours is endpoint or ours.topic != endpoint.topic for ours in same):
            return
        used, most = (self.sinks, self._limits.sinks) if endpoint.is_writer else (self.sources, self._limits.sources)
        if len(used) == most:
            self.counts["endpoints without room"] += 1
            return
        slot = free_slot(used)
        address = facts.address(Parameter.UNICAST_LOCATOR) or peer.user
        if not endpoint.is_writer:
            source = Source(slot, peer, entity, endpoint, address)
            self.sources = sorted([*self.sources, source], key=attrgetter("slot"))
            if endpoint.quality.is_reliable:
                self._request(source)
            return
        history = self.histories[endpoint.entity]
        is_reliable, wants_history = _quality(facts, is_writer=False)
        start = 1 if endpoint.quality.is_transient_local and wants_history else history.number + 1
        sink = Sink(slot, peer, entity, history, address, is_reliable, start)
        self.sinks = sorted([*self.sinks, sink], key=attrgetter("slot"))
        if is_reliable:
            self._send_heartbeat(sink)
        else:
            for number in history.samples:
                if number >= start:
                    self._send_sample(sink, number)

    # --- samples that come -----------------------------------------------------------------------------------------

    def _from_writer(self, peer: Peer, item: Data | DataFrag | Heartbeat | HeartbeatFrag | Gap) -> None:
        for source in self.sources:
            if source.is_of(peer, item.writer) and item.reader in (rtps.NO_ENTITY, source.endpoint.entity):
                match item:
                    case Data() | DataFrag() if item.number >= 1 << NUMBER_BITS:
                        pass
                    case Data():
                        self._sample(source, item)
                    case DataFrag():
                        self._fragments(source, item)
                    case Heartbeat():
                        self._told(source, item)
                    case HeartbeatFrag():
                        self._fragments_told(source, item)
                    case Gap():
                        self._gap(source, item)

    def _is_next(self, source: Source, number: int) -> bool:
        """Whether to take this sample now; what a reliable reader misses before it is asked for once, at once."""
        source.last = max(source.last, number) if source.is_reliable else 0
        if number <= source.expected or not source.is_reliable:
            return number >= source.expected
        if self._may_request(source):
            self._request(source)
        return False

    def _may_request(self, source: Source) -> bool:
        part = self._part_of(source)
        has_news = source.requested != source.expected or (part is not None and self._has_come(source, part))
        return has_news or self._now >= source.next_request

    def _has_come(self, source: Source, part: Assembly) -> bool:
        """Whether all fragments that were asked for have come."""
        return source.asked in (0, part.fragment)

    def _part_of(self, source: Source) -> Assembly | None:
        """The sample to take next, if some of its fragments have come."""
        part = self.assembly
        return part if part and part.is_of(source, source.expected) else None

    def _sample(self, source: Source, item: Data) -> None:
        payload = None if item.is_key else item.payload
        if payload:
            is_free = self._may_assemble(source, item.number)
            if len(payload) <= self._room:
                self._room -= len(payload)
            elif not is_free:
                if item.number >= source.before:
                    self._lose()
                return
            elif len(payload) > self._limits.assembled:
                self._skip()
                payload = None
            else:
                self._assembled = source, item.number
        if self._is_next(source, item.number):
            source.advance(item.number + 1)
            if payload is not None:
                self._give(source, payload)

    def _may_assemble(self, source: Source, number: int) -> bool:
        """Whether there is room for a long sample, which takes that of an older one of its writer.

        It is not known yet whether the sample needs it.
        """
        part = self.assembly
        if part and part.source is source and part.number != number and source.is_next(number):
            part = self.assembly = None
        has_room = part is None and self._assembled is None and self._limits.assembled > 0
        return has_room and number >= source.before

    def _skip(self) -> None:
        self.counts["payloads that are too long"] += 1
        self._has_skipped = True

    def _lose(self) -> None:
        self.counts["samples without room"] += 1
        self._has_lost = True

    def _give(self, source: Source, payload: bytes) -> None:
        if len(payload) > self._limits.longest:
            self.counts["payloads that are too long"] += 1
        else:
            self._take(source.endpoint, payload)

    def _fragments(self, source: Source, item: DataFrag) -> None:
        if item.is_key:
            return
        if item.size > self._limits.assembled:
            self._skip()
            if self._is_next(source, item.number):
                source.advance(item.number + 1)
            return
        is_taken = item.number == source.expected if source.is_reliable else item.number >= source.expected
        part = self.assembly
        if part is None or not part.is_of(source, item.number):
            is_again = self._assembled and self._assembled[0] is source and self._assembled[1] == item.number
            if is_again or not source.is_next(item.number):
                return
            is_sound = item.first == 1 and item.count and item.fragment_bytes and item.size and item.payload
            if self._assembled or (part and part.source is not source) or not is_sound:
                self._lose()
                return
            part = Assembly(source, item.number, item.size, item.fragment_bytes, self._now)
        part.take(item, self._now)
        self.assembly = part if part.data else None
        if part.is_whole:
            self.assembly, self._assembled = None, (source, item.number)
            if is_taken:
                source.advance(item.number + 1)
                self._give(source, bytes(part.data))

    def _told(self, source: Source, item: Heartbeat) -> None:
        if source.is_reliable and 1 <= item.first <= item.last + 1:
            # What was asked for before the first heartbeat was this heartbeat.
            source.requested = source.requested if source.is_heard else 0
            source.is_heard = True
            source.advance(item.first)
            source.last = max(source.last, item.last)
            is_behind = source.last >= source.expected
            if self._may_request(source) if is_behind else not item.is_final:
                self._request(source)

    def _fragments_told(self, source: Source, item: HeartbeatFrag) -> None:
        if not source.is_reliable:
            return
        source.last = max(source.last, item.number)
        part = self._part_of(source)
        is_behind = item.number > source.expected or part is None or item.last >= part.fragment
        if item.number >= source.expected and is_behind and self._may_request(source):
            self._request(source)

    def _gap(self, source: Source, item: Gap) -> None:
        if item.start <= source.expected:
            source.advance(item.others.base)
            others = set(item.others)
            while source.expected in others:
                source.advance(source.expected + 1)

    # --- samples that are asked for --------------------------------------------------------------------------------

    def _from_reader(self, peer: Peer, item: AckNack | NackFrag) -> None:
        for sink in self.sinks:
            if sink.is_of(peer, item.reader) and sink.endpoint.entity == item.writer and sink.is_reliable:
                if isinstance(item, AckNack):
                    self._asked(sink, item)
                elif item.number <= sink.history.number and item.count >= sink.next_count:
                    sink.next_count = (item.count + 1) % (1 << 32)
                    self._asked_for_fragments(sink, item)

    def _asked(self, sink: Sink, item: AckNack) -> None:
        was_heard = sink.is_heard
        sink.answer(item)
        wanted = [number for number in item.missing if 1 <= number <= sink.history.number]
        if gone := [number for number in wanted if number < sink.first]:
            self._send_to(
                sink.peer,
                sink.address,
                Gap(sink.entity, sink.endpoint.entity, gone[0], Numbers(sink.first)),
            )
        kept = [number for number in wanted if number >= sink.first]
        # Several samples in fragments might be too many for a reader, which asks for the next one after the heartbeat.
        long = [place for place, number in enumerate(kept, 1) if len(sink.history.samples[number]) > FRAGMENT_BYTES]
        kept = kept[: long[0]] if long else kept
        for number in kept:
            self._send_sample(sink, number, is_last=number == kept[-1])
        has_news = not was_heard and sink.is_heard and sink.is_behind
        if not wanted and (has_news or not item.is_final):
            self._send_heartbeat(sink)

    def _asked_for_fragments(self, sink: Sink, item: NackFrag) -> None:
        if item.number < sink.first:
            self._send_heartbeat(sink)
            return
        payload = sink.history.samples[item.number]
        ends = sink.entity, sink.endpoint.entity, item.number
        count = -(-len(payload) // FRAGMENT_BYTES)
        wanted = [place for place in item.missing if 1 <= place <= count] if count > 1 else []
        for place in wanted:
            self._send_to(sink.peer, sink.address, _fragment(ends, payload, place))
        if wanted:
            self._send_heartbeat(sink)


def _guid(prefix: bytes) -> bytes:
    return prefix + rtps.PARTICIPANT


def _fragment(ends: tuple[bytes, bytes, int], payload: bytes, place: int) -> DataFrag:
    """The fragment at a place, from 1."""
    start = (place - 1) * FRAGMENT_BYTES
    part = payload[start : start + FRAGMENT_BYTES]
    return DataFrag(*ends, place, 1, FRAGMENT_BYTES, len(payload), part + bytes(-len(part) % 4))


def _type_hash(facts: ParameterList) -> str:
    """The hash in the user data of an endpoint, if there is one."""
    data = facts.octets(Parameter.USER_DATA).decode(errors="replace")
    return next((part.removeprefix("typehash=") for part in data.split(";") if part.startswith("typehash=")), "")


def _encodings(facts: ParameterList) -> Iterable[int]:
    """The encodings that a reader accepts, or that a writer prefers; XCDR version 1 unless told."""
    (count,) = facts.integers(Parameter.DATA_REPRESENTATION, "I") or (0,)
    told = facts.integers(Parameter.DATA_REPRESENTATION, f"I{min(count, 16)}h")
    return told[1:] if told and count else (XCDR1,)


def _quality(facts: ParameterList, *, is_writer: bool) -> tuple[bool, bool]:
    """Whether an endpoint is reliable and transient-local; each kind has a default of its own."""
    default = Reliability.RELIABLE if is_writer else Reliability.BEST_EFFORT
    (reliability,) = facts.integers(Parameter.RELIABILITY, "I") or (default,)
    (durability,) = facts.integers(Parameter.DURABILITY, "I") or (Durability.VOLATILE,)
    return reliability == Reliability.RELIABLE, durability >= Durability.TRANSIENT_LOCAL
