"""A system's functions in a process, alone and behind the node's engine in C++."""

from __future__ import annotations

import io
import random
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.node.software_process import SoftwarePorts, serve, software_ports
from fusesoc_firm.system.derived.model import DerivedSystem
from fusesoc_firm.text.diagnostics import InputError
from tests.node.drivers import Driver
from tests.node.test_cpp_node import puts, run
from tests.runs.simulation.test_software import elsewhere, point, soft
from tests.seeds import seeded
from tests.system.systems import accelerator, converter, derived, instance, specification

SEED = seeded(20261125)
CODE = """\
def soft(m):
    print('what a function prints is no frame')
    if m['x'] == 666:
        raise ValueError('the beast')
    return None if m['x'] < 0 else {**m, 'x': 2 * m['x']}
"""


def text_of(folder: Path) -> str:
    """Software behind a topic, in front of hardware; hardware in front of software, which gives to a topic."""
    blocks = converter("sub", "subscriber", "Point", "one") + instance("one", "soft", "rotated", "near")
    blocks += instance("rotated", "hard", "two") + instance("two", "soft", "far") + instance("away", "gone", "away_pub")
    blocks += converter("away_sub", "subscriber", "Point", "away")
    blocks += "".join(converter(name, "publisher", "Point") for name in ("near", "far", "away_pub"))
    types = accelerator("hard", "Point", "Point") + soft(folder, "soft", CODE) + elsewhere("gone")
    return specification(blocks, types)


def made(folder: Path) -> tuple[DerivedSystem, SoftwarePorts]:
    system = derived(folder, text_of(folder))
    return system, software_ports(system)


def test_ports_are_what_the_functions_take_and_give(tmp_path: Path) -> None:
    """Not what software elsewhere does."""
    _, ports = made(tmp_path)
    assert [topic.block for topic in ports.inputs] == ["sub", "two_in"]
    assert [topic.block for topic in ports.outputs] == ["one_out", "near", "far"]


def _served(folder: Path, row: bytes) -> list[tuple[int, float]]:
    """The answers' ids and x."""
    system, ports = made(folder)
    out = io.BytesIO()
    serve(system, folder, io.BytesIO(row), out)
    data, found = out.getvalue(), []
    while data:
        size = 5 + int.from_bytes(data[1:5], "little")
        found.append((data[0], decode(ports.outputs[data[0]].frame, data[5:size])["x"]))
        data = data[size:]
    return found


def frame(folder: Path, identifier: int, x: float) -> bytes:
    _, ports = made(folder)
    return pack_frame(identifier, encode(ports.inputs[identifier].frame, point(x)))


def test_frames_are_answered(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    row = frame(tmp_path, 0, 1.0) + frame(tmp_path, 0, -1.0) + frame(tmp_path, 1, 5.0)
    assert _served(tmp_path, row) == [(0, 2.0), (1, 2.0), (2, 10.0)]
    garbage = pack_frame(0, b"short")
    assert _served(tmp_path, garbage + frame(tmp_path, 1, 3.0)) == [(2, 6.0)]
    assert "invalid message from 'sub': " in capfd.readouterr().err


@pytest.mark.parametrize(
    ("row", "error"),
    [
        (b"\0\1", "the input ends within a frame"),
        (b"\0\5\0\0\0abc", "the input ends within a frame"),
        (b"\2\0\0\0\0", "a frame has the id 2, but the software's inputs have the ids 0 to 1"),
    ],
)
def test_a_row_that_is_no_frames_is_refused(tmp_path: Path, row: bytes, error: str) -> None:
    with pytest.raises(InputError, match=error):
        _served(tmp_path, row)


def _command(folder: Path) -> str:
    made(folder)
    words = [sys.executable, "-m", "fusesoc_firm.node.software_process", str(folder / "spec.yaml")]
    return shlex.join(words)


def test_a_node_drives_the_process(node_driver: Driver, tmp_path: Path) -> None:
    """What a function prints is no frame, and all that was put is answered before the process ends."""
    print(f"seed {SEED}")
    source = random.Random(SEED)
    _, ports = made(tmp_path)
    given = [(source.randrange(2), source.uniform(-10, 10)) for _ in range(200)]
    payloads = [(identifier, encode(ports.inputs[identifier].frame, point(x))) for identifier, x in given]
    address = f"software:{_command(tmp_path)} 2>/dev/null"
    outcome = run(node_driver, puts(payloads), address, converters=3, depth=300)
    assert outcome.said["status"] == "0", outcome.said
    found = {
        identifier: [decode(ports.outputs[identifier].frame, payload)["x"] for payload in answers]
        for identifier, answers in outcome.published.items()
    }
    doubled = [[2 * x for taker, x in given if taker == number and x >= 0] for number in range(2)]
    assert found == {0: doubled[0], 1: doubled[0], 2: doubled[1]}


def test_a_function_that_fails_ends_the_node_or_is_started_again(node_driver: Driver, tmp_path: Path) -> None:
    _, ports = made(tmp_path)
    payloads = [(1, encode(ports.inputs[1].frame, point(x))) for x in (1.0, 666.0)]
    address = f"software:{_command(tmp_path)} 2>/dev/null"
    outcome = run(node_driver, puts(payloads), address, converters=3)
    assert outcome.said["status"] == "1"
    assert outcome.said["error"] == "the software ended with status 1"
    assert len(outcome.published[2]) == 1
    again = run(node_driver, [*puts(payloads), "await 1"], address, converters=3, restarts=1)
    assert again.said["status"] == "0" and again.count("restarts") == 1


def test_a_process_that_talks_nonsense_ends_the_node(node_driver: Driver) -> None:
    outcome = run(node_driver, ["put 0 00"], "software:printf '\\377nonsense'; cat >/dev/null")
    assert outcome.said["error"] == "the software sent an invalid frame: the id is 255, but the publishers are 0 to 1"


def test_faults_of_the_specification_are_told(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "fusesoc_firm.node.software_process", str(tmp_path / "none.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and not done.stdout
    assert "none.yaml" in done.stderr and "Traceback" not in done.stderr
