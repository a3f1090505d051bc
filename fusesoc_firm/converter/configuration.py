"""Frame -> template configuration: plain dictionaries that fill in the VHDL templates.

All numbers that a converter needs are computed here (dissertation, listing 5.4). Templates do no arithmetic; a
condition in a template only tests whether a value is present.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.converter.slices import slices_of, windows_of
from fusesoc_firm.converter.storing import is_beat, store_configuration, store_names, stored_slices
from fusesoc_firm.converter.stream import WIDTHS, Store, StoreMap, Stream, stores_of
from fusesoc_firm.converter.vhdl import bits_of_bool, hexadecimal
from fusesoc_firm.frame.defaults import default_payload
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES, Frame
from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.naming import entity_name, prefixed
from fusesoc_firm.text.render import Context

SUBSCRIBER_TEMPLATE = "vhdl/subscriber.vhd"
PUBLISHER_TEMPLATE = "vhdl/publisher.vhd"
# VHDL counts the bits of a publisher's frame, including up to three bytes before the frame, up to 2**31-1.
_LARGEST_FRAME = (2**31 - 1) // 8 - 3
# A single multiplexer of more beats would be slow.
_MANY_BEATS = 128
_CODE_BITS = 4
# The number of a literal's bytes on each line.
_ROW = 16
_ROWS = re.compile(rb"\x00{%d,}|.(?:(?!\x00{%d}).){0,%d}" % (_ROW + 1, _ROW + 1, _ROW - 1), re.DOTALL)


def subscriber_entity(frame: Frame, suffix: str = "", prefix: str = "") -> str:
    """Return `<prefix>_axis_to_<pkg>_<type>`; a suffix identifies the selection of fields, and a prefix the core."""
    return prefixed(prefix, f"axis_to_{entity_name(frame.message.package, frame.message.name)}{suffix}")


def publisher_entity(frame: Frame, suffix: str = "", prefix: str = "") -> str:
    """Return `<prefix>_<pkg>_<type>_to_axis`; a suffix identifies the selection of fields, and a prefix the core."""
    return prefixed(prefix, f"{entity_name(frame.message.package, frame.message.name)}_to_axis{suffix}")


def subscriber_configuration(frame: Frame, width: int, entity: str = "") -> Context:
    """Return the configuration of `entity` (default: `subscriber_entity`) for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    windows = windows_of(frame.fields)
    stores = stores_of(stream, windows)
    ends = [stream.payload_start + frame.payload_bytes + more - 1 for more in range(frame.trailing_bytes + 1)]
    return {
        **_common(frame, stream, entity or subscriber_entity(frame), "out"),
        **store_configuration(stores, stream.beat(ends[-1])),
        "position_bits": max(_CODE_BITS, stream.beat(ends[-1]).bit_length()),
        "is_byte_wide": stream.lanes == 1,
        "fields": _field_slices(frame, stream, stores),
        "has_trailing": frame.trailing_bytes > 0,
        "lengths": frame.trailing_bytes + 1,
        "length_beats": (length_beats := _length_beats(frame, stream)),
        # Without trailing bytes, one comparison checks the length.
        "is_length_early": len(length_beats) == 1
        and stream.beat(ends[0]) > 0
        and frame.checked_prefix > 0
        and frame.trailing_bytes > 0,
        "encoding": [_byte_check(stream, *item) for item in _prefix_bytes(frame, stream)],
        "ends": [_end(stream, byte, number if len(ends) > 1 else None) for number, byte in enumerate(ends)],
    }


def publisher_configuration(frame: Frame, width: int, entity: str = "") -> Context:
    """Return the configuration of `entity` (default: `publisher_entity`) for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    beats = stream.beat(frame.frame_bytes - 1) + 1
    last_lanes = stream.lane(frame.frame_bytes - 1) + 1
    start = _first_position(stream)
    return {
        **_common(frame, stream, entity or publisher_entity(frame), "in"),
        "is_one_beat": beats == 1,
        "is_long": beats > _MANY_BEATS,
        "next_bits": (start + 1) * width,
        "first_position": start,
        # The number of bytes before the frame.
        "start_bits": start * width,
        "start_zeros": hexadecimal(bytes(start)) if start else "",
        "last_position": start + beats - 1,
        "all_bits": (start + beats) * width,
        "position_bits": max(1, (start + beats - 1).bit_length()),
        "last_keep": ("1" * last_lanes).zfill(stream.lanes),
        "is_last_full": last_lanes == stream.lanes,
        "pieces": _publisher_pieces(frame, start * stream.lanes, beats * stream.lanes),
    }


def _first_position(stream: Stream) -> int:
    """Return a publisher's first position. On 8-bit streams, the payload then starts at a multiple of four.

    Four payload bytes then share a LUT of the multiplexer, and the constant bytes before the payload need no LUT. The
    alignment saves a third of the LUTs.
    """
    return -(ID_BYTES + LENGTH_BYTES) % 4 if stream.lanes == 1 else 0


def check_width(width: int) -> None:
    """Raise `InputError` if converters do not support a stream of this width."""
    if width not in WIDTHS:
        fail(f"converters do not support {width}-bit streams", hint=f"legal here: {', '.join(map(str, WIDTHS))}")


def _check_size(frame: Frame) -> None:
    if frame.frame_bytes > _LARGEST_FRAME:
        fail(
            f"{frame.message} has {frame.payload_bytes} bytes, which is too many for a converter",
            hint=f"legal here: at most {_LARGEST_FRAME - ID_BYTES - LENGTH_BYTES}, since VHDL"
            " cannot count more than 2**31-1 bits",
        )


def _common(frame: Frame, stream: Stream, entity: str, direction: str) -> Context:
    return {
        "entity": entity,
        "message": str(frame.message),
        "middleware": frame.ros.title,
        "payload_bytes": frame.payload_bytes,
        "width": stream.width,
        "lanes": stream.lanes,
        "ports": [
            {"name": port.name, "direction": direction, "type": port.vhdl_type, "comment": port.comment}
            for port in field_ports(frame)
        ],
    }


def _length_beats(frame: Frame, stream: Stream) -> list[Context]:
    """Return the beats that carry the length, with the bytes of each legal length in each beat.

    The legal lengths are the payload's length and, if writers append bytes, a few larger values. Bit k of `match` is
    high while the received length may still be the payload's length plus k.
    """
    places = range(stream.length_start, stream.length_start + LENGTH_BYTES)
    beats = sorted({stream.beat(byte) for byte in places})
    return [
        {
            "position": beat,
            "condition": is_beat(beat, beat),
            "candidates": [
                {"number": more, "checks": _length_checks(frame.payload_bytes + more, beat, stream)}
                for more in range(frame.trailing_bytes + 1)
            ],
        }
        for beat in beats
    ]


def _length_checks(length: int, beat: int, stream: Stream) -> list[Context]:
    """Return the checks of a length's bytes on a beat; a byte that is present and differs excludes this length."""
    return [
        _byte_check(stream, stream.length_start + index, byte)
        for index, byte in enumerate(length.to_bytes(LENGTH_BYTES, "little"))
        if stream.beat(stream.length_start + index) == beat
    ]


def _prefix_bytes(frame: Frame, stream: Stream) -> list[tuple[int, int]]:
    return [(stream.payload_start + index, frame.prefix[index]) for index in range(frame.checked_prefix)]


def _byte_check(stream: Stream, byte: int, value: int) -> Context:
    """Return the check that a byte of the stream has a certain value.

    A byte is present if its lane's `tkeep` is set.
    """
    lane = stream.lane(byte)
    return {
        "beat": is_beat(stream.beat(byte), stream.beat(byte)),
        "lane": lane,
        "high": 8 * lane + 7,
        "low": 8 * lane,
        "value": f"{value:02x}",
    }


def _end(stream: Stream, last_byte: int, number: int | None) -> Context:
    """Return the end of a frame whose length sets bit `number` of `match`.

    With only one legal length, `number` is None.
    """
    lane = stream.lane(last_byte)
    below = lane - 1 if lane > 0 else None
    above = lane + 2 if lane + 2 < stream.lanes else None
    return {
        "number": number,
        "beat": is_beat(stream.beat(last_byte), stream.beat(last_byte)),
        "lane": lane,
        "is_last_lane": lane + 1 == stream.lanes,
        # The nearest lane below `lane`, and the lane after its upper neighbour.
        "below": below,
        "above": above,
        "has_others": [{}] if below is not None or above is not None else [],
        "has_both": [{}] if below is not None and above is not None else [],
    }


def _field_slices(frame: Frame, stream: Stream, stores: Sequence[Store]) -> list[Context]:
    """Return the pieces of all ports; each piece is contiguous in a store."""
    places, registers = StoreMap(stream, stores), [f"fields{suffix}_r" for suffix in store_names(stores)]
    slices = (piece for port in field_ports(frame) for piece in slices_of(port))
    return [stored for piece in slices for stored in stored_slices(piece, places, registers)]


def _publisher_pieces(frame: Frame, start: int, size: int) -> list[Context]:
    """Return the parts of a frame after the id, with their values; bit 0 is `start` bytes before the frame.

    The parts are header, constant bytes, fields, and zeros up to `size` bytes.
    """
    header = ID_BYTES + LENGTH_BYTES
    constants = [
        (ID_BYTES, frame.payload_bytes.to_bytes(LENGTH_BYTES, "little")),
        *((header + offset, data) for offset, data in _constant_bytes(frame)),
    ]
    pieces = [(offset, len(data), _literal(data)) for offset, data in constants]
    for piece in (piece for port in field_ports(frame) for piece in slices_of(port)):
        value = bits_of_bool(piece.target) if piece.is_bit else piece.target
        pieces.append((header + piece.offset, piece.bytes, value))
    if size > frame.frame_bytes:
        pieces.append((frame.frame_bytes, size - frame.frame_bytes, _literal(bytes(size - frame.frame_bytes))))
    return [
        {"high": 8 * (start + first + count) - 1, "low": 8 * (start + first), "value": value}
        for first, count, value in pieces
    ]


def _literal(data: bytes) -> str:
    """Return bytes as a VHDL literal with the first byte lowest; long runs of zeros are abbreviated."""
    return hexadecimal(data) if any(data) or len(data) <= _ROW else "(others => '0')"


def _constant_bytes(frame: Frame) -> Iterator[tuple[int, bytes]]:
    """Yield the offset and the bytes of each part of the payload that no port drives.

    The bytes are the prefix, the defaults of unused fields, and zeros elsewhere. They are split into rows; a long run
    of zeros is a single part.
    """
    payload = default_payload(frame)
    cursor = 0
    for first, end in [*windows_of(frame.fields), (frame.payload_bytes, frame.payload_bytes)]:
        for part in _ROWS.finditer(payload, cursor, first):
            yield part.start(), part[0]
        cursor = end
