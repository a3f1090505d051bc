"""A run of a system, with simulated hardware and software, that receives one message at a time.

Each message is sent when the hardware is at rest after the previous message. The cause of each response is therefore
known, and equal messages always result in equal responses in the same cycles.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from fusesoc_firm.accelerator.functions import Functions, Message
from fusesoc_firm.accelerator.software import sent_elsewhere
from fusesoc_firm.frame.codec import CodecError, decode, pack_frame, trimmed
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.faults import told
from fusesoc_firm.node.engine.bursts import BurstError, BurstJoiner
from fusesoc_firm.node.engine.watch import Watch
from fusesoc_firm.node.transport.simulator import MOST_CYCLES, ErrorPulse, Simulator, Taken
from fusesoc_firm.node.transport.transport import Burst
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, End, Topic
from fusesoc_firm.text.diagnostics import InputError

# After this number of quiet periods, plus this number of cycles for each byte of the frame, a frame counts as stuck,
# and spontaneous sending as endless.
_QUIETS = 100
_CYCLES_A_BYTE = 64


@dataclass
class Cause:
    """A message that was sent to the system: the stamp in ns, and the cycle of the first beat into the hardware.

    `seen` is its number in the record of a `Watch`.
    """

    stamp: int
    first_cycle: int | None = None
    seen: int | None = None


@dataclass(frozen=True)
class Sent:
    """A message that left the system, with its cause: the last earlier message on a route to this message.

    `beats` are the cycles of the message's first and last beat, or None if software sent the message.
    """

    topic: Topic
    payload: bytes
    cause: Cause
    beats: tuple[int, int] | None

    @property
    def cycles(self) -> int | None:
        """The cycles from the cause's first to the response's last beat; None if one bypassed the hardware."""
        if self.beats is None or self.cause.first_cycle is None:
            return None
        return self.beats[1] - self.cause.first_cycle

    def latency(self, clock_hz: Fraction) -> int:
        """Return the time in ns of `cycles`, or 0."""
        return round((self.cycles or 0) * 10**9 / clock_hz)


class StuckError(Exception):
    """The hardware does not accept a frame, and would therefore not accept later frames."""


@dataclass
class SystemRun:
    """A system in simulation; the hardware is at rest after `quiet` cycles without a beat in either direction.

    `sent` and `faults` accumulate until the caller empties them. `watch` records the bursts.
    """

    system: DerivedSystem
    simulator: Simulator
    functions: Functions
    quiet: int
    watch: Watch | None = None
    sent: list[Sent] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    _waiting: deque[Converter] = field(default_factory=deque)
    _causes: dict[str, Cause] = field(default_factory=dict)
    # The cycle of the first beat of each incomplete frame, by the byte of its id.
    _first_cycles: dict[bytes, int | None] = field(default_factory=dict)
    _deadline: int = 0

    @cached_property
    def _joiner(self) -> BurstJoiner:
        return BurstJoiner(len(self.system.publishers), self.system.width)

    @cached_property
    def _subscribers(self) -> Mapping[str, Converter]:
        return {item.block: item for item in self.system.subscribers}

    @cached_property
    def _software(self) -> Mapping[str, Topic]:
        """The topics that software publishes, by block."""
        return {item.block: item for item in self.system.software.publishers}

    @cached_property
    def _entries(self) -> Mapping[str, End]:
        """The sources of the messages that software in other programs sends, by block."""
        return {topic.block: end for topic, end in sent_elsewhere(self.system).items()}

    @cached_property
    def _here(self) -> set[str]:
        return _software_here(self.system)

    @cached_property
    def _successors(self) -> Mapping[str, set[str]]:
        found: dict[str, set[str]] = {}
        for item in (*self.system.connections, *self.system.software.connections):
            found.setdefault(item.source.block, set()).update(end.block for end in item.sinks)
        return found

    def take(self, topic: Topic, payload: bytes, stamp: int, seen: int | None = None) -> None:
        """Send a message to the system, and wait until the hardware is at rest. `seen` is its number in a record.

        If the message is rejected, add a fault. May raise `StuckError` and `TransportError`.
        """
        payload = trimmed(topic.frame, payload)
        try:
            message = decode(topic.frame, payload)
        except CodecError as error:
            self.faults.append(str(error))
            return
        entry = self._entries.get(topic.block, End(topic.block))
        cause = Cause(stamp, seen=seen)
        self._causes |= dict.fromkeys(self._reached(entry.block), cause)
        if entry.block == topic.block and topic.block in self._subscribers:
            self._request(self._subscribers[topic.block], payload)
        self._give(entry, message, cause)
        self._settle(cause)

    @property
    def unfinished(self) -> str:
        """The fault of an incomplete last frame from the hardware; empty if all frames were complete."""
        blocks = [self.system.publishers[number].block for number in self._joiner.unfinished]
        return f"the system has not completed a frame of {', '.join(blocks)}" if blocks else ""

    def _reached(self, block: str) -> set[str]:
        """Return a block and all blocks that its messages reach."""
        found: set[str] = set()
        new = {block}
        while new:
            found |= new
            new = {name for item in new for name in self._successors.get(item, ())} - found
        return found

    def _request(self, subscriber: Converter, payload: bytes) -> None:
        self._waiting.append(subscriber)
        self.simulator.request(pack_frame(subscriber.id, payload))
        self._postpone(len(payload))

    def _postpone(self, size: int) -> None:
        """Extend the deadline because of progress; `size` bytes remain."""
        self._deadline = max(self._deadline, self.simulator.cycle + _QUIETS * self.quiet + _CYCLES_A_BYTE * size)

    def _give(self, source: End, message: Message, cause: Cause) -> None:
        """Pass a message to software, and send the results to the hardware or to publishers."""
        try:
            given = self.functions.take(source, message)
        except InputError as error:
            self.faults.append(str(error).removeprefix("error: "))
            return
        for name, answer in given:
            if subscriber := self._subscribers.get(name):
                self._request(subscriber, encode_used(subscriber.frame, answer))
            else:
                topic = self._software[name]
                self._send(topic, encode_used(topic.frame, answer), cause, None)

    def _settle(self, cause: Cause) -> None:
        """Run until the hardware is at rest."""
        while self._waiting or self._is_busy():
            for event in self.simulator.run(self._patience()):
                match event:
                    case Taken(first_cycle=cycle):
                        self._waiting.popleft()
                        self._postpone(0)
                        if cause.first_cycle is None:
                            cause.first_cycle = cycle
                    case Burst():
                        self._receive(event, cause)
                    case ErrorPulse(converter=converter, code=code):
                        self.faults.append(self._error(converter, code))
            if self._waiting and self.simulator.cycle >= self._deadline:
                raise StuckError(f"the system does not accept the message at '{self._waiting[0].block}'")

    def _is_busy(self) -> bool:
        return self.simulator.quiet < self.quiet and self.simulator.cycle < self._deadline

    def _patience(self) -> int:
        left = self._deadline - self.simulator.cycle
        wanted = left if self._waiting else min(left, self.quiet - self.simulator.quiet)
        return min(max(1, wanted), MOST_CYCLES)

    def _receive(self, burst: Burst, cause: Cause) -> None:
        first = self._first_cycles.pop(burst.data[:1], burst.first_cycle)
        beats = None if first is None or burst.last_cycle is None else (first, burst.last_cycle)
        try:
            frame = self._joiner.push(burst.data, burst.tid, is_aborted=burst.is_aborted)
            self._note_grant(burst)
            if frame is None:
                self._first_cycles[burst.data[:1]] = first
                return
            publisher = self.system.publishers[frame.id]
            if publisher.software and publisher.software.block in self._here:
                self._give(End(publisher.block), decode(publisher.frame, frame.payload), cause)
            else:
                self._send(publisher, frame.payload, cause, beats)
        except (BurstError, CodecError) as error:
            self.faults.append(f"the hardware sent invalid data: {error}")

    def _note_grant(self, burst: Burst) -> None:
        if self.watch and burst.first_cycle is not None and burst.last_cycle is not None:
            block = self.system.publishers[burst.data[0]].block
            self.watch.granted(block, burst.first_cycle, burst.last_cycle)

    def _send(self, topic: Topic, payload: bytes, cause: Cause, beats: tuple[int, int] | None) -> None:
        self.sent.append(Sent(topic, payload, self._causes.get(topic.block, cause), beats))

    def _error(self, converter: int | None, code: int) -> str:
        if converter is None:
            return "the hardware reports id_error: no subscriber has the frame's id"
        return f"the hardware reports frame_error at '{self.system.error_blocks[converter]}': {told(code)}"


def published(system: DerivedSystem) -> list[Topic]:
    """Return a system's output topics: those of software, and those of hardware that software here does not use."""
    here = _software_here(system)
    converters = [item for item in system.publishers if not item.software or item.software.block not in here]
    return [*converters, *system.software.publishers]


def _software_here(system: DerivedSystem) -> set[str]:
    """Return the blocks in software whose functions are available here."""
    return {block.block for block in system.software.blocks if block.type.accelerator.sources}
