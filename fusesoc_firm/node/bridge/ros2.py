"""A bridge to ROS 2."""

from __future__ import annotations

import functools
import time
from collections import defaultdict, deque
from contextlib import suppress
from typing import Any

from .channel import DIAGNOSTICS, DONE, STOP, Channel
from .managed import managed_node, waiting_group
from .ros import FLUSH_SECONDS, KINDS, LOOK_SECONDS, BridgeError, Ends, Gaps, Ros, type_report
from .ros2_log import Log
from .ros2_parameters import declare
from .ros2_types import SERVICE_DEPTH, message_class, service_class

# The argument of ROS 2 for nodes without the topic of the log.
_NO_LOG = "--disable-rosout-logs"
# The calls of a service that may be answered late.
_MOST_PENDING = 100


class Ros2(Ros):
    """A ROS 2 node through rclpy. Message packages must be installed, because rmw reads types from their libraries."""

    def __init__(self, config: dict[str, Any], arguments: list[str], channel: Channel) -> None:
        super().__init__(config, channel)
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._rclpy = rclpy
        types = {topic["type"]: message_class(topic["type"]) for kind in KINDS for topic in config[kind]}
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        # A node with lifecycle states carries messages, calls and goals only while it is active.
        self._is_active = not config["is_managed"]
        self._node = rclpy.create_node(config["name"]) if self._is_active else self._managed(config["name"])
        self._log = None if _NO_LOG in arguments else Log(self._node)
        declare(self._node, config["parameters"], self)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        # The number of callbacks so far.
        self._handled = 0
        # The functions that send responses, by service.
        self._senders: dict[int, Any] = {}
        # The futures of the latest calls by the hardware, by service: goals may be accepted late.
        self._called: dict[int, deque[Any]] = defaultdict(deque)
        self._stops_at: float | None = None
        self._looks_at = 0.0
        self._ends = Ends()
        self._gaps = {topic["number"]: Gaps() for topic in config["subscribers"]}
        self._publishers = {
            topic["number"]: self._node.create_publisher(types[topic["type"]], topic["name"], _quality(topic))
            for topic in config["publishers"]
        }
        self._add_diagnostics(config["diagnostics"])
        self._services: dict[int, Any] = {}
        if self._is_active:
            self._serve()
        self._callers = {number: self._caller(item) for number, item in self._clients.items()}
        self._subscribers = {
            topic["number"]: self._subscription(topic, types[topic["type"]]) for topic in config["subscribers"]
        }
        self._check_hashes()

    def _managed(self, name: str) -> Any:
        def end() -> None:
            self._channel.send(STOP)

        return managed_node(name, self._change, end)

    def _change(self, is_active: bool) -> None:
        """Begin or stop carrying messages. To clients, an inactive node has no services and no actions."""
        if is_active == self._is_active:
            return
        if is_active:
            self._serve()
            # Messages that ROS replaced in its queues meanwhile do not count as lost.
            for gaps in self._gaps.values():
                gaps.forget()
        else:
            self._cease()
        self._is_active = is_active

    def _serve(self) -> None:
        try:
            for number, item in self._servers.items():
                self._services[number] = self._service(number, item)
        except BaseException:
            self._cease()
            raise

    def _cease(self) -> None:
        for service in self._services.values():
            self._node.destroy_service(service)
        self._services.clear()

    def _add_diagnostics(self, topic: dict[str, Any]) -> None:
        try:
            message = message_class(topic["type"])
        except BridgeError as error:
            self.report(f"{topic['name']} is not published: {error}")
            return
        self._publishers[topic["number"]] = self._node.create_publisher(message, topic["name"], _quality(topic))

    def _service(self, number: int, service: dict[str, Any]) -> Any:
        """Return a server that passes requests on instead of answering them at once."""

        def kept(request: Any, _: Any) -> Any:
            return request

        from rclpy.qos import QoSProfile

        quality = QoSProfile(depth=SERVICE_DEPTH)
        made = self._node.create_service(service_class(service), service["name"], kept, qos_profile=quality)
        self._senders[number] = made.send_response
        # The executor sends what the callback returns: the request, with the header for its response.
        made.send_response = functools.partial(self._asked_for, number)
        return made

    def _asked_for(self, service: int, request: Any, header: Any) -> None:
        from rclpy.serialization import serialize_message

        self._handled += 1
        self.ask(service, serialize_message(request), header)

    def answer_asker(self, service: int, asker: Any, payload: bytes | None, reason: str) -> None:
        """Send the response; in ROS 2, a failed call has no response."""
        from rclpy.serialization import deserialize_message

        # An inactive node has no clients.
        if payload is None or service not in self._services:
            return
        try:
            self._senders[service](deserialize_message(payload, self._services[service].srv_type.Response), asker)
        except Exception as error:  # noqa: BLE001 - the client has gone, or the response is malformed
            self.report(f"a response of {self._services[service].service_name} is not sent: {error}")

    def _caller(self, service: dict[str, Any]) -> Any:
        from rclpy.qos import QoSProfile

        quality = QoSProfile(depth=SERVICE_DEPTH)
        return self._node.create_client(service_class(service), service["name"], qos_profile=quality)

    def call(self, service: int, number: int, payload: bytes) -> None:
        """Call a service; it fails at once without a server."""
        from rclpy.serialization import deserialize_message

        client = self._callers[service]
        if not self._is_active:
            self.give_answer(service, number, None, "the node is not active")
            return
        if not client.service_is_ready():
            self.give_answer(service, number, None, f"there is no server of {client.srv_name}")
            return
        try:
            future = client.call_async(deserialize_message(payload, client.srv_type.Request))
        except Exception as error:  # noqa: BLE001 - the request is malformed
            self.give_answer(service, number, None, str(error))
            return
        called = self._called[service]
        called.append(future)
        if len(called) > _MOST_PENDING:
            client.remove_pending_request(called.popleft())
        future.add_done_callback(functools.partial(self._called_back, service, number))

    def _called_back(self, service: int, number: int, future: Any) -> None:
        from rclpy.serialization import serialize_message

        with suppress(ValueError):
            self._called[service].remove(future)
        if not future.cancelled():
            self.give_answer(service, number, serialize_message(future.result()))

    def _subscription(self, topic: dict[str, Any], message: Any) -> Any:
        """Return a subscription that counts what ROS loses, by an event or by the numbers of a single publisher."""
        from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError

        number = topic["number"]

        def taken(payload: bytes, info: dict[str, int]) -> None:
            self._handled += 1
            if self._is_active:
                self.take(number, payload)
            # The message need not wait for the check of the publishers.
            missing = self._missing(number, info)
            if self._is_active:
                self.lose(number, missing)

        def lost(event: Any) -> None:
            self._handled += 1
            if self._is_active and not self._has_one_publisher(number):
                self.lose(number, event.total_count_change)

        create = functools.partial(
            self._node.create_subscription,
            message,
            topic["name"],
            taken,
            _quality(topic),
            raw=True,
            callback_group=waiting_group(lambda: self._is_active) if topic["is_transient_local"] else None,
        )
        try:
            return create(event_callbacks=SubscriptionEventCallbacks(message_lost=lost))
        except UnsupportedEventTypeError:
            return create()

    def _missing(self, topic: int, info: dict[str, int]) -> int:
        """Return the number of messages missing before one; rclpy does not report the publisher of a number."""
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
        for kind in KINDS:
            ends_of, verb = info[kind]
            for topic in self._config[kind]:
                name = names[kind][topic["number"]]
                for end in ends_of(name):
                    if end.topic_type != topic["type"] and self._ends.is_due(bytes(end.endpoint_gid), end.node_name):
                        self.report(type_report(end.node_name, verb, name, end.topic_type, topic["type"]))

    def _check_hashes(self) -> None:
        """Raise BridgeError if an installed type differs from the hardware's; older ROS 2 releases provide no hash."""
        info = {
            "subscribers": self._node.get_subscriptions_info_by_topic,
            "publishers": self._node.get_publishers_info_by_topic,
        }
        mine = (self._node.get_name(), self._node.get_namespace())
        names = self.names()
        for kind in KINDS:
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
                **{number: self._node.resolve_service_name(end["name"]) for number, end in self._servers.items()},
                **{number: end.service_name for number, end in self._callers.items()},
            },
            "subscribers": {number: topic.topic_name for number, topic in self._subscribers.items()},
            "publishers": {
                number: topic.topic_name for number, topic in self._publishers.items() if number != DIAGNOSTICS
            },
        }

    def publish(self, topic: int, payload: bytes) -> None:
        """Publish a message; `/diagnostics` may have no publisher, and is published in every state."""
        if topic in self._publishers and (self._is_active or topic == DIAGNOSTICS):
            self._publishers[topic].publish(payload)

    def log(self, level: int, text: str) -> None:
        """Put a line into the topic of ROS's log."""
        if self._log:
            self._log.put(level, text)

    def stop(self) -> None:
        """Make `spin` process the messages that have already arrived, but no further ones."""
        self._stops_at = time.monotonic() + FLUSH_SECONDS
        self._executor.wake()

    def spin(self) -> None:
        """Call the callbacks."""
        while not self._ended.is_set():
            handled = self._handled
            self._executor.spin_once(timeout_sec=0.5 if self._stops_at is None else 0)
            if self._stops_at is None:
                if time.monotonic() > self._looks_at:
                    self._look_at_peers()
                    self._looks_at = time.monotonic() + LOOK_SECONDS
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

        topics = [topic for topic in self._config["publishers"] if topic["is_reliable"]]
        log = [self._log.publisher] if self._log else []
        for publisher in [*(self._publishers[topic["number"]] for topic in topics), *log]:
            publisher.wait_for_all_acked(Duration(seconds=FLUSH_SECONDS))
        self._node.destroy_node()
        self._rclpy.shutdown()


def _quality(topic: dict[str, Any]) -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        depth=topic["depth"],
        reliability=ReliabilityPolicy.RELIABLE if topic["is_reliable"] else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic["is_transient_local"] else DurabilityPolicy.VOLATILE,
    )
