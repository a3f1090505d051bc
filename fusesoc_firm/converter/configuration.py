"""Frame -> template configuration: plain dictionaries that the VHDL templates only have to fill in.

All numbers that a converter needs are computed here (dissertation, listing 5.4): a template holds no
arithmetic and no choice beyond 'is this there'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.converter.ports import FieldPort, field_ports, vhdl_type
from fusesoc_firm.converter.slices import Slice, slices_of, windows_of
from fusesoc_firm.converter.stream import WIDTHS, Store, StoreMap, Stream, ranges, stores_of
from fusesoc_firm.diagnostics import fail
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES, Frame
from fusesoc_firm.naming import entity_name

Configuration = dict[str, Any]

SUBSCRIBER_TEMPLATE = "vhdl/subscriber.vhd"
PUBLISHER_TEMPLATE = "vhdl/publisher.vhd"
_LARGEST_FRAME = (2**31 - 1) // 8


def subscriber_entity(frame: Frame) -> str:
    """`axis_to_<pkg>_<type>`."""
    return f"axis_to_{entity_name(frame.message.package, frame.message.name)}"


def publisher_entity(frame: Frame) -> str:
    """`<pkg>_<type>_to_axis`."""
    return f"{entity_name(frame.message.package, frame.message.name)}_to_axis"


def subscriber_configuration(frame: Frame, width: int) -> Configuration:
    """The configuration of `axis_to_<pkg>_<type>` for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    windows = windows_of(frame)
    stores = stores_of(stream, windows)
    ends = [stream.payload_start + frame.payload_bytes + more - 1 for more in range(frame.trailing_bytes + 1)]
    # Until then nothing of the message that waits is touched, and none can follow it.
    hold_position = min(stream.beat(stream.payload_start), stream.beat(ends[0]))
    return {
        **_common(frame, stream, subscriber_entity(frame), "out"),
        "is_byte_wide": stream.lanes == 1,
        "has_void_lane": stream.length_start > 0,
        "last_position": stream.beat(ends[-1]),
        "position_high": max(1, stream.beat(ends[-1]).bit_length()) - 1,
        "hold_position": hold_position,
        "has_slack": hold_position > 0,
        "has_fields": bool(windows),
        "stores": [_store(store, name) for store, name in zip(stores, _store_names(stores), strict=True)],
        "store_signals": _store_signals(stores),
        "assignments": _subscriber_assignments(frame, stream, stores),
        "has_trailing": frame.trailing_bytes > 0,
        "match_high": frame.trailing_bytes,
        "length_beats": _length_beats(frame, stream),
        "has_encoding": frame.checked_prefix > 0,
        "prefix_checks": [_byte_check(stream, *item) for item in _prefix_bytes(frame, stream)],
        "ends": [_end(stream, number, byte) for number, byte in enumerate(ends)],
    }


def publisher_configuration(frame: Frame, width: int) -> Configuration:
    """The configuration of `<pkg>_<type>_to_axis` for a stream of `width` bits."""
    check_fixed_size(frame)
    check_width(width)
    _check_size(frame)
    stream = Stream(width)
    beats = stream.beat(frame.frame_bytes - 1) + 1
    last_lanes = stream.lane(frame.frame_bytes - 1) + 1
    return {
        **_common(frame, stream, publisher_entity(frame), "in"),
        "frame_beats": beats,
        "frame_high": beats * width - 1,
        "position_high": max(1, (beats - 1).bit_length()) - 1,
        "has_partial_beat": last_lanes < stream.lanes,
        "last_keep": "0" * (stream.lanes - last_lanes) + "1" * last_lanes,
        "pieces": _publisher_pieces(frame, beats * stream.lanes),
    }


def check_width(width: int) -> None:
    """Raise `InputError` for a stream of a width that converters do not have."""
    if width not in WIDTHS:
        fail(f"no converter is made for a stream of {width} bits", hint=f"legal here: {', '.join(map(str, WIDTHS))}")


def _check_size(frame: Frame) -> None:
    if frame.frame_bytes > _LARGEST_FRAME:
        fail(
            f"{frame.message} takes {frame.payload_bytes} bytes, too many for a converter",
            hint=f"at most {_LARGEST_FRAME - ID_BYTES - LENGTH_BYTES}: VHDL counts the bits of a frame up to 2**31-1",
        )


def _common(frame: Frame, stream: Stream, entity: str, direction: str) -> Configuration:
    ports = field_ports(frame)
    return {
        "entity": entity,
        "message": str(frame.message),
        "ros": int(frame.ros),
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
            "condition": "if" if beat == beats[0] else "elsif",
            "is_first": beat == beats[0],
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
    joints = _joints(len(checks), " or", "")
    return {"checks": [{**check, "joint": joint} for check, joint in zip(checks, joints, strict=True)]}


def _prefix_bytes(frame: Frame, stream: Stream) -> list[tuple[int, int]]:
    return [(stream.payload_start + index, frame.prefix[index]) for index in range(frame.checked_prefix)]


def _byte_check(stream: Stream, byte: int, value: int) -> Configuration:
    """That a byte of the stream has a value; `keep` is its lane's bit of tkeep."""
    lane = stream.lane(byte)
    return {
        "position": stream.beat(byte),
        "keep": lane,
        "is_kept": stream.lanes > 1,
        "bits": "" if stream.lanes == 1 else f"({stream.data(lane)})",
        "value": f"{value:02x}",
    }


def _end(stream: Stream, number: int, last_byte: int) -> Configuration:
    """Where a frame ends of which bit `number` of `match` tells the length."""
    lane = stream.lane(last_byte)
    return {
        "number": number,
        "position": stream.beat(last_byte),
        "lane": lane,
        "is_kept": stream.lanes > 1,
        "has_lane_behind": lane + 1 < stream.lanes,
        "lane_behind": lane + 1,
    }


def _store_names(stores: Sequence[Store]) -> list[str]:
    """What tells the stores apart in names: nothing if there is but one."""
    return [""] if len(stores) == 1 else [f"_{number}" for number in range(len(stores))]


def _store(store: Store, suffix: str) -> Configuration:
    lanes = ranges(store.lanes)
    register = f"fields{suffix}_r"
    data = [f"s_axis_tdata({8 * last + 7} downto {8 * first})" for first, last in reversed(lanes)]
    if len(store.beats) > 1:
        data.append(f"{register}({store.bits - 1} downto {store.beat_bits})")
    windows = ranges(store.beats)
    return {
        "store": f"store{suffix}",
        "register": register,
        "data": [
            {"piece": piece, "joint": joint} for piece, joint in zip(data, _joints(len(data), " &", ";"), strict=True)
        ],
        "windows": [
            {"first": first, "last": last, "is_one": first == last, "joint": joint}
            for (first, last), joint in zip(windows, _joints(len(windows), " or", " else '0';"), strict=True)
        ],
    }


def _store_signals(stores: Sequence[Store]) -> list[Configuration]:
    """The declaration of each store and of what makes it take a beat, in columns."""
    declared = []
    for store, suffix in zip(stores, _store_names(stores), strict=True):
        declared += [(f"store{suffix}", vhdl_type(None)), (f"fields{suffix}_r", vhdl_type(store.bits))]
    column = max((len(name) for name, _ in declared), default=0)
    return [{"name": name.ljust(column), "type": type_} for name, type_ in declared]


def _subscriber_assignments(frame: Frame, stream: Stream, stores: Sequence[Store]) -> list[Configuration]:
    """`port <= fields_r(...)` for every piece of a port that lies in one piece in a store."""
    names = _store_names(stores)
    places = StoreMap(stream, stores)
    pairs: list[tuple[str, str]] = []
    for port in field_ports(frame):
        for piece in slices_of(port):
            low = piece.low
            for stored in places.pieces(piece.offset, piece.bytes):
                bits = f"fields{names[stored.store]}_r({stored.high} downto {stored.low})"
                if _is_bit(piece):
                    # As roscpp and rospy read a bool: whatever is not zero is true.
                    pairs.append((_target(piece), f"'0' when {bits} = x\"00\" else '1'"))
                else:
                    part = replace(piece, low=low, width=8 * stored.count)
                    pairs.append((_target(part), bits))
                low += 8 * stored.count
    column = max([0, *(len(target) for target, _ in pairs)])
    return [{"target": target.ljust(column), "value": value} for target, value in pairs]


def _target(piece: Slice) -> str:
    """The port, or the part of it that the piece is."""
    port = piece.port
    if port.width is None or (piece.width == port.width and not _is_bit(piece)):
        return port.name
    return f"{port.name}({piece.low})" if _is_bit(piece) else f"{port.name}({piece.high} downto {piece.low})"


def _is_bit(piece: Slice) -> bool:
    return piece.port.field.type.bits == 1


def _publisher_pieces(frame: Frame, size: int) -> list[Configuration]:
    """`frame(...) <= value` for every part of the frame: the header, constant bytes, fields, and zeros up to `size`."""
    header = ID_BYTES + LENGTH_BYTES
    pieces = [
        (0, ID_BYTES, f"std_logic_vector(to_unsigned(ID, {8 * ID_BYTES}))"),
        (ID_BYTES, LENGTH_BYTES, _hex(frame.payload_bytes.to_bytes(LENGTH_BYTES, "little"))),
        *((header + offset, len(data), _hex(data)) for offset, data in _constant_bytes(frame)),
        *(
            (header + piece.offset, piece.bytes, f'"0000000" & {_target(piece)}' if _is_bit(piece) else _target(piece))
            for port in field_ports(frame)
            for piece in slices_of(port)
        ),
    ]
    if size > frame.frame_bytes:
        pieces.append((frame.frame_bytes, size - frame.frame_bytes, "(others => '0')"))
    targets = [f"frame({8 * (first + count) - 1} downto {8 * first})" for first, count, _ in pieces]
    column = max(map(len, targets))
    return [
        {"target": target.ljust(column), "value": value} for target, (_, _, value) in zip(targets, pieces, strict=True)
    ]


def _hex(data: bytes) -> str:
    """Bytes as a VHDL literal, the first one lowest."""
    return f'x"{data[::-1].hex()}"'


def _constant_bytes(frame: Frame) -> list[tuple[int, bytes]]:
    """The parts of the payload that hold no field, with what a publisher sends there: the prefix, else zeros."""
    parts = []
    cursor = 0
    for first, end in [*windows_of(frame), (frame.payload_bytes, frame.payload_bytes)]:
        if first > cursor:
            data = (frame.prefix + bytes(frame.payload_bytes))[cursor:first]
            parts.append((cursor, data))
        cursor = end
    return parts


def _joints(count: int, between: str, behind: str) -> list[str]:
    return [between] * (count - 1) + [behind] if count else []
