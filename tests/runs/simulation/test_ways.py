"""Messages that meet come in any order, but in order on each way."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.runs.simulation.answers import read_answers
from fusesoc_firm.runs.simulation.host_files import expected_text, stimulus_text
from fusesoc_firm.runs.simulation.reference import Response
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.runs.simulation.ways import MOST_WAYS, ways_of
from fusesoc_firm.system.derived.model import DerivedSystem
from tests.system.systems import converter, derived, specification

# Two subscribers meet at `both`; `one` also has its own publisher.
BLOCKS = (
    converter("one", "subscriber", "Point", "both", "alone")
    + converter("two", "subscriber", "Point", "both")
    + converter("both", "publisher", "Point")
    + converter("alone", "publisher", "Point")
)
# The subscriber of each message, and the publishers that respond.
TRAFFIC = [("one", ["both", "alone"]), ("two", ["both"]), ("one", ["both", "both", "alone"]), ("two", ["both"])]


@pytest.fixture
def system(tmp_path: Path) -> DerivedSystem:
    return derived(tmp_path, specification(BLOCKS))


def _traffic(system: DerivedSystem) -> tuple[list[Stimulus], list[Response]]:
    converters = {item.block: item for item in (*system.subscribers, *system.publishers)}
    stimuli, responses = [], []
    for cause, (name, publishers) in enumerate(TRAFFIC):
        message = {"x": float(cause), "y": 0.0, "z": 0.0}
        payload = encode_used(converters[name].frame, message)
        stimuli.append(Stimulus(converters[name], payload, message))
        for number, publisher in enumerate(publishers):
            answer = {**message, "z": float(number)}
            payload = encode_used(converters[publisher].frame, answer)
            responses.append(Response(converters[publisher], payload, answer, cause))
    return stimuli, responses


def test_only_messages_that_meet_have_ways(system: DerivedSystem) -> None:
    """A second response of one message has another way than the first one."""
    stimuli, responses = _traffic(system)
    assert ways_of(responses, stimuli, system) == [1, 0, 2, 1, 3, 0, 2]


def test_more_ways_than_the_host_knows_share_numbers(system: DerivedSystem) -> None:
    stimuli, responses = _traffic(system)
    ways = ways_of([responses[0]] * (MOST_WAYS + 2), stimuli, system)
    assert ways == [*range(1, MOST_WAYS + 1), 1, 2]


@pytest.mark.parametrize("order", [(0, 2, 3, 4, 6), (2, 0, 6, 3, 4), (0, 4, 2, 3, 6), (2, 6, 0, 3, 4)])
def test_an_answer_is_paired_with_its_message(tmp_path: Path, system: DerivedSystem, order: tuple[int, ...]) -> None:
    stimuli, responses = _traffic(system)
    ways = ways_of(responses, stimuli, system)
    both = [number for number, response in enumerate(responses) if response.publisher.block == "both"]
    (tmp_path / "stimulus.txt").write_text(stimulus_text(stimuli, system.subscribers))
    expected = expected_text([responses[k] for k in both], system.publishers, ways=[ways[k] for k in both])
    (tmp_path / "expected.txt").write_text(expected)
    frames = [pack_frame(0, responses[number].payload).hex() for number in order]
    (tmp_path / "received.txt").write_text("".join(f"< id 00\n  {frame}\n" for frame in frames))
    answers = read_answers(tmp_path, system.subscribers, system.publishers)
    assert [answer.cause for answer in answers] == [responses[number].cause for number in order]
    assert not any(answer.wrong for answer in answers)


def test_a_wrong_answer_is_compared_with_the_next_message(tmp_path: Path, system: DerivedSystem) -> None:
    stimuli, responses = _traffic(system)
    (tmp_path / "stimulus.txt").write_text(stimulus_text(stimuli, system.subscribers))
    expected = expected_text([responses[0], responses[2]], system.publishers, ways=[1, 2])
    (tmp_path / "expected.txt").write_text(expected)
    payload = encode_used(system.publishers[0].frame, {"x": 9.0, "y": 0.0, "z": 0.0})
    (tmp_path / "received.txt").write_text(f"< id 00\n  {pack_frame(0, payload).hex()}\n")
    (answer,) = read_answers(tmp_path, system.subscribers, system.publishers)
    assert [str(item) for item in answer.wrong.values()] == ["x: expected 0.0, got 9.0"]
