"""Headers that announce 2**32-1 bytes, in a whole system: others wait no longer than for the bytes that were sent."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.message import ROS2
from tests.hdl.frames import traffic, write_stimulus
from tests.payloads import Payloads
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20261123)
LIE = (2**32 - 1).to_bytes(4, "little")
ID_BYTES, LENGTH_BYTES = 1, 4
# Cycles that a lie may cost beside its beats.
REST = 64
POINT = "geometry_msgs/Point"
TYPES = (
    "std_msgs/String",
    "std_msgs/Header",
    "std_msgs/Float64MultiArray",
    "sensor_msgs/CompressedImage",
    "sensor_msgs/Image",
    "sensor_msgs/JointState",
    "sensor_msgs/LaserScan",
    "sensor_msgs/PointCloud2",
    "geometry_msgs/PoseArray",
    "diagnostic_msgs/DiagnosticArray",
)


def _system(folder: Path, width: int) -> GeneratedSystem:
    """A system that returns the messages of all types."""
    blocks = []
    for place, name in enumerate((POINT, *TYPES)):
        converter = f"middleware: ROS2, message: {name}, mode"
        blocks.append(f"- {{name: in{place}, {converter}: subscriber, outgoing: [{{name: out{place}}}]}}")
        blocks.append(f"- {{name: out{place}, {converter}: publisher}}")
    text = "\n".join([f"project: {{name: lies, width: {width}}}", "blocks:", *blocks, ""])
    (folder / "lies.yaml").write_text(text, encoding="utf-8")
    (folder / "stimuli.yaml").write_text("- in0: {x: 1.0, y: 2.0, z: 3.0}\n", encoding="utf-8")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n", encoding="utf-8")
    return build(call(folder / "lies.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _cycles(system: GeneratedSystem, frames: list[bytes]) -> int:
    """Send frames, of which all but the lies come back; return the number of cycles."""
    write_stimulus(system.folder / "stimulus.txt", frames)
    lies = sum(_is_lie(frame) for frame in frames)
    answers = [f"< @{n} back\n  {frame.hex()}\n" for n, frame in enumerate(frames) if not _is_lie(frame)]
    (system.folder / "expected.txt").write_text(f"! frame_error {lies}\n{''.join(answers)}", encoding="ascii")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output
    return traffic(result.output).cycles


def _is_lie(frame: bytes) -> bool:
    return frame[ID_BYTES : ID_BYTES + LENGTH_BYTES] == LIE


@pytest.mark.check
@pytest.mark.parametrize("width", [8, 64, 512])
def test_a_lying_length_holds_up_nobody(tmp_path: Path, width: int) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    system = _system(tmp_path, width)
    point = Payloads(ROS2, POINT)
    frames = []
    for id_, name in enumerate(TYPES, start=1):
        good = pack_frame(id_, Payloads(ROS2, name).draw(source))
        lie = bytes([id_]) + LIE + good[ID_BYTES + LENGTH_BYTES :]
        frames += [pack_frame(0, point.draw(source)), lie, pack_frame(0, point.draw(source)), good]
    honest = _cycles(system, [frame for frame in frames if not _is_lie(frame)])
    beats = sum(-(-len(frame) // (width // 8)) for frame in frames if _is_lie(frame))
    cycles = _cycles(system, frames)
    print(f"{cycles} cycles with {len(TYPES)} lies of {beats} beats, {honest} without")
    assert cycles <= honest + beats + REST * len(TYPES)
