"""The parts of a bridge that both versions of ROS share."""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import queue
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from .channel import ANSWER, CALL, LOST, MESSAGE, PARAMETERS, READY, Channel, pack_answer, pack_call, unpack_answer

# The maximum time in s to wait until published messages have been sent.
FLUSH_SECONDS = 2.0
# The interval in s at which the types of other nodes' topics are compared.
LOOK_SECONDS = 1.0
# The time in s that the engine has to set parameters.
PARAMETER_SECONDS = 10.0
# The name of a node of which ROS 2 has found only the topics so far.
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"

KINDS = ("subscribers", "publishers")


class BridgeError(Exception):
    """ROS cannot do what the node requests."""


class Gaps:
    """The numbers of a topic's messages; each publisher counts separately."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def missing(self, publisher: str, number: int) -> int:
        """Return how many messages are missing before the message with this number; a restart is not a gap."""
        last = self._last.get(publisher, number)
        self._last[publisher] = number
        return max(0, number - last - 1)

    def forget(self) -> None:
        """Begin with the next message."""
        self._last.clear()


class Ends:
    """The ends of topics, each of which is reported once, and not before the name of its node may be known."""

    def __init__(self) -> None:
        self._told: set[bytes] = set()
        self._nameless: set[bytes] = set()

    def is_due(self, end: bytes, node: str) -> bool:
        """Return whether to report an end now."""
        is_new_and_nameless = node == _UNKNOWN_NODE and end not in self._nameless
        if end in self._told or is_new_and_nameless:
            self._nameless.add(end)
            return False
        self._told.add(end)
        return True


class Ros(ABC):
    """The parts of a ROS node that both versions of ROS share."""

    def __init__(self, config: dict[str, Any], channel: Channel) -> None:
        self._config = config
        self._channel = channel
        self._is_taking = True
        self._is_ready = threading.Event()
        self._ended = threading.Event()
        self._reported: set[str] = set()
        self._servers = {item["number"]: item for item in config["services"] if item["is_server"]}
        self._clients = {item["number"]: item for item in config["services"] if not item["is_server"]}
        # The unanswered calls of the hardware's services, by number.
        self._asked: dict[int, Any] = {}
        self._call_numbers = itertools.count()
        # The requests to set parameters without an answer, by number.
        self._wanted: dict[int, queue.Queue[str]] = {}

    def set_parameters(self, values: dict[str, Any]) -> str:
        """Let the engine set parameters; return the reason of a refusal, or an empty text."""
        self._is_ready.wait()
        number = next(self._call_numbers)
        answer = self._wanted[number] = queue.Queue()
        try:
            self._channel.send(PARAMETERS, data=json.dumps({"number": number, "values": values}).encode())
            return answer.get(timeout=PARAMETER_SECONDS)
        except OSError:
            return "the node is ending"
        except queue.Empty:
            return "the hardware did not answer"
        finally:
            del self._wanted[number]

    def parameters_set(self, data: bytes) -> None:
        """Pass on the engine's answer to `set_parameters`."""
        answer = json.loads(data)
        if answer["number"] in self._wanted:
            self._wanted[answer["number"]].put(answer["reason"])

    def ask(self, service: int, payload: bytes, asker: Any) -> bool:
        """Hand over a call of the hardware's service; return whether it will be answered, through `asker`."""
        self._is_ready.wait()
        number = next(self._call_numbers)
        self._asked[number] = asker
        try:
            if self._is_taking:
                self._channel.send(CALL, service, pack_call(number, payload))
                return True
        except OSError:
            self._is_taking = False
        del self._asked[number]
        return False

    def answer(self, service: int, data: bytes) -> None:
        """Answer a call of the hardware's service."""
        number, payload, reason = unpack_answer(data)
        asker = self._asked.pop(number, None)
        if asker is not None:
            self.answer_asker(service, asker, payload, reason)

    def give_answer(self, service: int, number: int, payload: bytes | None, reason: str = "") -> None:
        """Hand over the answer to a call by the hardware."""
        with contextlib.suppress(OSError):
            self._channel.send(ANSWER, service, pack_answer(number, payload, reason))

    @abstractmethod
    def answer_asker(self, service: int, asker: Any, payload: bytes | None, reason: str) -> None:
        """Answer a call; without a payload, the call fails."""

    @abstractmethod
    def call(self, service: int, number: int, payload: bytes) -> None:
        """Call a service for the hardware; do not wait for the answer."""

    def ready(self) -> None:
        """Hand over messages; rospy may have received some, such as latched ones, before the engine expects them."""
        self._channel.send(READY, data=json.dumps(self.names()).encode())
        self._is_ready.set()

    def take(self, topic: int, payload: bytes) -> None:
        """Hand over a message; block until the engine accepts it."""
        self._hand_over(MESSAGE, topic, payload)

    def lose(self, topic: int, count: int) -> None:
        """Report messages that ROS did not deliver."""
        if count:
            self._hand_over(LOST, topic, str(count).encode())

    def _hand_over(self, kind: bytes, topic: int, data: bytes) -> None:
        self._is_ready.wait()
        if not self._is_taking:
            return
        try:
            self._channel.send(kind, topic, data, time.monotonic_ns())
        except OSError:
            self._is_taking = False

    def report(self, text: str) -> None:
        """Report a text to the user, once."""
        if text not in self._reported:
            self._reported.add(text)
            self.warn(text)

    def warn(self, text: str) -> None:
        """Print a text for the user, and put it into ROS's log."""
        print(text, file=sys.stderr, flush=True)
        self.log(logging.WARNING, text)

    def refused(self, names: Iterable[str], reason: str) -> None:
        """Report parameters that are not set, by their names in ROS."""
        self.warn(f"the parameter {', '.join(names)} is not set: {reason}")

    @abstractmethod
    def log(self, level: int, text: str) -> None:
        """Put a line that the terminal shows into ROS's log, with a level of `logging`; any thread may call it."""

    def end(self) -> None:
        """Make `spin` return; any thread may call it."""
        self._ended.set()

    @abstractmethod
    def names(self) -> dict[str, dict[int, str]]:
        """Return the names of the topics after remapping."""

    @abstractmethod
    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message."""

    @abstractmethod
    def stop(self) -> None:
        """Accept no more messages, and send DONE when all messages accepted so far are handed over."""

    @abstractmethod
    def spin(self) -> None:
        """Handle messages until `end` is called."""

    @abstractmethod
    def close(self) -> None:
        """Wait until published messages have been sent, then shut the ROS node down."""


def type_report(node: str, verb: str, topic: str, its: str, ours: str) -> str:
    """Return the report of a node that uses a topic with another type."""
    return f"{node} {verb} {topic} with the type {its}, which is {ours} here; no messages are exchanged"
