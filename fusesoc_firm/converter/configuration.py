"""Frame -> template configuration: plain dictionaries that the VHDL templates only have to fill in.

All numbers that a converter needs are computed here (dissertation, listing 5.4): a template holds no
arithmetic and no choice beyond 'is this there'.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.slices import slices_of, windows_of
from fusesoc_firm.converter.storing import Counter, joints, store_configuration, store_names
from fusesoc_firm.converter.stream import WIDTHS, Store, StoreMap, Stream, stores_of
from fusesoc_firm.frame.defaults import default_payload
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES, Frame
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import entity_name, prefixed

Configuration = dict[str, Any]

SUBSCRIBER_TEMPLATE = "vhdl/subscriber.vhd"
PUBLISHER_TEMPLATE = "vhdl/publisher.vhd"
# VHDL counts the bits of a publisher's frame, and of up to three bytes in front of it, up to 2**31-1.
_LARGEST_FRAME = (2**31 - 1) // 8 - 3
# A position tells 2**3 states that are no beats; while a message waits, the next beat is the first one.
_STATE_BITS = 3
_COUNTER = Counter(start="is_first = '1'")
# Bytes of a literal in a line.
_ROW = 16
_ROWS = re.compile(rb"\x00{%d,}|.(?:(?!\x00{%d}).){0,%d}" % (_ROW + 1, _ROW + 1, _ROW - 1), re.DOTALL)


def subscriber_entity(frame: Frame, suffix: str = "", prefix: str = "") -> str:
    """`<prefix>_axis_to_<pkg>_<type>`; a suffix tells converters of other fields apart, a prefix those of a core."""
    return prefixed(prefix, f"axis_to_{entity_name(frame.message.package, frame.message.name)}{suffix}")


def publisher_entity(frame: Frame, suffix: str = "", prefix: str = "") -> str:
    """`<prefix>_<pkg>_<type>_to_axis`; a suffix tells converters of other fields apart, a prefix those of a core."""
    return prefixed(prefix, f"{entity_name(frame.message.package, frame.message.name)}_to_axis{suffix}")


def subscriber_configuration(frame: Frame, width: int, entity: str = "") -> Configuration:
    """The configuration of `entity`, or else `subscriber_entity`, for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    windows = windows_of(frame.fields)
    stores = stores_of(stream, windows)
    ends = [stream.payload_start + frame.payload_bytes + more - 1 for more in range(frame.trailing_bytes + 1)]
    inputs = ["s_axis_tdata"] + ([] if stream.lanes == 1 else ["s_axis_tkeep"])
    return {
        **_common(frame, stream, entity or subscriber_entity(frame), "out"),
        **store_configuration(stores, _COUNTER),
        **_states(stream.beat(ends[-1])),
        "is_byte_wide": stream.lanes == 1,
        "has_void_lane": stream.length_start > 0,
        "assignments": _subscriber_assignments(frame, stream, stores),
        "has_trailing": frame.trailing_bytes > 0,
        "match_high": frame.trailing_bytes,
        "length_beats": _length_beats(frame, stream),
        "has_encoding": frame.checked_prefix > 0,
        "prefix_checks": [_byte_check(stream, *item) for item in _prefix_bytes(frame, stream)],
        "ends": [_end(stream, byte, number if len(ends) > 1 else None) for number, byte in enumerate(ends)],
        "compared": ", ".join(["position_r", "is_first", *inputs, *(["match_r"] if frame.trailing_bytes else [])]),
        "checked": ", ".join(["position_r", "is_first", *inputs, "s_axis_tlast", "match"]),
    }


def _states(last_position: int) -> Configuration:
    """The values of the position that are no beats: as few highest bits as can tell them are ones.

    Below these, bit 2 tells whether the frame has ended, bits 1 and 0 hold a code.
    """
    bits = max(_STATE_BITS + 1, (last_position + 2**_STATE_BITS).bit_length())
    ones = next(count for count in range(1, bits) if last_position < 2**bits - 2 ** (bits - count))
    high = "1" * ones + "0" * (bits - ones - _STATE_BITS)
    return {
        "position_high": bits - 1,
        "beyond": "1" * ones,
        "beyond_low": bits - ones,
        "broken": f"{high}000",
        "ended": f"{high}100",
        "complete": f"{high}010",
    }


def publisher_configuration(frame: Frame, width: int, entity: str = "") -> Configuration:
    """The configuration of `entity`, or else `publisher_entity`, for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    beats = stream.beat(frame.frame_bytes - 1) + 1
    last_lanes = stream.lane(frame.frame_bytes - 1) + 1
    start = _first_position(stream)
    position_bits = max(1, (start + beats - 1).bit_length())
    return {
        **_common(frame, stream, entity or publisher_entity(frame), "in"),
        "first_position": start,
        "last_position": start + beats - 1,
        "frame_high": (start + beats) * width - 1,
        "position_bits": position_bits,
        "position_high": position_bits - 1,
        "has_partial_beat": last_lanes < stream.lanes,
        "last_keep": "0" * (stream.lanes - last_lanes) + "1" * last_lanes,
        "pieces": _publisher_pieces(frame, start * stream.lanes, beats * stream.lanes),
    }


def _first_position(stream: Stream) -> int:
    """Where a publisher's position starts: at 8 bits so that the payload's bytes begin at a multiple of four.

    Four of them share a LUT of the multiplexer, and the constant bytes in front need none; a third less in all.
    """
    return -(ID_BYTES + LENGTH_BYTES) % 4 if stream.lanes == 1 else 0


def check_width(width: int) -> None:
    """Raise `InputError` for a stream of a width that converters do not have."""
    if width not in WIDTHS:
        fail(f"no converter is made for a stream of {width} bits", hint=f"legal here: {', '.join(map(str, WIDTHS))}")


def _check_size(frame: Frame) -> None:
    if frame.frame_bytes > _LARGEST_FRAME:
        fail(
            f"{frame.message} takes {frame.payload_bytes} bytes, too many for a converter",
            hint=f"at most {_LARGEST_FRAME - ID_BYTES - LENGTH_BYTES}, since VHDL counts bits up to 2**31-1",
        )


def _common(frame: Frame, stream: Stream, entity: str, direction: str) -> Configuration:
    ports = field_ports(frame)
    return {
        "entity": entity,
        "message": str(frame.message),
        "middleware": frame.ros.title,
        "payload_bytes": frame.payload_bytes,
        "width": stream.width,
        "data_high": stream.width - 1,
        "keep_high": stream.lanes - 1,
        "has_ports": bool(ports),
        "ports": _port_declarations(ports, direction),
    }


def _port_declarations(ports: Sequence[FieldPort], direction: str) -> list[Configuration]:
    """The fields as port declarations; names and types are padded so that columns align."""
    # Where no name is long, the fields align with the fixed ports too, of which frame_error_code is the longest.
    width = max([len("frame_error_code"), *(len(port.name) for port in ports)])
    types = max([0, *(len(port.vhdl_type) for port in ports)])
    return [
        {
            "name": port.name.ljust(width),
            "direction": direction.ljust(3),
            "type": port.vhdl_type,
            "padding": " " * (types - len(port.vhdl_type)),
            "comment": port.comment,
        }
        for port in ports
    ]


def _length_beats(frame: Frame, stream: Stream) -> list[Configuration]:
    """The beats that carry the length, and for each legal length the bytes that it has there.

    Legal are the payload's own length and, where writers append bytes, a few more. Bit k of `match` is high as long as
    the length can be the one with k more.
    """
    places = range(stream.length_start, stream.length_start + LENGTH_BYTES)
    beats = sorted({stream.beat(byte) for byte in places})
    return [
        {
            "position": beat,
            "condition": f"{'if' if beat == beats[0] else 'elsif'} {_COUNTER.is_in(beat, beat)}",
            "candidates": [
                {"number": more, **_length_candidate(frame.payload_bytes + more, beat, stream)}
                for more in range(frame.trailing_bytes + 1)
            ],
        }
        for beat in beats
    ]


def _length_candidate(length: int, beat: int, stream: Stream) -> Configuration:
    """The condition under which a beat rules a length out: any of its bytes is there and another one."""
    data = length.to_bytes(LENGTH_BYTES, "little")
    checks = [
        _byte_check(stream, stream.length_start + index, byte)
        for index, byte in enumerate(data)
        if stream.beat(stream.length_start + index) == beat
    ]
    ends = joints(len(checks), " or", "")
    return {"checks": [{**check, "joint": joint} for check, joint in zip(checks, ends, strict=True)]}


def _prefix_bytes(frame: Frame, stream: Stream) -> list[tuple[int, int]]:
    return [(stream.payload_start + index, frame.prefix[index]) for index in range(frame.checked_prefix)]


def _byte_check(stream: Stream, byte: int, value: int) -> Configuration:
    """That a byte of the stream has a value; `keep` is its lane's bit of tkeep."""
    lane = stream.lane(byte)
    return {
        "position": _COUNTER.is_in(stream.beat(byte), stream.beat(byte)),
        "keep": lane,
        "is_kept": stream.lanes > 1,
        "bits": "" if stream.lanes == 1 else f"({stream.data(lane)})",
        "value": f"{value:02x}",
    }


def _end(stream: Stream, last_byte: int, number: int | None) -> Configuration:
    """Where a frame ends, of which bit `number` of `match` tells the length; None if there is but one length."""
    lane = stream.lane(last_byte)
    match = "" if number is None else f"match({number}) = '1' and "
    return {
        "condition": f"{match}{_COUNTER.is_in(stream.beat(last_byte), stream.beat(last_byte))}",
        "lane": lane,
        "is_kept": stream.lanes > 1,
        "has_lane_behind": lane + 1 < stream.lanes,
        "lane_behind": lane + 1,
    }


def _subscriber_assignments(frame: Frame, stream: Stream, stores: Sequence[Store]) -> list[Configuration]:
    """`port <= fields_r(...)` for every piece of a port that lies in one piece in a store."""
    names = store_names(stores)
    places = StoreMap(stream, stores)
    pairs: list[tuple[str, str]] = []
    for port in field_ports(frame):
        for piece in slices_of(port):
            low = piece.low
            for stored in places.pieces(piece.offset, piece.bytes):
                bits = f"fields{names[stored.store]}_r({stored.high} downto {stored.low})"
                if piece.is_bit:
                    # As roscpp and rospy read a bool: whatever is not zero is true.
                    pairs.append((piece.target, f"'0' when {bits} = x\"00\" else '1'"))
                else:
                    part = replace(piece, low=low, width=8 * stored.count)
                    pairs.append((part.target, bits))
                low += 8 * stored.count
    column = max([0, *(len(target) for target, _ in pairs)])
    return [{"target": target.ljust(column), "value": value} for target, value in pairs]


def _publisher_pieces(frame: Frame, start: int, size: int) -> list[Configuration]:
    """`frame(...) <= value` for every part: zeros up to byte `start`, where a frame of `size` bytes begins.

    This is header, constant bytes, fields, and zeros behind its end.
    """
    header = ID_BYTES + LENGTH_BYTES
    pieces = [
        (0, ID_BYTES, f"std_logic_vector(to_unsigned(ID, {8 * ID_BYTES}))"),
        (ID_BYTES, LENGTH_BYTES, _literal(frame.payload_bytes.to_bytes(LENGTH_BYTES, "little"))),
        *((header + offset, len(data), _literal(data)) for offset, data in _constant_bytes(frame)),
        *(
            (header + piece.offset, piece.bytes, f'"0000000" & {piece.target}' if piece.is_bit else piece.target)
            for port in field_ports(frame)
            for piece in slices_of(port)
        ),
    ]
    if size > frame.frame_bytes:
        pieces.append((frame.frame_bytes, size - frame.frame_bytes, _literal(bytes(size - frame.frame_bytes))))
    if start:
        pieces.insert(0, (-start, start, _literal(bytes(start))))
    targets = [f"frame({8 * (start + first + count) - 1} downto {8 * (start + first)})" for first, count, _ in pieces]
    column = max(map(len, targets))
    return [
        {"target": target.ljust(column), "value": value} for target, (_, _, value) in zip(targets, pieces, strict=True)
    ]


def _literal(data: bytes) -> str:
    """Bytes as a VHDL literal, the first one lowest; many zeros in short."""
    return f'x"{data[::-1].hex()}"' if any(data) or len(data) <= _ROW else "(others => '0')"


def _constant_bytes(frame: Frame) -> Iterator[tuple[int, bytes]]:
    """The parts of the payload that no port drives, with what a publisher sends there.

    This is the prefix, the defaults of fields that are not used, else zeros; in rows, and long runs of zeros at once.
    """
    payload = default_payload(frame)
    cursor = 0
    for first, end in [*windows_of(frame.fields), (frame.payload_bytes, frame.payload_bytes)]:
        for part in _ROWS.finditer(payload, cursor, first):
            yield part.start(), part[0]
        cursor = end
