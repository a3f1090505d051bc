"""Read the frames of a finished simulation as messages: what was sent, expected and received.

The simulated host compares bytes. Its three files contain whole frames (docs/reference/simulation-host.md), from which
wrong bytes become wrong fields with their values.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode, field_ranges
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.runs.simulation.host_files import SOFTWARE_FILE, differences, leaves, value_text
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, Topic

_FILES = ("stimulus.txt", "expected.txt", "received.txt")
_WRONG_BYTE = re.compile(
    r"(?P<when>fault in cycle \d+: )'(?P<label>.*)': byte (?P<byte>\d+): expected .., got (?P<got>..)"
)
_MORE = re.compile(r"and (\d+) more faults")
_MOST_FIELDS = 10
# The frames among which the simulated host looks for the next one of another way.
_WAYS_LOOKED_AT = 1000
# Longer values are not shown, since their difference might be beyond the end of a line.
_LONGEST = 80


@dataclass(frozen=True)
class Payload:
    """The payload of a frame as hex digits, in which `..` is any byte."""

    topic: Topic
    digits: str

    @cached_property
    def content(self) -> bytes:
        """The bytes, with zeros for padding."""
        return bytes.fromhex(self.digits.replace(".", "0"))

    @cached_property
    def message(self) -> dict[str, Any]:
        """The decoded message; empty if the payload is not a message or has undefined bytes."""
        if re.search(r"[^0-9a-f.]", self.digits):
            return {}
        try:
            return decode(self.topic.frame, self.content)
        except CodecError:
            return {}

    @cached_property
    def fields(self) -> dict[str, Any]:
        """The values of the message by dotted names; arrays are not divided."""
        return dict(leaves(self.message))


@dataclass(frozen=True)
class WrongField:
    """A field with an unexpected value; of an array, the first wrong element and the number of others."""

    name: str
    expected: str
    received: str
    others: int

    def __str__(self) -> str:
        """Return a line of a report."""
        others = f", and {self.others} more elements" if self.others else ""
        line = f"{self.name}: expected {self.expected}, got {self.received}{others}"
        return line.encode("ascii", "backslashreplace").decode()


@dataclass(frozen=True)
class Answer:
    """A received message, the expected one, and the message sent that causes it, with its number, if known.

    `label` is the host's name for the expected frame.
    """

    label: str
    cause: int | None
    sent: Payload | None
    expected: Payload
    received: Payload

    @cached_property
    def wrong(self) -> dict[str, WrongField]:
        """The wrong fields by dotted names; fields whose values look equal are omitted."""
        found: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
        if self.received.message:
            for name, *values in differences(self.expected.message, self.received.message):
                expected, received = map(value_text, values)
                if max(len(expected), len(received)) <= _LONGEST:
                    found[re.sub(r"\[\d+\]", "", name)].append((name, expected, received))
        return {field: WrongField(*items[0], len(items) - 1) for field, items in found.items()}

    def wrong_fields(self, name: str) -> list[WrongField]:
        """Return the wrong fields within a field, which may be an array of messages."""
        return [item for field, item in self.wrong.items() if f"{field}.".startswith(f"{name}.")]

    @property
    def is_shifted(self) -> bool:
        """Whether a field of different length shifts the bytes of further fields."""
        return len(self.expected.digits) != len(self.received.digits)

    def wrong_bytes(self, fields: Collection[str]) -> int:
        """Return the number of bytes in `fields`, or of all bytes if they are shifted, that differ."""
        expected, received = self.expected.content, self.received.content
        return sum(
            one != other
            for first, end, name in field_ranges(self.expected.topic.frame, expected)
            if self.is_shifted or name in fields
            for one, other in zip(expected[first:end], received[first:end], strict=False)
        )

    def field_of(self, offset: int) -> str:
        """Return the name of the field with the byte at `offset`, or "" for other bytes."""
        ranges = field_ranges(self.expected.topic.frame, self.expected.content)
        return next((name for first, end, name in ranges if first <= offset < end), "")


def read_answers(
    folder: Path, subscribers: Iterable[Converter], publishers: Iterable[Converter], id_bytes: int = ID_BYTES
) -> list[Answer]:
    """Return the expected frames that were received in a simulation, in this order; none without its files."""
    paths = [folder / name for name in _FILES]
    if not all(path.is_file() for path in paths):
        return []
    stimuli, expected, received = ([*_frames(path.read_text(encoding="ascii"))] for path in paths)
    id_digits, first = 2 * id_bytes, 2 * (id_bytes + LENGTH_BYTES)
    sinks = {item.id.to_bytes(id_bytes, "little").hex(): item for item in publishers}
    sent = _sent(stimuli, subscribers, id_bytes)
    waiting: dict[str, list[_Wanted]] = defaultdict(list)
    for (label, digits), way in zip(expected, _ways(paths[1].read_text(encoding="ascii")), strict=True):
        waiting[digits[:id_digits]].append(_Wanted(label, digits[first:], way))
    for queue in waiting.values():
        queue.reverse()
    answers = []
    for _, digits in received:
        queue, topic = waiting[digits[:id_digits]], sinks.get(digits[:id_digits])
        if queue and topic:
            found = queue.pop(_place(queue, digits[first:]))
            label, wanted = found.label, found.digits
            cause, name = _parts(label)
            pair = Payload(topic, wanted), Payload(topic, _masked(digits[first:], wanted))
            answers.append(Answer(name, cause, None if cause is None else sent[cause], *pair))
    return answers


def surplus(folder: Path, publishers: Iterable[Converter], id_bytes: int = ID_BYTES) -> Iterator[str]:
    """Yield a sentence for each publisher that sent more frames in a simulation than expected."""
    paths = [folder / name for name in _FILES[1:]]
    if not all(path.is_file() for path in paths):
        return
    expected, received = (
        Counter(digits[: 2 * id_bytes] for _, digits in _frames(path.read_text(encoding="ascii"))) for path in paths
    )
    for item in publishers:
        digits = item.id.to_bytes(id_bytes, "little").hex()
        if (more := received[digits] - expected[digits]) > 0:
            count = f"{more} answer{'s' * (more > 1)} more than the {expected[digits]} expected"
            yield (
                f"'{item.block}' sent {count}; likely, a message is used again before its 'msg_ready', "
                "or an answer's 'segment_valid' stays high after its own"
            )


@dataclass(frozen=True)
class _Wanted:
    """An expected frame: its label, the digits of its payload, and its way, 0 for the order of the file."""

    label: str
    digits: str
    way: int


def expected_causes(text: str) -> list[int | None]:
    """Return the number of the stimulus that causes each frame in a file of expected frames, or None if unknown."""
    return [_parts(label)[0] for label, _ in _frames(text)]


def _ways(expected: str) -> list[int]:
    """Return the way of each frame in a file of expected frames."""
    found: list[int] = []
    for line in expected.splitlines():
        if line.startswith("<"):
            found.append(0)
        elif line.startswith("! way "):
            found[-1] = int(line.removeprefix("! way "))
    return found


def _place(queue: Sequence[_Wanted], digits: str) -> int:
    """Return the place of the frame that a received one is compared with, in a queue whose next frame is the last.

    It is the next frame, or the next one of another way if this one is equal.
    """
    last = len(queue) - 1
    seen: set[int] = set()
    for place in range(last, max(-1, last - _WAYS_LOOKED_AT), -1):
        wanted = queue[place]
        if not queue[last].way:
            break
        if wanted.way not in seen and _masked(digits, wanted.digits) == wanted.digits:
            return place
        seen.add(wanted.way)
    return last


def software_answers(folder: Path, system: DerivedSystem) -> dict[int, list[Answer]]:
    """Return the messages from software to publishers by the number of the message that causes them.

    They are sent without the hardware, so they are received as expected.
    """
    paths = [folder / name for name in (_FILES[0], SOFTWARE_FILE)]
    found: dict[int, list[Answer]] = defaultdict(list)
    if not system.software.publishers or not all(path.is_file() for path in paths):
        return found
    stimuli, published = ([*_frames(path.read_text(encoding="ascii"))] for path in paths)
    sent = _sent(stimuli, system.subscribers, system.id_bytes)
    topics = {topic.block: topic for topic in system.software.publishers}
    for label, digits in published:
        cause, name = _parts(label)
        payload = Payload(replace(topics[name], block=f"{name} (software)"), digits)
        found[cause or 0].append(Answer(name, cause, sent[cause or 0] if sent else None, payload, payload))
    return found


def _sent(stimuli: Iterable[tuple[str, str]], subscribers: Iterable[Converter], id_bytes: int) -> list[Payload | None]:
    """Return the messages in a file of stimuli; None for one of an unknown subscriber."""
    topics = {item.id.to_bytes(id_bytes, "little").hex(): item for item in subscribers}
    first = 2 * (id_bytes + LENGTH_BYTES)
    return [
        Payload(item, digits[first:]) if (item := topics.get(digits[: 2 * id_bytes])) else None for _, digits in stimuli
    ]


def _parts(label: str) -> tuple[int | None, str]:
    """Return the number of the stimulus in a label, if there is one, and the rest of the label."""
    cause, _, name = label.partition(" ")
    return (int(cause[1:]), name) if cause.startswith("@") else (None, label)


def _masked(digits: str, expected: str) -> str:
    """Return the digits with dots where the expected ones have dots."""
    if "." not in expected:
        return digits
    pairs = zip_longest(digits, expected[: len(digits)], fillvalue="")
    return "".join("." if wanted == "." else digit for digit, wanted in pairs)


def with_values(faults: Iterable[str], answers: Sequence[Answer], id_bytes: int = ID_BYTES) -> list[str]:
    """Return the faults of the host, with one line for each wrong field of a message instead of its wrong bytes.

    Other faults are kept: broken frames, and bytes whose values cannot be shown.
    """
    lines: list[str] = []
    shown: dict[int, Collection[str]] = {}
    # The number of faults without a line: reported or not, but less those of the fields that have a line.
    hidden, number = 0, 0
    for fault in faults:
        if more := _MORE.fullmatch(fault):
            hidden += int(more[1])
            continue
        match = _WRONG_BYTE.fullmatch(fault)
        offset = int(match["byte"]) - id_bytes - LENGTH_BYTES if match else -1
        found = _found(match, offset, answers, number) if match else None
        if not match or found is None:
            lines.append(fault)
            continue
        number, answer = found, answers[found]
        if number not in shown:
            shown[number] = [*answer.wrong][: max(0, _MOST_FIELDS - len(lines))]
            cause = "" if answer.cause is None else f" for message {answer.cause}"
            place = f"{match['when']}'{answer.expected.topic.block}'{cause}"
            lines += [f"{place}: {answer.wrong[field]}" for field in shown[number]]
            hidden -= answer.wrong_bytes(shown[number]) if shown[number] else 0
        if answer.field_of(offset) in answer.wrong or (answer.is_shifted and answer.wrong):
            hidden += 1
        else:
            lines.append(fault)
    return [*lines, f"and {hidden} more faults"] if hidden > 0 else lines


def _found(wrong: re.Match[str], offset: int, answers: Sequence[Answer], first: int) -> int | None:
    """Return the number of the first answer from `first` on that has this wrong byte in its payload."""
    for number in range(first, len(answers) if offset >= 0 else first):
        answer = answers[number]
        if (
            answer.label == wrong["label"]
            and answer.received.digits[2 * offset : 2 * offset + 2] == wrong["got"].lower()
        ):
            return number
    return None


def _frames(text: str) -> Iterator[tuple[str, str]]:
    """Yield the label and the hex digits of each frame in a file of the host."""
    label, lines = "", [""]
    for line in (*text.splitlines(), "<"):
        if line.startswith("  "):
            lines.append(line.replace(" ", "").lower())
        elif line[:1] in ("<", ">"):
            if len(lines) > 1:
                yield label, "".join(lines)
            label, lines = line[2:], [""]
