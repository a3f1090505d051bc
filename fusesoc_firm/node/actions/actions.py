"""The actions of a node, which the hardware serves or to which it sends goals."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence

from fusesoc_firm.node.actions.action_client import Ros1Client, Ros2Client
from fusesoc_firm.node.actions.action_end import ActionEnd, GoalCounts, Put, Report, Ways
from fusesoc_firm.node.actions.action_server import Ros1Server, Ros2Server
from fusesoc_firm.node.engine.calls import Start
from fusesoc_firm.node.engine.carrier import Answer, Answered, Call, Called, Carrier, Taken
from fusesoc_firm.node.interface.action_types import NodeAction
from fusesoc_firm.node.interface.description import NodeDescription

# s
_TICK_SECONDS = 0.1
_ACCEPT_SECONDS = 1.0
# The ends by the version of ROS and whether the hardware is the server.
_ENDS: Mapping[tuple[int, bool], type[Ros1Server | Ros2Server | Ros1Client | Ros2Client]] = {
    (1, True): Ros1Server,
    (2, True): Ros2Server,
    (1, False): Ros1Client,
    (2, False): Ros2Client,
}


class NodeActions:
    """The goals of all actions of a node, between carriers and hardware; any thread may call the methods."""

    def __init__(self, description: NodeDescription, put: Put, report: Report, start: Start) -> None:
        self.counts = {action.block: GoalCounts() for action in description.actions}
        self._ends = [
            _ENDS[action.ros, action.is_server](action, self.counts[action.block], put, report, start)
            for action in description.actions
        ]
        # The numbers of the actions' topics and services follow those of the others.
        self._topics = [*_numbered(self._ends, lambda action: action.subscribers)]
        self._services = [*_numbered(self._ends, lambda action: action.services)]
        self._first_topic, self._first_service = len(description.subscribers), len(description.services)
        self._first_published = len(description.publishers)
        self._has_ended = threading.Event()
        self._start = start

    def start(self, carriers: Mapping[int, Carrier]) -> None:
        """Begin to exchange goals; `carriers` are those of `Node.run`."""
        published, service = self._first_published, self._first_service
        for end in self._ends:
            carrier = carriers.get(end.action.ros)
            end.start(_ways(carrier, published, service) if carrier else _no_ways(end))
            published += len(end.action.publishers)
            service += len(end.action.services)
        if self._ends:
            self._start(self._tick)

    def taken(self, event: Taken) -> bool:
        """Take a message from ROS, if it belongs to an action; return whether it does."""
        if not 0 <= event.topic - self._first_topic < len(self._topics):
            return False
        end, topic = self._topics[event.topic - self._first_topic]
        end.taken(topic, event.payload)
        return True

    def called(self, event: Called) -> bool:
        """Take a call from ROS, if it belongs to an action; return whether it does."""
        if event.service < self._first_service:
            return False
        end, service = self._services[event.service - self._first_service]
        end.called(service, event.call)
        return True

    def answered(self, event: Answered) -> bool:
        """Take ROS's answer to a call, if it belongs to an action; return whether it does."""
        if event.service < self._first_service:
            return False
        end, service = self._services[event.service - self._first_service]
        end.answered(service, event.number, event.answer)
        return True

    def take(self, block: str, payload: bytes) -> bool:
        """Take a message of the hardware, if it belongs to an action; return whether it does."""
        return any(end.take(block, payload) for end in self._ends)

    def refuse(self, block: str, reason: str) -> None:
        """Fail the goal with a fault of the hardware, if the block belongs to an action."""
        for end in self._ends:
            end.refuse(block, reason)

    def forget(self, reason: str) -> None:
        """Handle a restart of the hardware, which has lost its goals."""
        for end in self._ends:
            end.forget(reason)

    def rest(self) -> None:
        """Handle the report that the hardware is idle."""
        for end in self._ends:
            end.rest()

    @property
    def is_idle(self) -> bool:
        """Whether the node can end without waiting for a goal."""
        return all(end.is_idle for end in self._ends)

    def give_up(self, seconds: float) -> None:
        """Cancel the goals of the hardware at their servers, since the node ends; ROS still accepts messages.

        Servers of ROS 2 must accept a goal first; wait for this at most `seconds`.
        """
        for end in self._ends:
            end.give_up()
        latest = time.monotonic() + min(seconds, _ACCEPT_SECONDS)
        for end in self._ends:
            end.wait_until_canceled(latest - time.monotonic())

    def close(self) -> None:
        """Fail all goals that have not ended."""
        self._has_ended.set()
        for end in self._ends:
            end.close()

    def _tick(self) -> None:
        while not self._has_ended.wait(_TICK_SECONDS):
            for end in self._ends:
                end.tick()


def _numbered(
    ends: Sequence[ActionEnd], parts: Callable[[NodeAction], Sequence[object]]
) -> Iterator[tuple[ActionEnd, int]]:
    for end in ends:
        for number in range(len(parts(end.action))):
            yield end, number


def _ways(carrier: Carrier, topic: int, service: int) -> Ways:
    """Return the functions of an action whose first topic and service have these numbers."""
    return Ways(
        lambda number, payload: carrier.publish(topic + number, payload),
        lambda own, number, payload: carrier.answer(service + own, number, Answer(payload)),
        lambda own, call: carrier.call(service + own, call),
    )


def _no_ways(end: ActionEnd) -> Ways:
    """Return the functions of an action whose version of ROS the node does not use."""

    def call(service: int, call: Call) -> None:
        end.answered(service, call.number, Answer(reason="the node has not joined this version of ROS"))

    return Ways(lambda *_: None, lambda *_: None, call)
