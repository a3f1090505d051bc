"""The fuzzing of whole systems: its judge sees every kind of fault, and a sample of its frames."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.message import ROS2
from tests.payloads import Payloads
from tests.seeds import seeded
from tools.bench import fuzz_systems
from tools.bench.fuzz_judge import ENCODING, Judge, Record, Sent, Trouble, WrongError, read_records
from tools.bench.fuzz_systems import System

SEED = seeded(20261123)
NUMBER, LATE, SUBSCRIBER, UNKNOWN = 1, 3, 0, 9
QUATERNION = Payloads(ROS2, "geometry_msgs/Quaternion")
needs_verilator = pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator")


def _quaternion(first: int) -> Sent:
    payload = ENCODING + bytes([first]) + bytes(31)
    body = len(payload).to_bytes(4, "little") + payload
    return Sent(0, body, Trouble.NONE, 0, QUATERNION.shown(payload))


def _broken(id_: int = 0) -> Sent:
    return Sent(id_, b"\x02\x00\x00\x00ab", Trouble.NONE, 0, None)


def _number(number: int) -> Sent:
    data = number.to_bytes(2, "little")
    return Sent(NUMBER, b"\x06\x00\x00\x00" + ENCODING + data, Trouble.NONE, 0, {"data": data})


def _text(number: int) -> Record:
    text = b"abcdefghijklmnopqrstuvwxyz"[:number] + b"\0"
    payload = ENCODING + len(text).to_bytes(4, "little") + text
    return Record("F", 0, bytes([NUMBER]) + len(payload).to_bytes(4, "little") + payload)


def _back(sent: Sent) -> Record:
    return Record("F", 0, bytes([sent.id]) + sent.body)


def _error(channel: int, code: Fault) -> Record:
    return Record("E", channel, bytes([code.value]))


ABORTED = Record("A", 0, b"\0")
FIRST, SECOND = _quaternion(1), _quaternion(2)
SENT = [FIRST, _broken(), SECOND, _number(5), _number(4), _number(8), _broken(NUMBER), _broken(UNKNOWN)]
SHORT, LATER = _error(SUBSCRIBER, Fault.SHORT_FRAME), _error(LATE, Fault.WATCHDOG)
OF_NUMBER, ID = _error(NUMBER, Fault.BAD_LENGTH), Record("I", 0, b"")
RIGHT = [_back(FIRST), SHORT, ABORTED, _back(SECOND), LATER, _text(8), OF_NUMBER, ID]


def _judge(sent: list[Sent], records: list[Record]) -> Judge:
    judge = Judge([QUATERNION], is_ros2=True, late=LATE)
    judge.judge(sent, records)
    return judge


def test_what_is_right() -> None:
    """A number without a response is counted as such."""
    assert _judge(SENT, RIGHT).dropped == 0
    dropped = [_error(NUMBER, Fault.DROPPED) if record is OF_NUMBER else record for record in RIGHT]
    assert _judge(SENT, dropped).dropped == 1


@pytest.mark.parametrize(
    ("records", "message"),
    [
        (RIGHT[1:], "came back as"),
        ([*RIGHT, _back(SECOND)], "delivered as good"),
        ([record for record in RIGHT if record is not SHORT], "1 broken frames of id 0, 0 counted"),
        ([*RIGHT, SHORT], "1 broken frames of id 0, 2 counted"),
        ([record for record in RIGHT if record != _back(SECOND)], "1 good frames are lost"),
        ([record for record in RIGHT if record is not LATER], "numbers, 4 counted|4 numbers, 3 counted"),
        ([*RIGHT, _text(7)], "no number has the answer"),
        ([record for record in RIGHT if record is not OF_NUMBER], "1 broken numbers, 0 counted"),
        ([*RIGHT, OF_NUMBER], "1 broken numbers, but 2 reported"),
        (RIGHT[:-1], "1 unknown ids, 0 counted"),
        ([*RIGHT, Record("A", 0, b"\x07")], "frames of .7., who are nobody"),
    ],
)
def test_what_is_wrong(records: list[Record], message: str) -> None:
    with pytest.raises(WrongError, match=message):
        _judge(SENT, records)


def test_ids_of_two_bytes() -> None:
    """A frame that begins with an empty beat, or is one byte, has no id; one of channel 256 is not one of channel 0."""
    judge = Judge([QUATERNION], is_ros2=True, late=LATE, id_bytes=2)
    back = Record("F", 0, b"\0\0" + FIRST.body)
    judge.judge([FIRST, replace(FIRST, trouble=Trouble.NULL_BEAT, shown=None)], [back, ID])
    one_byte = replace(FIRST, trouble=Trouble.ONE_BYTE, shown=None)
    assert one_byte.record(id_bytes=2) == bytes((Trouble.ONE_BYTE, 0, 0))
    judge.judge([FIRST, one_byte], [back, ID])
    with pytest.raises(WrongError, match=r"frames of \{256\}, who are nobody"):
        judge.judge([FIRST], [Record("F", 0, b"\0\1" + FIRST.body)])


def test_a_reset_takes_what_is_under_way() -> None:
    """What comes back before it is still judged, and after it everything."""
    reset = Record("R", 0, (3).to_bytes(4, "little"))
    hit = [FIRST, _broken(), SECOND, FIRST, *SENT]
    _judge(hit, [_back(FIRST), reset, *RIGHT])
    with pytest.raises(WrongError, match="came back as"):
        _judge(hit, [_back(SECOND), reset, *RIGHT])
    with pytest.raises(WrongError, match="came back as"):
        _judge(hit, [_back(FIRST), reset, *RIGHT[1:]])


def test_records_are_read() -> None:
    records = [Record("E", 3, b"\x09"), Record("I", 0, b""), Record("F", 0, b"abc")]
    data = b"".join(
        item.kind.encode() + bytes([item.channel]) + len(item.data).to_bytes(4, "little") + item.data
        for item in records
    )
    assert [*read_records(data)] == records


# Sizes of all kinds, of which some break on their way out.
_TYPES = (
    "geometry_msgs/Quaternion",
    "geometry_msgs/Pose",
    "geometry_msgs/Transform",
    "std_msgs/String",
    "std_msgs/Header",
    "std_msgs/Float64MultiArray",
    "sensor_msgs/JointState",
    "sensor_msgs/LaserScan",
    "sensor_msgs/CompressedImage",
    "geometry_msgs/PoseArray",
)


def _with_broken_beats(good: Sent, lanes: int) -> Iterator[Sent]:
    """The frame with a null, a holed and a short beat at every place, each followed by the good frame."""
    beats = -(-(1 + len(good.body)) // lanes)
    for place in range(beats):
        for what in Trouble.NULL_BEAT, Trouble.GAP, Trouble.SHORT:
            # A short last beat only ends the frame early.
            if what is not Trouble.SHORT or place < beats - 1:
                yield replace(good, trouble=what, beat=place, shown=None)
                yield good


def _codes(broken: Sent, lanes: int) -> tuple[Fault, ...]:
    """The codes of a frame with a broken beat: if the last one has a hole, the frame may also seem short or long."""
    is_last = broken.beat == -(-(1 + len(broken.body)) // lanes) - 1
    if broken.trouble is Trouble.GAP and is_last:
        return (Fault.BROKEN_BEAT, Fault.SHORT_FRAME, Fault.LONG_FRAME)
    return (Fault.BROKEN_BEAT,)


@needs_verilator
@pytest.mark.parametrize(
    "width",
    [
        pytest.param(width, marks=pytest.mark.check if width == 16 else pytest.mark.thorough)
        for width in (16, 32, 64, 128, 256, 512)
    ],
)
def test_a_broken_beat_at_every_place_costs_its_frame_alone(tmp_path: Path, width: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(f"{SEED} {width}")
    program = fuzz_systems.build(System(width, 2, _TYPES, "block"), tmp_path, is_long=False)
    sent: list[Sent] = []
    for id_, name in enumerate(_TYPES):
        payloads = Payloads(ROS2, name)
        payload = sorted((payloads.draw(source) for _ in range(9)), key=len)[4]
        body = len(payload).to_bytes(4, "little") + payload
        sent += _with_broken_beats(Sent(id_, body, Trouble.NONE, 0, payloads.shown(payload)), width // 8)
    for _ in fuzz_systems.STALLS:
        tally = program.send(sent, source, f"{SEED}")
        assert not tally.fault, tally.fault
        assert tally.broken == tally.good == len(sent) // 2
        records = [*read_records((program.path.parent / "records").read_bytes())]
        for id_ in range(len(_TYPES)):
            codes = [record.data[0] for record in records if record.kind == "E" and record.channel == id_]
            broken = [item for item in sent if item.id == id_ and item.shown is None]
            for item, code in zip(broken, codes, strict=True):
                assert code in _codes(item, width // 8), (item, code)
        print(f"{width} bits: {tally.broken} broken frames in {tally.cycles} cycles")


# A program of a wide system takes minutes to compile.
_SAMPLE = ((8, 1), (32, 1), (16, 2))


def _mark(system: System) -> pytest.MarkDecorator:
    return pytest.mark.check if (system.width, system.id_bytes) in _SAMPLE else pytest.mark.thorough


@needs_verilator
@pytest.mark.parametrize(
    "system",
    [pytest.param(system, marks=_mark(system)) for system in fuzz_systems.SYSTEMS],
    ids=lambda system: system.name,
)
def test_a_thousand_broken_frames(tmp_path: Path, system: System) -> None:
    print(f"seed {SEED}")
    tally = fuzz_systems.fuzz(system, tmp_path, 1000, SEED, print)
    assert not tally.fault, tally.fault
    assert tally.broken >= 1000
    assert tally.good > 300
