"""A simulator's end of the pipe before a model of the service in camera.yaml; it refuses what a request tells it to.

    python service_simulator.py 1|2 [--width BITS ...]

The response to a request is that of camera/model.py, unless the request's text begins with `refused` (frame error and
abort), `aborted` or `silent`. The rest is that of tests/node/model_simulator.py.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from tests.node import model_simulator
from tests.ros.camera.model import respond

HERE = Path(__file__).resolve().parent


@cache
def frames(version: int) -> tuple[Frame, Frame]:
    """The request and the response of the service."""
    library = MessageLibrary(middleware_of(version), [HERE / "camera/msg"])
    joint = "" if version == 1 else "_"
    names = [MessageName("sensor_msgs", f"SetCameraInfo{joint}{end}") for end in ("Request", "Response")]
    request, response = (frame_of(name, library.closure(name)) for name in names)
    return request, response


class ServiceSimulator(model_simulator.Simulator):
    """The model; `version` is that of ROS."""

    version = 1

    def take(self, now: int) -> bytes:
        frame = self.waiting[0]
        request, response = frames(self.version)
        message = decode(request, frame[5:])
        word = message["camera_info"]["distortion_model"].partition(" ")[0]
        (_, answer), *_ = respond("", message)
        reply = pack_frame(0, encode(response, answer))
        if word not in ("refused", "aborted", "silent"):
            self.waiting[0] = reply
            return super().take(now)
        self.waiting.popleft()
        self.begun = self.moved = now
        report = b"T" + (now - self.beats(frame) + 1).to_bytes(8, "little") + now.to_bytes(8, "little")
        cycle = now.to_bytes(8, "little")
        if word == "refused":
            report += b"E\0\0" + cycle
        if word != "silent":
            report += b"B\0\0\1" + cycle + cycle + (8).to_bytes(4, "little") + reply[:8]
        return report


if __name__ == "__main__":
    ServiceSimulator.version = int(sys.argv.pop(1))
    # The first call is to take no longer than others.
    frames(ServiceSimulator.version)
    model_simulator.Simulator = ServiceSimulator  # type: ignore[misc]
    model_simulator.main()
