"""Record the system's messages in the bag of responses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from fusesoc_firm.runs.bags.writer import BagWriter, RecordedTopic
from fusesoc_firm.runs.replay.audience import Audience
from fusesoc_firm.runs.replay.hardware_run import Sent


@dataclass
class Recorder:
    """The bag of responses while it is written, with the number of messages by block.

    With `clock_hz`, a stamp includes the hardware's latency.
    """

    bag: BagWriter
    topics: Mapping[str, RecordedTopic]
    clock_hz: Fraction | None
    audience: Audience
    counts: Counter[str] = field(default_factory=Counter)

    def record(self, sent: Sent) -> None:
        """Write a message with the stamp of its cause."""
        stamp = sent.cause.stamp + (sent.latency(self.clock_hz) if self.clock_hz else 0)
        self.bag.write(self.topics[sent.topic.block], stamp, sent.payload)
        self.counts[sent.topic.block] += 1
        self.audience.sent(sent, stamp)
