"""What a subscriber reads ahead of its message side: the queue, and the segments of elements that are held twice.

An element's fields and lengths are read into stores. When the element before it has been accepted, they are copied to
further registers, which the ports show. So the next element is read while an element is being accepted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from fusesoc_firm.converter.program import Block, Close, Header, Open, Segment, Step, Stream
from fusesoc_firm.converter.steps import StepSet, is_counted
from fusesoc_firm.frame.model import Path
from fusesoc_firm.frame.values import dotted

# The queue's depth: enough for the largest block of an element, and for what surrounds it.
_LEAST_DEPTH = 8
_LEAST_BEATS, _MOST_BEATS = 16, 128
_SURROUNDING = 8


@dataclass(frozen=True)
class HeldTwice:
    """A segment of an element: step `place` ends it, and the steps of `fillers` write its stores."""

    number: int
    segment: Segment
    place: int
    fillers: frozenset[int]

    @property
    def register(self) -> str:
        """The register that tells whether the current step writes the stores."""
        return f"fills_{self.number}_r"

    @property
    def about(self) -> str:
        """The array, for comments."""
        return dotted(self.segment.scope[-1].names)


@dataclass(frozen=True)
class ReadAhead:
    """The steps of a subscriber with arrays of messages, on a stream with `lanes` bytes in a beat.

    `arrays` are the paths of the arrays whose elements have ports. `ends` are the steps that may end an element, each
    with its `Close`.
    """

    steps: Sequence[Step]
    lanes: int
    arrays: frozenset[Path]
    ends: Mapping[int, int]

    @cached_property
    def segments(self) -> tuple[HeldTwice, ...]:
        """The segments of all elements."""
        ended = [
            (place, step.completes)
            for place, step in enumerate(self.steps)
            if isinstance(step, Block | Open) and step.completes and step.completes.scope
        ]
        return tuple(
            HeldTwice(number, segment, place, self._fillers(segment)) for number, (place, segment) in enumerate(ended)
        )

    def _fillers(self, segment: Segment) -> frozenset[int]:
        return frozenset(
            place
            for place, step in enumerate(self.steps)
            if (isinstance(step, Block) and step.fields and step.segment == segment)
            or (isinstance(step, Open) and is_counted(step) and step.completes == segment)
        )

    def closings(self, close: int) -> list[int]:
        """The steps that end an element of the array with this `Close`."""
        return sorted(place for place, found in self.ends.items() if found == close)

    @cached_property
    def sets(self) -> list[StepSet]:
        """The sets of steps that the queue needs."""
        hands = {place for place, step in enumerate(self.steps) if isinstance(step, Stream) and step.part.is_used}
        found = [StepSet("HANDS", "Hands a stream on.", frozenset(hands), "hands_r")] if hands else []
        found.append(StepSet("TELLS", "Ends a segment or an element.", frozenset(self._telling()), "tells_r"))
        found += [
            StepSet(f"FILLS_{each.number}", f"Writes a segment of {each.about}.", each.fillers, each.register)
            for each in self.segments
        ]
        return found

    def _telling(self) -> set[int]:
        completing = {
            place for place, step in enumerate(self.steps) if isinstance(step, Header | Block | Open) and step.completes
        }
        return completing | {place for place, close in self.ends.items() if self._is_shown(self.steps[close])}

    def _is_shown(self, close: Step) -> bool:
        return isinstance(close, Close) and close.loop.path in self.arrays

    @property
    def depth(self) -> int:
        """The words of the queue: a stream of an element waits while the element before it is being accepted."""
        in_elements = [step for step in self.steps if getattr(step, "scope", ())]
        if not any(isinstance(step, Stream) and step.part.is_used for step in in_elements):
            return _LEAST_DEPTH
        beats = max((-(-step.size // self.lanes) for step in in_elements if isinstance(step, Block)), default=0)
        power: int = 2 ** (beats + _SURROUNDING - 1).bit_length()
        return min(max(power, _LEAST_BEATS), _MOST_BEATS)
