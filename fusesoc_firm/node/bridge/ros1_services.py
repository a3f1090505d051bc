"""Services of ROS 1 as bytes."""

from __future__ import annotations

import queue
import threading
import time
from typing import Any

from .ros import Ros


class Caller:
    """A client of a service: a thread that calls it. A server that does not answer may block the thread."""

    def __init__(self, ros: Ros, rospy: Any, service: dict[str, Any]) -> None:
        self.proxy = rospy.ServiceProxy(service["name"], raw_service(rospy, service))
        self._ros = ros
        self._errors = (rospy.ServiceException, rospy.ROSException, OSError)
        self._service = service
        self._calls: queue.Queue[tuple[float, int, bytes]] = queue.Queue()
        threading.Thread(target=self._run, daemon=True).start()

    def put(self, number: int, payload: bytes) -> None:
        """Call the service after all earlier calls."""
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


def raw_service(rospy: Any, service: dict[str, Any]) -> Any:
    """Return a service class whose messages are raw bytes, and that announces the service's type to peers."""
    messages = {
        f"_{end}_class": type("RawMessage", (rospy.AnyMsg,), {"_type": service[f"{end}_type"], "__slots__": ()})
        for end in ("request", "response")
    }
    return type("RawService", (), {"_type": service["type"], "_md5sum": service["signature"], **messages})
