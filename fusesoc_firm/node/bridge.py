"""The ROS process of a Python node, which carries serialised messages between ROS topics and a socket.

The bridge runs under the Python for which ROS is installed. That is rarely the Python that runs this package, so the
bridge is a separate program, which needs only ROS and the standard library of Python 3.8. `node/carrier.py` starts the
bridge.

    python3 bridge.py SOCKET [ARGUMENT OF ROS ...]         # SOCKET is a file descriptor, a stream of parcels
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import logging
import os
import queue
import socket
import struct
import sys
import threading
import time
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, NamedTuple

# CONFIGURE, to the bridge: its configuration. READY, from the bridge: the names of the topics after remapping.
CONFIGURE, READY = b"C", b"R"
# MESSAGE, in both directions: a message from a topic, or a message to publish. PUBLISHED, from the bridge, on request:
# the message is published.
MESSAGE, PUBLISHED = b"M", b"P"
# LOST, from the bridge: the number of messages of a topic that ROS did not deliver, as text.
LOST = b"L"
# CALL, from the bridge: a call of the hardware's service; to the bridge: a call by the hardware. ANSWER, the other way:
# the answer to a call. The topic is the number of the service.
CALL, ANSWER = b"Q", b"A"
# The number of the topic `/diagnostics`.
DIAGNOSTICS = 0xFFFF
# STOP, to the bridge: accept no more messages. From the bridge: ROS asks the node to end.
STOP = b"S"
# DONE, from the bridge: all messages accepted before STOP are handed over. FAULT, from the bridge: the error that ended
# the bridge.
DONE, FAULT = b"D", b"E"

# The kind, the number of the topic, a time of the system's monotonic clock in ns, and the number of bytes that follow.
_HEADER = struct.Struct("<cHqI")
# The number of a call; whether it was answered.
_CALL, _ANSWER = struct.Struct("<Q"), struct.Struct("<Q?")
# The maximum time in s to wait until published messages have been sent.
_FLUSH_SECONDS = 2.0
# The capacity of the queues of services, in messages. Each client of ROS 2 receives the responses to all clients, so
# the default of 10 is too few on a busy machine.
_SERVICE_DEPTH = 1000
# The interval in s at which the types of other nodes' topics are compared.
_LOOK_SECONDS = 1.0
# The name of a node of which ROS 2 has found only the topics so far.
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"


def pack_call(number: int, payload: bytes) -> bytes:
    """Return the data of a CALL."""
    return _CALL.pack(number) + payload


def unpack_call(data: bytes) -> tuple[int, bytes]:
    """Return the number and the payload of a CALL."""
    return _CALL.unpack_from(data)[0], data[_CALL.size :]


def pack_answer(number: int, payload: bytes | None, reason: str = "") -> bytes:
    """Return the data of an ANSWER; without a payload, the call has failed for a reason."""
    return _ANSWER.pack(number, payload is not None) + (reason.encode() if payload is None else payload)


def unpack_answer(data: bytes) -> tuple[int, bytes | None, str]:
    """Return the number, the payload and the reason of an ANSWER."""
    number, is_answered = _ANSWER.unpack_from(data)
    rest = data[_ANSWER.size :]
    return (number, rest, "") if is_answered else (number, None, rest.decode(errors="replace"))


class Parcel(NamedTuple):
    """The unit of transfer over the socket."""

    kind: bytes
    topic: int
    time_ns: int
    data: bytes


class Channel:
    """One end of the socket. Any thread may send; only one may receive."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._file = end.makefile("rb", 1 << 16)
        self._lock = threading.Lock()

    def send(self, kind: bytes, topic: int = 0, data: bytes = b"", time_ns: int = 0) -> None:
        """Send a parcel; block while the other end does not read. Raise OSError if the other end is closed."""
        header = _HEADER.pack(kind, topic, time_ns, len(data))
        with self._lock:
            if len(data) < 1 << 16:
                self._socket.sendall(header + data)
            else:
                self._socket.sendall(header)
                self._socket.sendall(data)

    def receive(self) -> Parcel | None:
        """Return the next parcel, or None if the other end is closed, even in the middle of a parcel."""
        try:
            header = self._file.read(_HEADER.size)
            if len(header) < _HEADER.size:
                return None
            kind, topic, time_ns, size = _HEADER.unpack(header)
            data = self._file.read(size)
        except (OSError, ValueError):  # ValueError: this end is closed.
            return None
        return None if len(data) < size else Parcel(kind, topic, time_ns, data)

    def finish(self) -> None:
        """Close the sending direction; the other end sees the end of the stream."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def is_closed(self) -> bool:
        """Return whether the other end is closed and nothing is left to receive."""
        try:
            return not self._socket.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def close(self) -> None:
        """Close this end and wake all threads that wait for data from the socket."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        # The socket stays open until its file is closed.
        self._file.close()
        self._socket.close()


class BridgeError(Exception):
    """ROS cannot do what the node requests."""


class Gaps:
    """The numbers of a topic's messages, of which each publisher counts its own."""

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
        # The calls of the hardware's services that are not answered yet, by their numbers.
        self._asked: dict[int, Any] = {}
        self._call_numbers = itertools.count()

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
        """Answer a call, which has failed if there is no payload."""

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
        """Tell the user, once."""
        if text not in self._reported:
            self._reported.add(text)
            print(text, file=sys.stderr, flush=True)

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


class Ros1(Ros):
    """A ROS 1 node through rospy, which does not require installed message packages."""

    def __init__(self, config: dict[str, Any], arguments: list[str], channel: Channel) -> None:
        super().__init__(config, channel)
        # rospy reads remappings from here, some of them when it is imported.
        sys.argv = [config["name"], *arguments]
        import rospy

        self._rospy = rospy
        _warn_without_master()
        rospy.init_node(config["name"], disable_signals=True)
        # rospy's reports of refused peers.
        logging.getLogger("rosout").addFilter(_Once())
        rospy.on_shutdown(self._stopped_by_ros)
        given = [*config["publishers"], config["diagnostics"]]
        self._classes = {topic["number"]: _raw_class(rospy, topic) for topic in given}
        self._publishers = {
            topic["number"]: rospy.Publisher(
                topic["name"],
                self._classes[topic["number"]],
                queue_size=topic["depth"],
                latch=topic["is_transient_local"],
                tcp_nodelay=True,
            )
            for topic in given
        }
        self._services = {
            number: rospy.Service(item["name"], _raw_service(rospy, item), functools.partial(self._serve, number))
            for number, item in self._servers.items()
        }
        self._callers = {number: _Caller(self, rospy, item) for number, item in self._clients.items()}
        self._gaps = {topic["number"]: Gaps() for topic in config["subscribers"] if topic["is_numbered"]}
        self._subscribers = {
            topic["number"]: rospy.Subscriber(
                topic["name"], _raw_class(rospy, topic), self._taken, topic["number"], tcp_nodelay=True
            )
            for topic in config["subscribers"]
        }

    def _taken(self, message: Any, topic: int) -> None:
        payload = message._buff  # noqa: SLF001 - rospy has no public name for it
        missing = 0
        if topic in self._gaps:
            publisher = message._connection_header["callerid"]  # noqa: SLF001
            missing = self._gaps[topic].missing(publisher, int.from_bytes(payload[:4], "little"))
        self.take(topic, payload)
        self.lose(topic, missing)

    def _serve(self, service: int, request: Any) -> Any:
        """Return the response to a request; rospy has a thread for each client."""
        asker: queue.Queue[tuple[bytes | None, str]] = queue.Queue()
        is_asked = self.ask(service, request._buff, asker)  # noqa: SLF001
        payload, reason = asker.get() if is_asked else (None, "the node ends")
        if payload is None:
            raise self._rospy.ServiceException(reason)
        response = self._services[service].response_class()
        response._buff = payload  # noqa: SLF001
        return response

    def answer_asker(self, service: int, asker: Any, payload: bytes | None, reason: str) -> None:
        """Wake the thread of the client."""
        asker.put((payload, reason))

    def call(self, service: int, number: int, payload: bytes) -> None:
        """Call a service, in the thread of its client."""
        self._callers[service].put(number, payload)

    def _stopped_by_ros(self) -> None:
        """Report a stop by ROS, such as `rosnode kill`.

        ROS calls this method at every shutdown; later reports are ignored.
        """
        with contextlib.suppress(OSError):
            self._channel.send(STOP)

    def names(self) -> dict[str, dict[int, str]]:
        """Return the names of the topics and services after remapping."""
        ends = {**self._services, **{number: caller.proxy for number, caller in self._callers.items()}}
        return {
            "services": {number: end.resolved_name for number, end in ends.items()},
            "subscribers": {number: topic.resolved_name for number, topic in self._subscribers.items()},
            "publishers": {
                number: topic.resolved_name for number, topic in self._publishers.items() if number != DIAGNOSTICS
            },
        }

    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message; a connection whose queue is full drops its oldest message."""
        message = self._classes[topic]()
        message._buff = payload  # noqa: SLF001
        with contextlib.suppress(self._rospy.ROSException):  # ROS has ended; on_shutdown has reported it
            self._publishers[topic].publish(message)

    def stop(self) -> None:
        """Accept no more messages; after the call, no callback hands over a message."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()
        self._is_taking = False
        self._channel.send(DONE)

    def spin(self) -> None:
        """Wait for `end`, and look at the types of the topics: rospy works in its own threads."""
        while not self._ended.wait(_LOOK_SECONDS):
            with contextlib.suppress(OSError, self._rospy.ROSException):  # the master does not answer
                self._look_at_types(dict(self._rospy.get_published_topics()))

    def _look_at_types(self, types: dict[str, str]) -> None:
        names = self.names()
        for kind in _KINDS:
            for topic in self._config[kind]:
                name = names[kind][topic["number"]]
                found = types.get(name, "*")
                if found not in ("*", topic["type"]):
                    self.report(_type_report("another node", "uses", name, found, topic["type"]))

    def close(self) -> None:
        """Wait until published messages have been sent, then end the node."""
        latest = time.monotonic() + _FLUSH_SECONDS
        for publisher in self._publishers.values():
            for connection in list(publisher.impl.connections):
                _flush(connection, latest)
        self._rospy.signal_shutdown("the hardware is disconnected")


class _Caller:
    """A client of a service: a thread that calls it, and that a server without an answer may block."""

    def __init__(self, ros: Ros1, rospy: Any, service: dict[str, Any]) -> None:
        self.proxy = rospy.ServiceProxy(service["name"], _raw_service(rospy, service))
        self._ros = ros
        self._errors = (rospy.ServiceException, rospy.ROSException, OSError)
        self._service = service
        self._calls: queue.Queue[tuple[float, int, bytes]] = queue.Queue()
        threading.Thread(target=self._run, daemon=True).start()

    def put(self, number: int, payload: bytes) -> None:
        self._calls.put((time.monotonic(), number, payload))

    def _run(self) -> None:
        while True:
            begin, number, payload = self._calls.get()
            # The engine no longer waits for it.
            if time.monotonic() - begin > self._service["time_limit"]:
                continue
            request = self.proxy.request_class()
            request._buff = payload  # noqa: SLF001
            try:
                response = self.proxy.call(request)
            except self._errors as error:
                self._ros.give_answer(self._service["number"], number, None, str(error))
            else:
                self._ros.give_answer(self._service["number"], number, response._buff)  # noqa: SLF001


class _Once(logging.Filter):
    """Passes each report of a refused peer once, since a peer with another type of a topic tries again and again."""

    def __init__(self) -> None:
        super().__init__()
        self._known: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record is new."""
        text = record.getMessage()
        is_known = text in self._known
        if "inbound connection" in text:
            self._known.add(text)
        return not is_known


def _warn_without_master() -> None:
    """Say how to start the master for which rospy waits, if it does not run."""
    import rosgraph  # type: ignore[import-not-found, unused-ignore]

    if not rosgraph.is_master_online():
        print(
            f"waiting for the ROS master at {rosgraph.get_master_uri()}; start it in another terminal with 'roscore' or"
            " 'rosmaster --core', or set ROS_MASTER_URI to that of a running one",
            file=sys.stderr,
        )


def _raw_class(rospy: Any, topic: dict[str, Any]) -> Any:
    """Return a message class that carries raw bytes but announces the topic's type to peers."""
    names = {"_type": topic["type"], "_md5sum": topic["signature"], "_full_text": topic["definition"], "__slots__": ()}
    return type("RawMessage", (rospy.AnyMsg,), names)


def _raw_service(rospy: Any, service: dict[str, Any]) -> Any:
    """Return a service class whose messages are raw bytes, and that announces the service's type to peers."""
    messages = {
        f"_{end}_class": type("RawMessage", (rospy.AnyMsg,), {"_type": service[f"{end}_type"], "__slots__": ()})
        for end in ("request", "response")
    }
    return type("RawService", (), {"_type": service["type"], "_md5sum": service["signature"], **messages})


def _flush(connection: Any, latest: float) -> None:
    """Wait until a connection's thread has sent all messages that were queued before the call.

    The thread takes all queued messages at once and then sends them. When the thread has returned to the queue twice,
    it has sent all messages that were queued before the first return.
    """
    for _ in range(2):
        try:
            connection.write_data(b"")
        except Exception:  # noqa: BLE001 - the peer has gone, which rospy reports with several types
            return
        while getattr(connection, "_queue", None) and not connection.done and time.monotonic() < latest:
            time.sleep(0.005)


class Ros2(Ros):
    """A ROS 2 node through rclpy. Message packages must be installed, because rmw reads types from their libraries."""

    def __init__(self, config: dict[str, Any], arguments: list[str], channel: Channel) -> None:
        super().__init__(config, channel)
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._rclpy = rclpy
        types = {topic["type"]: _message_class(topic["type"]) for kind in _KINDS for topic in config[kind]}
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(config["name"])
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        # The number of callbacks so far.
        self._handled = 0
        # The functions that send responses, and the futures of calls by the hardware, by service.
        self._senders: dict[int, Any] = {}
        self._called: dict[int, tuple[Any, ...]] = {}
        self._stops_at: float | None = None
        self._looks_at = 0.0
        self._ends = Ends()
        self._gaps = {topic["number"]: Gaps() for topic in config["subscribers"]}
        self._publishers = {
            topic["number"]: self._node.create_publisher(types[topic["type"]], topic["name"], _quality(topic))
            for topic in config["publishers"]
        }
        self._add_diagnostics(config["diagnostics"])
        self._services = {number: self._service(number, item) for number, item in self._servers.items()}
        self._callers = {number: self._caller(item) for number, item in self._clients.items()}
        self._subscribers = {
            topic["number"]: self._subscription(topic, types[topic["type"]]) for topic in config["subscribers"]
        }
        self._check_hashes()

    def _add_diagnostics(self, topic: dict[str, Any]) -> None:
        try:
            message = _message_class(topic["type"])
        except BridgeError as error:
            self.report(f"{topic['name']} is not published: {error}")
            return
        self._publishers[topic["number"]] = self._node.create_publisher(message, topic["name"], _quality(topic))

    def _service(self, number: int, service: dict[str, Any]) -> Any:
        """Return a server whose requests are handed over, instead of being answered at once."""

        def kept(request: Any, _: Any) -> Any:
            return request

        from rclpy.qos import QoSProfile

        quality = QoSProfile(depth=_SERVICE_DEPTH)
        made = self._node.create_service(_service_class(service), service["name"], kept, qos_profile=quality)
        self._senders[number] = made.send_response
        # The executor sends what the callback returns: the request, with the header for its response.
        made.send_response = functools.partial(self._asked_for, number)
        return made

    def _asked_for(self, service: int, request: Any, header: Any) -> None:
        from rclpy.serialization import serialize_message

        self._handled += 1
        self.ask(service, serialize_message(request), header)

    def answer_asker(self, service: int, asker: Any, payload: bytes | None, reason: str) -> None:
        """Send the response; a call that failed has none in ROS 2."""
        from rclpy.serialization import deserialize_message

        if payload is None:
            return
        try:
            self._senders[service](deserialize_message(payload, self._services[service].srv_type.Response), asker)
        except Exception as error:  # noqa: BLE001 - the client has gone, or the response is malformed
            self.report(f"a response of {self._services[service].service_name} is not sent: {error}")

    def _caller(self, service: dict[str, Any]) -> Any:
        from rclpy.qos import QoSProfile

        quality = QoSProfile(depth=_SERVICE_DEPTH)
        return self._node.create_client(_service_class(service), service["name"], qos_profile=quality)

    def call(self, service: int, number: int, payload: bytes) -> None:
        """Call a service; it fails at once without a server."""
        from rclpy.serialization import deserialize_message

        client = self._callers[service]
        if not client.service_is_ready():
            self.give_answer(service, number, None, f"there is no server of {client.srv_name}")
            return
        # The engine no longer waits for an earlier call.
        for earlier in self._called.pop(service, ()):
            client.remove_pending_request(earlier)
        try:
            future = client.call_async(deserialize_message(payload, client.srv_type.Request))
        except Exception as error:  # noqa: BLE001 - the request is malformed
            self.give_answer(service, number, None, str(error))
            return
        self._called[service] = (future,)
        future.add_done_callback(functools.partial(self._called_back, service, number))

    def _called_back(self, service: int, number: int, future: Any) -> None:
        from rclpy.serialization import serialize_message

        if not future.cancelled():
            self.give_answer(service, number, serialize_message(future.result()))

    def _subscription(self, topic: dict[str, Any], message: Any) -> Any:
        """Return a subscription that counts what ROS loses, by an event or by the numbers of a single publisher."""
        from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError

        number = topic["number"]

        def taken(payload: bytes, info: dict[str, int]) -> None:
            self._handled += 1
            self.take(number, payload)
            # The message need not wait for the look at the publishers.
            self.lose(number, self._missing(number, info))

        def lost(event: Any) -> None:
            self._handled += 1
            if not self._has_one_publisher(number):
                self.lose(number, event.total_count_change)

        create = functools.partial(
            self._node.create_subscription, message, topic["name"], taken, _quality(topic), raw=True
        )
        try:
            return create(event_callbacks=SubscriptionEventCallbacks(message_lost=lost))
        except UnsupportedEventTypeError:
            return create()

    def _missing(self, topic: int, info: dict[str, int]) -> int:
        """Return how many messages are missing before one; rclpy does not tell which publisher has numbered it."""
        if not self._has_one_publisher(topic):
            self._gaps[topic].forget()
            return 0
        return self._gaps[topic].missing("", info["publication_sequence_number"])

    def _has_one_publisher(self, topic: int) -> bool:
        return bool(self._subscribers[topic].get_publisher_count() == 1)

    def _look_at_peers(self) -> None:
        """Report each node that uses a topic with another type."""
        info = {
            "subscribers": (self._node.get_publishers_info_by_topic, "publishes"),
            "publishers": (self._node.get_subscriptions_info_by_topic, "subscribes to"),
        }
        names = self.names()
        for kind in _KINDS:
            ends_of, verb = info[kind]
            for topic in self._config[kind]:
                name = names[kind][topic["number"]]
                for end in ends_of(name):
                    if end.topic_type != topic["type"] and self._ends.is_due(bytes(end.endpoint_gid), end.node_name):
                        self.report(_type_report(end.node_name, verb, name, end.topic_type, topic["type"]))

    def _check_hashes(self) -> None:
        """Raise BridgeError if an installed type differs from the hardware's; older ROS 2 releases provide no hash."""
        info = {
            "subscribers": self._node.get_subscriptions_info_by_topic,
            "publishers": self._node.get_publishers_info_by_topic,
        }
        mine = (self._node.get_name(), self._node.get_namespace())
        names = self.names()
        for kind in _KINDS:
            for topic in self._config[kind]:
                for end in info[kind](names[kind][topic["number"]]):
                    known = str(getattr(end, "topic_type_hash", topic["signature"]))
                    if (end.node_name, end.node_namespace) == mine and known != topic["signature"]:
                        raise BridgeError(
                            "the installed definition of '{}' ({}) differs from the system's definition ({})".format(
                                topic["type"], known, topic["signature"]
                            )
                        )

    def names(self) -> dict[str, dict[int, str]]:
        """Return the names of the topics and services after remapping."""
        return {
            "services": {
                **{number: end.service_name for number, end in self._services.items()},
                **{number: end.service_name for number, end in self._callers.items()},
            },
            "subscribers": {number: topic.topic_name for number, topic in self._subscribers.items()},
            "publishers": {
                number: topic.topic_name for number, topic in self._publishers.items() if number != DIAGNOSTICS
            },
        }

    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message; `/diagnostics` may have no publisher."""
        if topic in self._publishers:
            self._publishers[topic].publish(payload)

    def stop(self) -> None:
        """Make `spin` take the messages that have already arrived, and no further messages."""
        self._stops_at = time.monotonic() + _FLUSH_SECONDS
        self._executor.wake()

    def spin(self) -> None:
        """Call the callbacks."""
        while not self._ended.is_set():
            handled = self._handled
            self._executor.spin_once(timeout_sec=0.5 if self._stops_at is None else 0)
            if self._stops_at is None:
                if time.monotonic() > self._looks_at:
                    self._look_at_peers()
                    self._looks_at = time.monotonic() + _LOOK_SECONDS
            elif handled == self._handled or time.monotonic() > self._stops_at:
                break
        self._is_taking = False
        if not self._ended.is_set():
            self._channel.send(DONE)
            self._ended.wait()

    def end(self) -> None:
        """Make `spin` return."""
        super().end()
        self._executor.wake()

    def close(self) -> None:
        """Wait until published messages have been sent, then end the node."""
        from rclpy.duration import Duration

        for topic in self._config["publishers"]:
            if topic["is_reliable"]:
                self._publishers[topic["number"]].wait_for_all_acked(Duration(seconds=_FLUSH_SECONDS))
        self._node.destroy_node()
        self._rclpy.shutdown()


def _quality(topic: dict[str, Any]) -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        depth=topic["depth"],
        reliability=ReliabilityPolicy.RELIABLE if topic["is_reliable"] else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic["is_transient_local"] else DurabilityPolicy.VOLATILE,
    )


def _type_report(node: str, verb: str, topic: str, its: str, ours: str) -> str:
    return f"{node} {verb} {topic} with the type {its}, which is {ours} here; no messages are exchanged"


_KINDS = ("subscribers", "publishers")
_VERSIONS = {1: Ros1, 2: Ros2}


def _message_class(name: str, word: str = "message") -> Any:
    import importlib

    package, kind, message = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), message)
    except (ImportError, AttributeError):
        raise BridgeError(
            f"the {word} '{name}' is not installed for {sys.executable}; 'firm ros install {package}' or"
            f" 'apt-get install ros-$ROS_DISTRO-{package.replace('_', '-')}' installs a released package;"
            " build and source a package of your own"
        ) from None


def _service_class(service: dict[str, Any]) -> Any:
    """Return the class of a service, whose definition must be that of the hardware if ROS 2 tells its hash."""
    found = _message_class(service["type"], "service")
    known = _installed_hash(service["type"])
    if known and service["signature"] and known != service["signature"]:
        raise BridgeError(
            "the installed definition of '{}' ({}) differs from the system's definition ({})".format(
                service["type"], known, service["signature"]
            )
        )
    return found


def _installed_hash(name: str) -> str:
    """Return the hash of an installed type, or nothing; older ROS 2 releases have none."""
    from ament_index_python.packages import (  # type: ignore[import-not-found, unused-ignore]
        get_package_share_directory,
    )

    package, kind, word = name.split("/")
    try:
        text = Path(get_package_share_directory(package), kind, f"{word}.json").read_text(encoding="utf-8")
        hashes = json.loads(text)["type_hashes"]
    except (OSError, LookupError, ValueError):
        return ""
    return next((str(item["hash_string"]) for item in hashes if item["type_name"] == name), "")


def _serve(ros: Ros, channel: Channel, is_timed: bool) -> None:
    """Carry out the engine's requests until the engine closes its end."""
    while True:
        parcel = channel.receive()
        if parcel is None:
            break
        if parcel.kind == MESSAGE:
            ros.publish(parcel.topic, parcel.data)
            if is_timed and parcel.topic != DIAGNOSTICS:
                channel.send(PUBLISHED, parcel.topic, time_ns=time.monotonic_ns())
        elif parcel.kind == ANSWER:
            ros.answer(parcel.topic, parcel.data)
        elif parcel.kind == CALL:
            ros.call(parcel.topic, *unpack_call(parcel.data))
        elif parcel.kind == STOP:
            ros.stop()
    ros.end()


def main() -> int:
    """Run the bridge."""
    channel = Channel(socket.socket(fileno=int(sys.argv[1])))
    first = channel.receive()
    if first is None or first.kind != CONFIGURE:
        return 2
    config = json.loads(first.data)
    # rospy waits for its master without a time limit; an engine that gives up closes its end.
    ready = threading.Event()
    threading.Thread(target=_give_up, args=(channel, ready), daemon=True).start()
    try:
        ros = _VERSIONS[config["ros"]](config, sys.argv[2:], channel)
    except Exception as error:  # noqa: BLE001 - whatever ROS raises is reported
        channel.send(FAULT, data=str(error).encode())
        return 1
    ros.ready()
    ready.set()
    server = threading.Thread(target=_serve, args=(ros, channel, config["is_timed"]), daemon=True)
    server.start()
    ros.spin()
    ros.close()
    channel.finish()
    return 0


def _give_up(channel: Channel, ready: threading.Event) -> None:
    """End the process if the engine closes its end before ROS is ready."""
    while not ready.wait(0.2):
        if channel.is_closed():
            os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
