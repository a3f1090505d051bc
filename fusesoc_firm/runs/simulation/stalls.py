"""What is known about a simulation in which nothing moves: the message that is not answered, and who may hold it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from fusesoc_firm.runs.simulation.answers import Answer, expected_causes
from fusesoc_firm.runs.simulation.host_files import NO_BLOCK
from fusesoc_firm.system.derived.model import Connection, DerivedSystem

_STALLED = re.compile(r"fault in cycle \d+: nothing moved for \d+ cycles; (\d+) of \d+ frames in, ")


def stall(faults: Iterable[str], answers: Sequence[Answer], stimuli: str, expected: str) -> Stall | None:
    """Return the stall that the faults of the host report, if any; the texts are those of its two files."""
    match = next(filter(None, map(_STALLED.match, faults)), None)
    return Stall(match[0], int(match[1]), answers, stimuli, expected) if match else None


@dataclass(frozen=True)
class Stall:
    """A simulation that ended because nothing moved: the begin of the fault, and the number of messages `sent`."""

    fault: str
    sent: int
    answers: Sequence[Answer]
    stimuli: str
    expected: str

    @cached_property
    def message(self) -> int | None:
        """The number of the first message that was sent and is not answered, if it is known."""
        left = Counter(expected_causes(self.expected)) - Counter(answer.cause for answer in self.answers)
        return min((cause for cause in left if cause is not None and cause < self.sent), default=None)

    @property
    def reason(self) -> str:
        """Why no more bytes of the next message are taken: blocks take none before they have let go of the last."""
        if self.message is not None:
            return f"message {self.message} before it is not answered"
        return f"{NO_BLOCK}, or a message before it is still held" if self.sent else NO_BLOCK

    def notes(self, system: DerivedSystem, core: str) -> Iterator[str]:
        """Yield lines below the fault: the accelerators that may hold the message, their ports, and a check."""
        if self.message is None:
            return
        labels = [line.split()[1] for line in self.stimuli.splitlines() if line.startswith(">")]
        route = _route(system, labels[self.message])
        blocks = {item.block for item in system.accelerators}
        taken = [f"'{end.prefix}msg_ready' of '{end.block}'" for item in route for end in item.sinks if end.prefix]
        sent = [f"'{item.source.prefix}segment_valid' of '{item.source.block}'" for item in route if item.source.prefix]
        names = dict.fromkeys(end.block for item in route for end in item.sinks if end.block in blocks)
        if names:
            held = " or ".join(f"'{name}'" for name in names)
            yield f"message {self.message} to '{labels[self.message]}' is not answered: {held} holds it"
            yield f"likely, one of these stays low, or a 'tready' of its streams: {', '.join([*taken, *sent])}"
            yield (
                "an output's valid may not wait for its ready: 'firm check' warns about it, and "
                f"'firm build {core} --target lint' finds it"
            )


def _route(system: DerivedSystem, block: str) -> list[Connection]:
    """Return the connections that a message to a block can take, with those of the messages that it causes."""
    route: list[Connection] = []
    ahead = {block}
    while new := [item for item in system.connections if item.source.block in ahead and item not in route]:
        route += new
        ahead = {end.block for item in new for end in item.sinks}
    return route
