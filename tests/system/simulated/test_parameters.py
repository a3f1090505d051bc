"""Parameters of accelerators in whole systems: set by frames of the status, they change the answers in all simulators.

The accelerator `tuned` holds each message for 100 cycles, in which no parameter may change.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.system import system_core
from fusesoc_firm.system.hardware.parameters import BYTES, VALUE_ADDRESS, WANTED_ADDRESS
from fusesoc_firm.system.status_frames import WRITE, read_request, status_answer, write_request
from tests.hdl.frames import write_stimulus
from tests.hdl.verilator import simulator
from tests.hdl.verilog import compile_verilog, translated
from tests.system.simulated.systems import DATA, build, call

GAIN, OFFSET, INVERT = 0, 1, 2
SPECIFICATION = """
project: {{name: tuning, width: {width}, status: frames, clock: 100 MHz{clocks}}}
accelerators:
  - name: tuned
    type: VHDL
    sources: tuned.vhd
    interface:
      input: [{{middleware: ROS2, message: std_msgs/Int32}}]
      output: [{{middleware: ROS2, message: std_msgs/Int32}}]
    parameters:
      - {{name: gain, type: int8, default: 1, range: [-4, 100]}}
      - {{name: offset, type: float32, default: 0, range: [-1.5, 1e10]}}
      - {{name: invert, type: bool, default: false}}
blocks:
  - {{name: sub, middleware: ROS2, mode: subscriber, message: std_msgs/Int32, outgoing: [{{name: block}}]}}
  - {{name: block, type: tuned, outgoing: [{{name: pub}}]{clock}}}
  - {{name: pub, middleware: ROS2, mode: publisher, message: std_msgs/Int32}}
"""
Sent = list[tuple[bytes, bytes | None]]
needs_simulators = pytest.mark.skipif(
    not all(map(shutil.which, ("iverilog", "verilator"))), reason="Icarus Verilog or Verilator is not installed"
)


def specification(folder: Path, width: int = 8, clock: str = "") -> Path:
    (folder / "tuned.vhd").write_bytes((DATA / "tuned.vhd").read_bytes())
    names = {"clocks": f", clocks: [{{name: own, frequency: {clock}}}]", "clock": ", clock: own"} if clock else {}
    path = folder / "tuning.yaml"
    path.write_text(SPECIFICATION.format(width=width, **{"clocks": "", "clock": "", **names}))
    (folder / "stimuli.yaml").write_text("- sub: {data: 1}\n")
    (folder / "model.py").write_text("def respond(_, message):\n    return [('pub', message)]\n")
    return path


def number(value: int) -> bytes:
    return b"\0\1\0\0" + value.to_bytes(4, "little", signed=True)


class Traffic:
    """Frames with the responses that they cause, from the parameters that they set."""

    def __init__(self, width: int) -> None:
        self._pauses = 25 if width == 8 else 150
        self.sent: Sent = []
        self.wanted = {GAIN: 1, OFFSET: 0, INVERT: 0}
        self.words = dict(self.wanted)

    def set(self, parameter: int, word: int, *, is_legal: bool = True) -> None:
        """Want a word; the response has the word before."""
        address = WANTED_ADDRESS + BYTES * parameter
        self.sent.append((write_request(address, word), status_answer(address | WRITE, self.wanted[parameter])))
        self.wanted[parameter] = word
        if is_legal:
            self.words[parameter] = word

    def read(self, parameter: int) -> None:
        """Read the word in effect; it takes effect before a request after the last write is answered."""
        self.pause()
        address = VALUE_ADDRESS + BYTES * parameter
        self.sent.append((read_request(address), status_answer(address, self.words[parameter])))

    def pause(self) -> None:
        """Read the mark of a status, for longer than the accelerator holds a message."""
        self.sent += [(read_request(0), status_answer(0, 0x4D524946))] * self._pauses

    def ask(self, value: int) -> None:
        """Send a number, and expect its answer with the parameters in effect."""
        (gain,) = struct.unpack_from("<b", self.words[GAIN].to_bytes(4, "little"))
        answer = (value * gain + self.words[OFFSET]) % 2**32
        answer = ~answer % 2**32 if self.words[INVERT] else answer
        payload = b"\0\1\0\0" + answer.to_bytes(4, "little")
        self.sent.append((pack_frame(0, number(value)), pack_frame(0, payload)))

    def write(self, folder: Path) -> None:
        """Write the files of the simulated host."""
        write_stimulus(folder / "stimulus.txt", (frame for frame, _ in self.sent))
        lines = [f"< @{place} frame\n  {answer.hex()}\n" for place, (_, answer) in enumerate(self.sent) if answer]
        (folder / "expected.txt").write_text("! id_error 0\n! frame_error 0\n" + "".join(lines))


def scripted(width: int) -> Traffic:
    """Values in the range change the answers; others are ignored."""
    traffic = Traffic(width)
    traffic.ask(5)
    traffic.set(GAIN, 7)
    traffic.read(GAIN)
    traffic.ask(5)
    for word in (101, 0xFFFFFFFB, 0x107, 0x80000000):
        traffic.set(GAIN, word, is_legal=False)
        traffic.read(GAIN)
        traffic.ask(6)
    traffic.set(GAIN, 0xFFFFFFFC)
    traffic.set(INVERT, 1)
    traffic.read(INVERT)
    traffic.ask(6)
    # As floats: 0.5, -1.5, 1e10; a bit more than the range on both sides, NaN, minus infinity.
    for word in (0x3F000000, 0xBFC00000, 0x501502F9):
        traffic.set(OFFSET, word)
        traffic.read(OFFSET)
        traffic.ask(-3)
    for word in (0x501502FA, 0xBFC00001, 0x7FC00000, 0xFFC00000, 0xFF800000):
        traffic.set(OFFSET, word, is_legal=False)
        traffic.read(OFFSET)
        traffic.ask(-3)
    traffic.set(INVERT, 2, is_legal=False)
    traffic.read(INVERT)
    return traffic


CLOCKS = ["", pytest.param("37 MHz", marks=pytest.mark.check), pytest.param("310 MHz", marks=pytest.mark.check)]


@needs_simulators
@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("width", [8, pytest.param(512, marks=pytest.mark.check)])
def test_a_parameter_changes_the_answers_in_three_simulators(width: int, clock: str, tmp_path: Path) -> None:
    spec = specification(tmp_path, width, clock)
    request = call(spec, tmp_path / "stimuli.yaml", tmp_path / "model.py")
    system = build(request, tmp_path / "ghdl")
    scripted(width).write(system.folder)
    result = system.run(SEED=7, STALL_PERCENT=25)
    assert result.exit_code == 0, result.output

    folder = tmp_path / "netlist"
    top, files = translated(request, folder)
    scripted(width).write(folder)
    icarus = compile_verilog(top, files, folder).run(folder, SEED=7, STALL_PERCENT=25)
    assert icarus.exit_code == 0, icarus.output
    program = [str(simulator(top, files, folder)), "+SEED=7", "+STALL_PERCENT=25"]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("clock", ["", "90 MHz", "370 MHz"])
def test_no_parameter_changes_while_a_message_is_held(clock: str, tmp_path: Path) -> None:
    """The answers to 0 do not depend on the gain, so writes may come at any time of a message."""
    system = build(
        call(specification(tmp_path, 64, clock), tmp_path / "stimuli.yaml", tmp_path / "model.py"), tmp_path / "ghdl"
    )
    traffic = Traffic(64)
    for gain in range(100):
        traffic.ask(0)
        traffic.set(GAIN, gain)
    traffic.pause()
    traffic.read(GAIN)
    traffic.ask(2)
    traffic.write(system.folder)
    result = system.run(SEED=3, STALL_PERCENT=10)
    assert result.exit_code == 0, result.output


def test_the_digest_depends_on_parameters(tmp_path: Path) -> None:
    spec = specification(tmp_path)
    digests = set()
    for old, new in (("", ""), ("range: [-4, 100]", "range: [-4, 99]"), ("name: gain", "name: gains")):
        spec.write_text(spec.read_text().replace(old, new))
        request = call(spec, tmp_path / "stimuli.yaml", tmp_path / "model.py")
        digests.add(system_core.identity(system_core.load_requested(request)).digest)
    assert len(digests) == 3
