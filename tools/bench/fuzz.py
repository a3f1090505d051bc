"""Broken frames among good ones: exactly the good ones must be delivered, unchanged, and nothing may hang.

A frame is cut, lengthened, has a wrong length or count, has bytes changed, is another message's, or several of these.
`payloads` decides which frames are good; a broken one that reaches the converter must give one frame_error.
"""

from __future__ import annotations

import random
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice, zip_longest
from pathlib import Path

from fusesoc_firm.message.middleware import middleware_of
from tests.payloads import BrokenPayloadError, Payloads
from tools.bench.designs import SUBSCRIBER, Converter, NotConvertedError
from tools.bench.model import FrameError, Message, ModelError, Subscriber, subscriber_model
from tools.bench.tables import FAILED, MET, NOT_CONVERTED, NOT_MEASURED, Table, Tell, known_rows

BROKEN_FRAMES = 100_000
TITLE = "Broken frames"
STALL_PERCENT = 15
# Frames of one run; small enough that a fault is found at once, and its frames can be looked at.
BATCH = 10_000
MESSAGES = (
    (1, "geometry_msgs/Quaternion"),
    (2, "geometry_msgs/Quaternion"),
    (1, "sensor_msgs/Image"),
    (2, "sensor_msgs/Image"),
    (2, "geometry_msgs/PoseArray"),
    (1, "diagnostic_msgs/DiagnosticArray"),
    (2, "diagnostic_msgs/DiagnosticArray"),
)
WIDTHS = (8, 64)
_LENGTH_BYTES = 4
_COLUMNS = ("subscriber", "ROS", "bits", "broken", "good", "delivered", "frame_error", "cycles", "result")
_NOTE = f"""
    Broken frames are truncated or too long, have wrong lengths, counts or other bytes, belong to another message, or
    combine these faults. The column frame_error gives the number of cycles in which that signal is high. Every stream
    stalls in {STALL_PERCENT} % of the cycles. The seed is """


@dataclass(frozen=True)
class FuzzFrame:
    """The bytes after an id, and the expected values of the ports; None if the frame is broken."""

    body: bytes
    shown: dict[str, bytes] | None


@dataclass(frozen=True)
class Tally:
    """The result of a run; `fault` is empty if it is right."""

    broken: int = 0
    good: int = 0
    delivered: int = 0
    errors: int = 0
    cycles: int = 0
    fault: str = ""


def rows() -> list[Converter]:
    """A fuzzed subject."""
    return [Converter(ros, message, SUBSCRIBER, width) for ros, message in MESSAGES for width in WIDTHS]


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [_key(converter) for converter in rows()]}


def measure(seed: int, tell: Tell, broken: int = BROKEN_FRAMES, written: str = "", pattern: str = "") -> list[Table]:
    """Fuzz every subscriber whose name matches a regular expression with `broken` broken frames.

    `tell` hears of each batch. The other rows are taken from the text `written` of docs/figures.
    """
    known = known_rows(written, TITLE, _COLUMNS, keys=3)
    lines = []
    for converter in rows():
        name = " ".join(_key(converter))
        if not re.search(pattern, name):
            lines.append(known.get(_key(converter)) or (*_key(converter), *[""] * 5, NOT_MEASURED))
            continue
        try:
            with tempfile.TemporaryDirectory() as folder:
                tally = fuzz(converter, Path(folder), broken, seed, tell)
        except NotConvertedError:
            tell(f"{name}: {NOT_CONVERTED}")
            lines.append((*_key(converter), *[""] * 5, NOT_CONVERTED))
            continue
        if tally.fault:
            tell(f"{name}: {FAILED}: {tally.fault}")
        numbers = (tally.broken, tally.good, tally.delivered, tally.errors, tally.cycles)
        lines.append((*_key(converter), *map(str, numbers), FAILED if tally.fault else MET))
    return [Table(TITLE, _COLUMNS, tuple(lines), f"{_NOTE}{seed}.")]


def fuzz(converter: Converter, folder: Path, broken: int, seed: int, tell: Tell) -> Tally:
    """Send frames until `broken` of them were broken; raises `NotConvertedError`."""
    model = subscriber_model(converter, folder)
    frames = troubled_frames(Payloads(middleware_of(converter.ros), converter.message), converter.width, seed)
    total = Tally()
    while total.broken < broken and not total.fault:
        batch = [*islice(frames, min(BATCH, 2 * (broken - total.broken) + 2))]
        total = _run(model, folder, batch, seed, total)
        tell(f"{' '.join(_key(converter))}: {total.broken} broken frames")
    return total


def _run(model: Subscriber, folder: Path, batch: list[FuzzFrame], seed: int, before: Tally) -> Tally:
    """Send a batch and add its results to `before`."""
    broken = sum(frame.shown is None for frame in batch)
    try:
        records, timing = model.run(folder, [frame.body for frame in batch], seed + before.broken, STALL_PERCENT)
        cycles, fault = timing.cycles, difference(model, batch, records)
    except ModelError as error:
        records, cycles, fault = [], 0, str(error)
    delivered = sum(isinstance(record, Message) for record in records)
    return Tally(
        before.broken + broken,
        before.good + len(batch) - broken,
        before.delivered + delivered,
        before.errors + len(records) - delivered,
        before.cycles + cycles,
        fault,
    )


def difference(model: Subscriber, frames: list[FuzzFrame], records: list[Message | FrameError]) -> str:
    """Describe the first frame whose result is unexpected; empty if there is none."""
    for number, (frame, record) in enumerate(zip_longest(frames, records)):
        if frame is None:
            return f"behind all frames comes {record}"
        if frame.shown is None:
            if isinstance(record, FrameError):
                continue
            return f"frame {number}, {frame.body.hex()}, is broken and gives {record}"
        wanted = {name: frame.shown.get(name, b"") for name in model.shown}
        if record != Message(wanted):
            return f"frame {number}, {frame.body.hex()}, gives {record} instead of {wanted}"
    return ""


def troubled_frames(payloads: Payloads, width: int, seed: int) -> Iterator[FuzzFrame]:
    """Good and broken frames without end. Those that do not reach a converter are left out: at 8 bits an id alone."""
    source = random.Random(f"{seed} {width}")
    while True:
        payload = payloads.draw(source)
        frame = fuzz_frame(payloads, trouble(payload, source))
        if frame.body or width > 8:
            yield frame


def fuzz_frame(payloads: Payloads, body: bytes) -> FuzzFrame:
    """A frame with its verdict."""
    length, payload = body[:_LENGTH_BYTES], body[_LENGTH_BYTES:]
    if length != len(payload).to_bytes(_LENGTH_BYTES, "little"):
        return FuzzFrame(body, None)
    try:
        shown = payloads.shown(payload)
    except BrokenPayloadError:
        return FuzzFrame(body, None)
    return FuzzFrame(body, {**shown, "payload_length": length})


def _framed(payload: bytes, announced: int | None = None) -> bytes:
    length = len(payload) if announced is None else announced % 2**32
    return length.to_bytes(_LENGTH_BYTES, "little") + payload


def trouble(payload: bytes, source: random.Random) -> bytes:
    """A frame of the payload; three in five are troubled, some more than once."""
    body = _framed(payload)
    if source.random() < 0.4:
        return body
    for _ in range(source.choice((1, 1, 1, 2, 3))):
        body = source.choice(_TROUBLES)(body, source)
    return body


def _cut(body: bytes, source: random.Random) -> bytes:
    return body[: source.randrange(len(body) + 1)]


def _cut_and_honest(body: bytes, source: random.Random) -> bytes:
    payload = body[_LENGTH_BYTES:]
    return _framed(payload[: source.randrange(len(payload) + 1)])


def _lengthened(body: bytes, source: random.Random) -> bytes:
    return body + source.randbytes(source.choice((1, 2, 3, 4, 5, 8, 64, 300)))


def _lengthened_and_honest(body: bytes, source: random.Random) -> bytes:
    return _framed(body[_LENGTH_BYTES:] + source.randbytes(source.choice((1, 2, 3, 4, 5, 8, 64))))


def _lying_length(body: bytes, source: random.Random) -> bytes:
    payload = body[_LENGTH_BYTES:]
    return _framed(payload, len(payload) + source.choice((-256, -8, -4, -3, -2, -1, 1, 2, 3, 4, 8, 256, 2**24, 2**31)))


def _changed_byte(body: bytes, source: random.Random) -> bytes:
    """Anywhere: in a length, a count, the encoding, or a value, which leaves the frame good."""
    if not body:
        return body
    place = source.randrange(len(body))
    return body[:place] + source.randbytes(1) + body[place + 1 :]


def _lying_word(body: bytes, source: random.Random) -> bytes:
    """Change a word after the length that may be a count by a little, or make it huge."""
    words = (len(body) - _LENGTH_BYTES) // 4
    if words < 1:
        return body
    place = _LENGTH_BYTES + 4 * source.randrange(words) + source.choice((0, 0, 0, 1, 2, 3))
    word = int.from_bytes(body[place : place + 4], "little")
    lie = source.choice((0, word + 1, word - 1, word + 4, 2 * word, 2**31, 2**32 - 1, 2**32 - word)) % 2**32
    return body[:place] + lie.to_bytes(4, "little")[: len(body) - place] + body[place + 4 :]


def _removed_bytes(body: bytes, source: random.Random) -> bytes:
    payload = body[_LENGTH_BYTES:]
    start = source.randrange(len(payload) + 1)
    return _framed(payload[:start] + payload[start + source.randint(1, 8) :])


def _other_message(body: bytes, source: random.Random) -> bytes:
    return _framed(source.randbytes(source.randrange(2 * len(body) + 1)))


def _nothing(_body: bytes, source: random.Random) -> bytes:
    return source.choice((b"", _framed(b"")))


_TROUBLES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _cut,
    _cut_and_honest,
    _lengthened,
    _lengthened_and_honest,
    _lying_length,
    _changed_byte,
    _lying_word,
    _removed_bytes,
    _other_message,
    _nothing,
)


def _key(converter: Converter) -> tuple[str, ...]:
    return (converter.message, str(converter.ros), str(converter.width))
