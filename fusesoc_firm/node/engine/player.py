"""A carrier that plays given messages to a node, at a rate or as fast as the node accepts them."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from itertools import count, islice

from fusesoc_firm.node.engine.carrier import Answer, Call, Event, Taken
from fusesoc_firm.node.engine.watch import Control
from fusesoc_firm.node.interface.diagnostics import Report


class Player:
    """A carrier for the topics of all middlewares; what the node publishes is only recorded by its watch."""

    def __init__(
        self, messages: Sequence[tuple[int, bytes]], control: Control, rate: float = 0.0, rounds: int | None = 1
    ) -> None:
        """Play messages, each with the number of its topic, at `rate` in messages per second (0: as fast as possible).

        All messages are played `rounds` times (None: until the end). `control` pauses them.
        """
        self._messages = messages
        self._control = control
        self._seconds = 1 / rate if rate else 0.0
        self._rounds = rounds
        self._stopped = threading.Event()

    def receive(self) -> Iterator[Event]:
        """Yield the messages; a reader that stops reading also ends the player."""
        try:
            yield from self._play()
        finally:
            self._stopped.set()

    def _play(self) -> Iterator[Event]:
        due = time.monotonic()
        for _ in islice(count(), self._rounds):
            for topic, payload in self._messages:
                self._control.wait(due - time.monotonic())
                if not self._control.passes():
                    return
                now = time.monotonic()
                # After a pause or on a busy machine, delays are not compensated.
                due = max(due, now - self._seconds) + self._seconds
                yield Taken(topic, payload, time.monotonic_ns())

    def publish(self, topic: int, payload: bytes) -> None:
        """Do nothing: the player has no subscribers."""

    def call(self, service: int, call: Call) -> None:
        """Do nothing: no server answers, and the call ends at its time limit."""

    def answer(self, service: int, number: int, answer: Answer) -> None:
        """Do nothing: the player makes no calls."""

    def diagnose(self, report: Report) -> None:
        """Do nothing: the player has no subscribers."""

    def stop(self) -> None:
        """Play no more messages."""
        self._control.end()

    def wait_until_stopped(self, timeout: float) -> bool:
        """Wait until the last message has been yielded."""
        return self._stopped.wait(timeout)

    def close(self) -> None:
        """End the player."""
        self._control.end()
