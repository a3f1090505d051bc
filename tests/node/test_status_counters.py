"""Known faults through a simulated system: each language reads every counter of the status as it was injected.

The faults of a link are injected at the pins of a UART, all others at the streams.
"""

from __future__ import annotations

import os
import pty
import random
import re
import select
import subprocess
import termios
import threading
import tty
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.node.status.status import Status, read_status, read_word, write_word
from fusesoc_firm.node.status.status_socket import StatusServer
from fusesoc_firm.node.transport.built_simulator import BuiltSimulator, build_simulator
from fusesoc_firm.node.transport.link_code import LinkDecoder, encode
from fusesoc_firm.node.transport.simulator import Simulator, SimulatorTransport, Taken
from fusesoc_firm.node.transport.transport import Transport
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import identity
from tests.node.drivers import compile_c_driver, cpp_driver
from tests.seeds import seeded
from tests.system.simulated.systems import DATA

pytestmark = pytest.mark.check
SEED = seeded(20261123)
FRAMES = 200
MOST_BYTES = 40
QUEUED = 2
WATCHDOG = 32
POINT, TEXT, QUEUE, WATCHED, BUFFERED, NOBODY = 0, 1, 2, 3, 4, 7
SPECIFICATION = f"""\
project: {{name: robot, width: 32, idBytes: ID_BYTES, status: frames, timeStamps: added, watchdog: {WATCHDOG}}}
accelerators:
  - {{name: deaf, type: VHDL, sources: deaf.vhd, interface: {{
     input: [{{middleware: ROS2, message: geometry_msgs/Vector3}}],
     output: [{{middleware: ROS2, message: geometry_msgs/Vector3}}]}}}}
blocks:
  - {{name: point_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point,
     outgoing: [{{name: point_out}}]}}
  - {{name: point_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}}
  - {{name: text_in, middleware: ROS2, mode: subscriber, message: std_msgs/String, maxLength: {MOST_BYTES},
     outgoing: [{{name: text_out}}]}}
  - {{name: text_out, middleware: ROS2, mode: publisher, message: std_msgs/String, maxLength: {MOST_BYTES}}}
  - {{name: queue_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Vector3, queue: {QUEUED},
     overflow: drop_newest, outgoing: [{{name: queue_deaf}}]}}
  - {{name: queue_deaf, type: deaf, outgoing: [{{name: queue_out}}]}}
  - {{name: queue_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Vector3}}
  - {{name: watched_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Vector3, overflow: drop_newest,
     outgoing: [{{name: watched_deaf}}]}}
  - {{name: watched_deaf, type: deaf, outgoing: [{{name: watched_out}}]}}
  - {{name: watched_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Vector3}}
  - {{name: buffered_in, middleware: ROS2, mode: subscriber, message: std_msgs/String,
     outgoing: [{{name: buffered_out}}]}}
  - {{name: buffered_out, middleware: ROS2, mode: publisher, message: std_msgs/String, buffer: {MOST_BYTES}}}
"""
# Bits of the interrupts.
CONVERTER_FAULT, UNKNOWN_ID, LINK_FAULT = 1, 2, 4
# The code of a publisher whose frame was aborted.
ABORTED = f"faults[{Fault.SHORT_FRAME - 1}]"
ENCODING = b"\x00\x01\x00\x00"
# The names of the status that are compared; a word that is missing is zero.
COUNTED = re.compile(
    r"(subscriber|publisher)\[\d\]\.(frames|faults\[\d+\])|id_errors|link_errors|lost|last_fault|digest|control|interrupt.*"
)

Words = Mapping[str, int | str]


def _point(source: random.Random) -> bytes:
    return ENCODING + source.randbytes(24)


def _text(source: random.Random) -> bytes:
    text = bytes(source.choices(range(1, 256), k=source.randint(13, MOST_BYTES - 9))) + b"\0"
    return ENCODING + len(text).to_bytes(4, "little") + text


def _header(id_: int, length: int) -> bytes:
    return bytes([id_]) + length.to_bytes(4, "little")


def _broken(id_: int, payload: bytes, fault: Fault, source: random.Random) -> bytes:
    """The frame of a payload with a fault, of which that of a stream is not part of its bytes."""
    if fault in STREAM_FAULTS:
        return pack_frame(id_, payload)
    if fault is Fault.BAD_LENGTH:
        return pack_frame(id_, payload[:-1])
    if fault is Fault.SHORT_FRAME:
        # Without its last byte alone, a text is whole, and its length is not.
        return pack_frame(id_, payload)[: -source.randint(2, 4)]
    if fault is Fault.LONG_FRAME:
        return pack_frame(id_, payload) + source.randbytes(source.randint(1, 40))
    if fault is Fault.BAD_ENCODING:
        return pack_frame(id_, b"\x00\x09" + payload[2:])
    if fault is Fault.BAD_COUNT:
        return pack_frame(id_, payload[:-1] + b"x")
    return pack_frame(id_, payload + bytes(MOST_BYTES))


# Of frames whose bytes are good.
STREAM_FAULTS = (Fault.BROKEN_BEAT, Fault.ABORTED)
POINT_FAULTS = (Fault.BAD_LENGTH, Fault.SHORT_FRAME, Fault.LONG_FRAME, Fault.BAD_ENCODING, *STREAM_FAULTS)
TEXT_FAULTS = (
    *(Fault.SHORT_FRAME, Fault.LONG_FRAME, Fault.BAD_ENCODING, Fault.BAD_COUNT, Fault.TOO_LONG),
    *STREAM_FAULTS,
)


@dataclass
class Injection:
    """Frames, good, broken and for nobody, with the words of the status that follow from them.

    `faults` has the frames with a fault of the stream.
    """

    id_bytes: int = 1

    frames: list[bytes] = field(default_factory=list)
    faults: dict[bytes, Fault] = field(default_factory=dict)
    words: Counter[str] = field(default_factory=Counter)

    def add(self, id_: int, frame: bytes, fault: Fault | None) -> None:
        """Append a frame to a subscriber, which reports a fault or none."""
        frame = self.send(frame)
        self.words[f"subscriber[{id_}].frames"] += 1
        if fault:
            self.words[f"subscriber[{id_}].faults[{fault - 1}]"] += 1
        if fault in STREAM_FAULTS:
            self.faults[frame] = fault

    def send(self, frame: bytes) -> bytes:
        """Append a frame with an id of one byte, and return it with an id of `id_bytes`."""
        self.frames.append(frame[:1] + bytes(self.id_bytes - 1) + frame[1:])
        return self.frames[-1]


class FaultySimulator(Simulator):
    """A simulator whose host makes the faults of the stream."""

    faults: Mapping[bytes, Fault] = {}

    def request(self, frame: bytes, *, is_aborted: bool = False, hole: int | None = None) -> None:
        fault = self.faults.get(frame)
        # Not in the last beat, which may end there.
        super().request(
            frame, is_aborted=fault is Fault.ABORTED, hole=len(frame) // 2 if fault is Fault.BROKEN_BEAT else None
        )


def _injected(seed: int, id_bytes: int) -> Injection:
    """Return what is injected. The last frame is broken, and no publisher aborts a frame because of it."""
    print(f"seed {seed}")
    source = random.Random(seed)
    injected = Injection(id_bytes)
    for _ in range(FRAMES):
        id_ = source.choice((POINT, TEXT, TEXT, QUEUE, WATCHED, BUFFERED, NOBODY))
        if id_ == NOBODY:
            injected.send(_refused(id_, source))
            injected.words["id_errors"] += 1
        elif id_ in (POINT, TEXT):
            payload = _point(source) if id_ == POINT else _text(source)
            fault = source.choice((None, *(POINT_FAULTS if id_ == POINT else TEXT_FAULTS)))
            injected.add(id_, _broken(id_, payload, fault, source) if fault else pack_frame(id_, payload), fault)
        else:
            injected.add(id_, _refused(id_, source), None)
    last = source.choice(POINT_FAULTS)
    injected.add(POINT, _broken(POINT, _point(source), last, source), last)
    words = injected.words
    # One message is offered to the deaf accelerator; the publisher with a buffer reports what is too long for it.
    words[f"subscriber[{QUEUE}].faults[{Fault.DROPPED - 1}]"] = words[f"subscriber[{QUEUE}].frames"] - QUEUED - 1
    words[f"subscriber[{WATCHED}].faults[{Fault.WATCHDOG - 1}]"] = words[f"subscriber[{WATCHED}].frames"] - 1
    words[f"publisher[{BUFFERED}].faults[{Fault.OVER_BUFFER - 1}]"] = words[f"subscriber[{BUFFERED}].frames"]
    words |= {"last_fault": POINT << 4 | last, "control": 1, "interrupt": CONVERTER_FAULT | UNKNOWN_ID}
    return injected


def _refused(id_: int, source: random.Random) -> bytes:
    """A good frame to an accelerator that never takes, to a publisher whose buffer is too small, or to nobody."""
    if id_ == NOBODY:
        return pack_frame(id_, b"nobody")
    if id_ != BUFFERED:
        return pack_frame(id_, _point(source))
    text = b"a" * source.randint(MOST_BYTES, 2 * MOST_BYTES) + b"\0"
    return pack_frame(id_, ENCODING + len(text).to_bytes(4, "little") + text)


# Each hardware is built, and gets its faults, in one process.
ID_BYTES = [
    pytest.param(number, marks=pytest.mark.xdist_group(f"status_counters_{number}"), id=name)
    for number, name in ((1, "ids of one byte"), (2, "ids of two bytes"))
]


@pytest.fixture(scope="module", params=ID_BYTES)
def id_bytes(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def built(id_bytes: int, tmp_path_factory: pytest.TempPathFactory) -> BuiltSimulator:
    folder = tmp_path_factory.mktemp("robot")
    (folder / "robot.yaml").write_text(SPECIFICATION.replace("ID_BYTES", str(id_bytes)))
    (folder / "deaf.vhd").write_text((DATA / "deaf.vhd").read_text())
    return build_simulator(folder / "robot.yaml", build_root=folder / "build")


def _specification(built: BuiltSimulator) -> Path:
    return next(path for path in built.folder.parents if (path / "robot.yaml").is_file()) / "robot.yaml"


def _digest(built: BuiltSimulator) -> str:
    return identity(load_beside(_specification(built), [], None, needs_sources=False)).digest


@contextmanager
def _hardware(
    built: BuiltSimulator, faults: Mapping[bytes, Fault] = {}, stalls: int = 20
) -> Iterator[SimulatorTransport]:
    def start() -> Simulator:
        simulator = FaultySimulator(built.command(seed=3, stall_percent=stalls), built.folder)
        simulator.faults = faults
        return simulator

    with SimulatorTransport(start) as transport:
        yield transport


def _exchange(transport: SimulatorTransport, frames: Sequence[bytes]) -> Counter[str]:
    """Send the frames, the last one after a pause; return the publishers' words that follow from those received.

    A publisher aborts a frame that ends early.
    """
    found = Counter[str]()
    for part in (frames[:-1], frames[-1:]):
        for frame in part:
            transport.send(frame)
        while (burst := transport.receive(0.01)) or not transport.is_at_rest():
            if burst:
                found[f"publisher[{burst.data[0]}].frames"] += 1
                found[f"publisher[{burst.data[0]}].{ABORTED}"] += burst.is_aborted
    return found


@dataclass(frozen=True)
class Faulty:
    """Hardware into which faults were injected, and the words of its status that are not zero."""

    transport: SimulatorTransport
    words: Words
    id_bytes: int

    @property
    def status(self) -> Status:
        """The status now."""
        return read_status(self.transport, self.id_bytes)

    @property
    def now(self) -> Words:
        """The words of the status now."""
        return {**self.status.words, "digest": self.status.digest}


@pytest.fixture(scope="module")
def faulty(id_bytes: int, built: BuiltSimulator) -> Iterator[Faulty]:
    injected = _injected(SEED, id_bytes)
    assert len({name for name in injected.words if "faults" in name}) == len(POINT_FAULTS) + len(TEXT_FAULTS) + 3
    with _hardware(built, injected.faults) as transport:
        received = _exchange(transport, injected.frames)
        assert received[f"publisher[{TEXT}].{ABORTED}"]
        yield Faulty(transport, {**+injected.words, **+received, "digest": _digest(built)}, id_bytes)


def counted(words: Words) -> Words:
    return {name: word for name, word in words.items() if COUNTED.fullmatch(name) and word}


def test_python_reads_what_was_injected(faulty: Faulty) -> None:
    status = faulty.status
    assert counted({**status.words, "digest": status.digest}) == faulty.words
    # The beat that is offered to the deaf accelerator waits until the watchdog acts.
    assert status.words[f"subscriber[{WATCHED}].longest_wait"] == WATCHDOG


@pytest.mark.parametrize("language", ["c", "cpp"])
def test_another_language_reads_the_same(language: str, faulty: Faulty, tmp_path: Path) -> None:
    sources = ["firm/firm_frame.c", "firm/firm_status.c"]
    driver = cpp_driver("status") if language == "cpp" else compile_c_driver("status", tmp_path, sources, [], {})
    before = faulty.now
    found = told([driver.program, str(faulty.id_bytes), str(faulty.words["digest"])], faulty.transport)
    assert counted(found) == faulty.words
    # The cycle of the reading itself differs.
    moving = {"cycles": found["cycles"]}
    constant = {name: 0 for name in before if re.match(r"magic|shape|features|digest_|.*signature", name)}
    assert {**found, **moving} == {name: word for name, word in {**before, **constant, **moving}.items() if word}


def told(command: Sequence[str | Path], transport: Transport) -> Words:
    """The words that a program reads, whose requests are its lines."""
    words: dict[str, int | str] = {}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdin and program.stdout
        for line in program.stdout:
            if line.startswith("="):
                _, name, word = line.split()
                words[name] = word if name == "digest" else int(word)
                continue
            transport.send(bytes.fromhex(line))
            answer = transport.receive(20)
            assert answer
            program.stdin.write(f"{answer.data.hex()}\n")
            program.stdin.flush()
    assert program.returncode == 0
    return words


def test_interrupts_and_counting_can_be_switched(faulty: Faulty) -> None:
    addresses = {register.name: register.address for register in faulty.status.registers.values()}

    def word(name: str) -> int:
        return read_word(faulty.transport, addresses[name], faulty.id_bytes)

    def write(name: str, word: int) -> None:
        write_word(faulty.transport, addresses[name], word, faulty.id_bytes)

    write("interrupt_enable", UNKNOWN_ID)
    write("control", 0)
    before = word(f"subscriber[{POINT}].frames")
    faulty.transport.send(pack_frame(POINT, bytes(3), faulty.id_bytes))
    assert word("interrupt_enable") == UNKNOWN_ID
    assert word(f"subscriber[{POINT}].frames") == before
    write("control", 1)
    write("interrupt_enable", 0)
    assert counted(faulty.now) == faulty.words


def test_time_stamps_are_the_cycles_of_the_first_beat_in_and_the_last_beat_out(
    id_bytes: int, built: BuiltSimulator
) -> None:
    """Between two messages, the stamps advance as the cycles at the host do, which the simulator reports."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    taken: list[Taken] = []
    differences = set()
    start = partial(Simulator, built.command(seed=3, stall_percent=0), built.folder)
    with SimulatorTransport(
        start, observe=lambda event: taken.append(event) if isinstance(event, Taken) else None
    ) as transport:
        registers = read_status(transport, id_bytes).registers.values()
        addresses = {register.name: register.address for register in registers}
        for id_ in (POINT, TEXT, TEXT, POINT, TEXT):
            transport.send(pack_frame(id_, _point(source) if id_ == POINT else _text(source), id_bytes))
            burst = transport.receive(20)
            first = taken[-1].first_cycle
            assert burst and burst.last_cycle
            names = (f"subscriber[{id_}].stamp", f"publisher[{id_}].stamp", "cycles")
            entered, left, now = (read_word(transport, addresses[name], id_bytes) for name in names)
            assert 0 < left - entered <= burst.last_cycle - first
            assert left < now
            differences.add((entered - first, left - burst.last_cycle))
    assert len(differences) == 1


@contextmanager
def _line(transport: SimulatorTransport) -> Iterator[str]:
    """A serial line to the hardware, whose name it gives."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    stop = threading.Event()

    def carry() -> None:
        decoder = LinkDecoder()
        while not stop.is_set():
            if select.select([ours], [], [], 0.01)[0]:
                for frame in decoder.push(os.read(ours, 4096)):
                    assert frame
                    transport.send(frame)
            while burst := transport.receive(0):
                os.write(ours, encode(burst.data))

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        stop.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


@contextmanager
def _running_node(transport: SimulatorTransport) -> Iterator[str]:
    """The address of a node that uses the hardware."""

    def access(request: bytes) -> bytes:
        transport.send(request)
        answer = transport.receive(20)
        assert answer
        return answer.data

    # The whole machine shares the names of nodes.
    name = f"node:robot{os.getpid()}"
    with StatusServer((name,), access, print):
        yield name


@contextmanager
def _address(faulty: Faulty) -> Iterator[str]:
    """An address of the hardware: a link has ids of one byte."""
    if faulty.id_bytes == 1:
        with _line(faulty.transport) as device:
            yield f"uart:{device}:1000000"
    else:
        with _running_node(faulty.transport) as address:
            yield address


def test_the_command_prints_what_was_injected(
    built: BuiltSimulator, faulty: Faulty, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A pseudo-terminal has no breaks.
    monkeypatch.setattr(termios, "tcsendbreak", lambda _line, _duration: None)
    words = faulty.now
    with _address(faulty) as address:
        assert main(["status", address, "--system", str(_specification(built))]) == 0
    text = capsys.readouterr().out
    channels = ("point", "text", "queue", "watched", "buffered")
    names = {f"subscriber[{place}]": f"{name}_in" for place, name in enumerate(channels)}
    names |= {f"publisher[{place}]": f"{name}_out" for place, name in enumerate(channels)}
    found: dict[str, int] = {"id_errors": int(text.split("unknown ids ")[1].split(",")[0])}
    for channel, name in names.items():
        (row,) = [line.split(maxsplit=6) for line in text.splitlines() if line.startswith(f"{name} ")]
        found[f"{channel}.frames"] = int(row[2])
        assert (int(row[3]), row[4]) == (words[f"{channel}.longest_wait"], "cycles")
        assert row[5] == (str(words[f"{channel}.stamp"]) if int(row[2]) else "-")
        for count, code in re.findall(r"(\d+) of code (\d+)", row[6]):
            found[f"{channel}.faults[{int(code) - 1}]"] = int(count)
    others = {"last_fault", "control", "interrupt", "digest"}
    assert {name: word for name, word in found.items() if word} == {
        name: word for name, word in faulty.words.items() if name not in others
    }
    last = int(faulty.words["last_fault"])
    assert f"last fault: code {last & 15} of {names[f'subscriber[{last >> 4}]']}" in text
    assert f"digest {_digest(built)}" in text
