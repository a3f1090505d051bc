"""A model of the queue of whole frames: it replays the trace of `firm_axis_queue_tb` and says what must come out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

DROPPED = 11
# Cycles until a place is free for another frame, after the last beat of its frame has left.
RECOVERY = 3


@dataclass(frozen=True)
class Beat:
    """A stream in one cycle; `data` is the lowest byte, `lanes` the number of kept ones."""

    is_valid: bool
    is_ready: bool
    is_last: bool
    lanes: int
    data: int

    @property
    def is_taken(self) -> bool:
        """Whether the beat passes in this cycle."""
        return self.is_valid and self.is_ready


@dataclass(frozen=True)
class Cycle:
    """A line of the trace; `is_aborted` is the mark of the leaving beat."""

    entering: Beat
    leaving: Beat
    subscriber_error: bool
    error: bool
    code: int
    is_aborted: bool


@dataclass
class QueuedFrame:
    """A frame in the queue; `beats` are (data, lanes)."""

    beats: list[tuple[int, int]] = field(default_factory=list)
    is_whole: bool = False
    begun_at: int | None = None


@dataclass
class QueueModel:
    """A queue of `frames` frames of `beats` beats.

    The hardware decides which frame is dropped when; the model checks that this one had to go, and all else follows.
    """

    frames: int
    beats: int
    overflow: str
    inside: list[QueuedFrame] = field(default_factory=list)
    arriving: QueuedFrame | None = None
    is_skipping: bool = False
    dropped: int = 0
    left: int = 0
    last_left_at: int = -RECOVERY
    entered: int = 0

    def replay(self, cycles: list[Cycle]) -> None:
        """Follow the trace; raise `AssertionError` where the hardware is wrong."""
        for number, cycle in enumerate(cycles):
            # A report follows its cause by one cycle.
            is_report = number + 1 < len(cycles) and cycles[number + 1].error and cycles[number + 1].code == DROPPED
            if is_report and self.overflow == "drop_oldest":
                self._drop_oldest(number)
            if cycle.leaving.is_valid:
                self._leave(cycle.leaving, number)
            if cycle.entering.is_taken:
                self._enter(cycle.entering, number, is_report=is_report)
            elif self.overflow == "drop_newest":
                assert not cycle.entering.is_valid, f"cycle {number}: a queue that drops frames stalls"
        assert not self.inside, f"{len(self.inside)} frames did not leave"

    def _enter(self, beat: Beat, number: int, *, is_report: bool) -> None:
        if self.is_skipping:
            self.is_skipping = not beat.is_last
            return
        if self.arriving is None:
            self.entered += 1
            if is_report and self.overflow == "drop_newest":
                recovered = number - self.last_left_at >= RECOVERY
                assert len(self.inside) == self.frames or not recovered, f"cycle {number}: dropped with room"
                self.dropped += 1
                self.is_skipping = not beat.is_last
                return
            self.arriving = QueuedFrame()
            self.inside.append(self.arriving)
            assert len(self.inside) <= self.frames, f"cycle {number}: more than {self.frames} frames"
        self.arriving.beats.append((beat.data, beat.lanes))
        if beat.is_last or len(self.arriving.beats) == self.beats:
            self.arriving.is_whole = True
            self.arriving = None
            self.is_skipping = not beat.is_last

    def _leave(self, beat: Beat, number: int) -> None:
        assert self.inside, f"cycle {number}: a beat of no frame leaves"
        frame = self.inside[0]
        assert frame.is_whole, f"cycle {number}: a frame leaves before its end has arrived"
        if frame.begun_at is None:
            frame.begun_at = number
        assert frame.beats, f"cycle {number}: a frame is too long"
        assert (beat.data, beat.lanes) == frame.beats[0], f"cycle {number}: not the beat that entered"
        assert beat.is_last == (len(frame.beats) == 1), f"cycle {number}: the frame has another length"
        if beat.is_ready:
            del frame.beats[0]
            if beat.is_last:
                del self.inside[0]
                self.left += 1
                self.last_left_at = number

    def _drop_oldest(self, number: int) -> None:
        assert self.arriving is None, f"cycle {number}: dropped for no new frame"
        recovered = number - self.last_left_at >= RECOVERY
        assert len(self.inside) == self.frames or not recovered, f"cycle {number}: dropped with room"
        victim = next(frame for frame in self.inside if frame.begun_at is None)
        assert victim.is_whole
        self.inside.remove(victim)
        self.dropped += 1


def read_trace(path: Path) -> list[Cycle]:
    """Read the trace of the bench."""
    return list(_cycles(path))


def _cycles(path: Path) -> Iterator[Cycle]:
    for line in path.read_text(encoding="ascii").splitlines():
        numbers = [int(word) for word in line.split()]
        yield Cycle(_beat(numbers[:5]), _beat(numbers[5:10]), *_report(numbers[10:]))


def _report(numbers: list[int]) -> tuple[bool, bool, int, bool]:
    return bool(numbers[0]), bool(numbers[1]), numbers[2], bool(numbers[3])


def _beat(numbers: list[int]) -> Beat:
    return Beat(bool(numbers[0]), bool(numbers[1]), bool(numbers[2]), numbers[3], numbers[4])
