"""Frame -> configuration of the subscriber of a message of variable size: its program as tables and registers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from fusesoc_firm.converter.message_ports import (
    ElementPorts,
    MessageSide,
    StreamPorts,
    message_ports,
    message_side,
    port_declarations,
)
from fusesoc_firm.converter.ports import vhdl_type
from fusesoc_firm.converter.program import (
    Block,
    Close,
    End,
    Guard,
    Header,
    Open,
    Padding,
    Program,
    Segment,
    Step,
    subscriber_program,
)
from fusesoc_firm.converter.program import (
    Stream as StreamStep,
)
from fusesoc_firm.converter.slices import slices_of, windows_of
from fusesoc_firm.converter.steps import (
    alignment_of,
    closes_text,
    element_size,
    fixed_size,
    is_counted,
    is_hollow,
    is_text,
    number_rows,
    step_list,
    step_sets,
    terminator_of,
)
from fusesoc_firm.converter.storing import joints
from fusesoc_firm.converter.stream import Store, StoreMap, Stream, ranges, stores_of
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, Data, Frame, Loop, Path
from fusesoc_firm.frame.values import dotted

Configuration = dict[str, Any]

VARIABLE_SUBSCRIBER_TEMPLATE = "vhdl/variable_subscriber.vhd"

_LARGEST_NATURAL = 2**31 - 1


class _Window(Stream):
    """The bytes of a block as the window shows them: from the lowest lane up."""

    @property
    def payload_start(self) -> int:
        return 0


def variable_subscriber_configuration(frame: Frame, width: int, entity: str) -> Configuration:
    """The configuration of `axis_to_<pkg>_<type>` for a stream of `width` bits."""
    made = _Subscriber(subscriber_program(frame), message_side(frame), _Window(width))
    return {"entity": entity, **made.configuration()}


@dataclass(frozen=True)
class _Subscriber:
    program: Program
    side: MessageSide
    window: _Window

    @property
    def steps(self) -> tuple[Step, ...]:
        return self.program.steps

    @property
    def lanes(self) -> int:
        return self.window.lanes

    @property
    def frame(self) -> Frame:
        return self.program.frame

    def configuration(self) -> Configuration:
        end = len(self.steps) - 1
        return {
            "message": str(self.frame.message),
            "middleware": self.frame.ros.title,
            "width": self.window.width,
            "lanes": self.lanes,
            "data_high": self.window.width - 1,
            "keep_high": self.lanes - 1,
            "count_high": self.lanes.bit_length() - 1,
            "is_byte_wide": self.lanes == 1,
            "is_narrow": self.lanes < 8,
            "void_lanes": 0 if self.lanes == 1 else ID_BYTES,
            "ports": port_declarations(message_ports(self.frame, self.window.width), "out"),
            "segment_high": self.side.segments - 1,
            "steps": step_list(self.steps),
            "step_count": len(self.steps),
            "step_high": end.bit_length() - 1,
            "end_step": end,
            "trailing_bytes": self.frame.trailing_bytes,
            "has_encoding": self.frame.checked_prefix > 0,
            "has_bad_count": bool(self._count_checks()) or any(map(closes_text, self.steps)),
            "has_padding": self._has(Padding),
            "has_streams": any(step.part.is_used for step in self.steps if isinstance(step, StreamStep)),
            "has_data": self._has(StreamStep),
            "has_opens": any(map(is_counted, self.steps)),
            "has_text": any(map(is_text, self.steps)),
            "has_hollow": any(map(is_hollow, self.steps)),
            "step_sets": step_sets(self.steps),
            **self._tables(),
            **self._lengths(),
            **self._fields(),
            **self._flow(),
            **self._updates(),
        }

    def _has(self, kind: type[Step]) -> bool:
        return any(isinstance(step, kind) for step in self.steps)

    # --- tables -------------------------------------------------------------------------------------------------

    def _tables(self) -> Configuration:
        sizes = [fixed_size(step) for step in self.steps]
        last_beats = [max(0, -(-size // self.lanes) - 1) for size in sizes]
        last_bytes = [size - self.lanes * beat for size, beat in zip(sizes, last_beats, strict=True)]
        return {
            "largest_number": max(*last_beats, *last_bytes),
            "beat_high": max(1, max(last_beats).bit_length()) - 1,
            "last_beats": number_rows(last_beats),
            "last_bytes": number_rows(last_bytes),
        }

    def _lengths(self) -> Configuration:
        """What a count means: bytes of a stream, and how many elements there is room for."""
        sizes = [size for size in (2, 4, 8) if any(element_size(step) == size for step in self.steps)]
        shifts = {2: 1, 4: 2, 8: 3}
        bytes_ = [
            f"shift_left(count_value, {shifts[size]}) when STEP_HAS_{size}(step_number) = '1' else" for size in sizes
        ]
        masks = {2: "001", 4: "011"}
        gaps = [(masks[to], f" when STEP_ALIGNS_TO_{to}(step_number) = '1' else") for to in (2, 4) if self._aligned(to)]
        gaps.append(("111", ";"))
        width = self.window.width
        is_whole = width >= 8 * COUNT_BYTES
        word = "window_bytes(31 downto 0)" if is_whole else "window_bytes"
        return {
            "overflow": "".join(
                f" or (STEP_HAS_{size}(step_number) = '1' and left_r(31 downto {32 - shifts[size]}) /= 0)"
                for size in sizes
            ),
            "sizes": _values([*bytes_, "count_value;"]),
            "gaps": [{"mask": mask, "joint": joint} for mask, joint in gaps],
            "header_word": f"unsigned({word})" if is_whole else f"(unsigned({word}) & left_r(31 downto {width}))",
            "payload_length_word": word + ("" if is_whole else f" & payload_length_r(31 downto {width})"),
            "count_word": f"unsigned({word})" + ("" if is_whole else f" & left_r(31 downto {width})"),
            "first_phase": -len(self.frame.prefix) % 8,
        }

    def _aligned(self, alignment: int) -> bool:
        return any(alignment_of(step) == alignment for step in self.steps)

    # --- fields -------------------------------------------------------------------------------------------------

    @cached_property
    def _stores(self) -> list[tuple[int, Block, list[tuple[str, Store]]]]:
        """The stores of each block that holds used fields, by name."""
        found = []
        number = 0
        for place, step in enumerate(self.steps):
            if isinstance(step, Block) and step.fields:
                named = []
                for store in stores_of(self.window, windows_of(step.fields)):
                    named.append((f"store_{number}_r", store))
                    number += 1
                found.append((place, step, named))
        return found

    def _fields(self) -> Configuration:
        pairs = [("payload_length", "payload_length_r")]
        for part in self.side.parts:
            pairs += self._length_pairs(part)
        for _, block, named in self._stores:
            pairs += self._field_pairs(block, named)
        column = max(len(target) for target, _ in pairs)
        streams = [(place, step) for place, step in enumerate(self.steps) if isinstance(step, StreamStep)]
        return {
            "assignments": [{"target": target.ljust(column), "value": value} for target, value in pairs],
            "streams": [
                {"name": self.side.stream(step.part).name, "step": place}
                for place, step in streams
                if step.part.is_used
            ],
            "stores": [
                store for place, block, named in self._stores for store in self._store_updates(place, block, named)
            ],
        }

    def _length_pairs(self, part: object) -> list[tuple[str, str]]:
        match part:
            case StreamPorts():
                return [(part.length, f"std_logic_vector({self._length_register(part.part)})")]
            case ElementPorts():
                pairs = []
                if part.loop.count is None:
                    pairs.append((part.length, f"std_logic_vector({self._length_register(part.loop)})"))
                if self._is_closed(part.loop):
                    pairs.append((part.valid, self._register("valid", part.loop)))
                    pairs.append((part.last, self._register("last", part.loop)))
                if part.segments is not None:
                    pairs.append((part.segment_valid, self._register("segment_valid", part.loop)))
                return pairs
        return []

    def _field_pairs(self, block: Block, named: Sequence[tuple[str, Store]]) -> list[tuple[str, str]]:
        places = StoreMap(self.window, [store for _, store in named])
        pairs: list[tuple[str, str]] = []
        for leaf in block.fields:
            port = replace(self.side.field(leaf), field=leaf)
            for piece in slices_of(port):
                low = piece.low + leaf.first * leaf.type.bits
                for stored in places.pieces(piece.offset, piece.bytes):
                    bits = f"{named[stored.store][0]}({stored.high} downto {stored.low})"
                    if leaf.type.bits == 1:
                        # As roscpp and rospy read a bool: whatever is not zero is true.
                        pairs.append((replace(piece, low=low).target, f"'0' when {bits} = x\"00\" else '1'"))
                    else:
                        pairs.append((replace(piece, low=low, width=8 * stored.count).target, bits))
                    low += 8 * stored.count
        return pairs

    def _store_updates(self, place: int, block: Block, named: Sequence[tuple[str, Store]]) -> list[Configuration]:
        return [
            {
                "step": place,
                "register": name,
                "windows": _window_condition(store, -(-block.size // self.lanes)),
                "data": _store_data(name, store),
            }
            for name, store in named
        ]

    # --- flow ---------------------------------------------------------------------------------------------------

    def _flow(self) -> Configuration:
        jumps = self._jumps()
        elements = [f"({self._register('valid', ports.loop)} and not {ports.ready})" for ports in self._elements]
        closings = [place for place, step in enumerate(self.steps) if isinstance(step, Close)]
        return {
            "stopped": " or ".join(elements) or "'0'",
            "sinks": _values(self._sinks()),
            "has_checks": bool(self._checks()),
            "checks": self._checks(),
            "count_checks": self._count_checks(),
            "large_word": "elsif" if self._count_checks() else "if",
            "closes": [self._close(place) for place in closings],
            "closing_sensitivity": "".join(
                f", closing_{self._number(loop)}, {self._register('left', loop)}" for loop in self._closed_loops
            ),
            "has_jumps": bool(jumps),
            "jumps": [
                {"word": "if" if not number else "elsif", "condition": condition, "target": target}
                for number, (condition, target) in enumerate(jumps)
            ],
            "paddings": [
                {"step": place, "high": step.alignment.bit_length() - 2, "behind": place + 1}
                for place, step in enumerate(self.steps)
                if isinstance(step, Padding)
            ],
        }

    def _sinks(self) -> list[str]:
        """Whether the sink of the step's stream takes a beat; what nobody reads is always taken."""
        streams = [(place, step.part) for place, step in enumerate(self.steps) if isinstance(step, StreamStep)]
        used = [(place, part) for place, part in streams if part.is_used]
        found = [f"{self.side.stream(part).axis('tready')} when step_number = {place} else" for place, part in used]
        return [*found, "'1';"]

    def _checks(self) -> list[Configuration]:
        found = []
        if self.frame.checked_prefix:
            value = self.frame.prefix[: self.frame.checked_prefix]
            for beat in range(-(-len(value) // self.lanes)):
                data = value[beat * self.lanes : (beat + 1) * self.lanes]
                bits = "window_bytes" if self.lanes == 1 else f"window_bytes({8 * len(data) - 1} downto 0)"
                condition = f'step_number = 1 and beat_r = {beat} and {bits} /= x"{data[::-1].hex()}"'
                found.append({"condition": condition, "code": "BAD_ENCODING"})
        if any(map(closes_text, self.steps)):
            condition = "STEP_CLOSES_TEXT(step_number) = '1' and beat_r = 0 and window_bytes(7 downto 0) /= x\"00\""
            found.append({"condition": condition, "code": "BAD_COUNT"})
        return found

    def _count_checks(self) -> list[Configuration]:
        found = ["STEP_IS_TEXT(step_number) = '1' and left_r = 0"] if any(map(is_text, self.steps)) else []
        for place, step in enumerate(self.steps):
            if isinstance(step, Open) and step.part.bound is not None:
                most = step.part.bound + terminator_of(step.part)
                if most < _LARGEST_NATURAL:
                    found.append(f"step_number = {place} and left_r > {most}")
        return [{"word": "elsif" if number else "if", "condition": condition} for number, condition in enumerate(found)]

    def _close(self, place: int) -> Configuration:
        """An element ends with its last bytes; if a part at its end is empty, or an array, in a cycle of its own."""
        step = self.steps[place]
        assert isinstance(step, Close)
        is_joined = isinstance(self.steps[place - 1], Block | StreamStep)
        return {
            "number": self._number(step.loop),
            "about": dotted(step.loop.names),
            "condition": f"step_number = {place}" + (f" or step_number = {place - 1}" if is_joined else ""),
        }

    def _jumps(self) -> list[tuple[str, int]]:
        jumps: list[tuple[str, int]] = []
        for place, step in enumerate(self.steps):
            match step:
                case Guard():
                    jumps.append((f"step_number = {place} and left_r = 0", self.program.behind_guard(place)))
                case Open() if is_counted(step) and self.program.behind(place) != place + 1:
                    jumps.append((f"step_number = {place} and count_is_zero = '1'", self.program.behind(place)))
                case Close(loop=loop):
                    closing = f"closing_{self._number(loop)} = '1'"
                    jumps.append((f"{closing} and {self._register('left', loop)} = 1", place + 1))
                    jumps.append((closing, self.program.body(place)))
                case End():
                    jumps.append((f"step_number = {place}", place))
        return jumps

    # --- registers ----------------------------------------------------------------------------------------------

    @cached_property
    def _elements(self) -> list[ElementPorts]:
        """Of every loop whose elements somebody takes."""
        return [ports for ports in self.side.parts if isinstance(ports, ElementPorts) and self._is_closed(ports.loop)]

    @cached_property
    def _element_paths(self) -> frozenset[Path]:
        return frozenset(ports.loop.path for ports in self._elements)

    @cached_property
    def _closed_loops(self) -> list[Loop]:
        return [step.loop for step in self.steps if isinstance(step, Close)]

    @cached_property
    def _closed_paths(self) -> frozenset[Path]:
        return frozenset(loop.path for loop in self._closed_loops)

    def _is_closed(self, part: Data | Loop) -> bool:
        return isinstance(part, Loop) and part.path in self._closed_paths

    @cached_property
    def _numbers(self) -> dict[tuple[type, Path], int]:
        """Parts are numbered in wire order for the names of their registers."""
        paths = [(type(step.part), step.part.path) for step in self.steps if isinstance(step, Open)]
        return {path: number for number, path in enumerate(paths)}

    def _number(self, part: Data | Loop) -> int:
        return self._numbers[type(part), part.path]

    def _register(self, what: str, part: Data | Loop) -> str:
        return f"{what}_{self._number(part)}_r"

    def _length_register(self, part: Data | Loop) -> str:
        return self._register("length", part)

    def _segment_bit(self, segment: Segment) -> str:
        if not segment.scope:
            return f"segment_valid_r({segment.number})"
        loop = segment.scope[-1]
        if self.side.element(loop).segments is None:
            return ""
        return f"{self._register('segment_valid', loop)}({segment.number})"

    def _updates(self) -> Configuration:
        zeros, zero = "(others => '0')", "'0'"
        registers = [
            ("segment_valid_r", f"{vhdl_type(self.side.segments)} := {zeros}"),
            ("payload_length_r", vhdl_type(32)),
        ]
        resets = [("segment_valid_r", zeros)]
        for step in self.steps:
            if isinstance(step, Open) and step.part.is_used and is_counted(step):
                registers.append((self._length_register(step.part), "unsigned(31 downto 0)"))
            if isinstance(step, Open) and self._is_closed(step.part):
                registers.append((self._register("left", step.part), f"unsigned(31 downto 0) := {zeros}"))
        for ports in self._elements:
            valid = self._register("valid", ports.loop)
            registers += [(valid, f"std_logic := {zero}"), (self._register("last", ports.loop), "std_logic")]
            resets.append((valid, zero))
            if ports.segments is not None:
                bits = self._register("segment_valid", ports.loop)
                registers.append((bits, f"{vhdl_type(ports.segments)} := {zeros}"))
                resets.append((bits, zeros))
        registers += [(name, vhdl_type(store.bits)) for _, _, named in self._stores for name, store in named]
        column = max(len(name) for name, _ in registers)
        return {
            "registers": [{"name": name.ljust(column), "type": type_} for name, type_ in registers],
            "resets": [{"register": name, "value": value} for name, value in resets],
            "elements": [
                {"name": ports.name, "valid": self._register("valid", ports.loop)} for ports in self._elements
            ],
            "element_segments": [
                {
                    "name": ports.name,
                    "valid": self._register("valid", ports.loop),
                    "register": self._register("segment_valid", ports.loop),
                }
                for ports in self._elements
                if ports.segments is not None
            ],
            "openings": [
                {"step": place, "statements": [{"statement": text} for text in statements]}
                for place, step in enumerate(self.steps)
                if isinstance(step, Open) and (statements := self._opening(step))
            ],
            "completions": self._completions(),
            "closings": [
                {
                    "number": self._number(loop),
                    "statements": [{"statement": text} for text in self._closing(loop)],
                }
                for loop in self._closed_loops
            ],
        }

    def _opening(self, step: Open) -> list[str]:
        part = step.part
        statements = []
        if part.is_used and is_counted(step):
            statements.append(f"{self._length_register(part)} <= count_value;")
        if isinstance(part, Loop) and self._is_closed(part):
            value = "left_r" if part.count is None else f"to_unsigned({part.count}, 32)"
            statements.append(f"{self._register('left', part)} <= {value};")
        return statements

    def _completions(self) -> list[Configuration]:
        found = []
        for place, step in enumerate(self.steps):
            if (
                isinstance(step, Header | Block | Open)
                and step.completes
                and (bit := self._segment_bit(step.completes))
            ):
                found.append({"step": place, "bit": bit})
        return found

    def _closing(self, loop: Loop) -> list[str]:
        left = self._register("left", loop)
        statements = [f"{left} <= {left} - 1;"]
        if loop.path in self._element_paths:
            last = self._register("last", loop)
            statements += [f"{self._register('valid', loop)} <= '1';", f"{last} <= '0';"]
            statements.append(f"if {left} = 1 then {last} <= '1'; end if;")
        return statements


def _values(texts: Iterable[str]) -> list[Configuration]:
    return [{"value": text, "joint": ""} for text in texts]


def _window_condition(store: Store, beats: int) -> str:
    found = ranges(store.beats)
    if found == [(0, beats - 1)]:
        return ""
    conditions = [
        f"beat_r = {first}" if first == last else f"(beat_r >= {first} and beat_r <= {last})" for first, last in found
    ]
    return f" and {conditions[0]}" if len(conditions) == 1 else f" and ({' or '.join(conditions)})"


def _store_data(register: str, store: Store) -> list[Configuration]:
    lanes = ranges(store.lanes)
    data = [f"window_bytes({8 * last + 7} downto {8 * first})" for first, last in reversed(lanes)]
    if len(store.beats) > 1:
        data.append(f"{register}({store.bits - 1} downto {store.beat_bits})")
    return [{"piece": piece, "joint": joint} for piece, joint in zip(data, joints(len(data), " &", ";"), strict=True)]
