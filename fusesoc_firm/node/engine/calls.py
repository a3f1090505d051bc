"""The calls of services: each service has one call in progress, and further calls wait in the order of arrival.

A frame does not identify its caller. With one call of a service in the hardware, its response, its errors and its
time-out belong to that call. The same holds for the calls that hardware makes.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import count

from fusesoc_firm.node.engine.carrier import Answer, Answered, Call, Called, Carrier
from fusesoc_firm.node.engine.queues import ClosedError
from fusesoc_firm.node.interface.services import NodeService

# Starts a thread; an exception in it ends the node's run.
Start = Callable[[Callable[[], None]], threading.Thread]

# Calls of one service that may wait; a further call fails.
MOST_WAITING = 1000
# s; short time limits are exceeded by busy hosts.
LEAST_WAIT = 2.0

_ENDED = Answer(reason="the node ends")


@dataclass
class CallCounts:
    """The counts of a service's calls; `unasked` are responses of the hardware without a call."""

    called: int = 0
    answered: int = 0
    failed: int = 0
    unasked: int = 0


class CallLine:
    """The calls of one service. Any thread may call the methods; a separate thread passes calls on.

    A late answer that does not identify its call would be assigned to the next call. Therefore, if a call is not
    answered in time, or if more may follow its answer, the next call waits until something follows or until `rest`, but
    at most for another `limit` seconds, or `LEAST_WAIT` seconds if this is longer.

    The line's thread sends answers to the hardware, in the order of calls: the thread that receives calls from the
    hardware must not wait until the hardware accepts an answer.
    """

    def __init__(
        self,
        limit: float,
        hand_over: Callable[[Call], None],
        answer: Callable[[Call, Answer], None],
        start: Start,
        *,
        from_hardware: bool,
    ) -> None:
        """Create a line that answers each call once, by `answer`; `hand_over` may raise `ClosedError`.

        Calls of the hardware (`from_hardware`) have answers that identify their call.
        """
        self._limit = limit
        self._hand_over = hand_over
        self._give = answer
        self._from_hardware = from_hardware
        # Calls, with the answers to refused ones.
        self._waiting: deque[tuple[Call, Answer | None]] = deque()
        self._held: Call | None = None
        self._answer: Answer | None = None
        self._is_final = self._is_late = False
        self._is_closed = self._has_ended = False
        self._is_extended = False
        self._changed = threading.Condition()
        self._thread = start(self._run)

    def put(self, call: Call) -> None:
        """Add a call; it fails if too many calls wait, or if the line is closed."""
        refusal = Answer(reason="too many calls wait, or the node ends")
        with self._changed:
            is_refused = self._is_closed or len(self._waiting) >= MOST_WAITING
            # A refused call of the hardware keeps its turn.
            has_turn = not is_refused or (self._from_hardware and not self._has_ended)
            if has_turn:
                self._waiting.append((call, refusal if is_refused else None))
                self._changed.notify_all()
        if not has_turn:
            self._give(call, refusal)

    def settle(self, answer: Answer, number: int | None = None, *, is_final: bool = True) -> bool:
        """Answer the call in progress, if it has this `number`; return whether a call was answered.

        Unless `is_final` is set, more may follow from the hardware for this call.
        """
        with self._changed:
            is_other = self._held is None or number not in (None, self._held.number)
            if is_other or self._answer is not None:
                return False
            self._answer, self._is_final = answer, is_final
            self._changed.notify_all()
            return True

    def extend(self) -> None:
        """Give the call in progress another `limit` seconds from now."""
        with self._changed:
            self._is_extended = True
            self._changed.notify_all()

    def rest(self) -> None:
        """Handle the report that nothing more follows from the hardware for an abandoned call."""
        with self._changed:
            if self._is_late:
                self._answer = Answer()
                self._changed.notify_all()

    @property
    def is_idle(self) -> bool:
        """Whether no call is in progress or waiting."""
        with self._changed:
            return self._held is None and not self._waiting

    def close(self) -> None:
        """Fail all unanswered calls."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while waiting := self._next():
            call, refusal = waiting
            if refusal:
                self._give(call, refusal)
                continue
            try:
                self._hand_over(call)
            except ClosedError:
                with self._changed:
                    self._is_closed = True
            answer = self._wait()
            self._give(call, answer or (_ENDED if self._is_closed else self._no_answer()))
            self._wait_for_late()

    def _no_answer(self) -> Answer:
        return Answer(reason=f"no answer within {self._limit:g} s")

    def _next(self) -> tuple[Call, Answer | None] | None:
        """Return the next call, and its answer if it is refused, or None if the line is closed and empty."""
        with self._changed:
            self._held = self._answer = None
            self._is_late = False
            self._changed.wait_for(lambda: self._is_closed or self._waiting)
            if not self._waiting:
                self._has_ended = True
                return None
            call, refusal = self._waiting.popleft()
            if self._is_closed:
                return call, refusal or _ENDED
            self._held = call
            return call, refusal

    def _wait(self) -> Answer | None:
        """Return the answer to the call in progress, or None at its time limit or if the line is closed."""
        with self._changed:
            self._is_extended = True
            while self._is_extended and not (self._is_closed or self._answer):
                self._is_extended = False
                self._changed.wait_for(lambda: self._is_closed or self._answer or self._is_extended, self._limit)
            return self._answer

    def _wait_for_late(self) -> None:
        """Wait for late messages from the hardware for the call in progress."""
        with self._changed:
            if self._from_hardware or (self._answer and self._is_final):
                return
            self._answer, self._is_late = None, True
            self._changed.wait_for(lambda: self._is_closed or self._answer, max(self._limit, LEAST_WAIT))


class NodeCalls:
    """The calls of all services of a node, between carriers and hardware; any thread may call the methods."""

    def __init__(
        self,
        services: Sequence[NodeService],
        put: Callable[[str, bytes], None],
        report: Callable[[str], None],
        start: Start,
    ) -> None:
        """Prepare the calls; `put` sends a payload to a block of the hardware, and may raise `ClosedError`."""
        self.counts = {service.block: CallCounts() for service in services}
        self._services = services
        self._put = put
        self._report = report
        self._start = start
        self._numbers = count()
        self._lines: list[CallLine] = []
        self._carriers: Mapping[int, Carrier] = {}
        # The hardware's publishers and subscribers of services.
        self._leaving = {item.response if item.is_server else item.request: n for n, item in enumerate(services)}
        self._requests = {item.request: n for n, item in enumerate(services) if item.is_server}

    def start(self, carriers: Mapping[int, Carrier]) -> None:
        """Begin to hand over calls; `carriers` are those of `Node.run`."""
        self._carriers = carriers
        self._lines = [
            CallLine(
                service.time_limit,
                partial(self._to_hardware if service.is_server else self._to_ros, number),
                partial(self._answer_ros if service.is_server else self._answer_hardware, number),
                self._start,
                from_hardware=not service.is_server,
            )
            for number, service in enumerate(self._services)
        ]

    def called(self, event: Called) -> None:
        """Take a call from ROS."""
        self._call(event.service, event.call)

    def answered(self, event: Answered) -> None:
        """Take ROS's answer to a call of the hardware; late answers are ignored."""
        self._lines[event.service].settle(event.answer, event.number)

    def take(self, block: str, payload: bytes) -> bool:
        """Take a message of the hardware, if it belongs to a service; return whether it does."""
        number = self._leaving.get(block)
        if number is None:
            return False
        service = self._services[number]
        if not service.is_server:
            self._call(number, Call(next(self._numbers), payload))
        elif not self._lines[number].settle(Answer(payload)):
            self.counts[service.block].unasked += 1
            self._report(f"the hardware sent a response of '{service.block}' to no call")
        return True

    def refuse(self, block: str, reason: str) -> None:
        """Fail the call with a fault of the hardware, if the block belongs to a service.

        After a fault in a request, an aborted response may follow.
        """
        number = self._requests.get(block, self._leaving.get(block))
        if number is not None and self._services[number].is_server:
            self._lines[number].settle(Answer(reason=reason), is_final=block not in self._requests)

    def forget(self, reason: str) -> None:
        """Fail all calls in the hardware."""
        for service in self._services:
            self.refuse(service.response, reason)

    def rest(self) -> None:
        """Handle the report that the hardware is idle."""
        for line in self._lines:
            line.rest()

    @property
    def is_idle(self) -> bool:
        """Whether all calls are answered."""
        return all(line.is_idle for line in self._lines)

    def close(self) -> None:
        """Fail all unanswered calls."""
        for line in self._lines:
            line.close()

    def _call(self, number: int, call: Call) -> None:
        self.counts[self._services[number].block].called += 1
        self._lines[number].put(call)

    def _to_hardware(self, number: int, call: Call) -> None:
        self._put(self._services[number].request, call.payload)

    def _to_ros(self, number: int, call: Call) -> None:
        carrier = self._carriers.get(self._services[number].ros)
        if carrier:
            carrier.call(number, call)
        else:
            self._lines[number].settle(Answer(reason="the node has not joined this version of ROS"), call.number)

    def _answer_ros(self, number: int, call: Call, answer: Answer) -> None:
        service = self._services[number]
        # ROS 2 has no answer for a failed call.
        if self._counted(service, answer) and service.ros != 1:
            answer = Answer(service.failure or None, answer.reason)
        self._carriers[service.ros].answer(number, call.number, answer)

    def _answer_hardware(self, number: int, _: Call, answer: Answer) -> None:
        service = self._services[number]
        payload = (service.failure or None) if self._counted(service, answer) else answer.payload
        if payload is not None:
            with suppress(ClosedError):
                self._put(service.response, payload)

    def _counted(self, service: NodeService, answer: Answer) -> bool:
        """Count an answer, and report a failure; return whether the call failed."""
        counts, has_failed = self.counts[service.block], answer.payload is None
        counts.answered += not has_failed
        counts.failed += has_failed
        if has_failed:
            lost = "" if service.failure or (service.is_server and service.ros == 1) else ", and gets no response"
            self._report(f"a call of '{service.block}' failed{lost}: {answer.reason}")
        return has_failed
