"""Cycles that converters take, counted in simulation of their netlists: no clock of the machine is read."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fusesoc_firm.message.middleware import middleware_of
from tests.payloads import Payloads
from tools.bench.designs import PUBLISHER, SUBSCRIBER, Converter, NotConvertedError
from tools.bench.model import (
    PUBLISHER_ID,
    Message,
    ModelError,
    Publisher,
    Subscriber,
    publisher_model,
    subscriber_model,
)
from tools.bench.tables import FAILED, MET, MISSED, NOT_CONVERTED, Table, Tell

LATENCY_TITLE = "Cycles of a message"
IMAGE_TITLE = "An image of 1920 x 1080 in rgb8"
# Messages in a row; the slowest counts.
MESSAGES = 10
MOST_BEHIND = 2
LEAST_USED = 98.0
_SIZE = (1080, 1920)
_PIXEL_BYTES = 3
_IMAGE_WIDTH = 128
_LENGTH_BYTES = 4

_LATENCY_COLUMNS = ("converter", "ROS", "bits", "beats", "first to last", "message", "dissertation", "bar", "result")
_LATENCY_NOTE = f"""
    Neither side stalls; the values are for the slowest of {MESSAGES} consecutive messages. 'first to last' is the
    number of cycles from the first to the last beat, both included. 'message' is the number of cycles from the last
    beat to msg_valid for a subscriber, and from segment_valid to the first beat for a publisher. To pass, a converter
    must need no more cycles from first to last than there are beats, and at most {MOST_BEHIND} cycles for the message.
    """
_IMAGE_COLUMNS = ("converter", "ROS", "bits", "start lanes", "beats", "most cycles", "beats used", "bar", "result")
_IMAGE_NOTE = """
    'beats used' is the share of cycles with a beat. The cycles are counted from the first beat to msg_valid for a
    subscriber, and from segment_valid to the last beat for a publisher. The value is for the worst lane in which the
    pixels can start. In ROS 2, the pixels start at multiples of 4 bytes.
    """


@dataclass(frozen=True)
class Cycles:
    """One frame: its beats, the cycles from the first to the last, and those between beats and message."""

    beats: int
    beat_cycles: int
    message_cycles: int

    @property
    def used(self) -> float:
        """Cycles with a beat in percent of all."""
        return 100 * self.beats / (self.beat_cycles + self.message_cycles)


class WrongResultError(Exception):
    """A converter that was measured did not do its work."""


def latency_rows() -> list[tuple[Converter, str]]:
    """A measured subject, with the dissertation's cycles."""
    measured = (("geometry_msgs/Quaternion", SUBSCRIBER, "35"), ("geometry_msgs/Point", PUBLISHER, "28"))
    return [
        (Converter(ros, message, direction, width), theirs if (ros, width) == (1, 8) else "")
        for message, direction, theirs in measured
        for ros in (1, 2)
        for width in (8, 64)
    ]


def image_rows() -> list[Converter]:
    """A measured subject with images."""
    return [
        Converter(ros, "sensor_msgs/Image", direction, _IMAGE_WIDTH)
        for direction in (SUBSCRIBER, PUBLISHER)
        for ros in (1, 2)
    ]


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {
        LATENCY_TITLE: [_key(converter) for converter, _ in latency_rows()],
        IMAGE_TITLE: [_key(converter) for converter in image_rows()],
    }


def measure(seed: int, tell: Tell) -> list[Table]:
    """Count the cycles of all rows; `tell` hears of each."""
    latencies = []
    for converter, theirs in latency_rows():
        *figures, result = _cells(converter, tell, 3, partial(_latency, converter, seed))
        latencies.append((*_key(converter), *figures, theirs, f"0 lost, {MOST_BEHIND}", result))
    images = []
    for converter in image_rows():
        *figures, result = _cells(converter, tell, 4, partial(_image, converter, seed))
        images.append((*_key(converter), *figures, f">= {LEAST_USED:.0f} %", result))
    return [
        Table(LATENCY_TITLE, _LATENCY_COLUMNS, tuple(latencies), _LATENCY_NOTE),
        Table(IMAGE_TITLE, _IMAGE_COLUMNS, tuple(images), _IMAGE_NOTE),
    ]


def cycles_of(
    model: Subscriber | Publisher, width: int, folder: Path, payloads: Payloads, *data: bytes
) -> list[Cycles]:
    """Send payloads through a converter and count cycles; raises `WrongResultError` for a wrong result."""
    bodies = [len(payload).to_bytes(_LENGTH_BYTES, "little") + payload for payload in data]
    shown = [
        {**payloads.shown(payload), "payload_length": body[:_LENGTH_BYTES]}
        for payload, body in zip(data, bodies, strict=True)
    ]
    wanted = [{name: message.get(name, b"") for name in model.shown} for message in shown]
    if isinstance(model, Subscriber):
        records, timing = model.run(folder, bodies)
        if records != [Message(message) for message in wanted]:
            raise WrongResultError("not the messages that were sent")
        ends = _ends(timing.valid, timing.streams, len(model.streams))
        before = [end - last for end, last in zip(ends, timing.last, strict=True)]
    else:
        frames, timing = model.run(folder, wanted)
        if frames != [bytes([PUBLISHER_ID]) + body for body in bodies]:
            raise WrongResultError("not the frames of the messages")
        before = [first - start for first, start in zip(timing.first, timing.valid, strict=True)]
    # At 8 bits the Manager keeps a subscriber's id; wider, its lane is void.
    ids = int(width > 8 or isinstance(model, Publisher))
    return [
        Cycles(-(-8 * (len(body) + ids) // width), last - first + 1, message)
        for body, first, last, message in zip(bodies, timing.first, timing.last, before, strict=True)
    ]


def _ends(valid: Sequence[int], streams: Sequence[tuple[int, int, int]], count: int) -> list[int]:
    """When each message was there: msg_valid, or the last beat of its streams if that is later."""
    lasts = [[last for _, last, _ in streams[count * n : count * (n + 1)]] for n in range(len(valid))]
    return [max([cycle, *of_message]) for cycle, of_message in zip(valid, lasts, strict=True)]


def _latency(converter: Converter, seed: int, folder: Path) -> tuple[str, ...]:
    source = random.Random(seed)
    payloads = Payloads(middleware_of(converter.ros), converter.message)
    data = [payloads.draw(source) for _ in range(MESSAGES)]
    found = cycles_of(_model(converter, folder), converter.width, folder, payloads, *data)
    slowest = max(found, key=lambda each: (each.beat_cycles, each.message_cycles))
    is_met = slowest.beat_cycles == slowest.beats and slowest.message_cycles <= MOST_BEHIND
    figures = (slowest.beats, slowest.beat_cycles, slowest.message_cycles)
    return (*map(str, figures), MET if is_met else MISSED)


def _image(converter: Converter, seed: int, folder: Path) -> tuple[str, ...]:
    source = np.random.default_rng(seed)
    height, width = _SIZE
    pixels = source.integers(0, 256, height * width * _PIXEL_BYTES, dtype=np.uint8)
    payloads = Payloads(middleware_of(converter.ros), converter.message)
    model = _model(converter, folder)
    given = {"height": height, "width": width, "step": width * _PIXEL_BYTES, "encoding": "rgb8", "data": pixels}
    found = {}
    for letters in range(_IMAGE_WIDTH // 8):
        payload = payloads.draw(random.Random(seed), {**given, "header_frame_id": "x" * letters})
        lane = (1 + _LENGTH_BYTES + len(payload) - pixels.size) % (_IMAGE_WIDTH // 8)
        if lane not in found:
            (found[lane],) = cycles_of(model, _IMAGE_WIDTH, folder, payloads, payload)
    worst = min(found.values(), key=lambda each: each.used)
    figures = (len(found), worst.beats, worst.beat_cycles + worst.message_cycles)
    return (*map(str, figures), f"{worst.used:.2f} %", MET if worst.used >= LEAST_USED else MISSED)


def _model(converter: Converter, folder: Path) -> Subscriber | Publisher:
    return (subscriber_model if converter.direction == SUBSCRIBER else publisher_model)(converter, folder)


def _cells(converter: Converter, tell: Tell, figures: int, count: Callable[[Path], tuple[str, ...]]) -> tuple[str, ...]:
    """So many figures and the result; the figures are empty where there are none."""
    name = " ".join(_key(converter))
    try:
        with tempfile.TemporaryDirectory() as folder:
            cells = count(Path(folder))
    except NotConvertedError:
        cells = (*[""] * figures, NOT_CONVERTED)
    except (ModelError, WrongResultError) as error:
        tell(f"{name}: {error}")
        cells = (*[""] * figures, FAILED)
    tell(f"{name}: {' '.join(filter(None, cells))}")
    return cells


def _key(converter: Converter) -> tuple[str, ...]:
    return (str(converter), str(converter.ros), str(converter.width))
