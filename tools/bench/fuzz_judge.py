"""What a system must do with the frames that were sent to it: the judge of `fuzz_systems`."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.system.derived.ids import ONE_BYTE
from tests.payloads import Payloads
from tools.bench.fuzz import fuzz_frame

LENGTH_BYTES = 4
ENCODING = bytes.fromhex("00010000")
# The remainder by 8 of a number to which the accelerator does not respond.
SILENT = 4
_RECORD_HEAD = 6
# Of a frame without a whole id: unknown.
_NO_ID = 1 << 16


class Trouble(IntEnum):
    """What happens to a frame's beats; the bench in C++ has the same."""

    NONE = 0
    NULL_BEAT = 1
    GAP = 2
    SHORT = 3
    ABORT = 4
    RESET = 5
    # It ends before the second byte of its id.
    ONE_BYTE = 6


@dataclass(frozen=True)
class Sent:
    """A frame to the system: its bytes, what happens to its beats, and the values of a good frame."""

    id: int
    body: bytes
    trouble: Trouble
    beat: int
    shown: dict[str, bytes] | None

    @property
    def is_good(self) -> bool:
        return self.shown is not None

    @property
    def number(self) -> int:
        """The number in a good frame for the accelerator."""
        assert self.shown is not None
        return int.from_bytes(self.shown["data"], "little")

    def record(self, id_bytes: int) -> bytes:
        """What the bench reads."""
        frame = self.id.to_bytes(id_bytes, "little") + self.body
        return bytes((self.trouble, self.beat)) + (frame[:1] if self.trouble is Trouble.ONE_BYTE else frame)


@dataclass(frozen=True)
class Record:
    """What the system did, as the bench wrote it down."""

    kind: str
    channel: int
    data: bytes


def read_records(data: bytes) -> Iterator[Record]:
    """The records in a file of the bench."""
    place = 0
    while place < len(data):
        end = place + _RECORD_HEAD + int.from_bytes(data[place + 2 : place + _RECORD_HEAD], "little")
        yield Record(chr(data[place]), data[place + 1], data[place + _RECORD_HEAD : end])
        place = end


class WrongError(Exception):
    """The system did something else; the text says what."""


@dataclass
class Judge:
    """Compares what was sent with what the system did, from one reset to the next.

    `payloads` are those of the messages that come back, by id; the next id is that of the numbers. `late` is the
    channel that reports faulty responses to numbers. `dropped` counts the frames that left a full queue.
    """

    payloads: list[Payloads]
    is_ros2: bool
    late: int
    id_bytes: int = ONE_BYTE
    dropped: int = field(default=0, init=False)

    def judge(self, sent: list[Sent], records: list[Record]) -> None:
        """Raise `WrongError` at the first difference."""
        start, part = 0, list[Record]()
        for record in records:
            if record.kind != "R":
                part.append(record)
                continue
            hit = int.from_bytes(record.data, "little")
            self._part(sent[start : hit + 1], part, is_whole=False)
            start, part = hit + 1, []
        self._part(sent[start:], part, is_whole=True)

    def _part(self, sent: list[Sent], records: list[Record], *, is_whole: bool) -> None:
        """Judge what happened between two resets. A reset ends a part that is not whole: its last frames are gone."""
        frames = defaultdict[int, list[Sent]](list)
        for item in sent:
            frames[self._id(item)].append(item)
        answers = defaultdict[int, list[bytes]](list)
        errors = defaultdict[int, Counter[int]](Counter)
        for record in records:
            if record.kind == "F":
                answers[self._id_of(record)].append(record.data[self.id_bytes :])
            elif record.kind == "E":
                errors[record.channel][record.data[0]] += 1
        number_id = len(self.payloads)
        unknown = sum(len(items) for id_, items in frames.items() if id_ > number_id)
        _check_count("unknown ids", unknown, sum(record.kind == "I" for record in records), is_whole=is_whole)
        if wrong := {self._id_of(record) for record in records if record.kind in "FA"} - {*range(number_id + 1)}:
            raise WrongError(f"frames of {wrong}, who are nobody")
        for id_, payloads in enumerate(self.payloads):
            _check_returned(payloads, frames[id_], answers[id_], is_whole=is_whole)
            broken = sum(not item.is_good for item in frames[id_])
            _check_count(f"broken frames of id {id_}", broken, errors[id_].total(), is_whole=is_whole)
        self._check_numbers(frames[number_id], answers[number_id], is_whole=is_whole)
        self._check_errors_of_numbers(
            frames[number_id], len(answers[number_id]), errors[number_id], errors[self.late], is_whole=is_whole
        )

    def _id(self, sent: Sent) -> int:
        """The id of a frame to the system; it has none if it begins with an empty beat or ends too early."""
        begins_empty = sent.trouble is Trouble.NULL_BEAT and sent.beat == 0
        has_id = self.id_bytes == ONE_BYTE or not (begins_empty or sent.trouble is Trouble.ONE_BYTE)
        return sent.id if has_id else _NO_ID

    def _id_of(self, record: Record) -> int:
        return int.from_bytes(record.data[: self.id_bytes], "little")

    def _check_numbers(self, sent: list[Sent], answers: list[bytes], *, is_whole: bool) -> None:
        """Each answer is that of a number, in order."""
        good = deque(item for item in sent if item.is_good)
        for answer in answers:
            while good and self._text(good[0]) != answer:
                good.popleft()
            if not good:
                raise WrongError(f"no number has the answer {answer.hex()}, or it came late")
            good.popleft()

    def _check_errors_of_numbers(
        self, sent: list[Sent], answers: int, errors: Counter[int], late: Counter[int], *, is_whole: bool
    ) -> None:
        """Each number has an answer, a fault of its answer, or none if it is silent; or it was broken, or dropped."""
        dropped = errors[Fault.DROPPED.value]
        self.dropped += dropped
        reported = errors.total() - dropped
        broken = sum(not item.is_good for item in sent)
        silent = sum(item.number % 8 == SILENT for item in sent if item.is_good)
        if reported > broken:
            raise WrongError(f"{broken} broken numbers, but {reported} reported: {dict(errors)}")
        if is_whole and not dropped:
            _check_count("broken numbers", broken, reported, is_whole=True)
        _check_count(
            "numbers", len(sent), answers + late.total() + errors.total() + silent * is_whole, is_whole=is_whole
        )

    def _text(self, sent: Sent) -> bytes:
        """The response to a number, without its id."""
        number = sent.number
        text = bytes(ord("a") + place % 26 for place in range(number)) + (b"\0" if self.is_ros2 else b"")
        payload = (ENCODING if self.is_ros2 else b"") + len(text).to_bytes(LENGTH_BYTES, "little") + text
        return len(payload).to_bytes(LENGTH_BYTES, "little") + payload


def _check_returned(payloads: Payloads, sent: list[Sent], answers: list[bytes], *, is_whole: bool) -> None:
    """Good frames came back in order, unchanged, and no other ones."""
    good = deque(item for item in sent if item.is_good)
    for answer in answers:
        if not good:
            raise WrongError(f"delivered as good: {answer.hex()}")
        item = good.popleft()
        if not _is_equal(payloads, item, answer):
            raise WrongError(f"{item.record(ONE_BYTE).hex()} came back as {answer.hex()}")
    if is_whole and good:
        raise WrongError(f"{len(good)} good frames are lost, the last one {good[-1].record(ONE_BYTE).hex()}")


def _is_equal(payloads: Payloads, sent: Sent, body: bytes) -> bool:
    """Whether a frame has the values of another one; padding, and what is behind the last field, may differ."""
    if sent.body == body:
        return True
    shown = fuzz_frame(payloads, body).shown
    assert sent.shown is not None
    return shown is not None and {**shown, "payload_length": b""} == {**sent.shown, "payload_length": b""}


def _check_count(what: str, expected: int, counted: int, *, is_whole: bool) -> None:
    if counted > expected or (is_whole and counted != expected):
        raise WrongError(f"{expected} {what}, {counted} counted")
