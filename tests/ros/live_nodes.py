"""`firm live` and generated nodes in Python as processes, for peers of real ROS."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.ros.cpp_nodes import NodeProcess, Ros

REPOSITORY = Path(__file__).resolve().parents[2]
SPECS = REPOSITORY / "specs"
PACED_PEER = str(Path(__file__).with_name("paced_peer.py"))
MODEL_SIMULATOR = REPOSITORY / "tests/node/model_simulator.py"


def model_address(*arguments: str) -> str:
    """The address of a model of hardware that sends back what it gets, at the end of a pipe."""
    return f"pipe:env PYTHONPATH={REPOSITORY} {sys.executable} {MODEL_SIMULATOR} {' '.join(arguments)}"


def specification(name: str, version: int, folder: Path) -> Path:
    """An application's specification in a version of ROS, with all that lies beside it."""
    copy = folder / f"{name}_ros{version}"
    spec = copy / f"{name}.yaml"
    if copy.exists():
        return spec
    shutil.copytree(SPECS / name, copy)
    if version == 2:
        text = spec.read_text(encoding="utf-8")
        spec.write_text(re.sub(r"\bmiddleware: ROS\b", "middleware: ROS2", text), encoding="utf-8")
    return spec


class LiveNode(NodeProcess):
    """A node in Python."""

    def __init__(self, ros: Ros, log: Path, command: Sequence[str], *ros_arguments: str) -> None:
        """`command` are the arguments of `firm`, or a generated node with its own; those of ROS come behind all."""
        is_script = command[0].endswith(".py")
        program = [] if is_script else ["-m", "fusesoc_firm.cli"]
        # What programs in C++ need of the wheels is not for our own Python.
        environment = {name: value for name, value in ros.environment.items() if not name.startswith("LD_")}
        environment["PYTHONPATH"] = os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")])
        line = [sys.executable, *program, *command, "--ros-python", ros.python, *ros_arguments]
        super().__init__(log, line, environment)

    def wait_until_ready(self) -> None:
        """Wait until it is a node of ROS, its simulator being built."""
        self.wait_until_said(" is a node of ROS ")


def paced(ros: Ros, rate: int, seconds: float, ways: Sequence[tuple[str, str]], *kind: str) -> list[dict[str, Any]]:
    """Quaternions at a rate to the first topic of each way; what came from its second one (paced_peer.py).

    Of the `kind` images, images of 1 MB.
    """
    command = [ros.python, PACED_PEER, str(ros.version), str(rate), str(seconds), json.dumps(ways), *kind]
    done = subprocess.run(command, env=dict(ros.environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found
