"""`fusesoc_firm.System`: answers of a simulated system against its formula, its errors, and its end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from fusesoc_firm import Answer, CodecError, InputError, SimulationError, System
from fusesoc_firm.api.system import Run
from tests.hdl.ghdl import REPOSITORY

SPEC = REPOSITORY / "specs" / "quat2euler" / "quat2euler.yaml"
SUB, PUB = "QuaternionToEuler_sub", "QuaternionToEuler_pub"


@pytest.fixture(scope="module")
def system() -> System:
    return System(SPEC)


@pytest.fixture(scope="module")
def run(system: System) -> Iterator[Run]:
    with system.start() as run:
        yield run


def turned(angle: float) -> dict[str, float]:
    return {"z": math.sin(angle / 2), "w": math.cos(angle / 2)}


def test_a_system_has_the_codecs_of_its_inputs_and_outputs(system: System) -> None:
    assert (system.name, [*system.subscribers], [*system.publishers]) == ("quat2euler", [SUB], [PUB])
    assert (system.subscribers[SUB].name, system.publishers[PUB].ros) == ("geometry_msgs/Quaternion", 1)
    assert repr(system) == f"<system quat2euler: {SUB} to {PUB}>"


def test_answers_have_values_causes_and_cycles(run: Run) -> None:
    for number, angle in enumerate((0.25, -1.0)):
        (answer,) = run.send(SUB, turned(angle))
        assert answer.message["z"] == pytest.approx(angle, abs=1e-6)
        assert (answer.publisher, answer.cause, answer.seconds) == (PUB, number, None)
        assert answer.cycles
        assert answer.cycles > 100


def test_an_unknown_subscriber_and_a_wrong_message_are_reported(run: Run) -> None:
    with pytest.raises(InputError, match="'sub' is not a subscriber"):
        run.send("sub", {})
    with pytest.raises(InputError, match="is not a subscriber"):
        run.send(PUB, {})
    with pytest.raises(CodecError, match="has no field 'v'"):
        run.send(SUB, {"v": 1.0})
    # The run continues.
    assert run.send(SUB, turned(0.5))[0].message["z"] == pytest.approx(0.5, abs=1e-6)


def test_a_payload_of_wrong_length_is_an_error_of_the_simulation(run: Run) -> None:
    with pytest.raises(SimulationError, match=r"message \d+ to 'QuaternionToEuler_sub': the payload of"):
        run.send_payload(SUB, b"\0" * 31)
    assert run.send(SUB, turned(0.5))


def test_dictionaries_files_and_stalls_lead_to_the_same_answers(system: System, tmp_path: Path) -> None:
    stimuli = tmp_path / "stimuli.yaml"
    stimuli.write_text(f"- {SUB}: {turned(0.25)}\n- {SUB}: {turned(1.0)}\n")
    named = [{SUB: turned(0.25)}, {SUB: turned(1.0)}]
    found = [system.simulate(named), system.simulate(stimuli), system.simulate(named, seed=7, stall_percent=50)]
    assert found[0] == found[1]
    assert [[(item.cause, item.message) for item in answers] for answers in found] == [told(found[0])] * 3
    assert [item.cycles for item in found[2]] > [item.cycles for item in found[0]]


def told(answers: list[Answer]) -> list[tuple[int, dict[str, float]]]:
    assert len(answers) == 2
    return [(item.cause, item.message) for item in answers]


def test_a_killed_simulator_is_an_error_of_the_simulation(system: System) -> None:
    with system.start() as run:
        run._simulator.kill()
        with pytest.raises(SimulationError, match="simulator"):
            run.send(SUB, {})
        with pytest.raises(SimulationError, match="simulator"):
            run.close()
    with pytest.raises(SimulationError, match="has ended"):
        run.send(SUB, {})


def test_faults_are_reported_before_the_build(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fusesoc_firm.api.system.build_simulator", lambda *_: pytest.fail("built"))
    with pytest.raises(InputError, match="'sub' is not a subscriber"):
        system.simulate([{SUB: {}}, {"sub": {}}])
    with pytest.raises(InputError, match="do not exist"):
        system.simulate("missing.yaml")
    with pytest.raises(InputError, match=r"missing\.yaml"):
        System("missing.yaml")
