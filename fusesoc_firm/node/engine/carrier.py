"""A node's interface to the middleware, and the implementation for ROS: a process under ROS's Python."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, Protocol

from fusesoc_firm.node.bridge import channel as bridge
from fusesoc_firm.node.engine.ros_wheels import ros_python
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.interface.diagnostics import Report, diagnostics_payload, diagnostics_topic
from fusesoc_firm.node.interface.options import ROS_ARGUMENTS
from fusesoc_firm.node.interface.services import NodeService
from fusesoc_firm.node.interface.topics import NodeTopic

# For each version of ROS, a module that only the Python with that version can import.
# The variable with which ROS 2 selects its middleware.
_RMW = "RMW_IMPLEMENTATION"
_MODULES = {1: "rospy", 2: "rclpy"}
# The instructions to install ROS if it is missing.
_INSTALLATION = {
    1: "on Debian, 'apt-get install python3-rospy python3-rosmaster' installs ROS 1",
    2: "'firm ros install' installs ROS 2 beside fusesoc-firm",
}
# The folder of the bridge, which Python runs.
_BRIDGE = Path(bridge.__file__).parent
_END_SECONDS = 5.0


class CarrierError(Exception):
    """The middleware is missing, cannot do what the node requests, or has ended."""


@dataclass(frozen=True)
class Taken:
    """A message from the topic with this number; its arrival time is in ns of the system's monotonic clock."""

    topic: int
    payload: bytes
    time_ns: int


@dataclass(frozen=True)
class Published:
    """The time at which a message on the topic with this number was published; events follow the order of `publish`."""

    topic: int
    time_ns: int


@dataclass(frozen=True)
class Lost:
    """Messages of the topic with this number that were published, but that the middleware did not deliver."""

    topic: int
    count: int


@dataclass(frozen=True)
class Call:
    """A call of a service: its number, with which it is answered, and the payload of the request."""

    number: int
    payload: bytes


@dataclass(frozen=True)
class Answer:
    """The answer to a call: the payload of the response, or None if the call failed, for a `reason`."""

    payload: bytes | None = None
    reason: str = ""


@dataclass(frozen=True)
class Called:
    """A call, from ROS, of the service with this number."""

    service: int
    call: Call


@dataclass(frozen=True)
class Answered:
    """ROS's answer to the call with a `number`, of the hardware, of the service with this number."""

    service: int
    number: int
    answer: Answer


@dataclass(frozen=True)
class Wanted:
    """New values of parameters; `answer` takes the reason why they are refused, or an empty text."""

    values: Mapping[str, Any]
    answer: Callable[[str], None]


Event = Taken | Published | Lost | Called | Answered | Wanted


class Carrier(Protocol):
    """The topics of one middleware. Subscribers and publishers are numbered separately, as in the description."""

    def receive(self) -> Iterator[Event]:
        """Yield events until the carrier is closed or the middleware ends. May raise `CarrierError`."""

    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message; any thread may call this method. After the middleware has ended, messages are dropped."""

    def call(self, service: int, call: Call) -> None:
        """Call a service; an `Answered` follows, unless the middleware ends. Any thread may call this method."""

    def answer(self, service: int, number: int, answer: Answer) -> None:
        """Answer a `Called`; any thread may call this method."""

    def diagnose(self, report: Report) -> None:
        """Publish a report on `/diagnostics`."""

    def stop(self) -> None:
        """Accept no more messages."""

    def wait_until_stopped(self, timeout: float) -> bool:
        """Wait until `receive` has yielded all messages accepted before `stop`.

        Return False after `timeout` seconds.
        """

    def close(self) -> None:
        """End the carrier after all published messages have been sent."""


@dataclass(frozen=True)
class RosOptions:
    """The options of a node's ROS process.

    `arguments` are arguments to ROS, such as remappings. `depth`, in messages, and `is_reliable` are for all topics; if
    they are None, each topic has its own. `python` is the interpreter for which ROS is installed; if it is None, the
    carrier searches for an interpreter. With `is_managed`, a node of ROS 2 has lifecycle states. `parameters` are the
    first values of the hardware's parameters.
    """

    name: str
    arguments: tuple[str, ...] = ()
    depth: int | None = None
    is_reliable: bool | None = None
    is_timed: bool = False
    python: str | None = None
    is_managed: bool = False
    parameters: Mapping[str, Any] = field(default_factory=dict)


class RosCarrier:
    """A process that is a node of a running ROS; see `Carrier`."""

    def __init__(self, ros: int, description: NodeDescription, options: RosOptions) -> None:
        """Start the process and wait until the ROS node is ready; with ROS 1, wait for the master.

        May raise `CarrierError`.
        """
        self.title = f"ROS {ros}"
        self._ros = ros
        self._python = options.python or _python_of(ros)
        mine, its = socket.socketpair()
        arguments = [*ros_arguments(ros, options.arguments)]
        # In a separate session, the bridge does not receive Ctrl-C: it must still publish the last responses.
        try:
            self._process = subprocess.Popen(
                [self._python, str(_BRIDGE), str(its.fileno()), *arguments],
                pass_fds=[its.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )
        except OSError as error:
            mine.close()
            raise CarrierError(
                f"{self._python}, the Python for {self.title}, cannot be started: {error.strerror}"
            ) from None
        finally:
            its.close()
        self._channel = bridge.Channel(mine)
        self._stopped = threading.Event()
        self._is_closing = False
        configuration = {
            "ros": ros,
            "name": options.name,
            "is_timed": options.is_timed,
            "is_managed": options.is_managed,
            "subscribers": _numbered(ros, description.taken_topics, len(description.subscribers), options),
            "publishers": _numbered(ros, description.given_topics, len(description.publishers), options),
            "services": _services(ros, description.all_services),
            "groups": [*_groups(ros, description)],
            "parameters": [*_parameters(description, options)],
            "diagnostics": {"number": bridge.DIAGNOSTICS, **asdict(diagnostics_topic(ros))},
        }
        try:
            # If the process has ended already, its fault is found next.
            with suppress(OSError):
                self._channel.send(bridge.CONFIGURE, data=json.dumps(configuration).encode())
            self.subscribers, self.publishers, self.services = self._wait_until_ready()
        except BaseException:
            self._end(0)
            raise

    def _wait_until_ready(self) -> tuple[dict[int, str], dict[int, str], dict[int, str]]:
        """Wait for the bridge; return the names of subscribed topics, published topics and services."""
        parcel = self._channel.receive()
        if parcel is None or parcel.kind == bridge.FAULT:
            module = _MODULES[self._ros]
            if not _can_import(self._python, module):
                _check_middleware(self._ros, [self._python])
                raise CarrierError(
                    f"{self._python} cannot import {module}, which {self.title} installs; {_INSTALLATION[self._ros]}"
                )
            raise self._fault(parcel)
        names = json.loads(parcel.data)
        subscribers, publishers, services = (
            {int(number): name for number, name in names[kind].items()}
            for kind in ("subscribers", "publishers", "services")
        )
        return subscribers, publishers, services

    def receive(self) -> Iterator[Event]:
        """Yield events until the carrier is closed or ROS requests the end of the node. May raise `CarrierError`."""
        try:
            while parcel := self._channel.receive():
                if parcel.kind == bridge.MESSAGE:
                    if not self._stopped.is_set():
                        yield Taken(parcel.topic, parcel.data, parcel.time_ns)
                elif parcel.kind == bridge.PUBLISHED:
                    yield Published(parcel.topic, parcel.time_ns)
                elif parcel.kind == bridge.LOST:
                    yield Lost(parcel.topic, int(parcel.data))
                elif parcel.kind in (bridge.CALL, bridge.ANSWER, bridge.PARAMETERS):
                    yield self._request(parcel)
                elif parcel.kind == bridge.DONE:
                    self._stopped.set()
                elif parcel.kind == bridge.STOP:
                    return
                else:
                    raise self._fault(parcel)
            if not self._is_closing:
                raise self._fault(None)
        finally:
            self._stopped.set()

    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message."""
        self._send(bridge.MESSAGE, topic, payload)

    def call(self, service: int, call: Call) -> None:
        """Call a service."""
        self._send(bridge.CALL, service, bridge.pack_call(call.number, call.payload))

    def answer(self, service: int, number: int, answer: Answer) -> None:
        """Answer a call."""
        self._send(bridge.ANSWER, service, bridge.pack_answer(number, answer.payload, answer.reason))

    def _request(self, parcel: bridge.Parcel) -> Called | Answered | Wanted:
        if parcel.kind != bridge.PARAMETERS:
            return _event_of_service(parcel)
        request = json.loads(parcel.data)
        return Wanted(request["values"], partial(self._answer_parameters, request["number"]))

    def _answer_parameters(self, number: int, reason: str) -> None:
        self._send(bridge.PARAMETERS, data=json.dumps({"number": number, "reason": reason}).encode())

    def diagnose(self, report: Report) -> None:
        """Publish a report on `/diagnostics`."""
        self._send(bridge.MESSAGE, bridge.DIAGNOSTICS, diagnostics_payload(self._ros, report))

    def log(self, level: int, text: str) -> None:
        """Put a line into ROS's log, with a level of `logging`; the terminal does not show it again."""
        self._send(bridge.LOG, level, text.encode())

    def stop(self) -> None:
        """Accept no more messages."""
        self._send(bridge.STOP)

    def wait_until_stopped(self, timeout: float) -> bool:
        """Wait until all accepted messages are handed over; return False after `timeout` seconds."""
        return self._stopped.wait(timeout)

    def close(self) -> None:
        """End the process after all published messages have been sent."""
        self._end(_END_SECONDS)

    def _send(self, kind: bytes, topic: int = 0, data: bytes = b"") -> None:
        try:
            self._channel.send(kind, topic, data)
        except OSError:
            # The bridge has ended; `receive` reports this.
            return

    def _end(self, seconds: float) -> None:
        self._is_closing = True
        self._channel.finish()
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._channel.close()

    def _fault(self, parcel: bridge.Parcel | None) -> CarrierError:
        if parcel is None:
            return CarrierError(f"the process for {self.title} ({self._python}) has ended")
        return CarrierError(f"{self.title}: {parcel.data.decode(errors='replace')}")


def _event_of_service(parcel: bridge.Parcel) -> Called | Answered:
    if parcel.kind == bridge.CALL:
        return Called(parcel.topic, Call(*bridge.unpack_call(parcel.data)))
    number, payload, reason = bridge.unpack_answer(parcel.data)
    return Answered(parcel.topic, number, Answer(payload, reason))


def _numbered(ros: int, topics: Sequence[NodeTopic], blocks: int, options: RosOptions) -> list[dict[str, object]]:
    """Return the topics of a version of ROS with their numbers; the options concern the first ones, those of blocks."""
    given = {"depth": options.depth, "is_reliable": options.is_reliable}
    common = {name: value for name, value in given.items() if value is not None}
    return [
        {"number": number, **asdict(topic), **(common if number < blocks else {})}
        for number, topic in enumerate(topics)
        if topic.ros == ros
    ]


def _parameters(description: NodeDescription, options: RosOptions) -> Iterator[dict[str, object]]:
    """Yield the parameters with the values in effect."""
    for item in description.parameters:
        parameter = item.parameter
        yield {
            "name": item.name,
            "type": parameter.type.name,
            "value": options.parameters.get(item.name, parameter.default),
            "least": parameter.least,
            "most": parameter.most,
            "description": f"{parameter.type.name} of the accelerator '{item.block}': {parameter.range}",
        }


def _groups(ros: int, description: NodeDescription) -> Iterator[dict[str, list[int]]]:
    """Yield the numbers of each action client's topics; the first subscriber, of states, detects a server."""
    number, given = len(description.subscribers), len(description.publishers)
    for action in description.actions:
        if action.ros == ros and not action.is_server:
            yield {
                "subscribers": [*range(number, number + len(action.subscribers))],
                "publishers": [*range(given, given + len(action.publishers))],
            }
        number += len(action.subscribers)
        given += len(action.publishers)


def _services(ros: int, services: Sequence[NodeService]) -> list[dict[str, object]]:
    found = [(number, asdict(service)) for number, service in enumerate(services) if service.ros == ros]
    # Bytes are not part of JSON, and the bridge needs no failures.
    return [{"number": number, **{name: item[name] for name in item if name != "failure"}} for number, item in found]


def ros_arguments(ros: int, arguments: Sequence[str]) -> Iterator[str]:
    """Yield the arguments to ROS in the form of its version: NAME:=VALUE for both, all after `--ros-args` for ROS 2."""
    words = iter(arguments)
    if ros == 2:
        yield ROS_ARGUMENTS
    for word in words:
        if word == ROS_ARGUMENTS:
            yield from words if ros == 2 else ()
            return
        yield from ("-r", word) if ros == 2 else (word,)


@cache
def _python_of(ros: int) -> str:
    """Return the path of the first Python that can import the modules of ROS. May raise `CarrierError`."""
    module = _MODULES[ros]
    found = [shutil.which("python3"), "/usr/bin/python3", sys.executable, str(ros_python())]
    candidates = [path for path in dict.fromkeys(found) if path and Path(path).exists()]
    for path in candidates:
        # An installed interpreter is not sufficient, since the sourced ROS may be for another Python.
        if _can_import(path, module):
            return path
    _check_middleware(ros, candidates)
    raise CarrierError(
        f"no Python found here can import {module}, which ROS {ros} installs: {', '.join(candidates)};"
        f" {_INSTALLATION[ros]}; if ROS is installed, source its setup file, or select its Python with --ros-python"
    )


def _check_middleware(ros: int, pythons: Iterable[str]) -> None:
    """Raise `CarrierError` if the middleware in the environment is the reason why these Pythons do not import ROS 2."""
    chosen = os.environ.get(_RMW, "")
    without = {name: value for name, value in os.environ.items() if name != _RMW}
    if ros == 2 and chosen and any(_can_import(path, _MODULES[ros], without) for path in pythons):
        package = chosen.replace("_", "-")
        raise CarrierError(
            f"{_RMW}={chosen} in the environment selects a middleware of ROS 2 that is not installed: install it"
            f" (package ros-<distribution>-{package}), or unset the variable: unset {_RMW}"
        )


def _can_import(python: str, module: str, environment: Mapping[str, str] | None = None) -> bool:
    command = [python, "-c", f"import {module}"]
    return not subprocess.run(command, env=environment, capture_output=True, check=False).returncode
