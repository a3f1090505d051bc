"""Run a program on an emulated Zynq in front of a simulated system, and compare the responses with the model.

The program gets the messages in memory, and writes each received frame to its console (node/c/player/firm_player.h).
QEMU emulates the processor and its peripherals; its UART is connected to the pins of the simulated hardware.
"""

from __future__ import annotations

import queue
import re
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

from fusesoc_firm.frame.codec import CodecError, decode, pack_frame, used_bytes
from fusesoc_firm.frame.model import ID_BYTES, LENGTH_BYTES
from fusesoc_firm.frame.values import shown
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.runs.emulation.line import Line
from fusesoc_firm.runs.emulation.program import Processor
from fusesoc_firm.runs.simulation.software_run import Traffic
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import Converter, DerivedSystem
from fusesoc_firm.text.diagnostics import fail

_OPTIONS = ("-nographic", "-monitor", "none")
# FIRM_PLAYER_MESSAGES of the program.
_MESSAGES = 0x10000000
_LARGEST = 2**28 - 2**20
# QEMU 7's warning about sound in the machine's display, which no option prevents.
_REMARK = "audiodev default parameter is deprecated"
# The time after the last expected frame, to detect unexpected frames.
_SETTLE_SECONDS = 0.5
_WAIT_SECONDS = 0.05
_COUNT = re.compile(r"(\w+)=(\d+)")
# The smallest number of bytes in a response.
_HEADER = ID_BYTES + LENGTH_BYTES


@dataclass
class Report:
    """The frames that the program received, its counts at the end, and why the run ended early, if it did."""

    frames: list[bytes] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    fault: str = ""
    other_lines: list[str] = field(default_factory=list)

    def add(self, line: str) -> None:
        """Read a line of the console."""
        word, _, rest = line.partition(" ")
        if word == "frame" and re.fullmatch(r"([0-9a-f]{2})*", rest):
            self.frames.append(bytes.fromhex(rest))
        elif word == "counts":
            self.counts = {name: int(count) for name, count in _COUNT.findall(rest)}
        elif line:
            self.other_lines.append(line)


@dataclass(frozen=True)
class Emulation:
    """A program, a simulator, and the messages to and from the system's hardware.

    `start` starts the simulator. The run ends after `patience` seconds without progress in which the hardware is idle.
    `tell` is called with each line of the console and the number of frames so far.
    """

    program: Path
    processor: Processor
    start: Callable[[], Simulator]
    traffic: Traffic
    system: DerivedSystem
    patience: float = 60
    tell: Callable[[str, int], None] = lambda _, __: None

    def run(self) -> Report:
        """Run the program until all responses have returned. May raise `InputError`."""
        with tempfile.TemporaryDirectory(prefix="firm_emulate_") as name:
            folder = Path(name)
            messages = folder / "messages.bin"
            messages.write_bytes(memory_of(self.traffic.stimuli, self.system.subscribers))
            if (size := messages.stat().st_size) > _LARGEST:
                fail(f"the messages have {size:,} bytes; the emulated memory has room for {_LARGEST:,}")
            with Line(self.start(), folder / "line") as line:
                command = [
                    self.processor.emulator,
                    *_machine(self.processor),
                    *self.processor.options_of_machine,
                    *_OPTIONS,
                    "-kernel",
                    str(self.program),
                    "-serial",
                    "stdio",
                ]
                command += ["-chardev", f"socket,id=line,path={folder / 'line'}", "-serial", "chardev:line"]
                command += ["-device", f"loader,file={messages},addr={_MESSAGES:#x},force-raw=on"]
                with Console(command) as console:
                    return self._watched(console, line)

    def _watched(self, console: Console, line: Line) -> Report:
        """Read the console until all frames are received, a program ends, or progress stops."""
        report = Report()
        moved, since = -1, time.monotonic()
        while not report.fault:
            if text := console.line(_WAIT_SECONDS):
                report.add(text)
                self.tell(text, len(report.frames))
                since = time.monotonic()
            if line.moved != moved or not line.is_at_rest:
                moved, since = line.moved, time.monotonic()
            idle = time.monotonic() - since
            if self._is_complete(report) and line.is_at_rest and idle >= _SETTLE_SECONDS:
                break
            report.fault = line.error or console.error
            if idle >= self.patience:
                report.fault = report.fault or f"nothing has moved for {self.patience:g} s"
        return report

    def _is_complete(self, report: Report) -> bool:
        is_sent = report.counts.get("sent", 0) >= len(self.traffic.stimuli)
        return is_sent and len(report.frames) >= len(self.traffic.responses)

    def faults(self, report: Report) -> list[str]:
        """Compare the received frames with the expected ones, in order for each publisher; return a line per fault.

        Padding may have any value.
        """
        received: dict[int, list[bytes]] = {item.id: [] for item in self.system.publishers}
        found = []
        for frame in report.frames:
            if frame[:1] and frame[0] in received:
                received[frame[0]].append(frame)
            else:
                found.append(f"a frame from an unknown publisher: {frame[:_HEADER].hex(' ')}")
        for publisher in self.system.publishers:
            wanted = [item.payload for item in self.traffic.responses if item.publisher.block == publisher.block]
            found += _differences(publisher, received[publisher.id], wanted)
        return found


def _machine(processor: Processor) -> tuple[str, ...]:
    """Return the options that select the machine, without a sound card for its display controller.

    From QEMU 8.2 on, the machine has a property for this purpose; before, the default device is the only one. Raises
    `InputError`.
    """
    command = [processor.emulator, "-machine", f"{processor.machine.partition(',')[0]},help"]
    try:
        properties = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    except OSError as error:
        fail(f"{command[0]} cannot be started: {error.strerror}")
    device = ",audiodev=none" if "audiodev=" in properties else ""
    return "-machine", f"{processor.machine}{device}", "-audiodev", "none,id=none"


class Console:
    """A running emulator, and the lines of its console."""

    def __init__(self, command: Sequence[str]) -> None:
        """Start the emulator. May raise `InputError`."""
        self._name = command[0]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
        except OSError as error:
            fail(f"{command[0]} cannot be started: {error.strerror}")
        self._lines: queue.Queue[str] = queue.Queue()
        self._thread = threading.Thread(target=self._read, name="console", daemon=True)
        self._thread.start()

    def line(self, seconds: float) -> str:
        """Return the next line, or an empty string after this time."""
        try:
            return self._lines.get(timeout=seconds)
        except queue.Empty:
            return ""

    @property
    def error(self) -> str:
        """The reason why the emulator has ended, or an empty string."""
        status = self._process.poll()
        return "" if status is None else f"{self._name} ended with status {status}"

    def __enter__(self) -> Console:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()

    def _read(self) -> None:
        assert self._process.stdout
        with self._process.stdout as rows:
            for row in rows:
                line = row.decode(errors="replace").strip()
                if _REMARK not in line:
                    self._lines.put(line)


def memory_of(stimuli: Iterable[Stimulus], subscribers: Iterable[Converter]) -> bytes:
    """Return messages as the program reads them."""
    ids = {item.block: item.id for item in subscribers}
    rows = [(ids[stimulus.subscriber.block], stimulus.payload) for stimulus in stimuli]
    parts = [len(rows).to_bytes(4, "little")]
    for number, payload in rows:
        parts += [number.to_bytes(4, "little"), len(payload).to_bytes(4, "little"), payload, bytes(-len(payload) % 4)]
    return b"".join(parts)


def _differences(publisher: Converter, received: Sequence[bytes], wanted: Sequence[bytes]) -> list[str]:
    found = []
    for number, (frame, payload) in enumerate(zip(received, wanted, strict=False)):
        used = b"\1" * _HEADER + used_bytes(publisher.frame, payload)
        expected = pack_frame(publisher.id, payload)
        if len(frame) != len(expected) or any(
            is_used and one != other for one, other, is_used in zip(frame, expected, used, strict=True)
        ):
            texts = f"received {_text(publisher, frame)}, expected {_text(publisher, expected)}"
            found.append(f"message {number} of '{publisher.block}': {texts}")
    if len(received) != len(wanted):
        found.append(f"'{publisher.block}' sent {len(received)} messages, expected {len(wanted)}")
    return found


def _text(publisher: Converter, frame: bytes) -> str:
    try:
        return shown(decode(publisher.frame, frame[_HEADER:]))
    except CodecError as error:
        return f"{len(frame)} bytes ({error})"
