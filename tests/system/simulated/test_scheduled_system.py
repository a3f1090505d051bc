"""A system under every policy: messages of several sizes side by side, in bursts where the policy interrupts frames."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from fusesoc_firm.scheduling.policies import POLICIES
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20241008)
MESSAGES = {
    "scan": ("sensor_msgs/LaserScan", 20_000),
    "pose": ("geometry_msgs/Pose", 3000),
    "text": ("std_msgs/String", 2000),
    "flag": ("std_msgs/Bool", 400),
}


def specification(scheduler: str, width: int) -> str:
    blocks = ""
    for name, (message, period) in MESSAGES.items():
        converter = f"middleware: ROS, message: {message}"
        blocks += f"  - {{name: {name}_in, mode: subscriber, {converter}, outgoing: [{{name: {name}}}]}}\n"
        bound = "wcet: 500, " if message in ("sensor_msgs/LaserScan", "std_msgs/String") else ""
        blocks += f"  - {{name: {name}, mode: publisher, {converter}, {bound}period: {period}}}\n"
    return f"project: {{name: busy, scheduler: {scheduler}, width: {width}, shortestRun: 2}}\nblocks:\n{blocks}"


def stimuli(count: int) -> str:
    """Messages at random; prints the seed."""
    print(f"stimuli from seed {SEED}")
    source = random.Random(SEED)
    floats = [source.uniform(-9, 9) for _ in range(30)]
    scan = {
        "header": {"seq": 1, "stamp": {"sec": 2, "nsec": 3}, "frame_id": "laser"},
        **dict.fromkeys(("angle_min", "angle_max", "angle_increment", "time_increment"), 0.5),
        **dict.fromkeys(("scan_time", "range_min", "range_max"), 1.5),
        "ranges": [1.0] * 40,
        "intensities": [2.0] * 7,
    }
    pose = {"position": dict.fromkeys("xyz", floats[0]), "orientation": dict.fromkeys("xyzw", floats[1])}
    values = {"scan": scan, "pose": pose, "text": {"data": "so it is"}, "flag": {"data": True}}
    lines = []
    for _ in range(count):
        name = source.choice([*MESSAGES])
        lines.append(f"- {name}_in: {values[name]}")
    return "\n".join(lines).replace("True", "true") + "\n"


MODEL = """
def respond(subscriber, message):
    return [(subscriber.removesuffix("_in"), message)]
"""


def system(folder: Path, scheduler: str, width: int) -> GeneratedSystem:
    for name, text in (
        ("spec.yaml", specification(scheduler, width)),
        ("stimuli.yaml", stimuli(60)),
        ("model.py", MODEL),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    return build(call(folder / "spec.yaml", folder / "stimuli.yaml", folder / "model.py"), folder / "system")


@pytest.mark.one_in(5)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("scheduler", [*POLICIES, "auto"])
def test_every_message_comes_back(tmp_path: Path, scheduler: str, width: int) -> None:
    made = system(tmp_path, scheduler, width)
    assert made.passes(STALL_PERCENT=0)
    assert made.passes(SEED=3, STALL_PERCENT=50)


def test_frames_are_interrupted(tmp_path: Path) -> None:
    """Else the tests above would show nothing: without the joiner the host gets bursts, which are no frames."""
    made = system(tmp_path, "edf_latency", 8)
    bench = next(path for path in made.files if path.name.endswith("_tb.vhd"))
    text = bench.read_text(encoding="utf-8")
    without_join, joins = re.subn(r"  u_join : .*?\);\n", "", text, flags=re.DOTALL)
    assert joins == 1
    bench.write_text(without_join.replace("=> burst_", "=> from_"), encoding="utf-8")
    made.work.analyse([bench])
    assert not made.passes(STALL_PERCENT=0)
