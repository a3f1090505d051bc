"""Systems with a combined scheduler: groups of publishers, whose frames reach the host."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.simulated.systems import build, call

SEED = 435
GROUPS = {
    "whole frames": ("round_robin", ("fixed_priority", "[pub0, pub1]"), ("lru", "pub2")),
    "bursts": ("lru", ("edf_latency", "[pub0, pub1]"), ("lst", "pub2")),
    "priorities": ("fixed_priority_preemptive", ("round_robin", "pub0"), ("lru", "[pub1, pub2]")),
}


@pytest.mark.one_in(2)
@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize("kind", GROUPS)
def test_messages_of_all_groups(tmp_path: Path, kind: str, width: int) -> None:
    scheduler, *groups = GROUPS[kind]
    listed = ", ".join(f"{{scheduler: {policy}, publishers: {names}}}" for policy, names in groups)
    sinks = ", ".join(f"{{name: pub{number}}}" for number in range(3))
    message = "middleware: ROS1, message: geometry_msgs/Point"
    publishers = (
        f"  - {{name: pub{number}, mode: publisher, {message}, period: {900 + number}}}" for number in range(3)
    )
    lines = [
        f"project: {{name: grouped, width: {width}, scheduler: {scheduler}, shortestRun: 2, groups: [{listed}]}}",
        "blocks:",
        f"  - {{name: sub, mode: subscriber, {message}, outgoing: [{sinks}]}}",
        *publishers,
    ]
    spec, stimuli, model = (tmp_path / name for name in ("spec.yaml", "stimuli.yaml", "model.py"))
    spec.write_text("\n".join(lines), encoding="utf-8")
    stimuli.write_text(
        "".join(f"- sub: {{x: {number}.5, y: -{number}, z: 0}}\n" for number in range(9)), encoding="utf-8"
    )
    model.write_text(
        "def respond(_, message):\n    return [(f'pub{number}', message) for number in range(3)]\n", encoding="utf-8"
    )
    system = build(call(spec, stimuli, model), tmp_path / "system")
    for stall in (0, 50):
        assert system.passes(SEED=SEED, STALL_PERCENT=stall)
