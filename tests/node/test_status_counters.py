"""Known faults through a simulated system: each language reads every counter of the status as it was injected."""

from __future__ import annotations

import os
import pty
import random
import re
import select
import shlex
import subprocess
import termios
import threading
import tty
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.node.status import read_status
from fusesoc_firm.node.transport.link_code import LinkDecoder, encode
from fusesoc_firm.node.transport.simulator import Simulator, SimulatorTransport
from fusesoc_firm.simulation.simulator import BuiltSimulator, build_simulator
from fusesoc_firm.system.message_sources import load_beside
from fusesoc_firm.system.system_core import identity
from tests.node.drivers import compile_c_driver, cpp_driver
from tests.system.simulated.systems import DATA

pytestmark = pytest.mark.check
SEED = 20261123
FRAMES = 200
MOST_BYTES = 40
QUEUED = 2
POINT, TEXT, QUEUE, WATCHED, BUFFERED, NOBODY = 0, 1, 2, 3, 4, 7
SPECIFICATION = f"""\
project: {{name: robot, width: 32, status: frames, watchdog: 32}}
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
ABORTED = f"faults[{Fault.SHORT_FRAME - 1}]"
ENCODING = b"\x00\x01\x00\x00"
# The names of the status that are compared; a word that is missing is zero.
COUNTED = re.compile(
    r"(subscriber|publisher)\[\d\]\.(frames|faults\[\d+\])|id_errors|link_errors|lost|last_fault|digest"
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
    """The frame of a payload with a fault."""
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


POINT_FAULTS = (Fault.BAD_LENGTH, Fault.SHORT_FRAME, Fault.LONG_FRAME, Fault.BAD_ENCODING)
TEXT_FAULTS = (Fault.SHORT_FRAME, Fault.LONG_FRAME, Fault.BAD_ENCODING, Fault.BAD_COUNT, Fault.TOO_LONG)


def _injected(seed: int) -> tuple[list[bytes], dict[str, int]]:
    """Frames, good, broken and for nobody; and the words of the status that follow from them.

    The last one is broken, and no publisher aborts a frame because of it.
    """
    print(f"seed {seed}")
    source = random.Random(seed)
    frames, words = [], Counter[str]()
    for _ in range(FRAMES):
        id_ = source.choice((POINT, TEXT, TEXT, QUEUE, WATCHED, BUFFERED, NOBODY))
        if id_ not in (POINT, TEXT):
            frames.append(_refused(id_, source))
            words[f"subscriber[{id_}].frames" if id_ != NOBODY else "id_errors"] += 1
            continue
        payload = _point(source) if id_ == POINT else _text(source)
        fault = source.choice((None, *(POINT_FAULTS if id_ == POINT else TEXT_FAULTS)))
        frames.append(_broken(id_, payload, fault, source) if fault else pack_frame(id_, payload))
        words[f"subscriber[{id_}].frames"] += 1
        if fault:
            words[f"subscriber[{id_}].faults[{fault - 1}]"] += 1
    last = source.choice(POINT_FAULTS)
    frames.append(_broken(POINT, _point(source), last, source))
    for name in (f"subscriber[{POINT}].frames", f"subscriber[{POINT}].faults[{last - 1}]"):
        words[name] += 1
    # One message is offered to the deaf accelerator; the publisher with a buffer reports what is too long for it.
    words[f"subscriber[{QUEUE}].faults[{Fault.DROPPED - 1}]"] = words[f"subscriber[{QUEUE}].frames"] - QUEUED - 1
    words[f"subscriber[{WATCHED}].faults[{Fault.WATCHDOG - 1}]"] = words[f"subscriber[{WATCHED}].frames"] - 1
    words[f"publisher[{BUFFERED}].faults[{Fault.OVER_BUFFER - 1}]"] = words[f"subscriber[{BUFFERED}].frames"]
    return frames, {**words, "last_fault": POINT << 4 | last}


def _refused(id_: int, source: random.Random) -> bytes:
    """A good frame to an accelerator that never takes, to a publisher whose buffer is too small, or to nobody."""
    if id_ == NOBODY:
        return pack_frame(id_, b"nobody")
    if id_ != BUFFERED:
        return pack_frame(id_, _point(source))
    text = b"a" * source.randint(MOST_BYTES, 2 * MOST_BYTES) + b"\0"
    return pack_frame(id_, ENCODING + len(text).to_bytes(4, "little") + text)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> BuiltSimulator:
    folder = tmp_path_factory.mktemp("robot")
    (folder / "robot.yaml").write_text(SPECIFICATION)
    (folder / "deaf.vhd").write_text((DATA / "deaf.vhd").read_text())
    return build_simulator(folder / "robot.yaml", build_root=folder / "build")


def _specification(built: BuiltSimulator) -> Path:
    return next(path for path in built.folder.parents if (path / "robot.yaml").is_file()) / "robot.yaml"


def _digest(built: BuiltSimulator) -> str:
    return identity(load_beside(_specification(built), [], None, needs_sources=False)).digest


@contextmanager
def _hardware(built: BuiltSimulator) -> Iterator[SimulatorTransport]:
    with SimulatorTransport(lambda: Simulator(built.command(seed=3, stall_percent=20), built.folder)) as transport:
        yield transport


def _exchange(transport: SimulatorTransport, frames: list[bytes]) -> dict[str, int]:
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
    return dict(+found)


def _in_python(built: BuiltSimulator, frames: list[bytes]) -> tuple[Words, Words]:
    with _hardware(built) as transport:
        received = _exchange(transport, frames)
        status = read_status(transport)
    return {**status.words, "digest": status.digest}, received


def _in_cpp(built: BuiltSimulator, frames: list[bytes]) -> tuple[Words, Words]:
    digest = _digest(built)
    *sends, last = [f"send {frame.hex()}" for frame in frames]
    lines = [*sends, "rest", last, "rest", "status", f"digest {digest}", "digest 00"]
    script = shlex.quote(str(built.script(seed=3, stall_percent=20)))
    *answers, same, other = cpp_driver("status").answers(lines, f"pipe:{script} >/dev/null")
    assert same == "accepted"
    assert other == f"the hardware is not that of 'robot': its digest is {digest}, and the specification's is 00"
    rows = [line.split() for line in answers]
    words = {"received": "frames", "aborted": ABORTED}
    received: Words = {f"publisher[{row[1]}].{words[row[0]]}": int(row[2]) for row in rows if row[0] in words}
    return _words([row for row in rows if row[0] not in words]), received


def _in_c(built: BuiltSimulator, frames: list[bytes], folder: Path) -> tuple[Words, Words]:
    sources = ["firm/firm_frame.c", "firm/firm_status.c"]
    program = compile_c_driver("status", folder, sources, [], {}).program
    with (
        _hardware(built) as transport,
        subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as driver,
    ):
        assert driver.stdin and driver.stdout
        received = _exchange(transport, frames)
        rows = []
        for line in driver.stdout:
            if line.startswith("="):
                rows.append(line.split()[1:])
                continue
            transport.send(bytes.fromhex(line))
            answer = transport.receive(20)
            assert answer
            driver.stdin.write(f"{answer.data.hex()}\n")
            driver.stdin.flush()
    assert driver.returncode == 0
    return _words(rows), received


def _words(rows: Iterable[list[str]]) -> Words:
    return {name: word if name == "digest" else int(word) for name, word in rows}


READERS: dict[str, Callable[[BuiltSimulator, list[bytes], Path], tuple[Words, Words]]] = {
    "python": lambda built, frames, _: _in_python(built, frames),
    "cpp": lambda built, frames, _: _in_cpp(built, frames),
    "c": _in_c,
}


@pytest.mark.parametrize("language", READERS)
def test_the_counters_are_what_was_injected(language: str, built: BuiltSimulator, tmp_path: Path) -> None:
    frames, expected = _injected(SEED + len(language))
    found, received = READERS[language](built, frames, tmp_path)
    assert len(expected) == len(POINT_FAULTS) + len(TEXT_FAULTS) + 10 and received[f"publisher[{TEXT}].{ABORTED}"]
    counted = {name: word for name, word in found.items() if COUNTED.fullmatch(name) and word}
    assert counted == {**expected, **received, "digest": _digest(built)}


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


def test_the_command_prints_what_was_injected(
    built: BuiltSimulator, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A pseudo-terminal has no breaks.
    monkeypatch.setattr(termios, "tcsendbreak", lambda _line, _duration: None)
    frames, expected = _injected(SEED)
    with _hardware(built) as transport:
        received = _exchange(transport, frames)
        with _line(transport) as device:
            assert main(["status", f"uart:{device}:1000000", "--system", str(_specification(built))]) == 0
    text = capsys.readouterr().out
    channels = ("point", "text", "queue", "watched", "buffered")
    names = {f"subscriber[{place}]": f"{name}_in" for place, name in enumerate(channels)}
    names |= {f"publisher[{place}]": f"{name}_out" for place, name in enumerate(channels)}
    found: dict[str, int] = {"id_errors": int(text.split("unknown ids ")[1].split(",")[0])}
    for channel, name in names.items():
        (row,) = [line.split(maxsplit=5) for line in text.splitlines() if line.startswith(f"{name} ")]
        found[f"{channel}.frames"] = int(row[2])
        for count, code in re.findall(r"(\d+) of code (\d+)", row[5]):
            found[f"{channel}.faults[{int(code) - 1}]"] = int(count)
    last = expected.pop("last_fault")
    assert {name: word for name, word in found.items() if word} == {**expected, **received}
    assert f"last fault: code {last & 15} of {names[f'subscriber[{last >> 4}]']}" in text
    assert f"digest {_digest(built)}" in text
