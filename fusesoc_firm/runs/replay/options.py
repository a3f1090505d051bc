"""The options of a replay: the part of a bag to replay, the bag to write, and the settings."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.message.bag_reader import Bag, Form, Recorded
from fusesoc_firm.node.engine.watch import Control, Watch
from fusesoc_firm.runs.bags.goals import BagOfGoals, Told


@dataclass(frozen=True)
class Source:
    """The part of a bag to replay: at most `limit` messages.

    The part begins `start` seconds after the bag's beginning, and lasts `duration` seconds.
    """

    path: Path
    limit: int | None = None
    start: float = 0
    duration: float | None = None

    @property
    def is_whole(self) -> bool:
        """True if the part is the whole bag."""
        return self.limit is None and not self.start and self.duration is None

    def items(self, bag: BagOfGoals, topics: Collection[str]) -> Iterator[Recorded | Told]:
        """Yield the selected messages of some topics, and the bag's records of goals up to the last of them."""
        first, stop = self.window(bag)
        selected = 0
        for item in bag.items(topics, stop):
            if isinstance(item, Recorded):
                if item.stamp < first:
                    continue
                selected += 1
            yield item
            if selected == self.limit:
                return

    def window(self, bag: Bag) -> tuple[int, int | None]:
        """Return the stamps in ns from which on and before which messages are selected."""
        first = bag.start + round(self.start * 10**9)
        return first, None if self.duration is None else first + round(self.duration * 10**9)


@dataclass(frozen=True)
class Target:
    """The bag for the responses; without `form`, the name's ending or else the source determines the format."""

    path: Path
    form: Form | None = None
    force: bool = False


@dataclass(frozen=True)
class Settings:
    """The settings of a replay: `names` renames topics of blocks.

    The hardware is at rest after `quiet` cycles without a beat. If latency is included, a response's stamp is the
    cause's stamp plus the hardware's latency. The summary is a table, or JSON if `is_json` is set. `watch` records all
    messages, and `control` pauses the replay.
    """

    names: Mapping[str, str]
    quiet: int
    has_latency: bool = False
    is_json: bool = False
    watch: Watch | None = None
    control: Control | None = None
