"""The steps of a publisher as a sequence of places.

A place is a word of at most one beat, or a step without words: the opening of a part, a stream, padding, or the end of
an element. A publisher goes from place to place and, after the last place, returns to the first.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from fusesoc_firm.converter.program import Block, Close, Count, Header, Open, Padding, Program, Step, Stream
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, LENGTH_BYTES, Data

# A run of at least this many words of zeros becomes a single place that is sent repeatedly.
_ROW = 4


@dataclass(frozen=True)
class Row:
    """Bytes `offset` to `offset + size - 1` of a step, in words starting at `place`.

    If `times` is more than 1, the row is one word of zeros that is sent `times` times; `size` is the total number of
    bytes.
    """

    offset: int
    size: int
    place: int
    times: int = 1


@dataclass(frozen=True)
class Area:
    """The places `first` to `last` of step `number`; `rows` holds the step's bytes, if any."""

    number: int
    step: Step
    first: int
    last: int
    rows: tuple[Row, ...] = ()


@dataclass(frozen=True)
class Places:
    """The places of a program's steps, in words of `lanes` bytes."""

    program: Program
    lanes: int

    @cached_property
    def areas(self) -> tuple[Area, ...]:
        """The areas of all steps that have a place."""
        areas: list[Area] = []
        place = 0
        for number, step in enumerate(self.program.steps):
            rows = tuple(self._rows(step, place))
            count = sum(self._words(row) for row in rows) or self._moments(number)
            if count:
                areas.append(Area(number, step, place, place + count - 1, rows))
            place += count
        return tuple(areas)

    @property
    def end(self) -> int:
        """The place after all others."""
        return self.areas[-1].last + 1

    @cached_property
    def closings(self) -> tuple[tuple[Close, int], ...]:
        """Each `Close` with the place at which the element ends: the last word before the step, or the step's place."""
        steps = self.program.steps
        return tuple(
            (step, self.areas[bisect_right(self._area_numbers, number) - 1].last)
            for number, step in enumerate(steps)
            if isinstance(step, Close)
        )

    @cached_property
    def jumps(self) -> tuple[tuple[int, int], ...]:
        """(place, target) for each place that may jump, in order."""
        found = [(area.last, self._place(self.program.behind(area.number))) for area in self.areas_of(Open)]
        for (_, place), number in zip(self.closings, self._closing_numbers, strict=True):
            found.append((place, self._place(self.program.body(number))))
        return tuple(sorted(found))

    def at(self, place: int) -> Area:
        """The area of a place; the place after all others belongs to the last area."""
        index = bisect_right([area.first for area in self.areas], place) - 1
        return self.areas[index]

    def areas_of(self, *kinds: type[Step]) -> list[Area]:
        """The areas of the steps of the given kinds."""
        return [area for area in self.areas if isinstance(area.step, kinds)]

    def closed_by(self, area: Area) -> Close | None:
        """The `Close` of the element that ends with the area's last word, if any."""
        following = self.program.steps[area.number + 1]
        return following if isinstance(area.step, Block) and isinstance(following, Close) else None

    @property
    def _closing_numbers(self) -> list[int]:
        return [number for number, step in enumerate(self.program.steps) if isinstance(step, Close)]

    def _place(self, number: int) -> int:
        """The first place of step `number`, or of the next step that has a place."""
        index = bisect_left(self._area_numbers, number)
        return self.areas[index].first if index < len(self.areas) else self.end

    @cached_property
    def _area_numbers(self) -> list[int]:
        return [area.number for area in self.areas]

    def _moments(self, number: int) -> int:
        """The number of places of a step without words; 0 if another step replaces this step."""
        match self.program.steps[number]:
            case Stream() | Padding():
                return 1
            case Open(part=part):
                # An array without a body has no elements to iterate over.
                return int(isinstance(part, Data) or bool(part.body))
            case Close():
                return int(not isinstance(self.program.steps[number - 1], Block))
        return 0

    def _rows(self, step: Step, place: int) -> Iterator[Row]:
        """The bytes of a step in words; a long run of zeros takes a single word."""
        done = 0
        for first, end in _gaps(step):
            begin = -(-first // self.lanes)
            times = end // self.lanes - begin
            if times < _ROW:
                continue
            if begin * self.lanes > done:
                yield Row(done, begin * self.lanes - done, place)
                place += begin - done // self.lanes
            yield Row(begin * self.lanes, self.lanes, place, times)
            place += 1
            done = (begin + times) * self.lanes
        if size_of(step) > done:
            yield Row(done, size_of(step) - done, place)

    def _words(self, row: Row) -> int:
        return -(-row.size // self.lanes)


def size_of(step: Step) -> int:
    """The size of a step in bytes, if the size is constant."""
    match step:
        case Header():
            return ID_BYTES + LENGTH_BYTES
        case Block(size=size):
            return size
        case Count():
            return COUNT_BYTES
    return 0


def _gaps(step: Step) -> Sequence[tuple[int, int]]:
    """(first, end) of each run of zeros in a step."""
    if not isinstance(step, Block):
        return []
    held = [
        (run.offset, run.offset + run.count * leaf.type.size) for leaf in step.fields for run in leaf.runs if run.count
    ]
    held += [(offset, offset + len(data)) for offset, data in step.constants if any(data)]
    ends = [(0, 0), *sorted(held), (step.size, step.size)]
    return [(before[1], behind[0]) for before, behind in pairwise(ends)]
