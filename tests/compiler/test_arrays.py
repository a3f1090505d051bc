"""Compiled functions of messages of variable size, within systems: loops, lists, strings, and messages that break."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

_SEED = seeded(20261130)
_MESSAGES = {
    "Point": "float32 x\nfloat32 y\nfloat64[2] more\n",
    "Named": "string name\nint16 weight\nPoint place\nuint8[] bytes\n",
    "Cloud": "int32 first\nstring frame\nPoint[] points\nuint8[] colors\nNamed[] named\nPoint[3] corners\nint32 tail\n",
    "Track": "string frame\nPoint[] points\nuint8[] colors\nPoint[3] corners\nint32 first\n",
    "Summary": "float32 nearest\nuint32 count\nint64 total\n",
    "Points": "Point[] points\nint32 tail\nbool segments\nuint8 element_out_points\n",
}
# The types of the answers, the keys of the outputs, and the functions.
_FUNCTIONS = {
    "summary": (
        "Summary",
        "",
        """
class Summary:
    def __init__(self):
        self.total = 0
        self.grid = [0] * 4
        self.twos = [0] * 4

    def __call__(self, m):
        nearest = 1e9
        for i, p in enumerate(m.points):
            if p.x < nearest:
                nearest = p.x
            self.grid[i & 3] += 1
            self.twos[i & 3] += 2
        for n in m.named:
            self.total += n.weight + int(n.place.y > 0.0)
        return {"nearest": nearest, "count": self.grid[1], "total": self.total + m.tail + self.twos[1]}


summary = Summary()
""",
    ),
    "scaled": (
        "Points",
        "",
        """
def scaled(m):
    points = []
    for p in m.points:
        points.append({"x": p.x * p.y, "y": -p.x, "more": [p.more[1], p.more[0] + m.first]})
    return {"points": points, "tail": len(m.points) + m.tail}
""",
    ),
    # The last sum of an element stays at its adder while the element waits for the publisher.
    "ratios": (
        "Points",
        "",
        """
def ratios(m):
    return {"points": [{"x": p.x / p.y + 1.0, "y": p.x + p.y - m.first} for p in m.points], "tail": m.tail}
""",
    ),
    "coloured": (
        "Points",
        "",
        """
def coloured(m):
    if m.first == 2:
        return None
    return {"points": [{"x": c / 4, "y": m.first} for c in m.colors], "tail": m.tail}
""",
    ),
    "same": ("Cloud", "length: given", "def same(m):\n    return {**m, 'tail': m.tail * 3, 'first': len(m.frame)}\n"),
    "listed": (
        "Track",
        "length: computed",
        """
class Listed:
    def __init__(self):
        self.past = [0] * 5

    def __call__(self, m):
        self.past = [m.tail % 256, *self.past[:4]]
        if m.first == 1:
            return None
        corners = [{"x": c.y * 2.0, "y": c.x} for c in m.corners]
        return {
            "frame": "map \\u00e4", "points": (m.corners[0], {"more": [c.x for c in m.corners[:2]]}),
            "colors": self.past, "corners": corners, "first": m.first * 3,
        }


listed = Listed()
""",
    ),
    "sums": (
        "Cloud",
        "length: buffered",
        """
def sums(m):
    low = high = 0.0
    for p in m.points:
        low, high = min(low, p.x), max(high, p.y)
    named = [{"weight": len(m.points), "place": {"x": low}}, {"place": m.corners[1]}]
    return {"frame": m.frame, "points": [{"x": low, "y": high}], "colors": m.colors, "named": named, "tail": m.tail}
""",
    ),
    "folded": (
        "Summary",
        "",
        """
import math


def folded(m):
    answer = {"nearest": 0.0, "total": len(m.points)}
    answer.nearest = min((p.x for p in m.points if p.y != 0.5), default=math.inf)
    c = m.first
    answer["count"] = sum(c for c in m.colors) + c
    # The name of an element has one value for each loop.
    p = "none"
    for p in m.corners:
        answer["count"] += int(p.x > 0.0)
    if any(n.weight > 5 for n in m.named):
        answer.total += 1000
    return answer
""",
    ),
    # The loops of the following functions are pipelines.
    "nearer": (
        "Summary",
        "",
        """
class Nearer:
    def __init__(self):
        self.total = 0
        self.rounds = 0

    def __call__(self, m):
        best, place, near = 1e9, -1, 0
        for i, p in enumerate(m.points):
            distance = p.x * p.x + p.y * p.y + m.first
            if distance < best:
                best, place = distance, i
            if distance * 0.5 < 20.0:
                near += 1
        self.rounds += 1
        self.total += near
        return {"nearest": best, "count": place + 1, "total": self.total * 1000 + self.rounds}


nearer = Nearer()
""",
    ),
    "steps": (
        "Points",
        "",
        """
import numpy as np


def steps(m):
    before, points = np.float32(m.first), []
    for i, p in enumerate(m.points):
        points.append({"x": (p.x - before) * 3.0 + i, "y": p.y, "more": [float(p.x), before]})
        before = p.x
    return {"points": points, "tail": m.tail}
""",
    ),
    "brighter": (
        "Cloud",
        "length: buffered",
        """
def brighter(m):
    c = m.corners[0].x
    # The name of an element is one of the comprehension.
    return {"colors": [int(c * 1.25) + m.first for c in m.colors], "tail": round(c * 2)}
""",
    ),
    "partly": (
        "Cloud",
        "length: buffered",
        """
def partly(m):
    return {
        "first": m.first, "frame": m.frame, "points": [{"x": p.y, "y": p.x} for p in m.points],
        "colors": [c ^ 255 for c in m.colors], "named": [{"weight": n.weight + 1} for n in m.named],
        "corners": m.corners,
    }
""",
    ),
}

_PIPELINES = ("nearer", "steps", "brighter")


def _specification(folder: Path, width: int, names: list[str]) -> Path:
    types, blocks = [], []
    for name in names:
        answer, keys, text = _FUNCTIONS[name]
        (folder / f"{name}.py").write_text(text, encoding="ascii")
        output: dict[str, Any] = {"middleware": "ROS2", "message": f"demo_msgs/{answer}"}
        sides = {"input": [{"middleware": "ROS2", "message": "demo_msgs/Cloud"}], "output": [output]}
        output |= yaml.safe_load(keys) if keys else {}
        limits = {"element": 1} if name in _PIPELINES else {}
        types.append({**limits, "name": name, "type": "Python", "sources": f"{name}.py", "interface": sides})
        end = {"middleware": "ROS2", "name": f"{name}_out", "mode": "publisher", "message": f"demo_msgs/{answer}"}
        blocks += [
            {"middleware": "ROS2", "name": f"{name}_in", "mode": "subscriber", "message": "demo_msgs/Cloud",
             "outgoing": [{"name": f"{name}_b"}]},
            {"name": f"{name}_b", "type": name, "outgoing": [{"name": f"{name}_out"}]},
            {**end, "buffer": 4096} if "buffered" in keys else end,
        ]  # fmt: skip
    path = folder / "arrays.yaml"
    text = yaml.safe_dump({"project": {"name": "arrays", "width": width}, "accelerators": types, "blocks": blocks})
    path.write_text(text, encoding="ascii")
    return path


def _cloud(source: random.Random) -> dict[str, Any]:
    def number() -> float:
        return source.choice([0.0, -0.0, float("nan"), float("inf"), source.uniform(-9, 9)])

    def point() -> dict[str, Any]:
        return {"x": number(), "y": number(), "more": [number(), number()]}

    def named() -> dict[str, Any]:
        name = "n" * source.randrange(6)
        weight, data = source.randrange(-9, 9), [source.randrange(256) for _ in range(source.randrange(4))]
        return {"name": name, "weight": weight, "place": point(), "bytes": data}

    return {
        "first": source.randrange(3),
        "frame": "f" * source.choice([0, 1, 2, 3, 9]),
        "points": [point() for _ in range(source.choice([0, 1, 2, 7, 30]))],
        "colors": [source.randrange(256) for _ in range(source.choice([0, 1, 3, 4, 17]))],
        "named": [named() for _ in range(source.choice([0, 1, 3]))],
        "corners": [point() for _ in range(3)],
        "tail": source.randrange(-99, 99),
    }


def _built(folder: Path, width: int, names: list[str], clouds: list[dict[str, Any]]) -> GeneratedSystem:
    package = folder / "demo_msgs" / "msg"
    package.mkdir(parents=True)
    for name, text in _MESSAGES.items():
        (package / f"{name}.msg").write_text(text, encoding="ascii")
    sent = [{f"{name}_in": cloud} for cloud in clouds for name in names]
    (folder / "stimuli.yaml").write_text(yaml.safe_dump(sent), encoding="ascii")
    spec = _specification(folder, width, names)
    # The functions are the model.
    request = call(spec, folder / "stimuli.yaml", None, paths=["demo_msgs"])
    return build(request, folder / "work", "acc/cordic/cordic", "acc/float/float", "acc/python/python")


@pytest.mark.check
@pytest.mark.parametrize("width", [8, 64])
def test_functions_of_arrays_answer_as_python_does(width: int, tmp_path: Path) -> None:
    print("seed", _SEED + width)
    source = random.Random(_SEED + width)
    # The elements of a narrow channel are too slow for a pipeline, and take long to simulate.
    names = [name for name in _FUNCTIONS if name not in _PIPELINES or width > 8]
    made = _built(tmp_path, width, names, [_cloud(source) for _ in range(4)])
    for name in _FUNCTIONS if width > 8 else ():
        assert made.work.latches(name, {}) == []
    for stalls in (0, 40) if width > 8 else (30,):
        assert made.passes(SEED=_SEED, STALL_PERCENT=stalls)


@pytest.mark.check
@pytest.mark.parametrize("name", ["summary", "nearer"])
def test_a_broken_message_has_no_answer_and_changes_no_state(name: str, tmp_path: Path) -> None:
    print("seed", _SEED)
    source = random.Random(_SEED)
    made = _built(tmp_path, 8, [name], [_cloud(source) for _ in range(6)])
    stimuli, answers = made.folder / "stimulus.txt", made.folder / "expected.txt"
    frames = re.split(r"^> .*\n", stimuli.read_text(encoding="ascii"), flags=re.MULTILINE)[1:]
    sent = ""
    for number, frame in enumerate(frames):
        data = bytes.fromhex(frame)
        sent += f"> broken\n  {data[: source.randrange(6, len(data))].hex()}\n> {number}\n  {data.hex()}\n"
    stimuli.write_text(sent, encoding="ascii")
    later = re.sub(r"^< @(\d+)", lambda found: f"< @{2 * int(found[1]) + 1}", answers.read_text(), flags=re.MULTILINE)
    answers.write_text(f"! frame_error {len(frames)}\n{later}", encoding="ascii")
    for stalls in (0, 40):
        assert made.passes(SEED=_SEED, STALL_PERCENT=stalls)
