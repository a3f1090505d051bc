"""Systems in which every message goes from its subscriber directly to its publisher, and bags for them.

rosbags serialises the bags' messages, and the responses are compared with them byte by byte, independently of our code.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import Stimuli, kinds
from tests.frame.oracle import Oracle
from tests.runs.replay.replays import Item, read, write

_STORES = {"noetic": Stores.ROS1_NOETIC, "humble": Stores.ROS2_HUMBLE}
# A subscriber and a publisher do without a pause.
QUIET = 50
# GHDL evaluates all converters in every cycle, so several small systems finish sooner than a single large one.
_MESSAGES_A_SYSTEM = 18


@dataclass(frozen=True)
class PassThrough:
    """A system of some messages of a distribution, and `count` values of each, all drawn by `seed`.

    `pipeline` is that of all subscribers; without it, each has its default.
    """

    distribution: str
    names: Sequence[str]
    count: int
    seed: int
    width: int = 64
    megahertz: float | None = None
    pipeline: str | None = None

    @cached_property
    def ros(self) -> Middleware:
        """The version of ROS."""
        return ros_of(self.distribution)

    def specification(self, folder: Path) -> Path:
        """The system: each message has a subscriber that is called after it, and a publisher."""
        clock = f", clock: {self.megahertz:g} MHz" if self.megahertz else ""
        pipeline = f", pipeline: {self.pipeline}" if self.pipeline else ""
        lines = [f"project: {{name: pass_{self.distribution}, width: {self.width}{clock}{pipeline}}}", "blocks:"]
        for name in self.names:
            kind = f"middleware: ROS{self.ros.number}, message: {name}"
            block = _block(name)
            lines.append(f"  - {{name: {block}, mode: subscriber, {kind}, outgoing: [{{name: {block}_out}}]}}")
            lines.append(f"  - {{name: {block}_out, mode: publisher, {kind}}}")
        path = folder / "pass_through.yaml"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def items(self) -> list[Item]:
        """The messages of the bag, in turn."""
        payloads = self._payloads()
        turns = [(name, payloads[name][number]) for number in range(self.count) for name in self.names]
        return [
            (f"/{_block(name)}", name.replace("/", "/msg/"), 10**18 + number, payload)
            for number, (name, payload) in enumerate(turns)
        ]

    def _payloads(self) -> dict[str, list[bytes]]:
        """Values of all kinds of each message, as rosbags serialises them with its own definitions."""
        oracle = Oracle(self.ros, distribution=self.distribution)
        chance = random.Random(self.seed)
        found = {}
        for name in self.names:
            stimuli = Stimuli(oracle.closure(name), self.ros, chance)
            values = [stimuli.message(parse_name(name), kind) for kind in kinds(self.count)]
            found[name] = [oracle.serialise(name, value) for value in values]
        return found

    def bag(self, folder: Path) -> tuple[Path, list[Item]]:
        """A bag, and what is in it."""
        items = self.items()
        store = get_typestore(_STORES[self.distribution])
        if self.ros is ROS1:
            return write(folder / "in.bag", "ros1", items, store), items
        return write(folder / "in", "mcap", items, store), items


def received(path: Path) -> list[Item]:
    """The messages that came out, under the topics that they had."""
    return [(topic.removesuffix("_out"), type_, stamp, data) for topic, type_, stamp, data in read(path)]


def _block(name: str) -> str:
    return name.replace("/", "_")


def ros_of(distribution: str) -> Middleware:
    """The version of a distribution."""
    return next(ros for ros in (ROS1, ROS2) if distribution in ros.distributions())


def systems_of_all(distribution: str, count: int, seed: int) -> list[PassThrough]:
    """Systems that have, among them, every message of a distribution once."""
    names = Oracle(ros_of(distribution), distribution=distribution).messages()
    groups = [names[first : first + _MESSAGES_A_SYSTEM] for first in range(0, len(names), _MESSAGES_A_SYSTEM)]
    return [PassThrough(distribution, group, count, seed) for group in groups]
