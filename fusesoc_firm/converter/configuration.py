"""Frame -> template configuration: plain dictionaries that the VHDL templates only have to fill in.

All numbers that a converter needs are computed here (dissertation, listing 5.4): a template holds no
arithmetic and no choice beyond 'is this there'.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.converter.ports import FieldPort, field_ports
from fusesoc_firm.converter.slices import Slice, slices_of, stored_offset, windows_of
from fusesoc_firm.diagnostics import fail
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES, Frame
from fusesoc_firm.naming import entity_name

Configuration = dict[str, Any]

SUBSCRIBER_TEMPLATE = "vhdl/subscriber.vhd"
PUBLISHER_TEMPLATE = "vhdl/publisher.vhd"
WIDTHS = (8,)
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
    _check_width(width)
    _check_size(frame)
    windows = windows_of(frame)
    end = LENGTH_BYTES + frame.payload_bytes
    stored_bytes = sum(last - first for first, last in windows)
    last_header = min(LENGTH_BYTES, end - 1)
    return {
        **_common(frame, subscriber_entity(frame), "out"),
        "end_position": end,
        "last_position": end - 1,
        "position_high": end.bit_length() - 1,
        "hold_position": last_header,
        "has_fields": stored_bytes > 0,
        "has_many_bytes": stored_bytes > 1,
        "stored_high": 8 * stored_bytes - 1,
        "windows": [
            {"first": LENGTH_BYTES + first, "end": LENGTH_BYTES + last, "joint": joint}
            for (first, last), joint in zip(windows, _joints(len(windows), " or", " else '0';"), strict=True)
        ],
        "assignments": _subscriber_assignments(frame, windows),
        **_length_check(frame),
        "has_encoding": frame.checked_prefix > 0,
        "prefix_checks": [
            {"position": LENGTH_BYTES + index, "value": f"{frame.prefix[index]:02x}"}
            for index in range(frame.checked_prefix)
        ],
    }


def publisher_configuration(frame: Frame, width: int) -> Configuration:
    """The configuration of `<pkg>_<type>_to_axis` for a stream of `width` bits."""
    check_fixed_size(frame)
    _check_width(width)
    _check_size(frame)
    return {
        **_common(frame, publisher_entity(frame), "in"),
        "frame_bytes": frame.frame_bytes,
        "frame_high": 8 * frame.frame_bytes - 1,
        "position_high": max(1, (frame.frame_bytes - 1).bit_length()) - 1,
        "pieces": _publisher_pieces(frame),
    }


def _check_width(width: int) -> None:
    if width not in WIDTHS:
        fail(f"no converter is made for a stream of {width} bits", hint=f"legal here: {', '.join(map(str, WIDTHS))}")


def _check_size(frame: Frame) -> None:
    if frame.frame_bytes > _LARGEST_FRAME:
        fail(
            f"{frame.message} takes {frame.payload_bytes} bytes, too many for a converter",
            hint=f"at most {_LARGEST_FRAME - ID_BYTES - LENGTH_BYTES}: VHDL counts the bits of a frame up to 2**31-1",
        )


def _common(frame: Frame, entity: str, direction: str) -> Configuration:
    ports = field_ports(frame)
    return {
        "entity": entity,
        "message": str(frame.message),
        "ros": int(frame.ros),
        "payload_bytes": frame.payload_bytes,
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


def _length_check(frame: Frame) -> Configuration:
    """What the four length bytes must be: the payload's length, or up to `trailing_bytes` more.

    A length that may be longer can carry from its lowest byte into the next; then `carried` is what the
    upper bytes must be behind such a carry.
    """
    low = frame.payload_bytes.to_bytes(LENGTH_BYTES, "little")
    high = (frame.payload_bytes + frame.trailing_bytes).to_bytes(LENGTH_BYTES, "little")
    carries = low[1:] != high[1:]
    return {
        "has_trailing": frame.trailing_bytes > 0,
        "trailing_bytes": frame.trailing_bytes,
        "length_low": low[0],
        "length_low_hex": f"{low[0]:02x}",
        "length_carries": carries,
        "length_checks": [
            {"position": index, "value": f"{low[index]:02x}", "carried": f"{high[index]:02x}", "carries": carries}
            for index in range(1, LENGTH_BYTES)
        ],
    }


def _subscriber_assignments(frame: Frame, windows: Sequence[tuple[int, int]]) -> list[Configuration]:
    """`port <= fields_r(...)` for every piece; `fields_r` holds the windows' bytes, the first byte lowest."""
    pieces = [piece for port in field_ports(frame) for piece in slices_of(port)]
    column = max([0, *(len(_target(piece)) for piece in pieces)])
    return [
        {"target": _target(piece).ljust(column), "value": _stored_value(piece, stored_offset(windows, piece.offset))}
        for piece in pieces
    ]


def _stored_value(piece: Slice, first_byte: int) -> str:
    stored = f"fields_r({8 * (first_byte + piece.bytes) - 1} downto {8 * first_byte})"
    # As roscpp and rospy read a bool: whatever is not zero is true.
    return f"'0' when {stored} = x\"00\" else '1'" if _is_bit(piece) else stored


def _target(piece: Slice) -> str:
    """The port, or the part of it that the piece is."""
    port = piece.port
    if port.width is None or (piece.width == port.width and not _is_bit(piece)):
        return port.name
    return f"{port.name}({piece.low})" if _is_bit(piece) else f"{port.name}({piece.high} downto {piece.low})"


def _is_bit(piece: Slice) -> bool:
    return piece.port.field.type.bits == 1


def _publisher_pieces(frame: Frame) -> list[Configuration]:
    """`frame(...) <= value` for every part of the frame: the header, the constant bytes, the fields."""
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
