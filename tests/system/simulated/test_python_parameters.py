"""Parameters of a compiled function: attributes in Python, and ports of the hardware."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.system.hardware.parameters import value_address, wanted_address
from fusesoc_firm.system.status_frames import WRITE, read_request, status_answer, write_request
from tests.hdl.frames import write_stimulus
from tests.system.simulated.systems import build, call
from tests.system.simulated.test_parameters import number, specification

GAIN, OFFSET, INVERT = 0, 1, 2
SOURCE = """
import numpy as np


class Tuned:
    def __init__(self):
        self.gain = 1
        self.offset = 0.0
        self.invert = False
        self.count = np.int32(0)

    def __call__(self, message):
        self.count += 1
        result = message.data * np.int32(self.gain) + np.int32(int(np.float32(self.offset)))
        return {"data": ~result if self.invert else result}


tuned = Tuned()
"""
CORES = ("acc/cordic/cordic", "acc/float/float", "acc/fixed/fixed", "acc/python/python")


def compiled(folder: Path, source: str = SOURCE) -> Path:
    """The specification with the function in Python."""
    path = specification(folder)
    (folder / "tuned.py").write_text(source, encoding="utf-8")
    path.write_text(path.read_text().replace("type: VHDL", "type: Python").replace("tuned.vhd", "tuned.py"))
    return path


def word(value: float) -> int:
    return int(struct.unpack("<I", struct.pack("<f", value))[0])


def test_attributes_change_the_answers(tmp_path: Path) -> None:
    system = build(call(compiled(tmp_path), tmp_path / "stimuli.yaml", None), tmp_path / "ghdl", *CORES)
    assert system.passes(), "the model has the defaults"
    sent: list[tuple[bytes, bytes]] = []
    wanted = {GAIN: 1, OFFSET: 0, INVERT: 0}

    def put(parameter: int, new: int) -> None:
        address = wanted_address(parameter)
        sent.append((write_request(address, new), status_answer(address | WRITE, wanted[parameter])))
        sent.extend([(read_request(0), status_answer(0, 0x4D524946))] * 60)
        sent.append((read_request(value_address(parameter)), status_answer(value_address(parameter), new)))
        wanted[parameter] = new

    def ask(value: int, answer: int) -> None:
        sent.append((pack_frame(0, number(value)), pack_frame(0, number(answer))))

    ask(5, 5)
    put(GAIN, 0xFFFFFFFC)
    ask(5, -20)
    put(OFFSET, word(100.75))
    ask(5, 80)
    put(OFFSET, word(-1.5))
    put(INVERT, 1)
    ask(5, 20)
    put(GAIN, 100)
    ask(-7, 700)
    write_stimulus(system.folder / "stimulus.txt", (frame for frame, _ in sent))
    lines = [f"< @{place} frame\n  {answer.hex()}\n" for place, (_, answer) in enumerate(sent)]
    (system.folder / "expected.txt").write_text("! id_error 0\n! frame_error 0\n" + "".join(lines))
    result = system.run(SEED=5, STALL_PERCENT=25)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("self.gain = 1", "self.gain = 2", "'tuned.gain' is 2 at first, and its default 1"),
        ("self.gain = 1", "self.other = 1", "'Tuned' has no 'gain'"),
        ("self.count += 1", "self.gain += 1", "'tuned.gain' is a parameter, which the function cannot set"),
        ("tuned = Tuned()", "def tuned(m):\n    return m", "'tuned' has no attribute 'gain' for the parameter"),
    ],
)
def test_an_attribute_that_is_no_parameter(
    old: str, new: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in SOURCE
    assert main(["check", str(compiled(tmp_path, SOURCE.replace(old, new)))]) == 1
    assert error in capsys.readouterr().err


SCALED = """
class Scaled:
    def __init__(self):
        self.gain = 0.1

    def __call__(self, message):
        return {"data": message.data * self.gain}


tuned = Scaled()
"""


@pytest.mark.parametrize("numbers", ["float32", "float64", "fixed(24, 12)"])
def test_an_attribute_has_the_type_of_the_numbers(numbers: str, tmp_path: Path) -> None:
    """The model computes with the default in each type, as the hardware does."""
    path = compiled(tmp_path, SCALED)
    text = path.read_text().replace("std_msgs/Int32", "std_msgs/Float32")
    begin, end = text.index("      - {name: gain"), text.index("blocks:")
    parameter = "      - {name: gain, type: float32, default: 0.1, range: [0, 4]}\n"
    path.write_text(text[:begin] + parameter + f'    numbers: "{numbers}"\n' + text[end:])
    (tmp_path / "stimuli.yaml").write_text("".join(f"- sub: {{data: {value}}}\n" for value in (1.0, -3.7, 100.1)))
    system = build(call(path, tmp_path / "stimuli.yaml", None), tmp_path / "ghdl", *CORES)
    assert system.passes()
    sent = [
        (write_request(wanted_address(0), word(2.5)), status_answer(wanted_address(0) | WRITE, word(0.1))),
        *[(read_request(0), status_answer(0, 0x4D524946))] * 20,
        *[
            (pack_frame(0, b"\0\1\0\0" + struct.pack("<f", one)), pack_frame(0, b"\0\1\0\0" + struct.pack("<f", other)))
            for one, other in ((1.5, 3.75), (-8.0, -20.0))
        ],
    ]
    write_stimulus(system.folder / "stimulus.txt", (frame for frame, _ in sent))
    lines = [f"< @{place} frame\n  {answer.hex()}\n" for place, (_, answer) in enumerate(sent)]
    (system.folder / "expected.txt").write_text("! id_error 0\n! frame_error 0\n" + "".join(lines))
    result = system.run(SEED=5, STALL_PERCENT=25)
    assert result.exit_code == 0, result.output
