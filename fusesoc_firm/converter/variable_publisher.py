"""Frame -> configuration of the publisher of a message of variable size: its program as a row of places.

A place is a word of up to a beat of bytes, or a moment of the program that has none: the opening of a part, a stream,
padding, the end of an element. The publisher goes from place to place; one multiplexer chooses the place's word.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from textwrap import shorten
from typing import Any

from fusesoc_firm.converter.message_ports import MessagePort, MessageSide, message_ports, message_side
from fusesoc_firm.converter.ports import FieldPort
from fusesoc_firm.converter.program import (
    Block,
    Close,
    Count,
    End,
    Guard,
    Header,
    Open,
    Padding,
    Program,
    Scope,
    Segment,
    Step,
    Stream,
    comment,
    publisher_program,
)
from fusesoc_firm.converter.slices import Slice, slices_of
from fusesoc_firm.diagnostics import fail
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, LENGTH_BYTES, Data, Frame, FrameField, Loop

Configuration = dict[str, Any]

VARIABLE_PUBLISHER_TEMPLATE = "vhdl/variable_publisher.vhd"

# So many words of zeros in a row, and more, are one place that is sent as often.
_ROW = 4
# A literal of zeros and ones is no longer than this: GHDL's Verilog loses the low half of some that are longer.
_LITERAL_BYTES = 4
_COUNTER_BITS = 32
# About so long are lines of conditions.
_LINE = 80
_LARGEST_NATURAL = 2**31 - 1


def variable_publisher_configuration(frame: Frame, width: int, entity: str) -> Configuration:
    """The configuration of `<pkg>_<type>_to_axis` for a stream of `width` bits."""
    return {"entity": entity, **_Publisher(publisher_program(frame), message_side(frame), width).configuration()}


@dataclass(frozen=True)
class _Row:
    """Bytes `offset` to `offset + size - 1` of a step, in words from `place` on.

    Where `times` is more than 1, that is how often the one word of zeros is sent, which then is `size`.
    """

    offset: int
    size: int
    place: int
    times: int = 1


@dataclass(frozen=True)
class _Area:
    """The places of a step: `rows` has those with bytes that are known before."""

    number: int
    step: Step
    first: int
    last: int
    rows: tuple[_Row, ...] = ()


@dataclass(frozen=True)
class _Publisher:
    program: Program
    side: MessageSide
    width: int

    @property
    def frame(self) -> Frame:
        return self.program.frame

    @property
    def lanes(self) -> int:
        return self.width // 8

    def configuration(self) -> Configuration:
        self._check_size()
        return {
            "message": str(self.frame.message),
            "ros": int(self.frame.ros),
            "width": self.width,
            "data_high": self.width - 1,
            "keep_high": self.lanes - 1,
            "lanes": self.lanes,
            "count_high": self.lanes.bit_length() - 1,
            "count_bits": self.lanes.bit_length(),
            "is_byte_wide": self.lanes == 1,
            "ports": _port_declarations(message_ports(self.frame, self.width)),
            "segment_high": self.side.segments - 1,
            "slack": self.frame.trailing_bytes,
            "areas": self._listed(),
            "end": self.end,
            "end_bits": self.end.bit_length(),
            "place_high": self.end.bit_length() - 1,
            "word_count": self.end + 1,
            "words_high": (self.end + 1) * self.width - 1,
            "header_last": self._areas[0].last,
            "pieces": _columns(self._pieces()),
            "supplies": _ladder(self._supplies(), "'0'"),
            "sizes": _ladder(self._sizes(), self._size(self.lanes)),
            "short_parts": "".join(f" or {part}_short" for part in self._checked),
            "long_parts": " or ".join(f"{part}_long" for part in self._checked) or "'0'",
            **self._repeats(),
            **self._streams(),
            **self._loops(),
            **self._opens(),
            **self._paddings(),
        }

    def _check_size(self) -> None:
        if (self.end + 1) * self.width > _LARGEST_NATURAL:
            fail(
                f"{self.frame.message} has {(self.end + 1) * self.lanes} bytes of fields, too many for a converter",
                hint=f"at most {_LARGEST_NATURAL // 8}: VHDL counts the bits of the fields up to 2**31-1",
            )

    # --- places -------------------------------------------------------------------------------------------------

    @cached_property
    def _areas(self) -> tuple[_Area, ...]:
        """The places of every step that has any."""
        areas: list[_Area] = []
        place = 0
        for number, step in enumerate(self.program.steps):
            rows = self._rows(step, place)
            count = _words(rows, self.lanes) if rows else self._moments(number)
            if count:
                areas.append(_Area(number, step, place, place + count - 1, rows))
            place += count
        return tuple(areas)

    def _rows(self, step: Step, place: int) -> tuple[_Row, ...]:
        """The bytes of a step in words, rows of zeros in one word each."""
        size = _size(step)
        rows: list[_Row] = []
        done = 0
        for first, end in _gaps(step):
            begin, words = -(-first // self.lanes), end // self.lanes - -(-first // self.lanes)
            if words < _ROW:
                continue
            if begin * self.lanes > done:
                rows.append(_Row(done, begin * self.lanes - done, place))
                place += begin - done // self.lanes
            rows.append(_Row(begin * self.lanes, self.lanes, place, words))
            place += 1
            done = (begin + words) * self.lanes
        if size > done:
            rows.append(_Row(done, size - done, place))
        return tuple(rows)

    def _moments(self, number: int) -> int:
        """How many places a step without bytes of its own has: none if another one does its work."""
        match self.program.steps[number]:
            case Guard() | Stream() | Padding():
                return 1
            case Open(part=part):
                # A guard opens the part in front of its padding; without a body there is nothing behind it.
                return int(not self._is_guarded(part) and (isinstance(part, Data) or bool(part.body)))
            case Close():
                return int(not self._closes_with_block(number))
        return 0

    def _is_guarded(self, part: Data | Loop) -> bool:
        return any(isinstance(step, Guard) and step.part is part for step in self.program.steps)

    def _closes_with_block(self, number: int) -> bool:
        """Whether the last word in front of a `Close` is the end of the element."""
        return isinstance(self.program.steps[number - 1], Block)

    @cached_property
    def end(self) -> int:
        """The place behind all others."""
        return self._areas[-1].last + 1

    def _place(self, number: int) -> int:
        """Where the work of step `number` begins, or that of the next one with any."""
        return next((area.first for area in self._areas if area.number >= number), self.end)

    def _closing_place(self, number: int) -> int:
        """Where the element of the loop that step `number` closes ends."""
        return max(area.last for area in self._areas if area.number <= number)

    def _areas_of(self, *kinds: type[Step]) -> list[_Area]:
        return [area for area in self._areas if isinstance(area.step, kinds)]

    def _listed(self) -> list[Configuration]:
        """The places for the list in front of the architecture."""
        names = [f"{a.first} to {a.last}" if a.last > a.first else f"{a.first}" for a in self._areas] + [f"{self.end}"]
        texts = [*map(_about, self._areas), "the end"]
        column = max(map(len, names))
        return [{"places": name.rjust(column), "text": text} for name, text in zip(names, texts, strict=True)]

    # --- words --------------------------------------------------------------------------------------------------

    def _pieces(self) -> list[tuple[str, str]]:
        """(part of all_words, value): all bits, in order."""
        known: list[tuple[int, int, str]] = []
        for area in self._areas:
            known += [
                (8 * (self.lanes * row.place + offset - row.offset), 8 * size, value)
                for row in area.rows
                for offset, size, value in self._values(area.step)
                if row.offset <= offset < row.offset + row.size and row.times == 1
            ]
            if isinstance(area.step, Stream):
                known.append((area.first * self.width, self.width, self.side.stream(area.step.part).axis("tdata")))
        known.sort()
        total = (self.end + 1) * self.width
        pieces = []
        cursor = 0
        for low, bits, value in [*known, (total, 0, "")]:
            if low > cursor:
                pieces.append((cursor, low - cursor, "(others => '0')"))
            if bits:
                pieces.append((low, bits, value))
            cursor = low + bits
        return [(f"all_words({low + bits - 1} downto {low})", value) for low, bits, value in pieces]

    def _values(self, step: Step) -> Iterator[tuple[int, int, str]]:
        """(offset, bytes, value) of whatever in a step is not zero."""
        match step:
            case Header():
                yield 0, ID_BYTES, f"std_logic_vector(to_unsigned(ID, {8 * ID_BYTES}))"
                # The port may change once the message is withdrawn.
                here = min(LENGTH_BYTES, self.lanes - ID_BYTES)
                if here:
                    yield ID_BYTES, here, f"payload_length({8 * here - 1} downto 0)"
                if here < LENGTH_BYTES:
                    yield ID_BYTES + here, LENGTH_BYTES - here, f"announced(31 downto {8 * here})"
            case Count(part=part):
                length = self.side.length(part)
                more = part.terminator if isinstance(part, Data) else 0
                yield 0, COUNT_BYTES, f"std_logic_vector(unsigned({length}) + {more})" if more else length
            case Block():
                yield from self._block_values(step)

    def _block_values(self, block: Block) -> Iterator[tuple[int, int, str]]:
        for leaf in block.fields:
            for piece in self._slices(leaf):
                bits = _bits(piece)
                yield piece.offset, piece.bytes, f'"0000000" & {bits}' if _is_bit(piece) else bits
        for offset, data in block.constants:
            for start in range(0, len(data), _LITERAL_BYTES):
                part_of = data[start : start + _LITERAL_BYTES]
                if any(part_of):
                    yield offset + start, len(part_of), f'x"{part_of[::-1].hex()}"'

    def _slices(self, leaf: FrameField) -> Iterator[Slice]:
        port = self.side.field(leaf)
        for piece in slices_of(FieldPort(port.name, port.width, leaf)):
            yield Slice(port, piece.low + leaf.first * leaf.type.bits, piece.width, piece.offset, piece.bytes)

    # --- what happens at a place --------------------------------------------------------------------------------

    def _supplies(self) -> list[tuple[int, str]]:
        """(last place, what the places up to it wait for)."""
        found = [(0, "segment_valid(0)")]
        for area in self._areas:
            signal = self._supply(area.step)
            closing = self.program.steps[area.number + 1]
            if isinstance(closing, Close) and self._closes_with_block(area.number + 1):
                whole = self.side.element(closing.loop).valid
                if area.last > area.first:
                    found.append((area.last - 1, signal))
                signal = whole if signal in ("'1'", whole) else f"{signal} and {whole}"
            found.append((area.last, signal))
        return found

    def _supply(self, step: Step) -> str:
        match step:
            case Stream(part=part):
                return self.side.stream(part).axis("tvalid")
            case Close(loop=loop):
                return self.side.element(loop).valid
            case Header(segment=segment) | Block(segment=segment) | Count(segment=segment):
                return self._segment(segment)
        return "'1'"

    def _segment(self, segment: Segment | None) -> str:
        """The first segment is there at all places but the first, or the message is withdrawn."""
        if segment is None or segment == Segment((), 0):
            return "'1'"
        if not segment.scope:
            return f"segment_valid({segment.number})"
        ports = self.side.element(segment.scope[-1])
        return ports.valid if ports.segments is None else f"{ports.segment_valid}({segment.number})"

    def _sizes(self) -> list[tuple[int, str]]:
        """(last place, bytes of the places up to it); streams and padding know their own."""
        found = []
        for area in self._areas:
            size = _size(area.step)
            if isinstance(area.step, Stream | Padding):
                continue
            if not size:
                found.append((area.last, self._size(0)))
                continue
            rest = size % self.lanes
            if area.last > area.first or not rest:
                found.append((area.last - bool(rest), self._size(self.lanes)))
            if rest:
                found.append((area.last, self._size(rest)))
        return found

    def _size(self, count: int) -> str:
        return f'"{count:0{self.lanes.bit_length()}b}"'

    def _repeats(self) -> Configuration:
        repeats = [(row.place, row.times) for area in self._areas for row in area.rows if row.times > 1]
        bits = max((times - 1 for _, times in repeats), default=0).bit_length()
        return {
            "has_repeats": bool(repeats),
            "repeat_high": bits - 1,
            "repeats": [{"place": place, "last": times - 1, "bits": bits} for place, times in repeats],
        }

    @property
    def _checked(self) -> list[str]:
        """What can have more or less than its length."""
        return [name for name, found in [("stream", self.program.streams), ("elements", self._closings)] if found]

    # --- streams ------------------------------------------------------------------------------------------------

    def _streams(self) -> Configuration:
        areas = self._areas_of(Stream)
        ports = [(area.last, self.side.stream(area.step.part)) for area in areas if isinstance(area.step, Stream)]
        sizes = {part.part.element.size for _, part in ports}
        return {
            "has_streams": bool(areas),
            "in_stream": _any_place(area.first for area in areas),
            "stream_keeps": _ladder([(place, port.axis("tkeep")) for place, port in ports], "(others => '0')"),
            "stream_lasts": _ladder([(place, port.axis("tlast")) for place, port in ports], "'0'"),
            "stream_readies": [{"name": port.axis("tready"), "place": place} for place, port in ports],
            # Bytes of a stream are counted, of up to 2**32 - 1 elements.
            "left_high": _COUNTER_BITS - 1 + max(sizes, default=1).bit_length() - 1,
            "left_bits": _COUNTER_BITS + max(sizes, default=1).bit_length() - 1,
            "has_extra_bits": max(sizes, default=1) > 1,
            "step_high": max(2, self.lanes).bit_length() - 1,
            "step_bits": max(2, self.lanes).bit_length(),
            "counts_data": _any_range(
                (area.first, area.last)
                for area in self._areas_of(Count)
                if isinstance(area.step, Count) and isinstance(area.step.part, Data)
            ),
            **self._loading(),
        }

    def _loading(self) -> Configuration:
        """How a counter gets a count: from one word or, of a narrow stream, from several."""
        return {
            "is_narrow": self.width < _COUNTER_BITS,
            "loaded": "this_word" if self.width <= _COUNTER_BITS else f"this_word({_COUNTER_BITS - 1} downto 0)",
            "shift_low": self.width,
        }

    # --- openings -----------------------------------------------------------------------------------------------

    def _opens(self) -> Configuration:
        opens = self._areas_of(Open, Guard)
        jumps = [(area.last, self._behind(area)) for area in opens]
        jumps += [(self._closing_place(number), self._body(number)) for number in self._closings]
        data = [area for area in opens if isinstance(self._part(area), Data)]
        texts = [area for area in data if self._terminator(area)]
        shifts = [(area.first, self._part(area).element.size.bit_length() - 1) for area in data]  # type: ignore[union-attr]
        return {
            "has_jumps": bool(jumps),
            "jumps": sorted(
                [*map(self._opening_jump, opens), *map(self._closing_jump, self._closings)],
                key=lambda jump: jump["place"],
            ),
            "opens_data": _any_place(area.first for area in data),
            "opens_text": _any_place(area.first for area in texts),
            "has_texts": bool(texts),
            "targets": _ladder(
                [(place, f"to_unsigned({target}, {self.end.bit_length()})") for place, target in sorted(jumps)],
                "(others => '0')",
            ),
            "shifts": [
                {"places": _any_place(place for place, shift in shifts if shift == wanted), "shift": wanted}
                for wanted in sorted({shift for _, shift in shifts} - {0})
            ],
        }

    def _opening_jump(self, area: _Area) -> Configuration:
        """Past a part without elements; an array of fixed size has some."""
        match self._part(area):
            case Data():
                value = "left_ends"
            case Loop(count=None):
                assert isinstance(area.step, Open)
                value = self._elements_carry(len(area.step.scope) + 1)
            case _:
                value = "'0'"
        return {"place": area.last, "value": value}

    def _closing_jump(self, number: int) -> Configuration:
        return {"place": self._closing_place(number), "value": "not (element_last or elements_end)"}

    def _elements_carry(self, depth: int) -> str:
        return f"elements_{depth}_sum({self._depth_bits(depth)})"

    @staticmethod
    def _part(area: _Area) -> Data | Loop:
        assert isinstance(area.step, Open | Guard)
        return area.step.part

    def _terminator(self, area: _Area) -> int:
        part = self._part(area)
        return part.terminator if isinstance(part, Data) else 0

    def _behind(self, area: _Area) -> int:
        number = area.number
        if isinstance(area.step, Guard):
            number = self.program.behind_guard(number)
        return self._place(self.program.behind(number))

    def _body(self, number: int) -> int:
        return self._place(self.program.body(number))

    # --- loops --------------------------------------------------------------------------------------------------

    @cached_property
    def _closings(self) -> list[int]:
        return [number for number, step in enumerate(self.program.steps) if isinstance(step, Close)]

    def _loops(self) -> Configuration:
        closings = [(self._closing_place(number), self._loop(number)) for number in self._closings]
        ports = [(place, self.side.element(scope[-1])) for place, scope in closings]
        depths = sorted({len(scope) for _, scope in closings})
        return {
            "has_loops": bool(closings),
            "is_closing": _any_place(place for place, _ in closings),
            "element_lasts": _ladder([(place, port.last) for place, port in ports], "'0'"),
            "element_readies": [{"name": port.ready, "place": place} for place, port in ports],
            "element_ends": _ladder([(place, self._elements_carry(len(scope))) for place, scope in closings], "'0'"),
            "depths": [self._depth(depth) for depth in depths],
        }

    def _loop(self, number: int) -> Scope:
        step = self.program.steps[number]
        assert isinstance(step, Close)
        return step.scope

    def _depth_bits(self, depth: int) -> int:
        """Bits of the counter for the elements of the loops with `depth` - 1 others around."""
        loops = [scope[-1] for scope in map(self._loop, self._closings) if len(scope) == depth]
        return max(_COUNTER_BITS if loop.count is None else loop.count.bit_length() for loop in loops)

    def _depth(self, depth: int) -> Configuration:
        scopes = [self._loop(number) for number in self._closings if len(self._loop(number)) == depth]
        loops = [scope[-1] for scope in scopes]
        opens = [area for area in self._areas_of(Open) if any(self._part(area) is loop for loop in loops)]
        counts = [
            (area.first, area.last)
            for area in self._areas_of(Count)
            if isinstance(area.step, Count) and any(area.step.part is loop for loop in loops)
        ]
        bits = self._depth_bits(depth)
        fixed = [(area, self._part(area)) for area in opens]
        return {
            "depth": depth,
            **self._loading(),
            "high": bits - 1,
            "bits": bits,
            "counts": _any_range(counts),
            "has_counts": bool(counts),
            "opens_counted": _any_place(area.first for area, part in fixed if _count(part) is None),
            "fixed": [
                {"depth": depth, "place": area.first, "value": f'"{2**bits - count:0{bits}b}"', "count": count}
                for area, part in fixed
                if (count := _count(part)) is not None
            ],
            "closes": _any_place(
                self._closing_place(number) for number in self._closings if len(self._loop(number)) == depth
            ),
        }

    # --- padding ------------------------------------------------------------------------------------------------

    def _paddings(self) -> Configuration:
        areas = self._areas_of(Padding)
        widest = max((area.step.alignment for area in areas if isinstance(area.step, Padding)), default=2)
        bits = widest.bit_length() - 1
        gaps = []
        for area in areas:
            assert isinstance(area.step, Padding)
            own = area.step.alignment.bit_length() - 1
            zeros = f'"{"0" * (bits - own)}" & ' if bits > own else ""
            gaps.append((area.last, f"{zeros}phase_left({own - 1} downto 0)"))
        ahead = ID_BYTES + LENGTH_BYTES + len(self.frame.prefix)
        return {
            "has_padding": bool(areas),
            "in_padding": _any_place(area.first for area in areas),
            "phase_high": bits - 1,
            "phase_bits": bits,
            "first_phase": f'"{-ahead % 2**bits:0{bits}b}"',
            "gaps": _ladder(gaps, "(others => '0')"),
            "gap_fits": self.lanes >= 2**bits,
        }


def _size(step: Step) -> int:
    """The bytes of a step that are as many whenever it is reached."""
    match step:
        case Header():
            return ID_BYTES + LENGTH_BYTES
        case Block(size=size):
            return size
        case Count():
            return COUNT_BYTES
    return 0


def _gaps(step: Step) -> Iterator[tuple[int, int]]:
    """The (first, end) of each run of zeros in a step."""
    if not isinstance(step, Block):
        return
    held = [
        (run.offset, run.offset + run.count * leaf.type.size) for leaf in step.fields for run in leaf.runs if run.count
    ]
    held += [(offset, offset + len(data)) for offset, data in step.constants if any(data)]
    ends = [(0, 0), *sorted(held), (step.size, step.size)]
    yield from ((before[1], behind[0]) for before, behind in pairwise(ends))


def _words(rows: Sequence[_Row], lanes: int) -> int:
    return sum(1 if row.times > 1 else -(-row.size // lanes) for row in rows)


def _count(part: Data | Loop) -> int | None:
    return part.count if isinstance(part, Loop) else None


def _about(area: _Area) -> str:
    kind = {
        Header: "id and",
        Block: "1 byte:" if _size(area.step) == 1 else f"{_size(area.step)} bytes:",
        Count: "count of",
        Guard: "opens",
        Open: "opens",
        Stream: "stream of",
        Close: "closes an element of",
        Padding: "",
        End: "",
    }[type(area.step)]
    return shorten(f"{kind} {comment(area.step)}", _LINE, placeholder=" ...")


def _bits(piece: Slice) -> str:
    """The port, or the part of it that the piece is."""
    port = piece.port
    if port.width is None or (piece.width == port.width and not _is_bit(piece)):
        return port.name
    return f"{port.name}({piece.low})" if _is_bit(piece) else f"{port.name}({piece.high} downto {piece.low})"


def _is_bit(piece: Slice) -> bool:
    return piece.port.field.type.bits == 1


# --- VHDL text -------------------------------------------------------------------------------------------------------


def _port_declarations(ports: Sequence[MessagePort]) -> list[Configuration]:
    """The message side as port declarations in columns."""
    names = max([len("frame_error_code"), *(len(port.name) for port in ports)])
    types = max(len(port.vhdl_type) for port in ports)
    return [
        {
            "name": port.name.ljust(names),
            "direction": "out" if port.is_reverse else "in ",
            "type": port.vhdl_type,
            "comment": f"{' ' * (types - len(port.vhdl_type))} -- {port.comment}" if port.comment else "",
        }
        for port in ports
    ]


def _columns(pairs: Sequence[tuple[str, str]]) -> list[Configuration]:
    column = max(len(target) for target, _ in pairs)
    return [{"target": target.ljust(column), "value": value} for target, value in pairs]


def _ladder(choices: Iterable[tuple[int, str]], otherwise: str) -> list[Configuration]:
    """`value when place_r <= last else` for each choice in order; neighbours with the same value share one.

    The last choice needs no condition if nothing lies behind it; `otherwise` is for none at all.
    """
    groups = [(list(group)[-1][0], value) for value, group in groupby(choices, key=lambda choice: choice[1])]
    if not groups:
        return [{"value": otherwise, "condition": "", "joint": ";"}]
    column = max(len(value) for _, value in groups)
    rows = [
        {"value": value.ljust(column), "condition": f" when place_r <= {place}", "joint": " else"}
        for place, value in groups[:-1]
    ]
    return [*rows, {"value": groups[-1][1], "condition": "", "joint": ";"}]


def _any_place(places: Iterable[int]) -> str:
    """A condition that holds at these places only."""
    return _any(f"place_r = {place}" for place in places)


def _any_range(ranges: Iterable[tuple[int, int]]) -> str:
    """A condition that holds at the places from each `first` to its `last` only."""
    return _any(
        f"place_r = {first}" if first == last else f"(place_r >= {first} and place_r <= {last})"
        for first, last in ranges
    )


def _any(conditions: Iterable[str]) -> str:
    lines: list[str] = []
    for condition in conditions:
        if lines and len(lines[-1]) + len(condition) < _LINE:
            lines[-1] += f" or {condition}"
        else:
            lines.append(condition)
    return " or\n        ".join(lines) or "false"
