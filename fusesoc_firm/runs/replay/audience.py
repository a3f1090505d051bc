"""Show a replay to the page that watches it: its messages, and where they wait."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

from fusesoc_firm.node.engine.watch import Latency, Watch
from fusesoc_firm.node.transport.simulator import WAITS_SECONDS, Simulator, Waits
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.replay.hardware_run import Sent


@dataclass
class Audience:
    """A watch on a replay, or None; `start` is the bag's first stamp in ns."""

    watch: Watch | None
    simulator: Simulator
    start: int
    # The time of the last request of waits, by the monotonic clock.
    _counted_at: float = 0.0

    def __post_init__(self) -> None:
        """Tell the watch the time at which the bag begins."""
        if self.watch:
            self.watch.epoch_ns = self.start

    def received(self, block: str, payload: bytes, stamp: int) -> int | None:
        """Show a message to the system, and return its number in the record."""
        return self.watch.saw(block, payload, stamp - self.start) if self.watch else None

    def sent(self, message: Sent, stamp: int) -> None:
        """Show a message of the system, which is recorded at `stamp`."""
        if self.watch:
            latency = Latency(message.cause.seen, message.cycles)
            self.watch.saw(message.topic.block, message.payload, stamp - self.start, latency, message.beats)

    def count_waits(self) -> None:
        """Show where messages have waited since the last count, if that is some time ago."""
        now = time.monotonic()
        if not self.watch or now < self._counted_at + WAITS_SECONDS:
            return
        self._counted_at = now
        # The next message reports the end of a simulator.
        with suppress(TransportError):
            if not self.watch.is_watched():
                self.simulator.end_waits()
                return
            self.simulator.request_waits()
            for event in self.simulator.run(0):
                if isinstance(event, Waits):
                    self.watch.waited(event.first, event.cycle, event.counts)
