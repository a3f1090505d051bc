"""The node's C++ engine with the simulator of a system, as built by `firm simulator`."""

from __future__ import annotations

import random
import shlex
import shutil
import struct
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.transport.built_simulator import BuiltSimulator, build_simulator
from tests.house.test_live_simulators import SPECS, answers
from tests.node.drivers import Driver, cpp_driver
from tests.node.test_cpp_node import puts, run
from tests.seeds import seeded

pytestmark = pytest.mark.check
SEED = seeded(20261126)
# Each simulator is built in one process.
TOOLS = [
    pytest.param(
        tool,
        marks=[
            pytest.mark.skipif(shutil.which(tool) is None, reason=f"{tool} is not installed"),
            pytest.mark.xdist_group(f"cpp_node_live_{tool}"),
        ],
    )
    for tool in ("ghdl", "verilator")
]


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("node")


@pytest.fixture(scope="module", params=TOOLS)
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> BuiltSimulator:
    spec = SPECS / "quat2euler" / "quat2euler.yaml"
    return build_simulator(spec, request.param, build_root=tmp_path_factory.mktemp("live"))


def quaternions(count: int) -> list[bytes]:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    return [struct.pack("<4d", *(source.uniform(-1, 1) for _ in range(4))) for _ in range(count)]


def test_a_node_gets_the_simulator_s_answers(driver: Driver, built: BuiltSimulator) -> None:
    """The same bytes in lock-step with Python and asynchronously with the node, with stalls."""
    payloads = quaternions(20)
    outcome = run(
        driver,
        puts([(0, payload) for payload in payloads]),
        f"pipe:{shlex.quote(str(built.script(seed=3, stall_percent=25)))}",
        converters=1,
        drain=60000,
    )
    assert outcome.said["status"] == "0", outcome.said
    expected, _ = answers(built, [pack_frame(0, payload) for payload in payloads], (1, 8), 20)
    assert [pack_frame(0, payload) for payload in outcome.published[0]] == expected
    assert len(expected) == 20 and outcome.count("errors") == 0


def test_a_payload_that_is_too_short_is_an_error_and_the_rest_goes_on(driver: Driver, built: BuiltSimulator) -> None:
    (payload,) = quaternions(1)
    address = f"pipe:{shlex.quote(str(built.script()))}"
    messages = [(0, payload[:7]), (0, payload)]
    outcome = run(driver, puts(messages), address, converters=1, drain=60000)
    assert outcome.said["status"] == "0" and outcome.count("errors") == 1
    assert len(outcome.published[0]) == 1
    assert outcome.log[0].startswith("converter 0 reports an error in cycle ")


def test_a_simulator_that_is_killed_ends_the_node_or_is_started_again(
    driver: Driver, built: BuiltSimulator, tmp_path: Path
) -> None:
    """The simulator is killed after some reports, while other frames are in flight. The next one survives."""
    paths = (built.script(), tmp_path / "mark", tmp_path / "reports")
    script, mark, reports = (shlex.quote(str(path)) for path in paths)
    command = (
        f"if test -e {mark}; then exec {script}; fi; touch {mark}; rm -f {reports}; mkfifo {reports}; exec 2>/dev/null;"
        # Byte by byte, since the node sends more only after it has read the reports.
        f" {script} 4>{reports} & child=$!; {{ dd bs=1 count=600; kill -9 $child; cat; }} <{reports} 3<&- >&4 4>&- &"
        " wait $child; status=$?; wait; exit $status"
    )
    lines = puts([(0, payload) for payload in quaternions(100)])
    died = run(driver, lines, f"pipe:{command}", converters=1, drain=60000)
    assert died.said["status"] == "1"
    assert died.said["error"] == "the simulator ended with status 137 (signal 9)"
    assert 0 < len(died.published[0]) < 20
    (tmp_path / "mark").unlink()
    again = run(driver, [*lines[:30], "await 20"], f"pipe:{command}", converters=1, restarts=1, drain=60000)
    assert again.said["status"] == "0" and again.count("restarts") == 1
    assert len(again.published[0]) >= 20
