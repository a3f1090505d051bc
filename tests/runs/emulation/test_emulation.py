"""`firm emulate`: the program in C on QEMU's Zynq, whose UART is not ours, at the pins of the simulated hardware."""

from __future__ import annotations

import os
import random
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.cli import main
from fusesoc_firm.runs.emulation.program import PROCESSORS
from tests.hdl.ghdl import REPOSITORY
from tests.seeds import seeded

SPECS = REPOSITORY / "specs"
SEED = seeded(20261126)
KERNEL = os.environ.get("FREERTOS_KERNEL", "")

# The tests of a system share its build.
pytestmark = pytest.mark.xdist_group("emulation")


def _missing(processor: str) -> str:
    """Why a processor is not emulated here, or nothing."""
    programs = (PROCESSORS[processor].compiler, PROCESSORS[processor].emulator)
    absent = [name for name in programs if not shutil.which(name)]
    return f"no {' and no '.join(absent)}" if absent else ""


def _emulated_by(processor: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(bool(_missing(processor)), reason=_missing(processor) or "is not missing")


KERNELS = [
    pytest.param([], id="bare-metal", marks=_emulated_by("zynq7000")),
    pytest.param(
        ["--freertos", KERNEL],
        id="freertos",
        marks=[
            _emulated_by("zynq7000"),
            pytest.mark.skipif(not KERNEL, reason="FREERTOS_KERNEL names no folder"),
        ],
    ),
    pytest.param(["--processor", "zynqmp"], id="zynqmp", marks=_emulated_by("zynqmp")),
]


@pytest.fixture(scope="module")
def build_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("emulation") / "build"


def emulated(build_root: Path, name: str, *options: str) -> int:
    spec = SPECS / name.removesuffix("_link") / f"{name}.yaml"
    return main(["emulate", str(spec), "--build-root", str(build_root), *options])


def quaternions(chance: random.Random, count: int) -> list[dict[str, Any]]:
    """Random rotations."""
    found = []
    for _ in range(count):
        parts = [chance.gauss(0, 1) for _ in range(4)]
        length = sum(part * part for part in parts) ** 0.5
        found.append({"QuaternionToEuler_sub": dict(zip("xyzw", (part / length for part in parts), strict=True))})
    return found


def mixed(chance: random.Random, count: int) -> list[dict[str, Any]]:
    """Twists, scans and images of random sizes, in any order."""
    return [chance.choice((_twist, _scan, _image))(chance, number) for number in range(count)]


def _header(chance: random.Random, number: int) -> dict[str, Any]:
    frame_id = "".join(chance.choices("abcdefgh", k=chance.randrange(20)))
    return {"seq": number, "stamp": {"sec": chance.randrange(2**32), "nsec": 0}, "frame_id": frame_id}


def _twist(chance: random.Random, number: int) -> dict[str, Any]:
    vectors = {name: {axis: chance.uniform(-1, 1) for axis in "xyz"} for name in ("linear", "angular")}
    return {"twist_in": {"header": _header(chance, number), "twist": vectors}}


def _scan(chance: random.Random, number: int) -> dict[str, Any]:
    limits = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    ranges = [chance.randrange(256) / 8 for _ in range(chance.randrange(60))]
    values = {name: chance.randrange(100) / 4 for name in limits}
    return {"scan_in": {"header": _header(chance, number), **values, "ranges": ranges, "intensities": ranges[::2]}}


def _image(chance: random.Random, number: int) -> dict[str, Any]:
    height, width = chance.randrange(16), chance.randrange(24)
    image = {"height": height, "width": width, "encoding": "mono8", "is_bigendian": 0, "step": width}
    return {"image_in": {"header": _header(chance, number), **image, "data": list(chance.randbytes(height * width))}}


def _written(folder: Path, stimuli: Sequence[dict[str, Any]]) -> list[str]:
    path = folder / "stimuli.yaml"
    path.write_text(yaml.safe_dump(list(stimuli), default_flow_style=True))
    return ["--stimuli", str(path)]


@pytest.mark.check
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(("name", "messages"), [("quat2euler", quaternions), ("multi_type_link", mixed)])
def test_all_messages_return(
    build_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, messages: Any, kernel: list[str]
) -> None:
    """300 random messages, more than a byte counts; fewer with the second processor, which runs the same program."""
    print(f"seed {SEED}")
    count = 100 if "zynqmp" in kernel else 300
    stimuli = messages(random.Random(f"{SEED} {name}"), count)
    assert emulated(build_root, name, *_written(tmp_path, stimuli), *kernel) == 0
    said = capsys.readouterr().out
    assert f"PASS {count}/{count}" in said
    assert f"counts of the program: sent {count}, lost 0, good {count}, broken 0, refused 0, overruns 0" in said


@pytest.mark.check
def test_a_wrong_response_is_reported(build_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.py"
    text = (SPECS / "multi_type" / "model.py").read_text()
    model.write_text(text.replace("(_PUBLISHERS[subscriber], message)", "(_PUBLISHERS[subscriber], changed(message))"))
    with model.open("a") as file:
        file.write("\n\ndef changed(message: Message) -> Message:\n")
        file.write('    return {**message, "header": {**message["header"], "frame_id": "other"}}\n')
    stimuli = _written(tmp_path, mixed(random.Random(SEED), 3))
    assert emulated(build_root, "multi_type_link", *stimuli, "--model", str(model), "--quiet") == 1
    said = capsys.readouterr()
    assert "counts of the program" not in said.out
    assert said.out.count("received {") == 3
    assert "the messages differ from those of the model" in said.err


@_emulated_by("zynq7000")
def test_bursts_do_not_fit_a_line(build_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = SPECS / "multi_type" / "multi_type.yaml"
    assert main(["emulate", str(spec), "--build-root", str(build_root)]) == 1
    assert "cannot carry the bursts of scheduler 'fixed_priority_preemptive'" in capsys.readouterr().err


@_emulated_by("zynq7000")
def test_a_folder_without_the_kernel(tmp_path: Path, build_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert emulated(build_root, "quat2euler", "--freertos", str(tmp_path)) == 1
    assert f"{tmp_path} is not the FreeRTOS kernel: there is no tasks.c" in capsys.readouterr().err


@_emulated_by("zynq7000")
def test_a_specification_without_a_core(tmp_path: Path, build_root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(SPECS / "quat2euler", tmp_path / "own", ignore=shutil.ignore_patterns("*.core"))
    assert main(["emulate", str(tmp_path / "own" / "quat2euler.yaml"), "--build-root", str(build_root)]) == 1
    said = capsys.readouterr().err
    assert "names its stimuli" in said and "name them with --stimuli" in said
