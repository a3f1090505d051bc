"""The node, which carries messages from topics to the hardware as frames, and back.

It parses a message only as far as its end, to remove the bytes that senders of ROS 2 append.

    node = Node(description, open_transport, settings)
    node.run({1: carrier})                 # until `node.stop()`, or until a carrier or the hardware fails permanently

A message waits in its subscriber's queue (section 6.3.3: one queue per subscriber, the least recently used is next; the
two subscribers of an action share one, which loses only feedback) and is sent as a frame. If no message waits and the
hardware is ready, the thread that takes the message sends it. The response returns as bursts, which are joined. If
software is part of the system, the thread that delivers a message calls the software's functions. While a function
runs, the node accepts no burst; back-pressure stalls the hardware, as with any accelerator that is not ready. A
function's output never waits for space in a queue, since this could cause a deadlock: if the output's queue to the
hardware is full, a message is dropped and counted.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.content import without_tail
from fusesoc_firm.frame.faults import Fault, told
from fusesoc_firm.node.actions.actions import NodeActions
from fusesoc_firm.node.engine.bursts import AbortedFrameError, BurstError, BurstJoiner, JoinedFrame
from fusesoc_firm.node.engine.calls import NodeCalls
from fusesoc_firm.node.engine.carrier import (
    Answered,
    Called,
    Carrier,
    CarrierError,
    Event,
    Lost,
    Published,
    Taken,
    Wanted,
)
from fusesoc_firm.node.engine.hardware_parameters import HardwareParameters
from fusesoc_firm.node.engine.queues import ClosedError, Overflow, SubscriberQueues
from fusesoc_firm.node.engine.software import NodeSoftware
from fusesoc_firm.node.engine.trace import Entry, Trace
from fusesoc_firm.node.engine.watch import Latency, Load, Watch
from fusesoc_firm.node.interface.description import (
    Crossing,
    NodeDescription,
    channel_names,
    converter_names,
)
from fusesoc_firm.node.interface.diagnostics import INTERVAL_SECONDS, READING_SECONDS, Report
from fusesoc_firm.node.interface.topics import DEFAULT_DEPTH, NodeTopic
from fusesoc_firm.node.statistics import Statistics
from fusesoc_firm.node.status.status import StatusWatch
from fusesoc_firm.node.status.status_exchange import ANSWER_SECONDS, NO_ANSWER, StatusExchange
from fusesoc_firm.node.transport.status_registers import StatusRegisters
from fusesoc_firm.node.transport.transport import (
    Burst,
    LostFrameError,
    Transport,
    TransportError,
    TransportResetError,
)
from fusesoc_firm.system.status_frames import answered, read_request

# The interval at which waiting threads check whether to end.
_POLL_SECONDS = 0.1
# The number of successive transports that may fail before they deliver a burst.
_MOST_RESTARTS = 5
# The number of hardware faults that are reported; later faults are only counted.
_MOST_REPORTS = 20


class HardwareListener(Protocol):
    """The receiver of a transport's events other than bursts; any thread may call its methods."""

    def taken(self, first_cycle: int, last_cycle: int) -> None:
        """Handle the transfer of the next sent frame to simulated hardware in these cycles of clk."""

    def refused(self, converter: int | None, code: int = 0) -> None:
        """Handle a fault from the hardware: of a converter, numbered as in `frame_error`, or in a frame's id (None).

        `code` is that of the converter's fault, or 0 if the transport does not tell it.
        """

    def wants_waits(self) -> bool:
        """Return whether simulated hardware should count the cycles in which its wires wait."""

    def waited(self, first: int, cycle: int, counts: Sequence[int]) -> None:
        """Handle these counts, from the cycle `first` to the one before `cycle`.

        See `Waits` in `node/transport/simulator.py`.
        """


OpenTransport = Callable[[HardwareListener], Transport]


@dataclass(frozen=True)
class NodeSettings:
    """The settings of a node: each queue holds `depth` messages, and `overflow` is the action of a full queue.

    Without a `depth`, the queue of a topic has the topic's depth.

    After a stop request, the node processes received messages until the hardware has been silent for `settle` seconds
    and does not report work, but for at most `drain` seconds. If `restarts` is set, a failed transport is reopened.
    `report` receives messages to the user, and `watch` records all messages. `registers` are those of the hardware's
    status, if frames do not read it. `parameters` are the values of the accelerators' parameters.
    """

    depth: int | None = None
    overflow: Overflow = Overflow.DROP_OLDEST
    settle: float = 0.5
    drain: float = 10.0
    restarts: bool = False
    report: Callable[[str], None] = print
    watch: Watch | None = None
    registers: StatusRegisters | None = None
    parameters: HardwareParameters | None = None


@dataclass(frozen=True)
class _Message:
    """A message in a queue, for the input with this number."""

    number: int
    payload: bytes
    entry: Entry | None


class _Hardware:
    """The state of a transport from its opening to its failure or end."""

    def __init__(self, transport: Transport, description: NodeDescription) -> None:
        self.transport = transport
        publishers = len(description.sources)
        self.joiner = BurstJoiner(publishers, description.width, description.longest_payload)
        self.first_cycles: dict[int, int] = {}
        self.has_answered = False


class Node:
    """One run of a system's node, as described for the module."""

    def __init__(
        self,
        description: NodeDescription,
        open_transport: OpenTransport,
        settings: NodeSettings = NodeSettings(),
        software: NodeSoftware | None = None,
        trace: Trace | None = None,
    ) -> None:
        """Open the transport. May raise `TransportError`."""
        self._report = _Reporter(settings.report)
        self._is_wanted_to_end = threading.Event()
        self._drains = threading.Event()
        self._is_over = threading.Event()
        self._fault: BaseException | None = None
        self._lock, self._restarting, self._sending = threading.RLock(), threading.Lock(), threading.Lock()
        self._calls = NodeCalls(description.services, self._put_service_message, self._report, self._start)
        self._actions = NodeActions(description, self._put_service_message, self._report, self._start)
        self.statistics = Statistics.of(description, self._calls.counts, self._actions.counts)
        # The bytes of the longest message for each input.
        self._longest: dict[str, int] = {}
        self._description = description
        self._open_transport = open_transport
        self._settings = settings
        self._software = software
        # The trace determines the cause of each message.
        self._trace = trace or (Trace(None, description) if settings.watch else None)
        self._watch = settings.watch
        self._inputs = description.inputs
        self._numbers = {item.block: number for number, item in enumerate(self._inputs)}
        self._topics = {topic.block: (number, topic) for number, topic in enumerate(description.publishers)}
        self._subscriber_names, self._publisher_names = converter_names(description)
        self._status = StatusExchange(self._put_status_request) if description.has_status_frames else None
        pairs = [
            (item.goal, item.cancel) if item.is_server else (item.feedback, item.result) for item in description.actions
        ]
        # Of the messages of actions, only feedback may be lost.
        kept = {block for pair in pairs for block in pair} - {item.feedback for item in description.actions}
        # The last queue is that of the status.
        depths = [None if item.block in kept else self._depth(item) for item in self._inputs]
        depths += [1] if self._status else []
        self._queues: SubscriberQueues[_Message] = SubscriberQueues(len(depths), depths, overflow=settings.overflow)
        for first, second in pairs:
            # A result must not overtake feedback, nor a cancellation its goal.
            self._queues.share(self._numbers[second], self._numbers[first])
        self._carriers: Mapping[int, Carrier] = {}
        self._offered = self._declined = self._handled = 0
        self._is_counted = False
        self._failed_restarts = 0
        self._last_traffic = time.monotonic()
        if self._watch:
            self._watch.measure(self.loads)
        self._hardware = _Hardware(open_transport(self), description)

    def loads(self) -> dict[str, Load]:
        """Return the loads of the inputs, by block; any thread may call it."""
        found = {}
        for number, item in enumerate(self._inputs):
            counts = self.statistics.inputs[item.block]
            dropped = counts.dropped + (0 if self._is_counted else self._queues.dropped(number))
            waiting = self._queues.waiting(number)
            found[item.block] = Load(waiting, self._depth(item), dropped, counts.refused, counts.lost)
        return found

    def _depth(self, item: NodeTopic | Crossing) -> int:
        return self._settings.depth or (item.depth if isinstance(item, NodeTopic) else DEFAULT_DEPTH)

    # --- the run ---------------------------------------------------------------------------------------------------

    def run(self, carriers: Mapping[int, Carrier]) -> bool:
        """Carry messages until `stop` or the end of a carrier; return whether all received messages were processed.

        `carriers` maps each version of ROS to the carrier of its topics; the carriers stay open. Raise `TransportError`
        or `CarrierError` if the transport or a carrier fails permanently.
        """
        self._carriers = carriers
        self._calls.start(carriers)
        self._actions.start(carriers)
        # One carrier may have the topics of several versions.
        takers = [self._start(partial(self._take, carrier)) for carrier in dict.fromkeys(carriers.values())]
        sender, receiver = self._start(self._send), self._start(self._receive)
        self._start(self._diagnose)
        self._is_wanted_to_end.wait()
        # Without one of its threads, the node cannot process what it has received.
        is_whole = self._fault is None or isinstance(self._fault, TransportError | CarrierError)
        latest = time.monotonic() + (self._settings.drain if is_whole else 0.0)
        self._actions.give_up(_left(latest))
        if isinstance(self._fault, TransportError):
            # Without a sender, a message that waits for room in a queue would wait until the limit.
            self._queues.close()
        for carrier in carriers.values():
            carrier.stop()
        for carrier in carriers.values():
            carrier.wait_until_stopped(_left(latest))
        self._drains.set()
        receiver.join(_left(latest))
        self._queues.close()
        self._calls.close()
        self._actions.close()
        self.close()
        for thread in (sender, receiver, *takers):
            # A thread that receives messages ends with its carrier, which the caller closes.
            thread.join(_POLL_SECONDS)
        self._count_rest()
        if self._fault:
            raise self._fault
        return self.statistics.unfinished == 0

    def stop(self) -> None:
        """Make `run` return; any thread or signal handler may call it."""
        self._is_wanted_to_end.set()

    def close(self) -> None:
        """Close the transport and the queues, which wakes all waiting threads; a second call does nothing."""
        self._is_over.set()
        self._hardware.transport.close()
        self._queues.close()

    def access_status(self, request: bytes, seconds: float = ANSWER_SECONDS) -> bytes:
        """Return the answer of the hardware's status to a request; any thread may call this method.

        Raise `TransportError` after this time without an answer.
        """
        if self._settings.registers:
            return self._settings.registers.access(request)
        if not self._status:
            raise TransportError("the node has no access to a status of the hardware")
        return self._status.access(request, seconds)

    @property
    def has_status(self) -> bool:
        """Whether the node has access to a status of the hardware."""
        return bool(self._status or self._settings.registers)

    def _access(self, request: bytes, seconds: float = ANSWER_SECONDS) -> int:
        """Return the word of the answer to a request of the status. May raise `TransportError`."""
        answer = answered(self.access_status(request, seconds))
        if answer is None:
            raise TransportError(NO_ANSWER)
        return answer[1]

    def _set_parameters(self, wanted: Wanted) -> None:
        known = self._settings.parameters
        wanted.answer(known.set(wanted.values, self._access) if known else "the hardware has no parameters")

    def _restore_parameters(self) -> None:
        """Set the parameters after the hardware has reset itself."""
        try:
            if self._settings.parameters:
                self._settings.parameters.restore(self._access)
        except TransportError as error:
            self._report(f"parameters of the hardware are at their defaults: {error}")

    def _put_status_request(self, request: bytes) -> None:
        try:
            is_there = self._queues.put(len(self._inputs), _Message(len(self._inputs), request, None), 0.0)
        except ClosedError:
            raise TransportError("the node is ending") from None
        if not is_there:
            raise TransportError(NO_ANSWER)

    def _start(self, work: Callable[[], None]) -> threading.Thread:
        def guarded() -> None:
            try:
                work()
            except BaseException as error:  # noqa: BLE001 - the run would wait forever for the ended thread
                self._fail(error)

        thread = threading.Thread(target=guarded, daemon=True)
        thread.start()
        return thread

    def _fail(self, error: BaseException) -> None:
        """End the run with an error; ignore the errors of a transport or carrier that is being closed."""
        with self._lock:
            if not self._is_over.is_set():
                self._fault = self._fault or error
        self.stop()

    def _diagnose(self) -> None:
        """Report the counts of the node, and those of the hardware's status, at intervals."""
        before = status_before = 0
        watch = StatusWatch(self._read_word, channel_names(self._description))
        while not self._is_wanted_to_end.wait(INTERVAL_SECONDS):
            dropped = {item.block: self._queues.dropped(number) for number, item in enumerate(self._inputs)}
            now = self.statistics.troubles() + sum(dropped.values())
            self._tell(Report(f"{self._description.name}: node", now > before, self.statistics.counts(dropped)))
            before = now
            if self.has_status:
                watch.advance(READING_SECONDS)
                now = watch.troubles()
                self._tell(Report(f"{self._description.name}: hardware", now > status_before, watch.counts))
                if self._watch:
                    self._watch.status = watch.counts
                status_before = now

    def _tell(self, report: Report) -> None:
        for carrier in self._carriers.values():
            carrier.diagnose(report)

    def _read_word(self, address: int) -> int:
        return self._access(read_request(address), INTERVAL_SECONDS)

    def _count_rest(self) -> None:
        self._is_counted = True
        for number, item in enumerate(self._inputs):
            self.statistics.inputs[item.block].dropped += self._queues.dropped(number)
        self.statistics.unfinished = self._waiting() + len(self._hardware.joiner.unfinished)

    # --- from topics to the hardware -------------------------------------------------------------------------------

    def _take(self, carrier: Carrier) -> None:
        """Handle the events of a carrier."""
        try:
            for event in carrier.receive():
                self._take_event(event)
        except CarrierError as error:
            self._fail(error)
        except ClosedError:
            # The time limit for ending the node has passed.
            return
        self.stop()

    def _take_event(self, event: Event) -> None:
        if isinstance(event, Published):
            self._note_published(event)
        elif isinstance(event, Lost):
            self._note_lost(event)
        elif isinstance(event, Wanted):
            # The answer of the hardware must not wait for messages that this thread takes.
            self._start(partial(self._set_parameters, event))
        elif isinstance(event, Called):
            if not self._actions.called(event):
                self._calls.called(event)
        elif isinstance(event, Answered):
            if not self._actions.answered(event):
                self._calls.answered(event)
        elif not self._actions.taken(event):
            self._take_message(event)

    def _note_lost(self, event: Lost) -> None:
        # The messages of actions have no separate input.
        topic = self._description.taken_topics[event.topic]
        self.statistics.inputs[topic.block].lost += event.count

    def _take_message(self, taken: Taken) -> None:
        self._put(taken.topic, taken.payload, taken.time_ns, None)

    def _put_service_message(self, block: str, payload: bytes) -> None:
        """Send a message of a service or an action to the hardware."""
        self._put_own(block, payload, None)

    def _put_own(self, block: str, payload: bytes, timeout: float | None) -> None:
        """Add a message from the node or its software to a queue; without hardware, the message is dropped.

        The thread continues, since it may still have messages to publish.
        """
        number = self._numbers[block]
        try:
            self._put(number, payload, time.monotonic_ns(), timeout)
        except ClosedError:
            self._decline(number)

    def _put(self, number: int, payload: bytes, received_ns: int, timeout: float | None) -> None:
        """Add a message to a queue; if a full queue blocks, wait `timeout` seconds at most."""
        item, entry = self._inputs[number], None
        payload = without_tail(self._description.contents.get(item.block, ()), payload)
        counts = self.statistics.inputs[item.block]
        if self._trace and item.id is not None:
            entry = Entry(item.id, len(payload), received_ns, time.monotonic_ns())
        if self._watch:
            seen = self._watch.saw(item.block, payload, received_ns - self._watch.start_ns)
            if entry:
                entry.seen = seen
        message = _Message(number, payload, entry)
        with self._lock:
            is_alone = not self._waiting()
            counts.received += 1
            self._offered += 1
        if is_alone and self._software is None and self._hardware.transport.is_ready():
            self._queues.pass_by(number)
            self._handle(number, message)
            return
        is_there = self._queues.put(number, message, timeout)
        if not is_there and self._settings.overflow is Overflow.BLOCK:
            self._decline(number)

    def _decline(self, number: int) -> None:
        """Count a message that no queue accepted and no other thread counts."""
        with self._lock:
            self.statistics.inputs[self._inputs[number].block].dropped += 1
            self._declined += 1

    def _waiting(self) -> int:
        """Return the number of messages that are in queues or being sent."""
        # Requests of the status, which have the last queue, are not messages.
        dropped = self._queues.dropped_by_first(len(self._inputs))
        with self._lock:
            return self._offered - self._declined - self._handled - dropped

    def _send(self) -> None:
        for _, message in self._queues:
            is_request = message.number == len(self._inputs)
            if not (
                self._send_status_request(message.payload) if is_request else self._handle(message.number, message)
            ):
                return

    def _handle(self, number: int, message: _Message) -> bool:
        """Pass a message on to the hardware and to software; return False if the hardware has failed permanently."""
        item = self._inputs[number]
        self._longest[item.block] = max(self._longest.get(item.block, 0), len(message.payload))
        with self._sending:
            if item.id is not None and not self._send_frame(item.id, message):
                return False
            self._run_software(item.block, message.payload)
            self.statistics.inputs[item.block].sent += 1
            self._last_traffic = time.monotonic()
            with self._lock:
                self._handled += 1
        return True

    def _send_frame(self, subscriber: int, message: _Message) -> bool:
        """Send a frame to the hardware; return False if the hardware has failed permanently."""
        hardware = self._hardware
        if self._trace and message.entry:
            self._trace.sending(message.entry)
        try:
            hardware.transport.send(pack_frame(subscriber, message.payload))
        except TransportError as error:
            return self._begin_anew(hardware, error)
        if self._trace and message.entry:
            self._trace.sent(message.entry)
        return True

    def _send_status_request(self, request: bytes) -> bool:
        """Send a request of the status; return False if the hardware has failed permanently."""
        hardware = self._hardware
        with self._sending:
            if self._trace:
                self._trace.sending_other()
            try:
                hardware.transport.send(request)
            except TransportError as error:
                return self._begin_anew(hardware, error)
        return True

    def _run_software(self, block: str, payload: bytes) -> None:
        """Pass a message to software, and forward the software's outputs."""
        if not self._software or block not in self._software.sources:
            return
        for name, made in self._software.take(block, payload):
            if name in self._topics:
                if self._watch:
                    self._record(self._watch, name, made, None, None)
                self._publish(name, made)
            else:
                self._put_own(name, made, 0.0)

    # --- from the hardware to topics -------------------------------------------------------------------------------

    def _receive(self) -> None:
        while not self._is_over.is_set():
            hardware = self._hardware
            try:
                burst = hardware.transport.receive(_POLL_SECONDS)
            except LostFrameError as lost:
                self.statistics.faults += 1
                self._report(str(lost))
                continue
            except TransportResetError as reset:
                self._forget(hardware.transport, str(reset))
                # This thread passes on the answers.
                self._start(self._restore_parameters)
                continue
            except TransportError as error:
                if not self._begin_anew(hardware, error):
                    return
                continue
            if burst is not None and self._status and self._status.take(burst.data):
                continue
            if burst is not None:
                self._join(hardware, burst)
                self._last_traffic = time.monotonic()
            elif isinstance(self._fault, TransportError) or (self._drains.is_set() and self._is_at_rest(hardware)):
                return
            elif not self._waiting() and hardware.transport.is_at_rest():
                self._calls.rest()
                self._actions.rest()

    def _is_at_rest(self, hardware: _Hardware) -> bool:
        """Return whether all messages have been processed, as far as the transport can determine."""
        if self._waiting() or hardware.joiner.unfinished or not (self._calls.is_idle and self._actions.is_idle):
            return False
        is_silent = time.monotonic() - self._last_traffic > self._settings.settle
        return is_silent and hardware.transport.is_at_rest() is not False

    def _join(self, hardware: _Hardware, burst: Burst) -> None:
        try:
            frame = hardware.joiner.push(burst.data, burst.tid, is_aborted=burst.is_aborted)
        except AbortedFrameError as error:
            hardware.first_cycles.pop(burst.data[0], None)
            self.statistics.faults += 1
            self._report(f"the hardware ended a frame: {error}")
            self._refuse_call(burst, "the hardware aborted the response")
            return
        except BurstError as error:
            self.statistics.faults += 1
            self._report(f"the hardware sent an invalid burst: {error}")
            self._refuse_call(burst, "the hardware sent an invalid response")
            return
        hardware.has_answered = True
        first = None
        if burst.first_cycle is not None and burst.data:
            first = hardware.first_cycles.setdefault(burst.data[0], burst.first_cycle)
            self._note_grant(burst)
        if frame:
            hardware.first_cycles.pop(frame.id, None)
            cycles = None if first is None or burst.last_cycle is None else (first, burst.last_cycle)
            self._deliver(frame, cycles)

    def _note_grant(self, burst: Burst) -> None:
        block = self._publisher_names.get(burst.data[0])
        if self._watch and block is not None and burst.first_cycle is not None and burst.last_cycle is not None:
            self._watch.granted(block, burst.first_cycle, burst.last_cycle)

    def _refuse_call(self, burst: Burst, reason: str) -> None:
        """Fail the call with a faulty response, if the burst belongs to a response."""
        block = self._publisher_names.get(burst.data[0]) if burst.data else None
        if block is not None:
            self._refuse(block, reason)

    def _refuse(self, block: str, reason: str) -> None:
        self._calls.refuse(block, reason)
        self._actions.refuse(block, reason)

    def _deliver(self, frame: JoinedFrame, cycles: tuple[int, int] | None) -> None:
        block = self._publisher_names[frame.id]
        self.statistics.outputs[block].frames += 1
        cause = None
        if self._trace:
            cause = self._trace.came(frame.id, len(frame.payload), cycles, is_published=self._has_carrier(block))
        if self._watch:
            self._record(self._watch, block, frame.payload, cause, cycles)
        if block in self._topics:
            self._publish(block, frame.payload)
        elif not (self._calls.take(block, frame.payload) or self._actions.take(block, frame.payload)):
            self._run_software(block, frame.payload)

    def _record(
        self, watch: Watch, block: str, payload: bytes, cause: Entry | None, cycles: tuple[int, int] | None
    ) -> None:
        now = time.monotonic_ns()
        latency = Latency()
        if cause:
            taken = cycles[1] - cause.cycles[0] if cause.cycles and cycles else None
            latency = Latency(cause.seen, taken, now - cause.received_ns)
        watch.saw(block, payload, now - watch.start_ns, latency, cycles)

    def _has_carrier(self, block: str) -> bool:
        return block in self._topics and self._topics[block][1].ros in self._carriers

    def _publish(self, block: str, payload: bytes) -> None:
        if self._has_carrier(block):
            number, topic = self._topics[block]
            self._carriers[topic.ros].publish(number, payload)
            self.statistics.outputs[block].published += 1

    def _note_published(self, event: Published) -> None:
        publisher = self._description.given_topics[event.topic].id
        if self._trace and publisher is not None:
            self._trace.published(publisher, event.time_ns)

    # --- reports from the hardware ---------------------------------------------------------------------------------

    def taken(self, first_cycle: int, last_cycle: int) -> None:
        """Record that simulated hardware accepted the next sent frame; any thread may call this method."""
        if self._trace:
            self._trace.taken(first_cycle, last_cycle)

    def refused(self, converter: int | None, code: int = 0) -> None:
        """Report a converter's fault and its code, or 0 if that is unknown; any thread may call this method."""
        if converter is not None and converter in self._subscriber_names:
            block = self._subscriber_names[converter]
            self.statistics.inputs[block].refused += 1
            size = f": the longest message had {self._longest.get(block, 0)} bytes" if code == Fault.TOO_LONG else ""
            self._report(f"the hardware rejected a message from '{block}': {told(code)}{size}")
            self._refuse(block, "the hardware rejected the request")
            if self._trace:
                self._trace.refused(converter)
        else:
            self.statistics.faults += 1
            self._report(
                "the hardware rejected a frame " + ("with an unknown id" if converter is None else "of a publisher")
            )

    def wants_waits(self) -> bool:
        """Return whether the run is watched; any thread may call this method."""
        return self._watch is not None and self._watch.is_watched()

    def waited(self, first: int, cycle: int, counts: Sequence[int]) -> None:
        """Record the cycles in which wires waited; any thread may call this method."""
        if self._watch:
            self._watch.waited(first, cycle, counts)

    def _begin_anew(self, hardware: _Hardware, error: TransportError) -> bool:
        """Reopen the transport if the settings allow it; return False if they do not, or if reopening fails."""
        with self._restarting:
            if self._is_over.is_set():
                return False
            if hardware is not self._hardware:
                # The other thread has already reopened the transport.
                return True
            hardware.transport.close()
            self._failed_restarts = 0 if hardware.has_answered else self._failed_restarts + 1
            if not self._settings.restarts or self._failed_restarts > _MOST_RESTARTS:
                self._fail(error)
                return False
            try:
                self._forget(self._open_transport(self), str(error))
            except TransportError as failed:
                self._fail(failed)
                return False
            return True

    def _forget(self, transport: Transport, why: str) -> None:
        """Continue with hardware after a reset, and discard all messages in the hardware."""
        self._report(f"{why}; the hardware is restarted, and the messages in it are lost")
        self.statistics.restarts += 1
        if self._trace:
            self._trace.forget()
        if self._watch:
            self._watch.begin_cycles()
        self._hardware = _Hardware(transport, self._description)
        self._calls.forget("the hardware was restarted")
        self._actions.forget("the hardware was restarted")


class _Reporter:
    """A reporter to the user with a limit, since a broken link can repeat the same fault for hours."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._left = _MOST_REPORTS

    def __call__(self, text: str) -> None:
        if self._left > 0:
            self._report(text)
        elif self._left == 0:
            self._report("further reports of this kind are counted, but not printed")
        self._left -= 1


def _left(latest: float) -> float:
    """Return the seconds until a time, or 0 if the time has passed."""
    return max(0.0, latest - time.monotonic())
