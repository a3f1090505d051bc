"""A bridge to ROS 1."""

from __future__ import annotations

import contextlib
import functools
import logging
import queue
import sys
import time
from typing import Any

from .channel import DIAGNOSTICS, DONE, STOP, Channel
from .ros import FLUSH_SECONDS, KINDS, LOOK_SECONDS, Gaps, Ros, type_report
from .ros1_parameters import Watch
from .ros1_services import Caller, raw_service

# The attribute of a log's record that the terminal shows already.
_PRINTED = "is_printed"


class Ros1(Ros):
    """A ROS 1 node through rospy, which does not require installed message packages."""

    def __init__(self, config: dict[str, Any], arguments: list[str], channel: Channel) -> None:
        super().__init__(config, channel)
        # rospy reads remappings from here, some of them when it is imported.
        sys.argv = [config["name"], *arguments]
        import rosgraph.roslogging  # type: ignore[import-not-found, unused-ignore]
        import rospy

        self._rospy = rospy
        _warn_without_master()
        rospy.init_node(config["name"], disable_signals=True)
        self._log = logging.getLogger("rosout")
        # rospy's reports of refused peers.
        self._log.addFilter(_Once())
        for handler in self._log.handlers:
            if isinstance(handler, rosgraph.roslogging.RosStreamHandler):
                handler.addFilter(_is_not_printed)
        rospy.on_shutdown(self._stopped_by_ros)
        if config["parameters"]:
            Watch(rospy, config["parameters"], self, self._ended).start()
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
            number: rospy.Service(item["name"], raw_service(rospy, item), functools.partial(self._serve, number))
            for number, item in self._servers.items()
        }
        self._callers = {number: Caller(self, rospy, item) for number, item in self._clients.items()}
        self._gaps = {topic["number"]: Gaps() for topic in config["subscribers"] if topic["is_numbered"]}
        # For each topic, the topics that must be connected before its messages are passed on.
        self._others = {first: others for first, *others in (group["subscribers"] for group in config["groups"])}
        self._given = {group["subscribers"][0]: group["publishers"] for group in config["groups"]}
        self._subscribers: dict[int, Any] = {}
        for topic in config["subscribers"]:
            self._subscribers[topic["number"]] = rospy.Subscriber(
                topic["name"], _raw_class(rospy, topic), self._taken, topic["number"], tcp_nodelay=True
            )

    def _has_publisher(self, topic: int) -> bool:
        return topic in self._subscribers and self._subscribers[topic].get_num_connections() > 0

    def _has_subscriber(self, topic: int) -> bool:
        return bool(self._publishers[topic].get_num_connections() > 0)

    def _taken(self, message: Any, topic: int) -> None:
        is_connected = all(map(self._has_publisher, self._others.get(topic, ())))
        if not is_connected or not all(map(self._has_subscriber, self._given.get(topic, ()))):
            return
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

    def log(self, level: int, text: str) -> None:
        """Put a line into the topic and the file of ROS's log."""
        self._log.log(level, "%s", text, extra={_PRINTED: True})

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
        """Wait for `end`, and check the types of the topics: rospy works in its own threads."""
        while not self._ended.wait(LOOK_SECONDS):
            with contextlib.suppress(OSError, self._rospy.ROSException):  # the master does not answer
                self._look_at_types(dict(self._rospy.get_published_topics()))

    def _look_at_types(self, types: dict[str, str]) -> None:
        names = self.names()
        for kind in KINDS:
            for topic in self._config[kind]:
                name = names[kind][topic["number"]]
                found = types.get(name, "*")
                if found not in ("*", topic["type"]):
                    self.report(type_report("another node", "uses", name, found, topic["type"]))

    def close(self) -> None:
        """Wait until published messages have been sent, then end the node."""
        latest = time.monotonic() + FLUSH_SECONDS
        for publisher in [*self._publishers.values(), self._log_publisher()]:
            for connection in list(publisher.impl.connections):
                _flush(connection, latest)
        self._rospy.signal_shutdown("the hardware is disconnected")

    def _log_publisher(self) -> Any:
        import rospy.impl.rosout as log

        return log._rosout_pub  # noqa: SLF001 - rospy has no public name for it


class _Once(logging.Filter):
    """Passes each report of a refused peer once, since a peer with another type of a topic retries endlessly."""

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


def _is_not_printed(record: logging.LogRecord) -> bool:
    """Return whether the terminal does not show a line yet."""
    return not hasattr(record, _PRINTED)


def _warn_without_master() -> None:
    """Report how to start the master for which rospy waits, if it does not run."""
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
