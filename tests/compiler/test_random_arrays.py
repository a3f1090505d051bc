"""Random functions of messages of ROS 2 with arrays answer as Python does, in systems with random stalls and widths."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusesoc_firm.compiler.interface import Elements, Part, Side, places, side_of
from fusesoc_firm.compiler.program import Task, compile_function
from fusesoc_firm.compiler.source import Source
from fusesoc_firm.frame.model import names_of
from fusesoc_firm.message import ROS2
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.runs.verify.stimuli import EXTREME, TYPICAL, Stimuli
from fusesoc_firm.text.diagnostics import InputError
from tests.compiler.compiled import CORES, message_frame
from tests.frame.oracle import Oracle
from tests.seeds import seeded
from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = seeded(20261202)
ORACLE = Oracle(ROS2)
SUMMARY = "float64 total\nint64 count\nfloat64[] values\n"
# A longer message takes too long to simulate.
_LARGEST = 400
# What Python computes with the types of paths, or after a message, is none of these functions.
_REFUSED = ("which follows it in the message", "in one place")


def _at(steps: tuple[str | int, ...]) -> str:
    return "".join(f"[{step!r}]" for step in steps)


@dataclass(frozen=True)
class RandomLoops:
    """A function of all fields of a message: loops over its arrays, with numbers that they carry."""

    source: random.Random
    side: Side

    def text(self, name: str) -> str:
        """Return the function."""
        lines = ["total, count, last = 0.0, 0, 1"]
        for leaf in self.side.leaves:
            value = f"m{_at(self.source.choice(places(leaf.path)))}"
            lines.append(self.statement(value, leaf.kind.is_float, leaf.kind.name == "bool"))
        for part in self.side.parts:
            lines += self.part(part)
        lines.append(f"return None if count % 5 == {self.source.randrange(9)} else {self.answer()}")
        return f"import math\n\n\ndef {name}(m):\n" + "".join(f"    {line}\n" for line in lines)

    def answer(self) -> str:
        """Return a message of some of the numbers."""
        values = ["total", "total * 0.5", "count / 8", "float(last)"]
        chosen = ", ".join(self.source.sample(values, self.source.randrange(4)))
        return f"{{'total': total, 'count': count * 3 + last, 'values': [{chosen}]}}"

    def statement(self, value: str, is_float: bool, is_bool: bool) -> str:
        """Return a statement that uses a number."""
        if is_bool:
            return f"count += 3 if {value} else 1"
        if is_float:
            return self.source.choice([
                f"total = max(total, float({value}))",
                f"total = total + {value} * 0.25",
                f"count += 1 if {value} < {self.source.randint(-3, 3)} else 0",
            ])  # fmt: skip
        return self.source.choice([
            f"count = count + int({value}) % {self.source.randint(2, 9)}",
            f"last = (int({value}) & 255) + last % 3",
            f"count += int({value} == last)",
        ])  # fmt: skip

    def part(self, part: Part | Elements) -> list[str]:
        """Return the statements for a string or an array."""
        path = f"m{_at(names_of(part.path))}"
        if isinstance(part, Elements) and part.leaves:
            leaf, steps = self.source.choice(part.leaves), len(names_of(part.path))
            value = f"e{_at(self.source.choice(places(leaf.path))[steps:])}"
            kind = leaf.kind
        elif isinstance(part, Part) and part.kind:
            value, kind = "e", part.kind
        else:
            return [f"count += len({path})"]
        body = self.statement(value, kind.is_float, kind.name == "bool")
        if self.source.random() < 0.4:
            return [f"for i, e in enumerate({path}):", f"    {body}", "    count += i & 3"]
        return [f"for e in {path}:", f"    {body}"]


def _functions(source: random.Random, count: int) -> dict[str, tuple[str, str]]:
    """Return functions by name, each with its message: those that need no later field in a loop."""
    found: dict[str, tuple[str, str]] = {}
    answers = [side_of("out_", message_frame(SUMMARY))]
    while len(found) < count:
        message, name = source.choice(ORACLE.messages()), f"f{len(found)}"
        side = side_of("in_", ORACLE.frame(message))
        if not side.parts or len(side.leaves) > 25:
            continue
        text = RandomLoops(source, side).text(name)
        try:
            compile_function(Task(Source("f.py", text), name, [side], answers))
        except InputError as error:
            if not any(reason in str(error) for reason in _REFUSED):
                raise
            continue
        found[name] = message, text
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, bytes):
        return [*value]
    return [*map(_plain, value)] if isinstance(value, list | tuple) else value


def _built(folder: Path, source: random.Random, count: int) -> GeneratedSystem:
    functions = _functions(source, count)
    package = folder / "demo_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "Summary.msg").write_text(SUMMARY, encoding="ascii")
    types, blocks, sent = [], [], []
    for name, (message, text) in functions.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
        answer = {"middleware": "ROS2", "message": "demo_msgs/Summary"}
        interface = {"input": [{"middleware": "ROS2", "message": message}], "output": [answer]}
        types.append({"name": name, "type": "Python", "sources": f"{name}.py", "interface": interface})
        blocks += [
            {"middleware": "ROS2", "name": f"{name}_in", "mode": "subscriber", "message": message,
             "outgoing": [{"name": f"{name}_b"}]},
            {"name": f"{name}_b", "type": name, "outgoing": [{"name": f"{name}_out"}]},
            {"name": f"{name}_out", "mode": "publisher", **answer},
        ]  # fmt: skip
        stimuli = Stimuli(ORACLE.closure(message), ROS2, source)
        for kind in (TYPICAL, EXTREME, TYPICAL):
            value = stimuli.message(parse_name(message), kind)
            if len(ORACLE.serialise(message, value)) < _LARGEST:
                sent.append({f"{name}_in": _plain(value)})
    source.shuffle(sent)
    project = {"name": "arrays", "width": source.choice([8, 16, 32, 64, 128])}
    spec = folder / "arrays.yaml"
    spec.write_text(yaml.safe_dump({"project": project, "accelerators": types, "blocks": blocks}), encoding="ascii")
    (folder / "stimuli.yaml").write_text(yaml.safe_dump(sent, allow_unicode=True), encoding="utf-8")
    request = call(spec, folder / "stimuli.yaml", None, paths=["demo_msgs"])
    return build(request, folder / "work", "acc/cordic/cordic", *CORES[1:])


@pytest.mark.check
@pytest.mark.parametrize(
    ("seeds", "count"), [(range(1, 3), 4), pytest.param(range(3, 61), 4, marks=pytest.mark.thorough)]
)
def test_random_functions_of_arrays_answer_as_python_does(seeds: range, count: int, tmp_path: Path) -> None:
    for seed in seeds:
        print("seed", SEED + seed)
        source = random.Random(SEED + seed)
        made = _built(tmp_path / str(seed), source, count)
        assert made.passes(SEED=seed, STALL_PERCENT=source.choice([0, 20, 50]))
