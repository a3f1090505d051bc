"""Frames that the host aborts, in whole systems: reported, never delivered as good, and the others are not harmed."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.frame.codec import pack_frame
from tests.hdl.frames import write_stimulus
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20261126)
POINT, VECTOR, TEXT = 0, 1, 2
COUNT = 150
# Half a payload is enough for the publisher of the text to begin its frame.
LONGEST_TEXT = 300


def _system(folder: Path, width: int) -> GeneratedSystem:
    """Channels that return Points, Vector3s through a queue, and Strings, which are cut through."""
    messages = {"point": "geometry_msgs/Point", "vector": "geometry_msgs/Vector3", "text": "std_msgs/String"}
    keys = {"point": {}, "vector": {"queue": 2}, "text": {"maxLength": 4 + LONGEST_TEXT}}
    blocks = [
        {"name": name, "middleware": "ROS1", "mode": "subscriber", "message": message, **keys[name]}
        | {"outgoing": [{"name": f"{name}_back"}]}
        for name, message in messages.items()
    ] + [
        {"name": f"{name}_back", "middleware": "ROS1", "mode": "publisher", "message": message}
        for name, message in messages.items()
    ]
    content = {"project": {"name": "aborts", "width": width}, "blocks": blocks}
    (folder / "aborts.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- point: {x: 1.0, y: 2.0, z: 3.0}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "aborts.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _frame(channel: int, source: random.Random) -> bytes:
    if channel != TEXT:
        return pack_frame(channel, source.randbytes(24))
    text = source.randbytes(source.randint(LONGEST_TEXT // 2, LONGEST_TEXT))
    return pack_frame(TEXT, len(text).to_bytes(4, "little") + text)


def _cut(frame: bytes, source: random.Random) -> bytes:
    """The frame after its id, up to a place; a text's place is in the header, or late enough for an aborted answer."""
    if frame[0] != TEXT:
        return frame[: source.randint(2, len(frame))]
    return frame[: source.choice([source.randint(2, 5), source.randint(len(frame) // 2, len(frame)), len(frame)])]


@pytest.mark.parametrize("width", [8, pytest.param(32, marks=pytest.mark.check), 64])
def test_aborted_frames(tmp_path: Path, width: int) -> None:
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    system = _system(tmp_path, width)
    frames = [_frame(source.choice([POINT, VECTOR, TEXT]), source) for _ in range(COUNT)]
    aborted = set(source.sample(range(COUNT), COUNT // 2))
    frames = [_cut(frame, source) if number in aborted else frame for number, frame in enumerate(frames)]
    write_stimulus(system.folder / "stimulus.txt", frames, aborted)
    broken_off = {number for number in aborted if frames[number][0] == TEXT and len(frames[number]) > 5}
    answers = [
        f"< @{number} answer\n  {frame[:1].hex()}\n! aborted {TEXT} 10\n"
        if number in broken_off
        else f"< @{number} answer\n  {frame.hex()}\n"
        for number, frame in enumerate(frames)
        if number in broken_off or number not in aborted
    ]
    # The subscriber reports the frame, and the publisher its own.
    faults = len(aborted) + len(broken_off)
    (system.folder / "expected.txt").write_text(f"! frame_error {faults}\n{''.join(answers)}")
    for stall in (0, 30):
        result = system.run(SEED=SEED, STALL_PERCENT=stall)
        assert result.exit_code == 0, result.output
