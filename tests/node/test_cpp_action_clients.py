"""The C++ client of actions, before the same events as the Python one: what it sends to the server and the hardware."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import pytest

from fusesoc_firm.node.engine.calls import MOST_WAITING
from tests.node.drivers import Driver, cpp_driver

# The messages of ROS 2: a goal that is accepted, one that is rejected, and a result with the state 4.
ACCEPTED, REJECTED = (f"00010000{word:02x}000000{'00' * 8}" for word in (1, 0))
SUCCEEDED = "000100000400000007000000"
# What the hardware receives of goals that have no result of a server: the states 0 and 5.
LOST, CANCELED = (f"put 2 00010000{state:02x}000000" for state in (0, 5))


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("action_client")


def goal(number: int, identity: bytes = bytes(16)) -> str:
    return f"goal 00010000{identity.hex()}{struct.pack('<i', number).hex()}"


def run(driver: Driver, lines: Sequence[str], limit: int = 60_000, version: int = 2) -> list[str]:
    return driver.answers(lines, str(version), str(limit))


def requests(events: Sequence[str], service: int) -> list[str]:
    """The ids in the calls of a service."""
    return [event.split()[3][8:40] for event in events if event.startswith(f"call {service} ")]


def test_a_goal_has_a_result(driver: Driver) -> None:
    lines = [goal(3), "await call 0, 1", f"answer 0 {ACCEPTED}", "await call 2, 1", f"answer 1 {SUCCEEDED}"]
    events = run(driver, [*lines, "await put, 1"])
    assert requests(events, 0) == requests(events, 2)
    assert events[-1] == f"put 2 {SUCCEEDED}"


def test_too_many_goals_are_lost_in_their_turn(driver: Driver) -> None:
    goals = [goal(number) for number in range(MOST_WAITING + 2)]
    lines = [goals[0], "await call 0, 1", *goals[1:], f"cancel 00010000{'00' * 24}", f"answer 0 {REJECTED}"]
    events = run(driver, [*lines, f"await put, {MOST_WAITING + 2}"])
    results = [event for event in events if event.startswith("put")]
    assert results == [LOST, *[CANCELED] * MOST_WAITING, LOST]


def test_goals_that_are_accepted_late_are_canceled(driver: Driver) -> None:
    """Each lost goal is canceled at once, and again when its server accepts it."""
    lines: list[str] = []
    for number in range(2):
        lines += [goal(number), f"await call 0, {number + 1}", f"await put, {number + 1}"]
    # The calls 1 and 3 are the first cancellations.
    events = run(driver, [*lines, f"answer 2 {ACCEPTED}", f"answer 0 {ACCEPTED}", "await call 1, 4"], 50)
    first, second = requests(events, 0)
    assert requests(events, 1) == [first, second, second, first]


def test_restarted_hardware_gets_nothing_of_goals_before(driver: Driver) -> None:
    lines = [goal(3), "await call 0, 1", f"answer 0 {ACCEPTED}", "await call 2, 1", "forget", "feedback 05000000"]
    events = run(
        driver, [*lines, f"answer 1 {SUCCEEDED}", goal(4), "await call 0, 2", f"answer 3 {REJECTED}", "await put, 1"]
    )
    assert [event for event in events if event.startswith("put")] == [LOST]
    fed = run(driver, [*lines[:4], "feedback 05000000", "await put, 1"])
    assert f"put 1 00010000{'00' * 16}05000000" in fed


def test_a_goal_that_is_not_accepted_yet_is_canceled_when_the_node_ends(driver: Driver) -> None:
    lines = [goal(3), "await call 0, 1", "give_up", "canceled 60000", f"answer 0 {ACCEPTED}", "await canceled, 1"]
    events = run(driver, lines)
    assert requests(events, 1) == requests(events, 0)
    # A server that does not answer is not waited for.
    assert "canceled" in run(driver, [goal(3), "await call 0, 1", "give_up", "canceled 50", "await canceled, 1"])


def test_a_goal_of_actionlib_is_canceled_early(driver: Driver) -> None:
    sent = f"goal {'00' * 28}03000000"
    states = f"states {'00' * 20}"
    events = run(driver, [states, sent, "await publish 0, 1", "give_up"], version=1)
    assert [event.split()[1] for event in events if event.startswith("publish")] == ["0", "1"]


def test_goals_until_a_time_are_canceled(driver: Driver) -> None:
    """A time in the past means no goal, and one in the future all of them."""
    times = [f"cancel 00010000{'00' * 16}{struct.pack('<II', second, 0).hex()}" for second in (1, 2**32 - 1)]
    lines = [goal(3), "await call 0, 1", f"answer 0 {ACCEPTED}", "await call 2, 1", times[0]]
    early = [event for event in run(driver, [*lines, goal(4)]) if event.startswith("call")]
    assert [event.split()[1] for event in early][:2] == ["0", "2"]
    events = run(driver, [*lines, times[1], "await call 1, 1"])
    assert requests(events, 1) == requests(events, 0)


def test_a_fault_in_the_thread_is_told(driver: Driver) -> None:
    events = run(driver, ["fault", goal(3), "await fault, 1"])
    assert events == ["fault the middleware is broken"]
