"""Broken frames through whole systems: converters, Manager and accelerators, of which one misbehaves.

A system's messages come back as they went in: its converters are connected to each other. Frames are broken as for a
single converter, have an unknown id or only the first byte of one of two, are aborted, or have a beat that is empty,
short or with a gap. Resets hit them in the middle. Numbers go to an accelerator that responds too late, with too
little, too much, or not at all.

Each batch has a seed of its own: that of the bench, the width and its number.
"""

from __future__ import annotations

import random
import re
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path

from fusesoc_firm.converter.limits import LONGEST_TAIL
from fusesoc_firm.message.middleware import Middleware, middleware_of
from fusesoc_firm.system.derived.ids import ONE_BYTE, TWO_BYTES
from fusesoc_firm.text.render import render
from tests.hdl.ghdl import Library, core_files
from tests.payloads import Payloads
from tests.system.simulated.systems import HARDWARE, generate_system
from tools.bench.designs import ports_of
from tools.bench.fuzz import FuzzFrame, fuzz_frame, trouble
from tools.bench.fuzz_judge import ENCODING, LENGTH_BYTES, SILENT, Judge, Sent, Trouble, WrongError, read_records
from tools.bench.model import verilate
from tools.bench.tables import FAILED, MET, NOT_MEASURED, Table, Tell, known_rows

BROKEN_FRAMES = 1_000_000
TITLE = "Broken frames through whole systems"
WATCHDOG = 1000
STALLS = (0, 10, 40)
_BATCH = 20_000
_ENTITY = "fuzzed_system"
_HERE = Path(__file__).parent
_COLUMNS = ("bits", "id bytes", "ROS", "messages", "broken", "good", "resets", "dropped", "cycles", "result")
_NOTE = f"""
    The messages come back, and numbers go to an accelerator that misbehaves; the watchdog waits {WATCHDOG} cycles.
    Each broken frame is reported once, by its converter or, if its id is unknown, by the Manager. Good frames come back
    unchanged and in order; broken ones do not come back, or are aborted. 'dropped' are frames that left a full queue.
    Both streams stall in {", ".join(map(str, STALLS))} % of the cycles. The seed is """
# Payloads of a message that are drawn; the troubles make frames differ.
_PAYLOADS = 300
_MOST_BEAT = 255


@dataclass(frozen=True)
class System:
    """A system that returns these messages, each with the same id, and responds to numbers, which have the next id.

    `overflow` is that of the queue before the accelerator; with `block`, there is none.
    """

    width: int
    ros: int
    messages: tuple[str, ...]
    overflow: str
    id_bytes: int = ONE_BYTE

    @property
    def middleware(self) -> Middleware:
        return middleware_of(self.ros)

    @property
    def number_id(self) -> int:
        return len(self.messages)

    @property
    def name(self) -> str:
        """The name of its row."""
        ids = ", ids of two bytes" if self.id_bytes == TWO_BYTES else ""
        return f"system of {self.width} bits{ids}"

    @property
    def types(self) -> str:
        """The messages without their packages."""
        return ", ".join(message.split("/")[1] for message in self.messages)

    def text(self) -> str:
        """The specification."""
        number = f"{{middleware: ROS{self.ros}, message: std_msgs/UInt16}}"
        text = f"{{middleware: ROS{self.ros}, message: std_msgs/String}}"
        queue = "" if self.overflow == "block" else f", queue: 3, overflow: {self.overflow}"
        blocks = [
            *(self._converter("in", id_, "subscriber", message) for id_, message in enumerate(self.messages)),
            f"{{name: number, mode: subscriber{queue}, outgoing: [{{name: accelerator}}], {number[1:]}",
            "{name: accelerator, type: mischief, outgoing: [{name: text}]}",
            *(self._converter("back", id_, "publisher", message) for id_, message in enumerate(self.messages)),
            f"{{name: text, mode: publisher, {text[1:]}",
        ]
        return "\n".join(
            [
                f"project: {{name: fuzzed, width: {self.width}, idBytes: {self.id_bytes}, watchdog: {WATCHDOG}}}",
                "accelerators:",
                "- name: mischief",
                "  type: VHDL",
                "  sources: mischief.vhd",
                f"  interface: {{input: [{number}], output: [{text}]}}",
                "blocks:",
                *(f"- {block}" for block in blocks),
                "",
            ]
        )

    def _converter(self, name: str, id_: int, mode: str, message: str) -> str:
        outgoing = f", outgoing: [{{name: back{id_}}}]" if mode == "subscriber" else ""
        return f"{{name: {name}{id_}, middleware: ROS{self.ros}, mode: {mode}, message: {message}{outgoing}}}"


SYSTEMS = (
    System(8, 2, ("geometry_msgs/Quaternion", "std_msgs/String", "sensor_msgs/JointState"), "block"),
    System(16, 1, ("sensor_msgs/Image", "geometry_msgs/PoseArray", "std_msgs/Header"), "drop_oldest"),
    System(32, 2, ("geometry_msgs/Quaternion", "sensor_msgs/LaserScan", "std_msgs/Float64MultiArray"), "drop_newest"),
    System(64, 1, ("std_msgs/String", "diagnostic_msgs/DiagnosticArray"), "block"),
    System(128, 2, ("geometry_msgs/PoseArray", "sensor_msgs/Image"), "drop_oldest"),
    System(256, 2, ("sensor_msgs/CompressedImage", "geometry_msgs/Pose"), "drop_newest"),
    System(512, 1, ("std_msgs/String", "sensor_msgs/JointState"), "block"),
    System(8, 1, ("geometry_msgs/Quaternion", "std_msgs/String"), "drop_oldest", TWO_BYTES),
    System(16, 2, ("geometry_msgs/PoseArray", "std_msgs/Header"), "block", TWO_BYTES),
    System(64, 2, ("std_msgs/String", "sensor_msgs/JointState"), "drop_newest", TWO_BYTES),
    System(256, 1, ("geometry_msgs/Pose", "std_msgs/String"), "block", TWO_BYTES),
)


@dataclass(frozen=True)
class Tally:
    """The result of one or more runs; `fault` is empty if it is right."""

    broken: int = 0
    good: int = 0
    resets: int = 0
    dropped: int = 0
    cycles: int = 0
    fault: str = ""

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            self.broken + other.broken,
            self.good + other.good,
            self.resets + other.resets,
            self.dropped + other.dropped,
            self.cycles + other.cycles,
            self.fault or other.fault,
        )


def keys() -> dict[str, list[tuple[str, ...]]]:
    """The first cells of every row, by table."""
    return {TITLE: [_key(system) for system in SYSTEMS]}


def measure(seed: int, tell: Tell, broken: int = BROKEN_FRAMES, written: str = "", pattern: str = "") -> list[Table]:
    """Fuzz the systems whose names match a regular expression, all systems with `broken` frames in total.

    `tell` hears of each batch. The other rows are taken from the text `written` of docs/figures.
    """
    known = known_rows(written, TITLE, _COLUMNS, keys=3)
    lines = []
    for system in SYSTEMS:
        key = _key(system)
        if re.search(pattern, system.name):
            lines.append((*key, system.types, *_measured(system, seed, tell, -(-broken // len(SYSTEMS)))))
        else:
            lines.append(known.get(key) or (*key, system.types, *[""] * 5, NOT_MEASURED))
    return [Table(TITLE, _COLUMNS, tuple(lines), f"{_NOTE}{seed}.")]


def _measured(system: System, seed: int, tell: Tell, broken: int) -> tuple[str, ...]:
    with tempfile.TemporaryDirectory() as folder:
        tally = fuzz(system, Path(folder), broken, seed, tell)
    if tally.fault:
        tell(f"{system.name}: {FAILED}: {tally.fault}")
    numbers = (tally.broken, tally.good, tally.resets, tally.dropped, tally.cycles)
    return (*map(str, numbers), FAILED if tally.fault else MET)


def fuzz(system: System, folder: Path, broken: int, seed: int, tell: Tell) -> Tally:
    """Send frames until `broken` of them were broken; raises `ModelError`."""
    program = build(system, folder, is_long=broken > _BATCH)
    total = Tally()
    for batch in count():
        if total.broken >= broken or total.fault:
            break
        seed_of_batch = f"{seed} {system.width} {batch}" + " two" * (system.id_bytes == TWO_BYTES)
        total += program.run(seed_of_batch, min(_BATCH, 2 * broken))
        tell(f"{system.name}, seed {seed}, batch {batch}: {total.broken} broken frames")
    return total


@dataclass(frozen=True)
class Program:
    """A system with its bench; the highest of its errors is that of the accelerator's responses."""

    system: System
    path: Path
    errors: int

    def run(self, seed: str, size: int) -> Tally:
        """Send so many frames and judge what happens."""
        source = random.Random(seed)
        return self.send([_frame(self.system, source) for _ in range(size)], source, seed)

    def send(self, sent: list[Sent], source: random.Random, seed: str) -> Tally:
        """Send these frames and judge what happens; `source` draws stalls, and faults name `seed`."""
        folder = self.path.parent
        records = [item.record(self.system.id_bytes) for item in sent]
        frames = b"".join(len(record).to_bytes(4, "little") + record for record in records)
        (folder / "frames").write_bytes(frames)
        command = [str(self.path), "frames", "records", str(source.getrandbits(63)), str(source.choice(STALLS))]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            return Tally(fault=f"seed '{seed}': {done.stderr.strip()}")
        payloads = [_payloads(self.system.middleware, message) for message in self.system.messages]
        judge = Judge(payloads, self.system.ros == 2, self.errors - 1, self.system.id_bytes)
        fault = ""
        try:
            judge.judge(sent, [*read_records((folder / "records").read_bytes())])
        except WrongError as error:
            fault = f"seed '{seed}': {error}"
        resets = sum(item.trouble is Trouble.RESET for item in sent)
        good = sum(item.is_good for item in sent)
        return Tally(len(sent) - resets - good, good, resets, judge.dropped, int(done.stdout.split()[1]), fault)


def build(system: System, folder: Path, *, is_long: bool) -> Program:
    """Generate, synthesise and compile a system for a long or a short run; raises `ModelError`."""
    (folder / "system.yaml").write_text(system.text(), encoding="utf-8")
    (folder / "mischief.vhd").write_bytes((_HERE / "mischief.vhd").read_bytes())
    files = generate_system(folder / "system.yaml", folder / "core")
    Library("firm", folder).analyse(core_files(*HARDWARE))
    work = Library("work", folder)
    work.analyse(files)
    top = (folder / "core" / f"{_ENTITY}.vhd").read_text(encoding="ascii")
    (errors,) = (port.bits for port in ports_of(top) if port.name == "frame_error")
    lanes = system.width // 8
    values = {"entity": _ENTITY, "lanes": lanes, "kept": min(lanes, system.id_bytes), "errors": errors}
    bench = render("fuzz_system.cpp", values, _HERE)
    return Program(system, verilate(work, _ENTITY, bench, is_long=is_long), errors)


def _frame(system: System, source: random.Random) -> Sent:
    """A frame with its trouble: of a message that comes back, of a number, or of an unknown id."""
    id_ = source.choice([*range(system.number_id), *range(system.number_id + 1)])
    body = _number(system, source) if id_ == system.number_id else _message(system, id_, source)
    if source.random() < 0.02:
        id_ = _unknown_id(system, source)
    if not body.body and system.width == 8:
        # An id alone reaches no converter.
        return _frame(system, source)
    what, beat = _beat_trouble(system, system.id_bytes + len(body.body), source)
    is_good = what is Trouble.NONE and id_ <= system.number_id
    return Sent(id_, body.body, what, beat, body.shown if is_good else None)


def _unknown_id(system: System, source: random.Random) -> int:
    """An id that nobody has; half of those of two bytes differ from a known one only in the upper byte."""
    if system.id_bytes == TWO_BYTES and source.random() < 0.5:
        return source.randrange(system.number_id + 1) + 256 * source.randrange(1, 256)
    return source.randrange(system.number_id + 1, 256**system.id_bytes)


def _beat_trouble(system: System, size: int, source: random.Random) -> tuple[Trouble, int]:
    """What happens to a frame of so many bytes, and to which beat of it."""
    lanes = system.width // 8
    beats = min(-(-size // lanes), _MOST_BEAT)
    # A beat of nothing but the id cannot be short and have it.
    first = int(lanes == system.id_bytes)
    chance = source.random()
    if chance < 0.0005:
        return Trouble.RESET, source.randrange(beats)
    if chance < 0.05:
        return Trouble.ABORT, 0
    if lanes > 1 and chance < 0.1:
        return Trouble.NULL_BEAT, source.randrange(beats)
    if lanes > 1 and beats > first + 1 and chance < 0.2:
        # A beat that is full before it is hit.
        return source.choice((Trouble.GAP, Trouble.SHORT)), source.randrange(first, beats - 1)
    if system.id_bytes == TWO_BYTES and 0.2 <= chance < 0.21:
        return Trouble.ONE_BYTE, 0
    return Trouble.NONE, 0


def _message(system: System, id_: int, source: random.Random) -> FuzzFrame:
    """A frame of a message that comes back, with no more bytes behind the message than a publisher replaces."""
    payloads = _payloads(system.middleware, system.messages[id_])
    while True:
        body = trouble(source.choice(_drawn(system.middleware, system.messages[id_])), source)
        frame = fuzz_frame(payloads, body)
        if frame.shown is None or payloads.with_tail(body[LENGTH_BYTES:])[1] <= LONGEST_TAIL:
            return frame


def _number(system: System, source: random.Random) -> FuzzFrame:
    """A number of letters. With a queue that drops frames, none is silent: that cannot be told from a dropped one."""
    number = source.randrange(16, 200)
    if system.overflow != "block" and number % 8 == SILENT:
        number += 1
    payload = (ENCODING if system.ros == 2 else b"") + number.to_bytes(2, "little")
    body = len(payload).to_bytes(LENGTH_BYTES, "little") + payload
    if source.random() < 0.2:
        body = body[: source.randrange(len(body))] if source.random() < 0.5 else body + source.randbytes(8)
    return fuzz_frame(_payloads(system.middleware, "std_msgs/UInt16"), body)


@cache
def _payloads(ros: Middleware, message: str) -> Payloads:
    return Payloads(ros, message)


@cache
def _drawn(ros: Middleware, message: str) -> tuple[bytes, ...]:
    source = random.Random(message)
    return tuple(_payloads(ros, message).draw(source) for _ in range(_PAYLOADS))


def _key(system: System) -> tuple[str, ...]:
    return (str(system.width), str(system.id_bytes), str(system.ros))
