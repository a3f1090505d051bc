"""A version of ROS that runs, and a folder for what a module of tests makes there, such as nodes in C++."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet

from fusesoc_firm.cli import main
from fusesoc_firm.node.transport.built_simulator import build_simulator
from tests.node.model_simulator import Gate
from tests.ros.cpp_nodes import Node, NodeProcess, Ros, missing_ros, running_ros
from tests.ros.live_nodes import LiveNode


@dataclass
class Place:
    """A version of ROS that runs, and a folder; each node in C++ is compiled once."""

    ros: Ros
    folder: Path
    programs: dict[Path, Path] = field(default_factory=dict)

    @property
    def version(self) -> int:
        return self.ros.version

    @property
    def gate(self) -> Gate:
        """The gate of a model that waits."""
        return Gate(self.folder / "gate")

    def program(self, spec: Path) -> Path:
        """The node of a system in C++."""
        if spec not in self.programs:
            package = self.folder / f"{spec.stem}_package"
            command = ["system", "node", str(spec), "--language", "cpp", "--ros", str(self.version)]
            assert main([*command, "-o", str(package)]) == 0
            self.programs[spec] = self.folder / f"{spec.stem}_node"
            self.ros.compile(package, self.programs[spec])
        return self.programs[spec]

    def simulator(self, spec: Path) -> str:
        """The address of a system's VHDL in GHDL."""
        return f"pipe:{build_simulator(spec, 'ghdl', build_root=self.folder / 'simulators').script()}"

    def node_of(self, spec: Path, language: str, transport: str) -> NodeProcess:
        """The node of a system, in Python or C++."""
        if language == "cpp":
            return Node(self.ros, self.program(spec), transport, "--drain", "100")
        return LiveNode(self.ros, self.folder / "node.log", ["live", str(spec), "--transport", transport])


def wait_until_reached(gate: Gate, node: NodeProcess) -> None:
    """Wait until the model of a node's hardware waits."""
    while not gate.reached.exists():
        assert node.process.poll() is None, node.said()
        time.sleep(0.02)


def versions(name: str) -> list[ParameterSet]:
    """The parameters of a module's fixture, the versions of ROS; each stays in one process of the test run."""
    return [
        pytest.param(version, marks=pytest.mark.xdist_group(f"{name}_{version}"), id=f"ros{version}")
        for version in (1, 2)
    ]


@contextmanager
def running(request: pytest.FixtureRequest, factory: pytest.TempPathFactory) -> Iterator[tuple[Ros, Path]]:
    """The fixture's version of ROS and a new folder; the test is skipped where ROS is missing."""
    folder = factory.mktemp(f"ros{request.param}")
    if reason := missing_ros(request.param):
        pytest.skip(reason)
    with running_ros(request.param, folder) as ros:
        yield ros, folder


@contextmanager
def diagnoses(ros: Ros, name: str) -> Iterator[Iterator[dict[str, int]]]:
    """The counts of a part of the system that are published on /diagnostics, one after another."""
    command = [ros.python, str(Path(__file__).with_name("diagnostics_peer.py")), str(ros.version)]
    with subprocess.Popen(command, env=dict(ros.environment), stdout=subprocess.PIPE, text=True) as peer:
        try:
            assert peer.stdout
            reports = map(json.loads, peer.stdout)
            own = (report["values"] for report in reports if report["name"] == name)
            yield ({key: int(value) for key, value in values.items()} for values in own)
        finally:
            peer.kill()


class LogPeer:
    """A node of ROS that reads the log."""

    def __init__(self, ros: Ros) -> None:
        command = [ros.python, str(Path(__file__).with_name("log_peer.py")), str(ros.version)]
        self._process = subprocess.Popen(command, env=dict(ros.environment), stdout=subprocess.PIPE, text=True)
        self.lines: list[dict[str, Any]] = []

    def wait_until_connected(self) -> None:
        """Wait until it has the log of a node."""
        while self._next() != {"connected": True}:
            pass

    def wait_for(self, text: str) -> dict[str, Any]:
        """The first line that contains a text."""
        while not (found := [line for line in self.lines if text in line["text"]]):
            self._next()
        return found[0]

    def _next(self) -> dict[str, Any]:
        assert self._process.stdout
        line: dict[str, Any] = json.loads(self._process.stdout.readline())
        if "text" in line:
            self.lines.append(line)
        return line

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()


@contextmanager
def log_of(ros: Ros) -> Iterator[LogPeer]:
    """A peer with the log of the node that runs."""
    peer = LogPeer(ros)
    try:
        peer.wait_until_connected()
        yield peer
    finally:
        peer.kill()
