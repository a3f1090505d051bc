"""The main program of nodes in C++ ends with a reason and the status 1 when its hardware, ROS or a thread fails.

It runs with a middleware that fails where asked, before a model of the hardware; no ROS is needed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.node.drivers import Driver, cpp_driver

# The driver compiles for ten seconds.
pytestmark = pytest.mark.check

REPOSITORY = Path(__file__).parents[2]
MODEL = f"exec env PYTHONPATH={REPOSITORY} {sys.executable} {Path(__file__).with_name('model_simulator.py')} --width 64"
BROKEN = "the middleware is broken"


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("ros_node", sanitizers="")


def run(driver: Driver, fault: str, simulator: str = "") -> subprocess.CompletedProcess[str]:
    """A node that ends by itself."""
    command = [str(driver.program), "--transport", f"pipe:{MODEL} {simulator}"]
    environment = {**os.environ, "FAULT": fault}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def check_fault(done: subprocess.CompletedProcess[str], reason: str) -> None:
    """The node has ended by itself, with a reason, and when its threads have left the middleware alone."""
    assert (done.returncode, reason in done.stderr) == (1, True), done.stderr
    assert "the calls are stopped" in done.stderr
    assert "the middleware ends the node" not in done.stderr


def test_a_node_ends_with_its_middleware(driver: Driver) -> None:
    done = run(driver, "none")
    assert done.returncode == 0, done.stderr
    assert "driven_node: 1 received, 0 dropped, 1 sent, 1 published, 0 errors, 0 restarts, 0 lost" in done.stderr


@pytest.mark.parametrize(
    ("simulator", "reason"),
    [
        ("--fault exit --at 0", "the simulator ended with status 3"),
        ("--fault kill --at 0", "the simulator was killed by signal 9"),
        # After the message has come back, so the node has nothing to send.
        ("--fault later --at 0", "the simulator ended with status 5"),
    ],
)
def test_a_node_whose_simulator_dies_ends(driver: Driver, simulator: str, reason: str) -> None:
    check_fault(run(driver, "stay", simulator), reason)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("publish", f"a payload could not be published: {BROKEN}\n"),
        # In a thread of the node; its hardware still works.
        ("call", f"{BROKEN}\n"),
        ("answer", f"{BROKEN}\n"),
        ("connect", f"driven_node: {BROKEN}\n"),
        ("spin", f"driven_node: {BROKEN}\n"),
    ],
)
def test_a_node_whose_middleware_throws_ends(driver: Driver, fault: str, reason: str) -> None:
    """No exception leaves a thread, none is lost, and no thread calls a middleware that has ended."""
    check_fault(run(driver, fault), reason)
