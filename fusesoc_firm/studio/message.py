"""A recorded message as the page shows it: its fields as texts, or its picture."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import islice
from math import hypot, isfinite
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.runs.simulation.host_files import is_zero, leaves, value_text
from fusesoc_firm.studio.units import unit_of

# The largest parts of a message that are sent to the page.
_MOST_FIELDS, _MOST_ITEMS, _MOST_CHARACTERS, _MOST_BYTES = 500, 16, 500, 32
_MOST_PIXELS = 2**24
# The longest payload in bytes whose numbers can be plotted, and the longest one whose fields are listed, since lists
# show many messages a second.
_MOST_PLOTTED, _MOST_LISTED = 2**16, 2**12
# The number of characters of a message in a list.
_MOST_LISTED_CHARACTERS = 160
# The place of a message's pose: its field, and the names of its position and rotation.
_POSES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "geometry_msgs/Pose": ((), "position", "orientation"),
    "geometry_msgs/PoseStamped": (("pose",), "position", "orientation"),
    "geometry_msgs/PoseWithCovariance": (("pose",), "position", "orientation"),
    "geometry_msgs/PoseWithCovarianceStamped": (("pose", "pose"), "position", "orientation"),
    "geometry_msgs/Transform": ((), "translation", "rotation"),
    "geometry_msgs/TransformStamped": (("transform",), "translation", "rotation"),
    "nav_msgs/Odometry": (("pose", "pose"), "position", "orientation"),
}
# The fields of a time in ROS 2 and in ROS 1; the seconds of the years 2000 and 2100, between which it is a date.
_STAMPS = {("sec", "nanosec"), ("secs", "nsecs")}
_FIRST_DATE, _LAST_DATE = 946_684_800, 4_102_444_800
_IMAGE, _COMPRESSED = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
# For each encoding of sensor_msgs/Image: bits of a value, and the places of red, green and blue or of gray in a pixel.
_ENCODINGS: dict[str, tuple[int, tuple[int, ...], int]] = {
    "mono8": (8, (0,), 1),
    "8UC1": (8, (0,), 1),
    "rgb8": (8, (0, 1, 2), 3),
    "bgr8": (8, (2, 1, 0), 3),
    "8UC3": (8, (2, 1, 0), 3),
    "rgba8": (8, (0, 1, 2), 4),
    "bgra8": (8, (2, 1, 0), 4),
    "mono16": (16, (0,), 1),
    "16UC1": (16, (0,), 1),
    **{f"bayer_{order}8": (8, (0,), 1) for order in ("rggb", "bggr", "gbrg", "grbg")},
}
# The media types that browsers may show, by first bytes; other formats might contain scripts.
_SAFE = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def fields_of(frame: Frame, payload: bytes) -> dict[str, Any]:
    """Return the fields of a message: rows of a dotted name, a shortened text and a unit, and whether rows are omitted.

    For an invalid payload, the result has a `fault`.
    """
    try:
        rows = [*islice(_rows("", decode(frame, payload)), _MOST_FIELDS + 1)]
    except CodecError as error:
        return {"fields": [], "isShortened": False, "fault": str(error)}
    fields = [(name, text, unit_of(str(frame.message), name)) for name, text in rows[:_MOST_FIELDS]]
    return {"fields": fields, "isShortened": len(rows) > _MOST_FIELDS, "fault": ""}


def words_of(frame: Frame, payload: bytes) -> list[str]:
    """Return the fields of a message as `firm sim` prints them, such as `point.x=1.5`, up to the length of a line.

    The fields of a header come last. If the line is too long, zero and empty fields are omitted. An invalid or long
    payload has no words.
    """
    if len(payload) > _MOST_LISTED:
        return []
    try:
        fields = sorted(leaves(decode(frame, payload)), key=lambda field: field[0].startswith("header."))
    except CodecError:
        return []
    words = [f"{name}={value_text(value)}" for name, value in fields]
    if len(" ".join(words)) > _MOST_LISTED_CHARACTERS:
        words = [word for word, (_, value) in zip(words, fields, strict=True) if not is_zero(value)]
    found: list[str] = []
    room = _MOST_LISTED_CHARACTERS
    for word in words:
        if len(word) > room:
            return [*found, f"{word[:room]}..."]
        found.append(word)
        room -= len(word) + 1
    return found


def numbers_of(frame: Frame, payload: bytes) -> dict[str, float | None]:
    """Return the numbers in a message by their dotted names, None for those that are not finite.

    An invalid or long payload has no numbers.
    """
    if len(payload) > _MOST_PLOTTED:
        return {}
    try:
        return dict(islice(_numbers("", decode(frame, payload)), _MOST_FIELDS))
    except CodecError:
        return {}


def has_pose(frame: Frame) -> bool:
    """Return whether messages of a frame have a pose."""
    return str(frame.message) in _POSES


def pose_of(frame: Frame, payload: bytes) -> list[float] | None:
    """Return the pose in a message: x, y and z of its position, then x, y, z and w of its rotation, a unit quaternion.

    Return None if these fields are missing, or if the numbers are not a valid pose.
    """
    if not has_pose(frame):
        return None
    way, *names = _POSES[str(frame.message)]
    try:
        message: Any = decode(frame, payload)
        for name in way:
            message = message[name]
        place, rotation = (
            [float(message[part][axis]) for axis in axes] for part, axes in zip(names, ("xyz", "xyzw"), strict=True)
        )
    except (CodecError, KeyError):
        return None
    size = hypot(*rotation)
    if not all(map(isfinite, [*place, size])) or not size:
        return None
    return [*place, *(number / size for number in rotation)]


def has_picture(frame: Frame) -> bool:
    """Return whether messages of a frame are pictures."""
    return str(frame.message) in (_IMAGE, _COMPRESSED)


def picture_of(frame: Frame, payload: bytes) -> tuple[bytes, str] | None:
    """Return the picture in a message, and its media type; None without a picture that a browser can show."""
    if not has_picture(frame):
        return None
    try:
        message = decode(frame, payload)
    except CodecError:
        return None
    data = bytes(message["data"])
    if str(frame.message) == _COMPRESSED:
        return next(((data, kind) for start, kind in _SAFE.items() if data.startswith(start)), None)
    made = _png(message, data)
    return (made, "image/png") if made else None


def _rows(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and tuple(value) in _STAMPS:
        yield name, _stamp_text(*value.values())
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _rows(f"{name}.{key}" if name else str(key), item)
    elif isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
        for number, item in enumerate(value):
            yield from _rows(f"{name}[{number}]", item)
    else:
        yield name, _text(value)


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float | None]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _numbers(f"{name}.{key}" if name else str(key), item)
    elif isinstance(value, list | tuple):
        for number, item in enumerate(value[:_MOST_ITEMS]):
            yield from _numbers(f"{name}[{number}]", item)
    elif isinstance(value, int | float):
        yield name, float(value) if isfinite(value) else None


def _stamp_text(seconds: int, nanoseconds: int) -> str:
    """Return a time: as a date if its seconds are since 1970, and otherwise in seconds."""
    if seconds < 0 or nanoseconds >= 10**9:
        return f"{seconds} s + {nanoseconds} ns"
    text = f"{seconds}.{nanoseconds:09d} s"
    if not _FIRST_DATE <= seconds <= _LAST_DATE:
        return text
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{nanoseconds:09d} UTC ({text})"


def _text(value: Any) -> str:
    if isinstance(value, bytes | bytearray):
        return _shortened(value[:_MOST_BYTES].hex(" "), len(value), _MOST_BYTES, "bytes")
    if isinstance(value, str):
        return value if len(value) <= _MOST_CHARACTERS else f"{value[:_MOST_CHARACTERS]}... ({len(value)} characters)"
    if isinstance(value, Sequence):
        return _shortened(", ".join(_text(item) for item in value[:_MOST_ITEMS]), len(value), _MOST_ITEMS, "items")
    return str(value)


def _shortened(text: str, count: int, most: int, unit: str) -> str:
    return text if count <= most else f"{text}, ... ({count} {unit})"


def _png(message: Mapping[str, Any], data: bytes) -> bytes | None:
    """Return an image as PNG, or None if its fields do not describe one."""
    width, height, step = (int(message.get(name, 0)) for name in ("width", "height", "step"))
    bits, places, values = _ENCODINGS.get(str(message.get("encoding")), (0, (), 0))
    size = bits // 8
    if not bits or not width or not height or width * height > _MOST_PIXELS:
        return None
    if step < width * values * size or len(data) < step * (height - 1) + width * values * size:
        return None
    is_swapped = size == 2 and not message.get("is_bigendian")
    lines = bytearray()
    for line in range(height):
        lines += b"\0" + _pixels(data[line * step :][: width * values * size], places, values, size, is_swapped)
    header = struct.pack(">IIBBBBB", width, height, bits, 2 if len(places) == 3 else 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes(lines), 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _pixels(line: bytes, places: Sequence[int], values: int, size: int, is_swapped: bool) -> bytes:
    """Return the pixels of a line in the order of PNG: red, green, blue, the high byte first."""
    if is_swapped:
        made = bytearray(len(line))
        made[0::2], made[1::2] = line[1::2], line[0::2]
        return bytes(made)
    if size == 2 or (places == tuple(range(values))):
        return line
    made = bytearray(len(line) // values * len(places))
    for place, source in enumerate(places):
        made[place :: len(places)] = line[source::values]
    return bytes(made)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
