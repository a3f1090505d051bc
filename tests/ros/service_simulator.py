"""A simulator's end of the pipe before a model of the service in camera.yaml, or of the client in asking.yaml.

    python service_simulator.py camera|asking 1|2 GATE [--width BITS ...]

The response to a request is that of camera/model.py, unless the request's text begins with `refused` (frame error and
abort), `aborted`, `silent`, or `gated`: the response comes when the file GATE exists. The client sends each name in a
request, and the text of each response to a topic. The rest is that of tests/node/model_simulator.py.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from fusesoc_firm.frame.codec import decode, encode, pack_frame
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import with_names_in_use
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import middleware_of
from fusesoc_firm.message.model import MessageName
from tests.node import model_simulator
from tests.ros.camera.model import respond

HERE = Path(__file__).resolve().parent


@cache
def frames(version: int) -> tuple[Frame, Frame, Frame]:
    """The request and the response of the service, and a string."""
    library = MessageLibrary(middleware_of(version), [HERE / "camera/msg"])
    joint = "" if version == 1 else "_"
    names = [MessageName("sensor_msgs", f"SetCameraInfo{joint}{end}") for end in ("Request", "Response")]
    request, response, text = (
        frame_of(name, library.closure(name)) for name in (*names, MessageName("std_msgs", "String"))
    )
    return request, response, text


class ServiceSimulator(model_simulator.Simulator):
    """The model; `version` is that of ROS."""

    version = 1
    gate = model_simulator.Gate(Path())

    def take(self, now: int) -> bytes:
        frame = self.waiting[0]
        request, response, _ = frames(self.version)
        message = decode(request, frame[5:])
        word = message["camera_info"]["distortion_model"].partition(" ")[0]
        (_, answer), *_ = respond("", message)
        reply = pack_frame(0, encode(response, answer))
        if word == "gated":
            self.gate.wait()
        if word not in ("refused", "aborted", "silent"):
            self.waiting[0] = reply
            return super().take(now)
        self.waiting.popleft()
        self.begun = self.moved = now
        report = b"T" + (now - self.beats(frame) + 1).to_bytes(8, "little") + now.to_bytes(8, "little")
        cycle = now.to_bytes(8, "little")
        if word == "refused":
            report += b"E\0\0\1" + cycle
        if word != "silent":
            report += b"B\0\0\1" + cycle + cycle + (8).to_bytes(4, "little") + reply[:8]
        return report


class AskingSimulator(model_simulator.Simulator):
    """The model of the client."""

    version = 1
    gate = model_simulator.Gate(Path())

    def take(self, now: int) -> bytes:
        frame = self.waiting[0]
        request, response, text = frames(self.version)
        if frame[0] == 0:
            info = {"camera_info": {"distortion_model": decode(text, frame[5:])["data"]}}
            reply = encode_used(with_names_in_use(request, {("camera_info", "distortion_model")}), info)
            self.waiting[0] = pack_frame(0, reply)
        else:
            reply = encode(text, {"data": decode(response, frame[5:])["status_message"]})
            self.waiting[0] = pack_frame(1, reply)
        return super().take(now)


if __name__ == "__main__":
    kinds: dict[str, type[ServiceSimulator | AskingSimulator]] = {"camera": ServiceSimulator, "asking": AskingSimulator}
    kind = kinds[sys.argv.pop(1)]
    kind.version, kind.gate = int(sys.argv.pop(1)), model_simulator.Gate(Path(sys.argv.pop(1)))
    # The first call is to take no longer than others.
    frames(kind.version)
    model_simulator.Simulator = kind  # type: ignore[misc]
    model_simulator.main()
