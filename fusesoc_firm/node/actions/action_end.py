"""The common parts of the two ends of an action: a server of goals, or a client that sends goals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from fusesoc_firm.node.engine.carrier import Answer, Call
from fusesoc_firm.node.interface.action_types import NodeAction


@dataclass
class GoalCounts:
    """The counts of an action's goals.

    `unasked` are feedback and results of the hardware without a goal, `lost` are goals of the hardware whose end is
    unknown.
    """

    goals: int = 0
    succeeded: int = 0
    canceled: int = 0
    aborted: int = 0
    rejected: int = 0
    unasked: int = 0
    lost: int = 0


# Sends a payload to a block of the hardware; may raise `ClosedError`. Reports to the user.
Put = Callable[[str, bytes], None]
Report = Callable[[str], None]


class Ways(NamedTuple):
    """The functions that send from an action to ROS: topics and services have the action's own numbers."""

    publish: Callable[[int, bytes], None]
    reply: Callable[[int, int, bytes], None]
    """Answers the call with a number, of a service."""
    call: Callable[[int, Call], None]
    """Calls a service; `ActionEnd.answered` follows."""


class ActionEnd(ABC):
    """One end of one action, between a carrier and the hardware; any thread may call the methods."""

    def __init__(self, action: NodeAction, counts: GoalCounts, put: Put, report: Report) -> None:
        self.action = action
        self.counts = counts
        self._put = put
        self._report = report

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        try:
            yield
        except ValueError as error:
            self._report(f"an invalid message of '{self.action.block}' is ignored: {error}")

    @abstractmethod
    def start(self, ways: Ways) -> None:
        """Begin to exchange messages with ROS; no message may arrive earlier."""

    @abstractmethod
    def taken(self, topic: int, payload: bytes) -> None:
        """Take a message from ROS."""

    def called(self, service: int, call: Call) -> None:
        """Take a call from ROS."""
        raise AssertionError("the action has no servers of services")

    def answered(self, service: int, number: int, answer: Answer) -> None:
        """Take ROS's answer to a call."""
        raise AssertionError("the action has no clients of services")

    @abstractmethod
    def take(self, block: str, payload: bytes) -> bool:
        """Take a message of the hardware, if it belongs to this action; return whether it does."""

    @abstractmethod
    def refuse(self, block: str, reason: str) -> None:
        """Handle a fault of the hardware in a frame of this block."""

    @abstractmethod
    def forget(self, reason: str) -> None:
        """Handle a restart of the hardware."""

    @abstractmethod
    def rest(self) -> None:
        """Handle the report that the hardware is idle."""

    @property
    @abstractmethod
    def is_idle(self) -> bool:
        """Whether the node can end without waiting for a goal."""

    @abstractmethod
    def tick(self) -> None:
        """Perform the work that is due; called about every 0.1 s."""

    @abstractmethod
    def give_up(self) -> None:
        """Handle the end of the node, while ROS still accepts messages."""

    def wait_until_canceled(self, seconds: float) -> None:  # noqa: B027  (servers have nothing to wait for)
        """Wait at most `seconds` for the answer of a ROS 2 server that may not yet have accepted a goal."""

    @abstractmethod
    def close(self) -> None:
        """Fail all goals that have not ended."""
