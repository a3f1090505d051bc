"""Frame -> configuration of the subscriber of a message of variable size: its program as tables and registers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from fusesoc_firm.converter.ahead import HeldTwice, ReadAhead
from fusesoc_firm.converter.message_ports import (
    ElementPorts,
    MessageSide,
    StreamPorts,
    message_ports,
    message_side,
    port_declarations,
)
from fusesoc_firm.converter.pipeline import FULL, NONE
from fusesoc_firm.converter.ports import FieldPort
from fusesoc_firm.converter.program import (
    Block,
    Close,
    Header,
    Open,
    Padding,
    Program,
    Scope,
    Segment,
    Step,
    Stream,
    Tail,
    subscriber_program,
)
from fusesoc_firm.converter.slices import slices_of, windows_of
from fusesoc_firm.converter.steps import (
    alignment_of,
    closes_text,
    closes_with_padding,
    digit_rows,
    element_size,
    fixed_size,
    is_count_whole,
    is_counted,
    is_hollow,
    is_lossy,
    is_stream,
    is_text,
    number_rows,
    step_classes,
    step_list,
    step_sets,
)
from fusesoc_firm.converter.storing import enables, store_data, stored_slices
from fusesoc_firm.converter.stream import Store, StoreMap, stores_of
from fusesoc_firm.converter.stream import Stream as Lanes
from fusesoc_firm.converter.vhdl import binary, bits, hexadecimal, vhdl_type
from fusesoc_firm.frame.length import longest_payload
from fusesoc_firm.frame.model import COUNT_BYTES, ID_BYTES, Data, Frame, Loop, Path
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.text.render import Context

VARIABLE_SUBSCRIBER_TEMPLATE = "vhdl/variable_subscriber.vhd"

_LARGEST_NATURAL = 2**31 - 1
_LARGEST_ALIGNMENT = 8
_LENGTH_TYPE = "unsigned(31 downto 0)"
# The bits of a queue's entry below the step.
_FLAGS = 3


class _Window(Lanes):
    """The alignment of a block's bytes in the window, where the first byte is in the lowest lane."""

    @property
    def payload_start(self) -> int:
        return 0


def variable_subscriber_configuration(frame: Frame, width: int, entity: str, pipeline: str = NONE) -> Context:
    """The configuration of `axis_to_<pkg>_<type>` for a stream of `width` bits; `pipeline` is one of `PIPELINES`."""
    made = _Subscriber(subscriber_program(frame), message_side(frame), _Window(width), pipeline)
    return {"entity": entity, **made.configuration()}


@dataclass(frozen=True)
class _Subscriber:
    program: Program
    side: MessageSide
    window: _Window
    pipeline: str

    @property
    def stores_late(self) -> bool:
        """Whether fields are stored in the cycle after their beat."""
        return self.pipeline == FULL

    @property
    def steps(self) -> tuple[Step, ...]:
        return self.program.steps

    @property
    def lanes(self) -> int:
        return self.window.lanes

    @property
    def frame(self) -> Frame:
        return self.program.frame

    def configuration(self) -> Context:
        return {
            "message": str(self.frame.message),
            "middleware": self.frame.ros.title,
            "longest": longest_payload(self.frame),
            "width": self.window.width,
            "lanes": self.lanes,
            "count_bits": self.lanes.bit_length(),
            "lane_bits": (self.lanes - 1).bit_length(),
            "is_byte_wide": self.lanes == 1,
            "is_narrow": self.lanes < _LARGEST_ALIGNMENT,
            "is_count_whole": is_count_whole(self.lanes),
            "count_beat_bits": max(COUNT_BYTES // self.lanes - 1, 0).bit_length(),
            "void_lanes": 0 if self.lanes == 1 else ID_BYTES,
            "ports": port_declarations(message_ports(self.frame, self.window.width), "out"),
            "segments": self.side.segments,
            "end_step": len(self.steps) - 1,
            "is_step_lossy": is_lossy(len(self.steps)),
            "is_aligned_lossy": is_lossy(2 * len(self.steps)),
            "is_choice_lossy": is_lossy(4 * len(self.steps)),
            "step_bits": (len(self.steps) - 1).bit_length(),
            # Bytes after the message are dropped, however many there are.
            "has_tail": self.frame.trailing_bytes > 0,
            "first_gap": len(self.frame.prefix) % _LARGEST_ALIGNMENT,
            **self._tables(),
            **self._kinds(),
            **self._checks(),
            "parts": [found for part in self.side.parts for found in self._part(part)],
            "elements": [self._element(ports) for ports in self._elements],
            "fields": [field for _, block, named in self._stores for field in self._field_slices(block, named)],
            "streams": (streams := self._streams()),
            "stream_count": len(streams),
            **self._leaving(bool(streams)),
            "ahead": self._queue(streams) if self.ahead else None,
            "stores_late": self.stores_late,
            "stores": (stores := list(self._stored())),
            "has_windows": any(store["windows"] for store in stores),
            "opened": [found for place, step in enumerate(self.steps) for found in self._opened(place, step)],
            "completions": self._completions(),
            # The segment that the header completes.
            "opens_at_once": [
                {} for step in self.steps if isinstance(step, Header) and self._segment_bit(step.completes)
            ],
            "loops": [self._loop(place) for place, step in enumerate(self.steps) if isinstance(step, Close)],
        }

    # --- steps --------------------------------------------------------------------------------------------------

    def _tables(self) -> Context:
        """The steps as lists and tables, indexed by step number."""
        sizes = [fixed_size(step) for step in self.steps]
        last_beats = [max(0, -(-size // self.lanes) - 1) for size in sizes]
        last_bytes = [size - self.lanes * beat for size, beat in zip(sizes, last_beats, strict=True)]
        further = self.ahead.sets if self.ahead else ()
        return {
            "steps": step_list(self.steps),
            "step_sets": (sets := step_sets(self.steps, self.lanes, further)),
            "classes": step_classes(sets, further),
            "targets": number_rows([self._target(*choice) for choice in self._choices]),
            "largest_number": max(self.lanes, *last_beats),
            "beat_bits": max(1, max(last_beats).bit_length()),
            "second_last_beats": number_rows([max(0, beat - 1) for beat in last_beats]),
            "first_bytes": number_rows([min(size, self.lanes) for size in sizes]),
            "last_bytes": number_rows(last_bytes),
        }

    def _kinds(self) -> Context:
        """The kinds of steps that occur in the program, with the cases that the template must distinguish."""
        sizes = {element_size(step) for step in self.steps}
        alignments = {alignment_of(step) for step in self.steps}
        has_data = any(isinstance(step, Stream) for step in self.steps)
        has_opens = any(map(is_counted, self.steps))
        tail = [{"step": place} for place, step in enumerate(self.steps) if isinstance(step, Tail)]
        return {
            "has_data": has_data,
            "has_stream": any(map(is_stream, self.steps)),
            "has_opens": has_opens,
            "has_left": has_opens or bool(tail),
            "has_zero": any(isinstance(step, Tail) or is_counted(step) for step in self.steps),
            "tail": tail,
            "opened_bytes": "count_bytes" if has_data else "left_r",
            "has_text": any(map(is_text, self.steps)),
            "has_hollow": any(map(is_hollow, self.steps)),
            "element_sizes": [
                {"size": size, "shift": shift, "low": 8 * COUNT_BYTES - shift}
                for size, shift in ((2, 1), (4, 2), (8, 3))
                if size in sizes
            ],
            "aligned_sets": [
                {
                    "alignment": alignment,
                    "size": binary(alignment, 4).strip('"'),
                    "mask": mask,
                    "rows": digit_rows(self._aligned(alignment)),
                }
                for alignment, mask in ((2, "001"), (4, "011"))
                if alignment in alignments
            ],
            "closing_rows": digit_rows(self._closing()) if any(map(closes_with_padding, self.steps)) else [],
            "paddings": [{} for step in self.steps if isinstance(step, Padding)],
        }

    def _checks(self) -> Context:
        """The values that the subscriber checks on the wire."""
        prefix = self.frame.prefix[: self.frame.checked_prefix]
        beats = [prefix[first : first + self.lanes] for first in range(0, len(prefix), self.lanes)]
        has_zeros = any(map(closes_text, self.steps))
        counts: list[Context] = [{"bound": None}] if any(map(is_text, self.steps)) else []
        counts += [
            {"bound": {"step": place, "most": most}}
            for place, step in enumerate(self.steps)
            if isinstance(step, Open) and step.part.bound is not None and (most := step.part.bound) < _LARGEST_NATURAL
        ]
        return {
            "encoding": [
                {"beat": beat, "bits": 8 * len(data), "value": hexadecimal(data)} for beat, data in enumerate(beats)
            ],
            "closes_text": has_zeros,
            "is_checked": bool(beats) or has_zeros,
            "count_checks": counts,
            "is_count_checked": bool(counts) or has_zeros,
        }

    def _opened(self, place: int, step: Step) -> Iterator[Context]:
        """The registers of a part: its length and the number of elements left."""
        if not isinstance(step, Open):
            return
        has_length, is_closed = step.part.is_used and is_counted(step), self._is_closed(step.part)
        if has_length or is_closed:
            yield {
                "step": place,
                "number": self._number(step.part),
                "has_length": has_length,
                "is_closed": is_closed,
                "count": step.part.count if isinstance(step.part, Loop) else None,
                "is_single": int(isinstance(step.part, Loop) and step.part.count == 1),
            }

    def _loop(self, place: int) -> Context:
        """The end of a loop's element: with the element's last bytes, or in a separate cycle after a variable part."""
        step = self.steps[place]
        assert isinstance(step, Close)
        return {
            "number": self._number(step.loop),
            "about": dotted(step.loop.names),
            "step": place,
            "is_joined": self._is_joined(place),
        }

    @cached_property
    def _choices(self) -> list[tuple[int, bool, bool]]:
        """The arguments of `_target` in the order of the table."""
        return list(product(range(len(self.steps)), (False, True), (False, True)))

    def _target(self, place: int, turns: bool, is_aligned: bool) -> int:
        """The step after a step; `is_aligned` skips the padding there."""
        target = self._successor(place, turns)
        while is_aligned and isinstance(step := self.steps[target], Padding) and not step.closes_text:
            target += 1
        return target

    def _successor(self, place: int, turns: bool) -> int:
        """The step after a step: `turns` skips an empty part, and leaves a loop at its last element."""
        if place in self._ends:
            close = self._ends[place]
            return close + 1 if turns else self.program.body(close)
        match self.steps[place]:
            case Open() as step if is_counted(step) and turns:
                return self.program.behind(place)
            case Tail() if turns:
                return place + 2
        return min(place + 1, len(self.steps) - 1)

    @cached_property
    def _ends(self) -> dict[int, int]:
        """The steps that may end an element, each with its `Close`."""
        closes = [place for place, step in enumerate(self.steps) if isinstance(step, Close)]
        return {place - joined: place for place in closes for joined in (0, 1) if not joined or self._is_joined(place)}

    def _is_joined(self, place: int) -> bool:
        """Whether the element ends with the bytes of the step before its `Close`."""
        return isinstance(self.steps[place - 1], Block | Stream)

    def _closing(self) -> str:
        """The digits that mark the steps and choices with a transition to padding after a text's zero."""
        choices = product(range(len(self.steps)), (False, True))
        return "".join(str(int(closes_with_padding(self.steps[self._successor(*choice)]))) for choice in choices)

    def _aligned(self, alignment: int) -> str:
        """The digits that mark the steps and choices with a transition to padding of this alignment."""
        choices = product(range(len(self.steps)), (False, True))
        return "".join(str(int(alignment_of(self.steps[self._successor(*choice)]) == alignment)) for choice in choices)

    # --- ports --------------------------------------------------------------------------------------------------

    def _part(self, part: FieldPort | StreamPorts | ElementPorts) -> Iterator[Context]:
        """The lengths and elements on the message side, with the numbers of their registers."""
        if isinstance(part, StreamPorts):
            yield {"name": part.name, "has_length": True, "length": self._length(part.part), "element": None}
        elif isinstance(part, ElementPorts):
            yield {
                "name": part.name,
                "has_length": part.loop.count is None,
                "length": self._length(part.loop),
                "element": self._element(part) if self._is_closed(part.loop) else None,
            }

    def _element(self, ports: ElementPorts) -> Context:
        return {"name": ports.name, "number": self._number(ports.loop), "segments": ports.segments}

    def _streams(self) -> list[Context]:
        """All used streams; the bytes of other streams are dropped."""
        streams = [(place, step.part) for place, step in enumerate(self.steps) if isinstance(step, Stream)]
        used = [(place, part) for place, part in streams if part.is_used]
        return [
            {"name": self.side.stream(part).name, "step": place, "number": number, **self._beat(place, number)}
            for number, (place, part) in enumerate(used)
        ]

    def _beat(self, place: int, number: int) -> Context:
        """The expressions for a beat of the stream of step `place`."""
        if self.ahead:
            high, width = self._entry_bits - 2, self.window.width
            low = high - (0 if self.lanes == 1 else self.lanes)
            return {
                "tdata": bits("ahead_word", low, low - width + 1),
                "tkeep": '"1"' if self.lanes == 1 else bits("ahead_word", high, low + 1),
                "tvalid": f"ahead_offers and firm.firm_axis_pkg.is_equal({self._queued_step}, {place})",
                "tlast": f"ahead_word({self._entry_bits - 1})",
            }
        return {
            "tdata": "out_data_r",
            "tkeep": '"1"' if self.lanes == 1 else "out_keep_r",
            "tvalid": f"out_valid_r({number})" if self.pipeline == NONE else f"out_busy_r and out_choice_r({number})",
            "tlast": "out_last_r",
        }

    def _leaving(self, has_streams: bool) -> Context:
        """How beats leave, and when the message side has taken everything."""
        is_sliced = self.pipeline != NONE and has_streams and not self.ahead
        shown = "(ahead_begun_r or element_shown)" if has_streams else "element_shown"
        return {
            "is_sliced": is_sliced,
            "is_registered": has_streams and not self.ahead and not is_sliced,
            "is_always_free": bool(self.ahead) or not has_streams,
            "tells_at_once": not self.ahead and not self.stores_late,
            "tells_late": not self.ahead and self.stores_late,
            "message_busy": "ahead_busy" if self.ahead else "out_busy_r",
            "fault_busy": shown if self.ahead else "out_busy_r",
        }

    # --- what is read ahead of the message side -----------------------------------------------------------------

    @cached_property
    def ahead(self) -> ReadAhead | None:
        """The queue of a message with arrays of messages."""
        if not self._elements:
            return None
        return ReadAhead(self.steps, self.lanes, self._element_paths, self._ends)

    def _queue(self, streams: Sequence[Context]) -> Context:
        assert self.ahead
        closes = [(place, step.loop) for place, step in enumerate(self.steps) if isinstance(step, Close)]
        return {
            "is_late": self.stores_late,
            "is_cut": self.pipeline != NONE,
            "is_byte_wide": self.lanes == 1,
            "entry_bits": self._entry_bits,
            "control_bits": self._control_bits,
            "step_high": self._control_bits - 1,
            "largest_step": 2 ** (self._control_bits - _FLAGS) - 1,
            "depth": self.ahead.depth,
            "has_streams": bool(streams),
            "streams": streams,
            "elements": [self._element(ports) for ports in self._elements],
            "completions": self._completions(),
            "segments": [self._held_twice(held) for held in self.ahead.segments],
            "copies": [copy for held in self.ahead.segments for copy in self._copies(held)],
            "closings": [
                {
                    "number": self._number(loop),
                    "is_used": loop.path in self._element_paths,
                    "steps": self.ahead.closings(place),
                }
                for place, loop in closes
            ],
        }

    @property
    def _control_bits(self) -> int:
        """The bits of an entry without a beat."""
        return _FLAGS + (len(self.steps) - 1).bit_length()

    @property
    def _entry_bits(self) -> int:
        """The bits of an entry: a beat's data, `tkeep` and `tlast` are above the others."""
        keep = 0 if self.lanes == 1 else self.lanes
        return self._control_bits + (self.window.width + keep + 1 if self._has_streams else 0)

    @property
    def _queued_step(self) -> str:
        return bits("ahead_word", self._control_bits - 1, _FLAGS)

    @property
    def _has_streams(self) -> bool:
        return any(isinstance(step, Stream) and step.part.is_used for step in self.steps)

    def _held_twice(self, held: HeldTwice) -> Context:
        return {
            "number": held.number,
            "about": held.about,
            "step": held.place,
            "fills": held.register,
            "copies": list(self._copies(held)),
        }

    def _copies(self, held: HeldTwice) -> Iterator[Context]:
        """The registers of a segment, and those that the ports show."""
        for _, block, named in self._stores:
            if block.segment == held.segment:
                for name, store in named:
                    yield {"register": name, "shown": f"shown_{name}", "type": vhdl_type(store.bits)}
        step = self.steps[held.place]
        if isinstance(step, Open) and is_counted(step) and step.part.is_used:
            name = f"length_{self._number(step.part)}_r"
            yield {"register": name, "shown": f"shown_{name}", "type": _LENGTH_TYPE}

    def _length(self, part: Data | Loop) -> str:
        """The register of a part's length that the port shows."""
        name = f"length_{self._number(part)}_r"
        return f"shown_{name}" if self._scopes[type(part), part.path] else name

    @cached_property
    def _scopes(self) -> dict[tuple[type, Path], Scope]:
        """The loops around each part."""
        return {(type(step.part), step.part.path): step.scope for step in self.steps if isinstance(step, Open)}

    @cached_property
    def _stores(self) -> list[tuple[int, Block, list[tuple[str, Store]]]]:
        """The stores of each block with used fields, with their names."""
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

    def _stored(self) -> Iterator[Context]:
        """All registers of fields, with the beats in which they store bytes."""
        for place, block, named in self._stores:
            lanes = Counter(store.lanes for _, store in named)
            for name, store in named:
                yield self._store(place, block, name, store, is_part=lanes[store.lanes] > 1)

    def _store(self, place: int, block: Block, name: str, store: Store, *, is_part: bool) -> Context:
        """A register, with the beats of a block in which the register stores lanes of the window."""
        data, beat = ("stored_bytes_r", "stored_beat_r") if self.stores_late else ("window_bytes", "beat_r")
        windows = enables(store, beat, -(-block.size // self.lanes) - 1, is_part=is_part)
        return {
            "step": place,
            "register": name,
            "bits": store.bits,
            "windows": windows,
            "is_parted": len(windows) > 1,
            "data": store_data(name, store, data),
        }

    def _field_slices(self, block: Block, named: Sequence[tuple[str, Store]]) -> Iterator[Context]:
        """The slices of ports with their positions in the stores."""
        places = StoreMap(self.window, [store for _, store in named])
        names = [f"shown_{name}" if block.scope else name for name, _ in named]
        for leaf in block.fields:
            port = replace(self.side.field(leaf), field=leaf)
            for piece in slices_of(port):
                yield from stored_slices(replace(piece, low=piece.low + leaf.first * leaf.type.bits), places, names)

    # --- registers ----------------------------------------------------------------------------------------------

    @cached_property
    def _elements(self) -> list[ElementPorts]:
        """The ports of the elements of all loops with used elements."""
        return [ports for ports in self.side.parts if isinstance(ports, ElementPorts) and self._is_closed(ports.loop)]

    @cached_property
    def _element_paths(self) -> frozenset[Path]:
        return frozenset(ports.loop.path for ports in self._elements)

    @cached_property
    def _closed_paths(self) -> frozenset[Path]:
        return frozenset(step.loop.path for step in self.steps if isinstance(step, Close))

    def _is_closed(self, part: Data | Loop) -> bool:
        return isinstance(part, Loop) and part.path in self._closed_paths

    @cached_property
    def _numbers(self) -> dict[tuple[type, Path], int]:
        """The number of each part in wire order, for the names of its registers."""
        paths = [(type(step.part), step.part.path) for step in self.steps if isinstance(step, Open)]
        return {path: number for number, path in enumerate(paths)}

    def _number(self, part: Data | Loop) -> int:
        return self._numbers[type(part), part.path]

    def _completions(self) -> list[Context]:
        """The bits that steps set."""
        return [
            {"step": place, "bit": bit}
            for place, step in enumerate(self.steps)
            if isinstance(step, Header | Block | Open) and (bit := self._segment_bit(step.completes))
        ]

    def _segment_bit(self, segment: Segment | None) -> str:
        """The bit that signals a segment as valid; "" if no port signals it."""
        if segment is None:
            return ""
        if not segment.scope:
            return f"segment_valid_r({segment.number})"
        loop = segment.scope[-1]
        if self.side.element(loop).segments is None:
            return ""
        return f"segment_valid_{self._number(loop)}_r({segment.number})"
