"""Publishers whose frames may be late have a FIFO of the size that the bound on lateness requires (section 6.3.2)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.simulated.systems import GeneratedSystem, build, call

SEED = 632


def generated(folder: Path, width: int, scheduler: str, message: str, keys: str) -> GeneratedSystem:
    """Two messages that pass through, with more data than the channel can send within the deadlines."""
    spec, stimuli, model = (folder / name for name in ("spec.yaml", "stimuli.yaml", "model.py"))
    lines = [f"project: {{name: late, width: {width}, scheduler: {scheduler}}}", "blocks:"]
    kind = f"middleware: ROS1, message: {message}"
    for name in "pq":
        lines.append(f"  - {{name: to_{name}, mode: subscriber, {kind}, outgoing: [{{name: {name}}}]}}")
        lines.append(f"  - {{name: {name}, mode: publisher, {kind}, {keys}}}")
    spec.write_text("\n".join(lines), encoding="utf-8")
    values = "{data: text that is long enough}" if "String" in message else "{x: 1, y: 2, z: 3}"
    stimuli.write_text(f"- to_p: {values}\n- to_q: {values}\n" * 12, encoding="utf-8")
    model.write_text("def respond(name, message):\n    return [(name[3:], message)]\n", encoding="utf-8")
    return build(call(spec, stimuli, model), folder / "system")


@pytest.mark.parametrize("width", [8, 64])
@pytest.mark.parametrize(
    ("scheduler", "message", "keys"),
    [
        ("round_robin", "geometry_msgs/Point", "period: 40, deadline: 3"),
        ("lst", "geometry_msgs/Point", "period: 40, deadline: 3"),
        ("round_robin", "std_msgs/String", "period: 200, deadline: 3, buffer: 60"),
        ("round_robin", "std_msgs/String", "period: 200, deadline: 3, wcet: 80"),
    ],
)
def test_frames_pass_their_fifo(tmp_path: Path, width: int, scheduler: str, message: str, keys: str) -> None:
    system = generated(tmp_path, width, scheduler, message, keys)
    assert (tmp_path / "system" / "late_system.vhd").read_text(encoding="utf-8").count("firm.firm_axis_fifo") == 2
    for stall in (0, 60):
        assert system.passes(SEED=SEED, STALL_PERCENT=stall)
