"""Systems with an accelerator that misbehaves: the other channels keep their rate, and the fault is reported."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
import yaml

from fusesoc_firm.frame.codec import pack_frame
from tests.hdl.frames import traffic, write_stimulus
from tests.system.simulated.systems import DATA, GeneratedSystem, build, call

SEED = 20250118
POINT, VECTOR = "geometry_msgs/Point", "geometry_msgs/Vector3"
PAYLOAD_BYTES = 24
GOOD, BAD = 0, 1
FRAMES = 3
COUNT = 200


def _system(folder: Path, width: int, accelerator: str, *, takes: bool = False, **keys: str | int) -> GeneratedSystem:
    """A channel that returns Points, and one from a subscriber with `keys` through an accelerator."""
    folder.mkdir()
    text = (DATA / f"{accelerator}.vhd").read_text()
    (folder / f"{accelerator}.vhd").write_text(
        text.replace("ready      <= '0'", "ready      <= '1'") if takes else text
    )
    sides = [{"middleware": "ROS1", "message": VECTOR}]
    blocks = [
        _converter("good", "subscriber", POINT, outgoing=[{"name": "good_back"}]),
        _converter("bad", "subscriber", VECTOR, outgoing=[{"name": "acc"}], **keys),
        {"name": "acc", "type": accelerator, "outgoing": [{"name": "bad_back"}]},
        _converter("good_back", "publisher", POINT),
        _converter("bad_back", "publisher", VECTOR),
    ]
    interface = {"input": sides, "output": sides}
    source = {"name": accelerator, "type": "VHDL", "sources": f"{accelerator}.vhd", "interface": interface}
    content = {"project": {"name": "faulty", "width": width}, "accelerators": [source], "blocks": blocks}
    (folder / "faulty.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    (folder / "stimuli.yaml").write_text("- good: {x: 1.0, y: 2.0, z: 3.0}\n")
    (folder / "model.py").write_text("def respond(subscriber, message):\n    return []\n")
    return build(call(folder / "faulty.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "work")


def _converter(name: str, mode: str, message: str, **more: object) -> dict[str, object]:
    return {"name": name, "middleware": "ROS1", "mode": mode, "message": message, **more}


def _exchange(system: GeneratedSystem, ids: list[int], faults: int) -> int:
    """Send frames of these ids, and expect those of the good channel back; return the number of cycles."""
    source = random.Random(SEED)
    frames = [pack_frame(id_, source.randbytes(PAYLOAD_BYTES)) for id_ in ids]
    write_stimulus(system.folder / "stimulus.txt", frames)
    answers = [f"< @{n} frame\n  {frame.hex()}\n" for n, frame in enumerate(frames) if frame[0] == GOOD]
    (system.folder / "expected.txt").write_text(f"! frame_error {faults}\n{''.join(answers)}")
    result = system.run(SEED=SEED, STALL_PERCENT=0)
    assert result.exit_code == 0, result.output
    return traffic(result.output).cycles


@pytest.mark.parametrize("width", [8, pytest.param(64, marks=pytest.mark.check)])
@pytest.mark.parametrize("overflow", ["drop_newest", "drop_oldest"])
def test_an_accelerator_that_never_takes(tmp_path: Path, width: int, overflow: str) -> None:
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    ids = [source.choice([GOOD, BAD]) for _ in range(COUNT)]
    ids[-1] = GOOD
    deaf = _system(tmp_path / "deaf", width, "deaf", queue=FRAMES, overflow=overflow)
    # One message is offered to the accelerator.
    dropped = ids.count(BAD) - FRAMES - 1
    cycles = _exchange(deaf, ids, dropped)
    healthy = _system(tmp_path / "healthy", width, "deaf", takes=True, queue=FRAMES, overflow=overflow)
    # To replace a frame takes a cycle.
    assert cycles <= _exchange(healthy, ids, 0) + (dropped if overflow == "drop_oldest" else 0)
