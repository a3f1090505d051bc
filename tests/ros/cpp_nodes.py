"""Real ROS for the generated nodes in C++: what compiles them, where they run, and the peers that speak to them."""

from __future__ import annotations

import base64
import ctypes.util
import itertools
import json
import math
import os
import queue
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import xmlrpc.client
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from types import TracebackType
from typing import Any, Self

import pytest

from tests.compilers import compile_program
from tests.node.drivers import HEADERS
from tests.processes import IGNORING_INTERRUPTS
from tests.shared import made_once

HERE = Path(__file__).resolve().parent
DEBIAN_PYTHON = "/usr/bin/python3"
# A venv with ROS 2 from wheels.
ROS2 = Path(os.environ.get("FIRM_ROS2") or Path(sys.prefix) / "ros2")
_OPTIONS = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-pthread"]
# What all nodes include, and the code in it that is the same for all.
_HEADER = "nodes.hpp"
_INSTANCE = "template int firm::run<firm::Ros{}>(const firm::System&, int, char**);\n"
_OBJECT = "nodes.o"
_PROGRAM = "compiled"
_ROS1_MODULES = ("rospy", "geometry_msgs", "sensor_msgs", "std_msgs")
_ROS2_LIBRARIES = (
    "rcl",
    "rcl_lifecycle",
    "lifecycle_msgs__rosidl_generator_c",
    "rcl_yaml_param_parser",
    "rcutils",
    "rmw",
    "rosidl_runtime_c",
)


@dataclass(frozen=True)
class Ros:
    """A version of ROS that is there: what compiles and links against it, what runs in it, and its own Python."""

    version: int
    python: str
    includes: tuple[str, ...]
    libraries: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)

    def compile(self, package: Path, program: Path | None) -> None:
        """Compile a node's package to `program`, or look only whether it would."""
        output = ["-fsyntax-only"] if program is None else ["-o", _PROGRAM, *self.libraries]
        sources = [str(path) for path in sorted((package / "src").glob("*.cpp"))]

        def made() -> list[str]:
            folder = made_once(f"ros{self.version}_nodes", self._precompile)
            return ["-include", str(folder / _HEADER), *([str(folder / _OBJECT)] if program else [])]

        compile_program([*self._command(package / "include"), *sources, *output], package, made)
        if program:
            shutil.move(package / _PROGRAM, program)

    def _precompile(self, folder: Path) -> None:
        """Compile what all nodes include, the longest part of each: a node itself is a table."""
        header, source, instance = folder / _HEADER, folder / "nodes.cpp", _INSTANCE.format(self.version)
        includes = f"#include <firm/ros{self.version}.hpp>\n#include <firm/ros_node.hpp>\n"
        header.write_text(f"{includes}extern {instance}", encoding="utf-8")
        source.write_text(instance, encoding="utf-8")
        for words in (
            ["-x", "c++-header", str(header), "-o", f"{header}.gch"],
            ["-include", str(header), "-c", str(source), "-o", str(folder / _OBJECT)],
        ):
            done = subprocess.run([*self._command(HEADERS), *words], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr[-4000:]

    def _command(self, headers: Path) -> list[str]:
        return ["g++", *_OPTIONS, "-I", str(headers), *self.includes]


@cache
def missing_ros1() -> str:
    """Why there is no ROS 1 here, or nothing."""
    for program in ("g++", "pkg-config", "rosmaster"):
        if not shutil.which(program):
            return f"{program} is not installed"
    if subprocess.run(["pkg-config", "--exists", "roscpp"], check=False).returncode:
        return "roscpp is not installed (libroscpp-dev)"
    modules = "; ".join(f"import {module}" for module in _ROS1_MODULES)
    if subprocess.run([DEBIAN_PYTHON, "-c", modules], capture_output=True, check=False).returncode:
        return f"{DEBIAN_PYTHON} lacks one of {', '.join(_ROS1_MODULES)}"
    return ""


def missing_ros2() -> str:
    """Why there is no ROS 2 here, or nothing."""
    if not shutil.which("g++"):
        return "g++ is not installed"
    if not (ROS2 / "include/rcl").is_dir():
        return f"{ROS2} is no environment with ROS 2 (FIRM_ROS2 names another one)"
    if not _libpython():
        return "libpython is not installed, which the wheels of ROS 2 need"
    return ""


def _libpython() -> str:
    """Some libraries of the wheels refer to Python, which a program in C++ is not."""
    version = next(iter(sorted((ROS2 / "lib").glob("python3.*"))), Path("python3")).name
    return ctypes.util.find_library(version) or ""


@contextmanager
def ros1(folder: Path, port: int | None = None) -> Iterator[Ros]:
    """ROS 1 as Debian has it, with a master of its own, at a free port unless one is given."""
    words = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "roscpp"], capture_output=True, text=True, check=True
    ).stdout.split()
    port = port or _free_port()
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder),
        "ROS_LOG_DIR": str(folder / "log"),
    }
    with (folder / "rosmaster.log").open("wb") as log:
        master = subprocess.Popen(
            ["rosmaster", "--core", "-p", str(port)], env=environment, stdout=log, stderr=subprocess.STDOUT
        )
        try:
            _wait_for_master(environment["ROS_MASTER_URI"])
            yield Ros(1, DEBIAN_PYTHON, (), tuple(words), environment)
        finally:
            master.terminate()
            master.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _free_domain() -> int:
    """A domain that nobody on this machine has joined, of those that leave Linux its ephemeral ports."""
    for number in range(100):
        domain = 1 + (os.getpid() + number) % 100
        with suppress(OSError), socket.socket(type=socket.SOCK_DGRAM) as probe:
            # The first participant's (DDSI-RTPS 2.2, 9.6.1.1).
            probe.bind(("127.0.0.1", 7410 + 250 * domain))
            return domain
    raise AssertionError("there is no free ROS domain")


def _wait_for_master(uri: str) -> None:
    master = xmlrpc.client.ServerProxy(uri)
    while True:
        with suppress(OSError):
            master.getSystemState("/test")
            return
        time.sleep(0.05)


def ros2(folder: Path) -> Ros:
    """ROS 2 out of wheels, on loopback and in a domain of its own."""
    libraries = [ROS2 / "lib", *sorted(ROS2.glob("lib/python3.*/site-packages/*.libs"))]
    environment = {
        **os.environ,
        "LD_LIBRARY_PATH": ":".join(map(str, libraries)),
        "LD_PRELOAD": _libpython(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(_free_domain()),
        "ROS_LOG_DIR": str(folder / "log"),
    }
    includes = [word for path in sorted((ROS2 / "include").iterdir()) for word in ("-isystem", str(path))]
    links = ["-L", str(ROS2 / "lib"), *(f"-l{name}" for name in _ROS2_LIBRARIES), "-Wl,--allow-shlib-undefined"]
    return Ros(2, str(ROS2 / "bin/python"), tuple(includes), tuple(links), environment)


def missing_ros(version: int) -> str:
    """Why this version of ROS is not here, or nothing."""
    return missing_ros1() if version == 1 else missing_ros2()


def running_ros(version: int, folder: Path) -> AbstractContextManager[Ros]:
    """A version of ROS that is here, for as long as it is wanted."""
    return ros1(folder) if version == 1 else nullcontext(ros2(folder))


class NodeProcess:
    """A node that runs; within a `with`, after which it is gone."""

    def __init__(self, log: Path, command: Sequence[str], environment: Mapping[str, str]) -> None:
        """What it prints goes to `log`. Like one that a script starts in its background, it has to listen to SIGINT."""
        self._path = log
        self._log = log.open("wb")
        self.process = subprocess.Popen(
            [*IGNORING_INTERRUPTS, *command], env=environment, stdout=self._log, stderr=subprocess.STDOUT
        )

    def said(self) -> str:
        """All that it has printed."""
        return self._path.read_text(encoding="utf-8", errors="replace")

    def stop(self, number: int = signal.SIGINT) -> int:
        """Ask it to end; its exit status."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        """Wait until it ends; its exit status."""
        return self.process.wait()

    def children(self) -> dict[str, int]:
        """The processes that it started, by their command lines."""
        lines = {Path(f"/proc/{number}/cmdline"): number for number in self._child_numbers()}
        return {path.read_bytes().replace(b"\0", b" ").decode(): number for path, number in lines.items()}

    def _child_numbers(self) -> list[int]:
        path = Path(f"/proc/{self.process.pid}/task")
        return [int(word) for task in path.iterdir() for word in (task / "children").read_text().split()]

    def kill_child(self, word: str) -> None:
        """Kill what it started with `word` in its command line."""
        (number,) = [number for line, number in self.children().items() if word in line]
        os.kill(number, signal.SIGKILL)

    def wait_until_said(self, text: str, times: int = 1) -> None:
        """Wait until it has printed a text so many times."""
        while self.said().count(text) < times:
            assert self.process.poll() is None, self.said()
            time.sleep(0.02)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            # Its bridge to ROS would still answer for the next node of the same name.
            ends = []
            for number in (self.process.pid, *self._child_numbers()):
                with suppress(ProcessLookupError):
                    ends.append(os.pidfd_open(number))
                    signal.pidfd_send_signal(ends[-1], signal.SIGKILL)
            for end in ends:
                select.select([end], [], [])
                os.close(end)
            self.process.wait()
        self._log.close()
        if error is not None:
            sys.stderr.write(self.said())


class Node(NodeProcess):
    """A node in C++."""

    def __init__(self, ros: Ros, program: Path, transport: str, *arguments: str) -> None:
        command = [str(program), "--transport", transport, *arguments]
        super().__init__(program.with_suffix(".log"), command, ros.environment)


class Peer:
    """A node of rospy or rclpy that publishes payloads and takes some (payload_peer.py)."""

    def __init__(self, ros: Ros, subscribed: Mapping[str, str], published: Mapping[str, str]) -> None:
        topics = map(json.dumps, (subscribed, published))
        command = [ros.python, str(HERE / "payload_peer.py"), str(ros.version), *topics]
        self._process = subprocess.Popen(
            command, env=ros.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._lines: queue.Queue[dict[str, Any]] = queue.Queue()
        # Messages that came while an echo was awaited.
        self._kept: deque[dict[str, Any]] = deque()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self._lines.put(json.loads(line))

    def wait_until_connected(self) -> None:
        assert self._lines.get() == {"connected": True}

    def publish(self, topic: str, payload: bytes, *, is_raw: bool = False) -> None:
        """Publish a message; in ROS 2, `is_raw` publishes these bytes, whatever is after the message in them."""
        assert self._process.stdin
        line = {"topic": topic, "payload": base64.b64encode(payload).decode(), **({"raw": True} if is_raw else {})}
        self._process.stdin.write(json.dumps(line) + "\n")
        self._process.stdin.flush()

    def publish_until_back(self, topic: str, payload: bytes) -> tuple[int, bytes]:
        """Publish a message until a payload comes: how often it was published, and that payload.

        A node that the peer has found may not have found the peer yet.
        """
        for count in itertools.count(1):
            self.publish(topic, payload)
            with suppress(queue.Empty):
                return count, base64.b64decode(self._lines.get(timeout=2)["payload"])
        raise AssertionError

    def wait_until_published(self) -> None:
        """Wait until it has published all."""
        self._echo("sync")

    def wait_until_acked(self) -> None:
        """Wait until every subscriber has received all, in ROS 2."""
        self._echo("acked")

    def _echo(self, word: str) -> None:
        assert self._process.stdin
        self._process.stdin.write(json.dumps({word: True}) + "\n")
        self._process.stdin.flush()
        while (line := self._lines.get()) != {word: True}:
            self._kept.append(line)

    def take(self) -> tuple[str, bytes]:
        """The next message: its topic and payload."""
        line = self._kept.popleft() if self._kept else self._lines.get()
        return line["topic"], base64.b64decode(line["payload"])

    def kill(self) -> None:
        """Let it die without a word."""
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> Peer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()


def check_angles(peer: Peer, source: Random, prefix: bytes) -> None:
    """Send a random quaternion, after a prefix, to the system quat2euler, and check the angles that it answers."""
    x, y, z, w = (source.gauss(0, 1) for _ in range(4))
    peer.publish("/QuaternionToEuler_sub", prefix + struct.pack("<4d", x, y, z, w))
    _, payload = peer.take()
    norm = x * x + y * y + z * z + w * w
    expected = (
        math.atan2(2 * (w * x + y * z), norm - 2 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x) / norm))),
        math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z)),
    )
    assert struct.unpack("<3d", payload[len(prefix) :]) == pytest.approx(expected, abs=1e-9)


def roscpp_peer(name: str, *packages: str) -> Path:
    """`<name>.cpp`, a peer of roscpp, compiled once in a run; `packages` of ROS are those that it needs besides."""

    def make(folder: Path) -> None:
        words = ["pkg-config", "--cflags", "--libs", *packages, "roscpp"]
        libraries = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
        source = str(HERE / f"{name}.cpp")
        compile_program(["g++", "-std=c++17", "-pthread", source, "-o", name, *libraries, "-lboost_thread"], folder)

    return made_once(f"roscpp/{name}", make) / name


class Client:
    """A client of a service or an action, which prints that it is ready, begins after a line, and prints results."""

    def __init__(self, ros: Ros, command: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            command, env=dict(ros.environment), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def line(self) -> str:
        assert self.process.stdout
        return self.process.stdout.readline()

    def begin(self) -> None:
        assert self.process.stdin
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def end(self) -> None:
        """Let it die without a word."""
        self.process.kill()
        self.process.wait()
