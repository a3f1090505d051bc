"""Frame -> configuration of the publisher of a message of variable size.

The publisher goes through the places of its program (`places`); a multiplexer selects the word of the current place.
A value that depends on the place is a list in the order of places; each item applies up to and including the item's
`last` place.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from textwrap import shorten

from fusesoc_firm.converter.limits import LONGEST_TAIL
from fusesoc_firm.converter.message_ports import (
    MessageSide,
    StreamPorts,
    message_ports,
    message_side,
    port_declarations,
)
from fusesoc_firm.converter.places import Area, Places, size_of
from fusesoc_firm.converter.ports import FieldPort
from fusesoc_firm.converter.program import (
    Block,
    Close,
    Count,
    Header,
    Open,
    Padding,
    Segment,
    Step,
    Stream,
    comment,
    publisher_program,
)
from fusesoc_firm.converter.slices import Slice, slices_of
from fusesoc_firm.converter.steps import terminator_of
from fusesoc_firm.converter.vhdl import LINE, all_of, any_of, between, binary, bits_of_bool, hexadecimal, within
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, LENGTH_BYTES, Data, Frame, FrameField, Loop
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import Context

VARIABLE_PUBLISHER_TEMPLATE = "vhdl/variable_publisher.vhd"

# Longer literals are split, since GHDL's Verilog output loses the low half of some of them.
_LITERAL_BYTES = 4
_COUNTER_BITS = 32
_LARGEST_NATURAL = 2**31 - 1
_ZEROS = "(others => '0')"
_ALWAYS = ""
# With at least this many places, the multiplexer of all words has too many levels for further logic after it.
_MANY_PLACES = 80
# The words of a longer block are selected a cycle ahead, in groups of 2**6 words, or of 2**7 if words are wide.
_MANY_WORDS = 64
_WIDE_WORD = 32


def variable_publisher_configuration(frame: Frame, width: int, entity: str) -> Context:
    """The configuration of `<pkg>_<type>_to_axis` for a stream of `width` bits."""
    places = Places(publisher_program(frame), width // 8)
    if (places.end + 1) * width > _LARGEST_NATURAL:
        fail(
            f"the fields of {frame.message} have {places.end * places.lanes} bytes, which is too many for a converter",
            hint=f"legal here: at most {_LARGEST_NATURAL // 8}, since VHDL cannot count more than 2**31-1 bits",
        )
    return {"entity": entity, **_Publisher(places, message_side(frame), width).configuration()}


@dataclass(frozen=True)
class _Publisher:
    places: Places
    side: MessageSide
    width: int

    @property
    def frame(self) -> Frame:
        return self.places.program.frame

    @property
    def lanes(self) -> int:
        return self.places.lanes

    def configuration(self) -> Context:
        end = self.places.end
        return {
            "message": str(self.frame.message),
            "middleware": self.frame.ros.title,
            "width": self.width,
            "lanes": self.lanes,
            "count_bits": self.lanes.bit_length(),
            "is_byte_wide": self.lanes == 1,
            # A 32-bit count takes several words, or only part of a word.
            "is_narrow": self.width < _COUNTER_BITS,
            "is_wide": self.width > _COUNTER_BITS,
            "ports": port_declarations(message_ports(self.frame, self.width), "in"),
            "segments": self.side.segments,
            "slack": LONGEST_TAIL if self.frame.trailing_bytes else 0,
            "areas": _listed(self.places),
            "end": end,
            "place_bits": end.bit_length(),
            "all_bits": (end + 1) * self.width,
            "header_last": self.places.areas[0].last,
            # The bits of the length in the first word, and whether more words follow.
            "early_bits": 8 * self._early_bytes,
            "is_length_parted": self._early_bytes < LENGTH_BYTES,
            "pieces": list(self._pieces()),
            **self._ahead_keys(),
            "supplies": _gathered(self._supplies()),
            "sizes": [size for size in _gathered(self._sizes()) if int(size["size"].strip('"'), 2)],
            **self._repeats(),
            **self._stream_keys(),
            **self._opening_keys(),
            **self._loop_keys(),
            **self._padding_keys(),
        }

    # --- words --------------------------------------------------------------------------------------------------

    @property
    def _early_bytes(self) -> int:
        """The number of length bytes in the first word."""
        return min(LENGTH_BYTES, self.lanes - ID_BYTES)

    def _pieces(self) -> Iterator[Context]:
        """The bit ranges of all words after the header with their values, in order."""
        cursor = 8 * (ID_BYTES + LENGTH_BYTES)
        total = (self.places.end + 1) * self.width
        for low, count, value in [*self._known(), (total, 0, "")]:
            if low > cursor:
                yield {"high": low - 1, "low": cursor, "value": _ZEROS}
            if count:
                yield {"high": low + count - 1, "low": low, "value": value}
            cursor = low + count

    def _known(self) -> list[tuple[int, int, str]]:
        """Sorted (lowest bit, bits, value) of all nonzero values."""
        found = [
            (8 * (self.lanes * row.place + offset - row.offset), 8 * size, value)
            for area in self.places.areas
            for row in area.rows
            for offset, size, value in self._values(area.step)
            if row.offset <= offset < row.offset + row.size
        ]
        found += [(self.width * area.first, self.width, port.axis("tdata")) for area, port in self._streams]
        return sorted(found)

    def _ahead_keys(self) -> Context:
        """The ranges of bits whose words are selected a cycle ahead, and the other ranges.

        The first word of a long block is excluded: its place waits for the block's values, which then stay valid.
        """
        ends = [0, *(area.last + 1 for area in self._long_areas)]
        starts = [*(area.first + 1 for area in self._long_areas), self.places.end + 1]
        ahead = [
            {
                **self._word_range(area.first + 1, area.last),
                "number": number,
                "words": area.last - area.first,
                "is_running": _within(area.first, area.last - 1),
                "is_ahead": _within(area.first + 1, area.last),
            }
            for number, area in enumerate(self._long_areas)
        ]
        direct = [self._word_range(end, start - 1) for end, start in zip(ends, starts, strict=True)]
        return {"ahead": ahead, "direct": direct, "group_bits": 7 if self.width > _WIDE_WORD else 6}

    def _word_range(self, first: int, last: int) -> Context:
        return {"high": self.width * (last + 1) - 1, "low": self.width * first}

    @cached_property
    def _long_areas(self) -> list[Area]:
        return [area for area in self.places.areas_of(Block) if area.last - area.first >= _MANY_WORDS]

    def _values(self, step: Step) -> Iterator[tuple[int, int, str]]:
        """(offset, bytes, value) of all nonzero values of a step."""
        if isinstance(step, Count):
            yield 0, COUNT_BYTES, self._count(step.part)
        elif isinstance(step, Block):
            for piece in (piece for leaf in step.fields for piece in self._slices(leaf)):
                yield piece.offset, piece.bytes, bits_of_bool(piece.target) if piece.is_bit else piece.target
            yield from _constants(step)

    def _count(self, part: Data | Loop) -> str:
        length, terminator = self.side.length(part), terminator_of(part)
        return f"std_logic_vector(unsigned({length}) + {terminator})" if terminator else length

    def _slices(self, leaf: FrameField) -> Iterator[Slice]:
        """The pieces of the leaf's port in this step; another `Fixed` may hold the leaf's preceding elements."""
        port = self.side.field(leaf)
        for piece in slices_of(FieldPort(port.name, port.width, leaf)):
            yield Slice(port, piece.low + leaf.first * leaf.type.bits, piece.width, piece.offset, piece.bytes)

    # --- inputs and sizes of places -----------------------------------------------------------------------------

    def _supplies(self) -> Iterator[tuple[int, Context]]:
        """(last place, the inputs that all places up to it need); an element's last place also waits for `valid`."""
        yield 0, {"signal": "segment_valid(0)", "element": ""}
        for area in self.places.areas:
            signal = self._supply(area.step)
            element = ""
            if closing := self.places.closed_by(area):
                if area.last > area.first:
                    yield area.last - 1, {"signal": signal, "element": ""}
                whole = self.side.element(closing.loop).valid
                signal, element = (whole, "") if signal in (_ALWAYS, whole) else (signal, whole)
            yield area.last, {"signal": signal, "element": element}

    def _supply(self, step: Step) -> str:
        match step:
            case Stream(part=part):
                return self.side.stream(part).axis("tvalid")
            case Close(loop=loop):
                return self.side.element(loop).valid
            case Header(segment=segment) | Block(segment=segment) | Count(segment=segment):
                return self._segment(segment)
        return _ALWAYS

    def _segment(self, segment: Segment | None) -> str:
        # After the first place, the message's first segment either stays valid or the message is withdrawn.
        if segment is None or segment == Segment((), 0):
            return _ALWAYS
        if not segment.scope:
            return f"segment_valid({segment.number})"
        ports = self.side.element(segment.scope[-1])
        return ports.valid if ports.segments is None else f"{ports.segment_valid}({segment.number})"

    def _sizes(self) -> Iterator[tuple[int, Context]]:
        """(last place, size in bytes of each place up to it), without streams and padding, whose sizes vary."""
        for area in self.places.areas:
            if isinstance(area.step, Stream | Padding):
                continue
            size = size_of(area.step)
            rest = size % self.lanes
            if size > rest:
                yield area.last - bool(rest), self._size(self.lanes)
            if rest or not size:
                yield area.last, self._size(rest)

    def _size(self, count: int) -> Context:
        return {"size": binary(count, self.lanes.bit_length())}

    def _repeats(self) -> Context:
        rows = [row for area in self.places.areas for row in area.rows if row.times > 1]
        return {
            "repeats": [{"place": row.place, "last": row.times - 1} for row in rows],
            "repeat_bits": max((row.times - 1 for row in rows), default=0).bit_length(),
        }

    # --- streams ------------------------------------------------------------------------------------------------

    @cached_property
    def _streams(self) -> list[tuple[Area, StreamPorts]]:
        """The place and the ports of every stream."""
        areas = self.places.areas_of(Stream)
        return [(area, self.side.stream(area.step.part)) for area in areas if isinstance(area.step, Stream)]

    def _stream_keys(self) -> Context:
        extra_bits = max((_shift(port.part) for _, port in self._streams), default=0)
        return {
            "streams": [{"name": port.name, "place": area.first} for area, port in self._streams],
            "in_stream": _at(area.first for area, _ in self._streams),
            "can_be_long": bool(self._streams or self._closings),
            # The counter counts the bytes of up to 2**32 - 1 elements.
            "left_bits": _COUNTER_BITS + extra_bits,
            "has_extra_bits": extra_bits > 0,
            "near_bits": self._near_bits,
            "step_bits": max(2, self.lanes).bit_length(),
            "counts_data": _any_area(self._data_counts),
            "count_words": self._count_words(),
            "count_word_bits": min(self.width, _COUNTER_BITS),
        }

    def _count_words(self) -> list[Context]:
        """The words of streams' counts, if the multiplexer of all words is too deep and a separate one is faster."""
        if self.places.end - sum(area.last - area.first for area in self._long_areas) < _MANY_PLACES:
            return []
        places = [place for area in self._data_counts for place in range(area.first, area.last + 1)]
        bits = min(self.width, _COUNTER_BITS)
        return [{"place": place, "high": self.width * place + bits - 1, "low": self.width * place} for place in places]

    @property
    def _data_counts(self) -> list[Area]:
        return [area for area in self._counts if isinstance(_part(area), Data)]

    @property
    def _near_bits(self) -> int:
        """The width of a number of bytes that can end with the next beat; a text's count includes one more byte."""
        return max(2, self.lanes.bit_length())

    @property
    def _counts(self) -> list[Area]:
        return self.places.areas_of(Count)

    # --- openings and jumps -------------------------------------------------------------------------------------

    @property
    def _opens(self) -> list[Area]:
        return self.places.areas_of(Open)

    def _opening_keys(self) -> Context:
        data = [(area.first, part) for area in self._opens if isinstance(part := _part(area), Data)]
        jumps = [*self._opening_jumps(), *map(self._closing_jump, self._closings), *self._skips()]
        return {
            "opens_data": _any_place(place for place, _ in data),
            "opens_text": _any_place(place for place, part in data if part.terminator),
            "opens_text_here": _at(place for place, part in data if part.terminator),
            "opens_plain": _any_place(place for place, part in data if not part.terminator),
            "has_plain": any(not part.terminator for _, part in data),
            "opens_bytes": _any_place(place for place, part in data if not _shift(part)),
            "shifts": [
                {
                    "places": _any_place(place for place, part in data if _shift(part) == shift),
                    "shift": shift,
                    # This bit and all higher bits of the number of elements are zero if they take at most two beats.
                    "near_bit": max(0, self._near_bits - shift),
                }
                for shift in sorted({_shift(part) for _, part in data} - {0})
            ],
            "jumps": _gathered(sorted(jumps, key=lambda jump: jump[0]), is_dense=False),
            "targets": _gathered(self._targets({place for place, _ in jumps}), is_dense=False),
        }

    def _targets(self, jumping: Collection[int]) -> Iterator[tuple[int, Context]]:
        """(place, the target of its jump under a condition); padding without a byte is skipped."""
        jumps = [(place, target) for place, target in self.places.jumps if place in jumping]
        skips = [place for place, _ in self._skips()]
        busy = {place for place, _ in jumps} & set(skips)
        found = [(place, target, "left_empty" if place in busy else "") for place, target in jumps]
        found += [(place, place + 2, "not left_empty" if place in busy else "") for place in skips]
        for place, target, condition in sorted(found):
            is_empty = self._is_empty(place, target)
            yield place, self._target(target, condition, f"not {is_empty}" if is_empty else "")
            if is_empty:
                yield place, self._target(target + 1, condition, is_empty)

    def _target(self, place: int, *conditions: str) -> Context:
        return {"target": binary(place, self.places.end.bit_length()), "condition": all_of(filter(None, conditions))}

    def _skips(self) -> Iterator[tuple[int, Context]]:
        """(place, the jump past padding without a byte), where the place has no jump, or skips an empty part."""
        busy = {place for place, _ in self.places.jumps}
        for area in self.places.areas:
            opens_data = isinstance(area.step, Open) and isinstance(area.step.part, Data)
            if (opens_data or area.last not in busy) and (is_empty := self._is_empty(area.last, area.last + 1)):
                yield area.last, {"empty_stream": False, "array": None, "is_closing": False, "empty_padding": is_empty}

    def _is_empty(self, place: int, target: int) -> str:
        """The bit that tells at a place whether the padding at the place `target` is empty.

        "" unless there is padding that may be empty, and the place's size is constant.
        """
        area, padding = self.places.at(place), self.places.at(target).step
        if isinstance(area.step, Stream | Padding) or not isinstance(padding, Padding) or padding.closes_text:
            return ""
        size = size_of(area.step) % self.lanes or min(size_of(area.step), self.lanes)
        phase = f"std_logic_vector(phase_r({_log2(padding.alignment) - 1} downto 0))"
        return f"is_equal({phase}, {-size % padding.alignment})"

    def _opening_jumps(self) -> Iterator[tuple[int, Context]]:
        """(place, the jump past a part without elements); an array of fixed size is never empty."""
        for area in self._opens:
            part = _part(area)
            if isinstance(part, Data):
                yield area.last, {"empty_stream": True, "array": None, "is_closing": False, "empty_padding": ""}
            elif part.count is None:
                array = self._counter(self._depth_of(part))
                yield area.last, {"empty_stream": False, "array": array, "is_closing": False, "empty_padding": ""}

    def _closing_jump(self, closing: tuple[Close, int]) -> tuple[int, Context]:
        """(place, the jump back to the next element)."""
        return closing[1], {"empty_stream": False, "array": None, "is_closing": True, "empty_padding": ""}

    # --- loops --------------------------------------------------------------------------------------------------

    @property
    def _closings(self) -> Sequence[tuple[Close, int]]:
        return self.places.closings

    def _loop_keys(self) -> Context:
        return {
            "closings": [
                {"name": self.side.element(close.loop).name, "place": place} for close, place in self._closings
            ],
            "is_closing": _at(place for _, place in self._closings),
            "element_ends": _gathered(
                ((place, self._counter(len(close.scope))) for close, place in self._closings), is_dense=False
            ),
            "depths": [self._depth(depth) for depth in sorted({len(close.scope) for close, _ in self._closings})],
        }

    def _depth_of(self, loop: Loop) -> int:
        return self._depths[id(loop)]

    @cached_property
    def _depths(self) -> dict[int, int]:
        """The number of loops around the elements of each loop, including the loop itself, by the loop's identity."""
        return {id(close.loop): len(close.scope) for close, _ in self._closings}

    @cached_property
    def _bits_of_depths(self) -> dict[int, int]:
        """The width of the element counter for each depth, which is the number of loops around the elements."""
        bits: dict[int, int] = {}
        for close, _ in self._closings:
            count, depth = close.loop.count, len(close.scope)
            bits[depth] = max(bits.get(depth, 0), _COUNTER_BITS if count is None else count.bit_length())
        return bits

    def _counter(self, depth: int) -> Context:
        return {"depth": depth, "bits": self._bits_of_depths[depth]}

    def _depth(self, depth: int) -> Context:
        bits = self._bits_of_depths[depth]
        own = {id(close.loop) for close, _ in self._closings if len(close.scope) == depth}
        opens = [
            (area.first, part.count)
            for area in self._opens
            if isinstance(part := _part(area), Loop) and id(part) in own
        ]
        return {
            **self._counter(depth),
            "counts": _any_area(area for area in self._counts if id(_part(area)) in own),
            "opens_counted": _any_place(place for place, count in opens if count is None),
            "fixed": [
                {"place": place, "value": binary(2**bits - count, bits), "count": count}
                for place, count in opens
                if count is not None
            ],
            "closes": _any_place(place for close, place in self._closings if len(close.scope) == depth),
        }

    # --- padding ------------------------------------------------------------------------------------------------

    def _padding_keys(self) -> Context:
        steps = ((area.first, area.step) for area in self.places.areas)
        found = [(place, _log2(step.alignment), step.closes_text) for place, step in steps if isinstance(step, Padding)]
        bits = max((own for _, own, _ in found), default=1)
        ahead = ID_BYTES + LENGTH_BYTES + len(self.frame.prefix)
        return {
            "gaps": _by_place((place, {"bits": own, "closes_text": closes}) for place, own, closes in found),
            "in_padding": _at(place for place, _, _ in found),
            "phase_bits": bits,
            "first_phase": binary(-ahead % 2**bits, bits),
            "gap_fits": self.lanes >= max((2**own - (not closes) for _, own, closes in found), default=0),
        }


# --- properties of steps ----------------------------------------------------------------------------------------------


def _part(area: Area) -> Data | Loop:
    assert isinstance(area.step, Count | Open)
    return area.step.part


def _shift(part: Data) -> int:
    """The left shift that turns a number of elements into a number of bytes."""
    return _log2(part.element.size)


def _log2(power: int) -> int:
    return power.bit_length() - 1


def _constants(block: Block) -> Iterator[tuple[int, int, str]]:
    for offset, data in block.constants:
        for start in range(0, len(data), _LITERAL_BYTES):
            part = data[start : start + _LITERAL_BYTES]
            if any(part):
                yield offset + start, len(part), hexadecimal(part)


# --- by place --------------------------------------------------------------------------------------------------------


def _by_place(choices: Iterable[tuple[int, Context]]) -> list[Context]:
    """The choices with their last places, in order; equal neighbours are merged."""
    return [{**value, "last": list(group)[-1][0]} for value, group in groupby(choices, key=lambda choice: choice[1])]


def _gathered(choices: Iterable[tuple[int, Context]], *, is_dense: bool = True) -> list[Context]:
    """The distinct values of the choices in order, each with the condition under which it applies.

    A choice applies from the place after the previous choice if `is_dense`, otherwise only at its own place.
    """
    found: list[tuple[Context, list[tuple[int, int]]]] = []
    first = 0
    for last, value in choices:
        ranges = next((ranges for known, ranges in found if known == value), None)
        if ranges is None:
            found.append((value, ranges := []))
        start = first if is_dense else last
        if ranges and ranges[-1][1] == start - 1:
            start = ranges.pop()[0]
        ranges.append((start, last))
        first = last + 1
    return [{**value, "places": _one_of(ranges)} for value, ranges in found]


def _one_of(ranges: Sequence[tuple[int, int]]) -> str:
    """The bit that is '1' only at the places of these ranges, as an operand."""
    places = any_of(_within(*span) for span in ranges)
    return f"({places})" if len(ranges) > 1 else places


def _at(places: Iterable[int]) -> str:
    """The bit that is '1' only at these places."""
    return any_of(_within(place, place) for place in places)


def _within(first: int, last: int) -> str:
    """The bit that is '1' at the places `first` to `last`."""
    return f"is_equal(place_index, {first})" if first == last else f"is_within(place_index, {first}, {last})"


def _any_place(places: Iterable[int]) -> str:
    """A condition that holds only at these places."""
    return any_of(within("place_r", place, place) for place in places)


def _any_area(areas: Iterable[Area]) -> str:
    """A condition that holds only at the places of these areas, without outer parentheses."""
    areas = list(areas)
    if len(areas) == 1:
        return between("place_r", areas[0].first, areas[0].last)
    return any_of(within("place_r", area.first, area.last) for area in areas)


# --- the list of places ----------------------------------------------------------------------------------------------


def _listed(places: Places) -> list[Context]:
    """The places for the list before the architecture."""
    return [
        {"first": area.first, "last": area.last if area.last > area.first else None, "text": _about(area)}
        for area in places.areas
    ]


def _about(area: Area) -> str:
    size = size_of(area.step)
    match area.step:
        case Header():
            kind = "id and"
        case Block():
            kind = "1 byte:" if size == 1 else f"{size} bytes:"
        case Count():
            kind = "count of"
        case Open():
            kind = "opens"
        case Stream():
            kind = "stream of"
        case Close():
            kind = "closes an element of"
        case _:
            kind = ""
    return shorten(f"{kind} {comment(area.step)}", LINE, placeholder=" ...")
