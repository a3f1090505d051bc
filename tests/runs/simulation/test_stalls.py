"""A simulation in which nothing moves: the message that is not answered, and the accelerator that holds it."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.cli import main
from fusesoc_firm.runs.simulation.answers import Answer, Payload
from fusesoc_firm.runs.simulation.stalls import Stall, stall
from fusesoc_firm.system.message_sources import load_beside

STIMULI = "".join(f"> sub std_msgs/Bool data={value}\n  00\n" for value in ("True", "False", "True"))
EXPECTED = "".join(f"< @{cause} pub std_msgs/Bool data=True\n  00\n" for cause in (0, 1, 2))


def stalled(sent: int, answered: int) -> Stall:
    """The stall of a run after so many sent and answered messages."""
    fault = f"fault in cycle 9: nothing moved for 100000 cycles; {sent} of 3 frames in, {answered} of 3 out"
    payload = Payload.__new__(Payload)
    answers = [Answer("pub", cause, None, payload, payload) for cause in range(answered)]
    found = stall(["fault in cycle 9: other", fault], answers, STIMULI, EXPECTED)
    assert found
    assert fault.startswith(found.fault)
    return found


def test_the_first_message_without_an_answer_is_found() -> None:
    assert stalled(2, 0).message == 0
    assert stalled(2, 1).message == 1
    assert stalled(2, 2).message is None
    assert stall(["fault in cycle 9: missing: 'pub'"], [], STIMULI, EXPECTED) is None


def test_a_field_is_not_blamed_while_a_message_before_is_held() -> None:
    """The fields of the next message are offered only after the blocks have accepted the last one."""
    assert stalled(2, 1).reason == "message 1 before it is not answered"
    assert stalled(0, 0).reason == "no block takes this field or one before it"
    # An answer may leave before its message is accepted.
    assert stalled(1, 1).reason.endswith(", or a message before it is still held")


def test_the_accelerator_on_the_route_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "low", "--in", "std_msgs/Bool", "--out", "std_msgs/Bool"]) == 0
    system = load_beside(Path("low/low.yaml")).system
    held, ports, check = stalled(2, 1).notes(system, "robot:sys:low:0.1.0")
    assert held == "message 1 to 'sub' is not answered: 'low' holds it"
    assert ports.endswith(": 'in_msg_ready' of 'low', 'out_segment_valid' of 'low'")
    assert "'firm build robot:sys:low:0.1.0 --target lint' finds it" in check
    assert [*stalled(2, 2).notes(system, "robot:sys:low:0.1.0")] == []
