"""Frame -> configuration of the publisher of a message of variable size.

The publisher goes through the places of its program (`places`); a multiplexer chooses the word of the place. Whatever
depends on the place is a ladder of conditions, a line a step.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from textwrap import shorten
from typing import Any

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
    Guard,
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
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, LENGTH_BYTES, Data, Frame, FrameField, Loop
from fusesoc_firm.text.diagnostics import fail

Configuration = dict[str, Any]

VARIABLE_PUBLISHER_TEMPLATE = "vhdl/variable_publisher.vhd"

# A literal is no longer: GHDL's Verilog loses the low half of some that are.
_LITERAL_BYTES = 4
_COUNTER_BITS = 32
# About so long are lines of conditions and of the list of places.
_LINE = 80
_LARGEST_NATURAL = 2**31 - 1
_ZEROS = "(others => '0')"


def variable_publisher_configuration(frame: Frame, width: int, entity: str) -> Configuration:
    """The configuration of `<pkg>_<type>_to_axis` for a stream of `width` bits."""
    places = Places(publisher_program(frame), width // 8)
    if (places.end + 1) * width > _LARGEST_NATURAL:
        fail(
            f"the fields of {frame.message} take {places.end * places.lanes} bytes, too many for a converter",
            hint=f"at most {_LARGEST_NATURAL // 8}: VHDL counts the bits of all fields up to 2**31-1",
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

    def configuration(self) -> Configuration:
        end = self.places.end
        checked = [name for name, found in [("stream", self._streams), ("elements", self._closings)] if found]
        return {
            "message": str(self.frame.message),
            "middleware": self.frame.ros.title,
            "width": self.width,
            "data_high": self.width - 1,
            "keep_high": self.lanes - 1,
            "lanes": self.lanes,
            "count_high": self.lanes.bit_length() - 1,
            "count_bits": self.lanes.bit_length(),
            "is_byte_wide": self.lanes == 1,
            "ports": port_declarations(message_ports(self.frame, self.width), "in"),
            "segment_high": self.side.segments - 1,
            "slack": self.frame.trailing_bytes,
            "areas": _listed(self.places),
            "end": end,
            "end_bits": end.bit_length(),
            "place_high": end.bit_length() - 1,
            "word_count": end + 1,
            "words_high": (end + 1) * self.width - 1,
            "header_last": self.places.areas[0].last,
            "pieces": _columns(list(self._pieces())),
            "supplies": _ladder(self._supplies(), "'0'"),
            "sizes": _ladder(self._sizes(), self._size(0)),
            "short_parts": "".join(f" or {part}_short" for part in checked),
            "long_parts": " or ".join(f"{part}_long" for part in checked) or "'0'",
            **self._repeat_keys(),
            **self._stream_keys(),
            **self._opening_keys(),
            **self._loop_keys(),
            **self._padding_keys(),
        }

    # --- words --------------------------------------------------------------------------------------------------

    def _pieces(self) -> Iterator[tuple[str, str]]:
        """(part of all_words, value): all bits, in order."""
        cursor = 0
        total = (self.places.end + 1) * self.width
        for low, bits, value in [*self._known(), (total, 0, "")]:
            if low > cursor:
                yield f"all_words({low - 1} downto {cursor})", _ZEROS
            if bits:
                yield f"all_words({low + bits - 1} downto {low})", value
            cursor = low + bits

    def _known(self) -> list[tuple[int, int, str]]:
        """(lowest bit, bits, value) of what is not zeros, in order."""
        found = [
            (8 * (self.lanes * row.place + offset - row.offset), 8 * size, value)
            for area in self.places.areas
            for row in area.rows
            for offset, size, value in self._values(area.step)
            if row.offset <= offset < row.offset + row.size
        ]
        found += [(self.width * area.first, self.width, port.axis("tdata")) for area, port in self._streams]
        return sorted(found)

    def _values(self, step: Step) -> Iterator[tuple[int, int, str]]:
        """(offset, bytes, value) of what a step has that is not zeros."""
        match step:
            case Header():
                yield 0, ID_BYTES, f"std_logic_vector(to_unsigned(ID, {8 * ID_BYTES}))"
                # Behind the first word the port may be wrong already: the message may be withdrawn.
                first = min(LENGTH_BYTES, self.lanes - ID_BYTES)
                if first:
                    yield ID_BYTES, first, f"payload_length({8 * first - 1} downto 0)"
                if first < LENGTH_BYTES:
                    yield ID_BYTES + first, LENGTH_BYTES - first, f"announced(31 downto {8 * first})"
            case Count(part=part):
                length, terminator = self.side.length(part), terminator_of(part)
                yield 0, COUNT_BYTES, f"std_logic_vector(unsigned({length}) + {terminator})" if terminator else length
            case Block():
                yield from self._fields(step)
                yield from _constants(step)

    def _fields(self, block: Block) -> Iterator[tuple[int, int, str]]:
        for leaf in block.fields:
            for piece in self._slices(leaf):
                yield piece.offset, piece.bytes, f'"0000000" & {piece.target}' if piece.is_bit else piece.target

    def _slices(self, leaf: FrameField) -> Iterator[Slice]:
        """The pieces of the leaf's port; another `Fixed` may hold the elements before the first one here."""
        port = self.side.field(leaf)
        for piece in slices_of(FieldPort(port.name, port.width, leaf)):
            yield Slice(port, piece.low + leaf.first * leaf.type.bits, piece.width, piece.offset, piece.bytes)

    # --- what a place waits for, and how many bytes it has ------------------------------------------------------

    def _supplies(self) -> Iterator[tuple[int, str]]:
        """(last place, what the places up to it wait for)."""
        yield 0, "segment_valid(0)"
        for area in self.places.areas:
            signal = self._supply(area.step)
            if closing := self.places.closed_by(area):
                if area.last > area.first:
                    yield area.last - 1, signal
                whole = self.side.element(closing.loop).valid
                signal = whole if signal in ("'1'", whole) else f"{signal} and {whole}"
            yield area.last, signal

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
        # Behind the first place, the message's first segment is valid, or the message is withdrawn.
        if segment is None or segment == Segment((), 0):
            return "'1'"
        if not segment.scope:
            return f"segment_valid({segment.number})"
        ports = self.side.element(segment.scope[-1])
        return ports.valid if ports.segments is None else f"{ports.segment_valid}({segment.number})"

    def _sizes(self) -> Iterator[tuple[int, str]]:
        """(last place, bytes of each of the places up to it); a stream and padding know their own."""
        for area in self.places.areas:
            if isinstance(area.step, Stream | Padding):
                continue
            size = size_of(area.step)
            rest = size % self.lanes
            if size > rest:
                yield area.last - bool(rest), self._size(self.lanes)
            if rest or not size:
                yield area.last, self._size(rest)

    def _size(self, count: int) -> str:
        return f'"{count:0{self.lanes.bit_length()}b}"'

    def _repeat_keys(self) -> Configuration:
        repeats = [(row.place, row.times - 1) for area in self.places.areas for row in area.rows if row.times > 1]
        bits = max((last for _, last in repeats), default=0).bit_length()
        return {
            "has_repeats": bool(repeats),
            "repeat_high": bits - 1,
            "repeats": [{"place": place, "last": last, "bits": bits} for place, last in repeats],
        }

    # --- streams ------------------------------------------------------------------------------------------------

    @cached_property
    def _streams(self) -> list[tuple[Area, StreamPorts]]:
        """Every stream's place and ports."""
        areas = self.places.areas_of(Stream)
        return [(area, self.side.stream(area.step.part)) for area in areas if isinstance(area.step, Stream)]

    def _stream_keys(self) -> Configuration:
        # What is counted are bytes, of up to 2**32 - 1 elements.
        extra_bits = max((_shift(port.part) for _, port in self._streams), default=0)
        counts = [area for area in self._counts if isinstance(_part(area), Data)]
        readies = _aligned([port.axis("tready") for _, port in self._streams])
        return {
            "has_streams": bool(self._streams),
            "in_stream": _any_place(area.first for area, _ in self._streams),
            "stream_keeps": _ladder([(area.last, port.axis("tkeep")) for area, port in self._streams], _ZEROS),
            "stream_lasts": _ladder([(area.last, port.axis("tlast")) for area, port in self._streams], "'0'"),
            "stream_readies": [
                {"name": name, "place": area.first} for (area, _), name in zip(self._streams, readies, strict=True)
            ],
            "left_high": _COUNTER_BITS + extra_bits - 1,
            "left_bits": _COUNTER_BITS + extra_bits,
            "has_extra_bits": extra_bits > 0,
            "step_high": max(2, self.lanes).bit_length() - 1,
            "step_bits": max(2, self.lanes).bit_length(),
            "counts_data": _any_range(counts),
            **self._loading(),
        }

    @property
    def _counts(self) -> list[Area]:
        return self.places.areas_of(Count)

    def _loading(self) -> Configuration:
        """How a counter gets a count: from one word or, of a narrow stream, from several."""
        return {
            "is_narrow": self.width < _COUNTER_BITS,
            "loaded": "this_word" if self.width <= _COUNTER_BITS else f"this_word({_COUNTER_BITS - 1} downto 0)",
            "shift_low": self.width,
        }

    # --- openings and jumps -------------------------------------------------------------------------------------

    @property
    def _opens(self) -> list[Area]:
        return self.places.areas_of(Open, Guard)

    def _opening_keys(self) -> Configuration:
        data = [(area.first, part) for area in self._opens if isinstance(part := _part(area), Data)]
        texts = [place for place, part in data if part.terminator]
        bits = self.places.end.bit_length()
        return {
            "opens_data": _any_place(place for place, _ in data),
            "opens_text": _any_place(texts),
            "has_texts": bool(texts),
            "shifts": [
                {"places": _any_place(place for place, part in data if _shift(part) == shift), "shift": shift}
                for shift in sorted({_shift(part) for _, part in data} - {0})
            ],
            "has_jumps": bool(self.places.jumps),
            "jumps": sorted(
                [*map(self._opening_jump, self._opens), *map(self._closing_jump, self._closings)],
                key=lambda jump: int(jump["place"]),
            ),
            "targets": _ladder(
                [(place, f"to_unsigned({target}, {bits})") for place, target in self.places.jumps], _ZEROS
            ),
        }

    def _opening_jump(self, area: Area) -> Configuration:
        """Past a part without elements; an array of fixed size has some."""
        match _part(area):
            case Data():
                value = "left_ends"
            case Loop(count=None) as loop:
                value = self._elements_end(self._depth_of(loop))
            case _:
                value = "'0'"
        return {"place": area.last, "value": value}

    def _closing_jump(self, closing: tuple[Close, int]) -> Configuration:
        return {"place": closing[1], "value": "not (element_last or elements_end)"}

    # --- loops --------------------------------------------------------------------------------------------------

    @property
    def _closings(self) -> Sequence[tuple[Close, int]]:
        return self.places.closings

    def _loop_keys(self) -> Configuration:
        ports = [(place, self.side.element(close.loop)) for close, place in self._closings]
        readies = _aligned([port.ready for _, port in ports])
        return {
            "has_loops": bool(ports),
            "is_closing": _any_place(place for place, _ in ports),
            "element_lasts": _ladder([(place, port.last) for place, port in ports], "'0'"),
            "element_readies": [
                {"name": name, "place": place} for (place, _), name in zip(ports, readies, strict=True)
            ],
            "element_ends": _ladder(
                [(place, self._elements_end(len(close.scope))) for close, place in self._closings], "'0'"
            ),
            "depths": [self._depth(depth) for depth in sorted({len(close.scope) for close, _ in self._closings})],
        }

    def _depth_of(self, loop: Loop) -> int:
        return self._depths[id(loop)]

    @cached_property
    def _depths(self) -> dict[int, int]:
        """How many loops are around the elements of each loop, itself included; by its identity."""
        return {id(close.loop): len(close.scope) for close, _ in self._closings}

    def _depth_bits(self, depth: int) -> int:
        """Bits of the counter for the elements of loops with `depth` - 1 others around."""
        return self._bits_of_depths[depth]

    @cached_property
    def _bits_of_depths(self) -> dict[int, int]:
        bits: dict[int, int] = {}
        for close, _ in self._closings:
            count, depth = close.loop.count, len(close.scope)
            bits[depth] = max(bits.get(depth, 0), _COUNTER_BITS if count is None else count.bit_length())
        return bits

    def _elements_end(self, depth: int) -> str:
        return f"elements_{depth}_sum({self._depth_bits(depth)})"

    def _depth(self, depth: int) -> Configuration:
        bits = self._depth_bits(depth)
        own = {id(close.loop) for close, _ in self._closings if len(close.scope) == depth}
        counts = [area for area in self._counts if id(_part(area)) in own]
        opens = [
            (area.first, part.count)
            for area in self._opens
            if isinstance(part := _part(area), Loop) and id(part) in own
        ]
        return {
            "depth": depth,
            "high": bits - 1,
            "bits": bits,
            "has_counts": bool(counts),
            "counts": _any_range(counts),
            "opens_counted": _any_place(place for place, count in opens if count is None),
            "fixed": [
                {"depth": depth, "place": place, "value": f'"{2**bits - count:0{bits}b}"', "count": count}
                for place, count in opens
                if count is not None
            ],
            "closes": _any_place(place for close, place in self._closings if len(close.scope) == depth),
            **self._loading(),
        }

    # --- padding ------------------------------------------------------------------------------------------------

    def _padding_keys(self) -> Configuration:
        steps = ((area.first, area.step) for area in self.places.areas)
        found = [(place, _log2(step.alignment)) for place, step in steps if isinstance(step, Padding)]
        bits = max((own for _, own in found), default=1)
        ahead = ID_BYTES + LENGTH_BYTES + len(self.frame.prefix)
        return {
            "has_padding": bool(found),
            "in_padding": _any_place(place for place, _ in found),
            "phase_high": bits - 1,
            "phase_bits": bits,
            "first_phase": f'"{-ahead % 2**bits:0{bits}b}"',
            "gaps": _ladder([(place, _low_bits("phase_left", own, bits)) for place, own in found], _ZEROS),
            "gap_fits": self.lanes >= 2**bits,
        }


# --- what a step is --------------------------------------------------------------------------------------------------


def _part(area: Area) -> Data | Loop:
    assert isinstance(area.step, Count | Open | Guard)
    return area.step.part


def _shift(part: Data) -> int:
    """By how many bits elements are more bytes."""
    return _log2(part.element.size)


def _log2(power: int) -> int:
    return power.bit_length() - 1


def _constants(block: Block) -> Iterator[tuple[int, int, str]]:
    for offset, data in block.constants:
        for start in range(0, len(data), _LITERAL_BYTES):
            part = data[start : start + _LITERAL_BYTES]
            if any(part):
                yield offset + start, len(part), f'x"{part[::-1].hex()}"'


# --- VHDL text -------------------------------------------------------------------------------------------------------


def _listed(places: Places) -> list[Configuration]:
    """The places for the list in front of the architecture."""
    rows = [(f"{a.first} to {a.last}" if a.last > a.first else f"{a.first}", _about(a)) for a in places.areas]
    rows.append((f"{places.end}", "the end"))
    column = max(len(name) for name, _ in rows)
    return [{"places": name.rjust(column), "text": text} for name, text in rows]


def _about(area: Area) -> str:
    size = size_of(area.step)
    match area.step:
        case Header():
            kind = "id and"
        case Block():
            kind = "1 byte:" if size == 1 else f"{size} bytes:"
        case Count():
            kind = "count of"
        case Guard() | Open():
            kind = "opens"
        case Stream():
            kind = "stream of"
        case Close():
            kind = "closes an element of"
        case _:
            kind = ""
    return shorten(f"{kind} {comment(area.step)}", _LINE, placeholder=" ...")


def _columns(pairs: Sequence[tuple[str, str]]) -> list[Configuration]:
    names = _aligned([target for target, _ in pairs])
    return [{"target": name, "value": value} for name, (_, value) in zip(names, pairs, strict=True)]


def _aligned(names: Sequence[str]) -> list[str]:
    column = max(map(len, names), default=0)
    return [name.ljust(column) for name in names]


def _ladder(choices: Iterable[tuple[int, str]], otherwise: str) -> list[Configuration]:
    """`value when place_r <= last else` for each choice in order; neighbours with the same value share one.

    Behind the last choice nothing is asked for, so it stands without a condition; `otherwise` if there is none at all.
    """
    groups = [(list(group)[-1][0], value) for value, group in groupby(choices, key=lambda choice: choice[1])]
    if not groups:
        return [{"value": otherwise, "condition": "", "joint": ";"}]
    *rows, (_, final) = groups
    column = max((len(value) for _, value in rows), default=0)
    return [
        *(
            {"value": value.ljust(column), "condition": f" when place_r <= {place}", "joint": " else"}
            for place, value in rows
        ),
        {"value": final, "condition": "", "joint": ";"},
    ]


def _any_place(places: Iterable[int]) -> str:
    """A condition that holds at these places only."""
    return _any(f"place_r = {place}" for place in places)


def _any_range(areas: Iterable[Area]) -> str:
    """A condition that holds at the places of these areas only."""
    return _any(
        f"place_r = {area.first}"
        if area.first == area.last
        else f"(place_r >= {area.first} and place_r <= {area.last})"
        for area in areas
    )


def _any(conditions: Iterable[str]) -> str:
    lines: list[str] = []
    for condition in conditions:
        if lines and len(lines[-1]) + len(condition) < _LINE:
            lines[-1] += f" or {condition}"
        else:
            lines.append(condition)
    return " or\n        ".join(lines) or "false"


def _low_bits(name: str, count: int, bits: int) -> str:
    """The `count` lowest bits of a vector, with zeros in front up to `bits`."""
    if count == bits:
        return name
    return f'"{"0" * (bits - count)}" & {name}({count - 1} downto 0)'
