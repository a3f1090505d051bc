"""Broken frames on a UART, at the pins of a simulated system: the status counts each of them, and no good one."""

from __future__ import annotations

import random
import shutil
from collections import deque
from pathlib import Path

import pytest

from fusesoc_firm.frame.codec import pack_frame
from fusesoc_firm.node.status.status import read_status, status_text
from fusesoc_firm.node.transport.built_simulator import build_simulator
from fusesoc_firm.node.transport.link_code import LinkDecoder, encode
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.node.transport.transport import Burst
from tests.node.drivers import compile_c_driver, cpp_driver
from tests.node.test_status_counters import LINK_FAULT, counted, told
from tests.seeds import seeded

pytestmark = [pytest.mark.check, pytest.mark.skipif(not shutil.which("verilator"), reason="no verilator")]
SEED = seeded(20261126)
FRAMES = 60
SPECIFICATION = """\
project: {name: linked, status: frames, timeStamps: added}
blocks:
  - {name: point_in, middleware: ROS2, mode: subscriber, message: geometry_msgs/Point, outgoing: [{name: point_out}]}
  - {name: point_out, middleware: ROS2, mode: publisher, message: geometry_msgs/Point}
"""
_STEP_CYCLES = 20_000
# The response to a frame comes within these.
_MOST_STEPS = 50


class SimulatedLine:
    """A transport to the pins of a simulated UART, in lock-step."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._decoder = LinkDecoder()
        self._frames: deque[bytes] = deque()

    def send(self, frame: bytes) -> None:
        self.send_bytes(encode(frame))

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are."""
        self._simulator.request(data)

    def receive(self, timeout: float | None = None) -> Burst | None:
        for _ in range(_MOST_STEPS):
            if self._frames:
                return Burst(self._frames.popleft())
            for event in self._simulator.run(_STEP_CYCLES):
                if isinstance(event, Burst):
                    frames = self._decoder.push(event.data)
                    assert None not in frames
                    self._frames.extend(frame for frame in frames if frame is not None)
        return None

    def is_ready(self) -> bool:
        return False

    def is_at_rest(self) -> bool | None:
        return None

    def close(self) -> None:
        self._simulator.close()

    def __enter__(self) -> SimulatedLine:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _broken(frame: bytes, source: random.Random) -> bytes:
    """The code of the frame with another byte; the zero byte stays at the end alone."""
    coded = bytearray(encode(frame))
    place = source.randrange(len(coded) - 1)
    coded[place] = source.choice([byte for byte in range(1, 256) if byte != coded[place]])
    return bytes(coded)


def test_each_broken_frame_is_a_link_error(tmp_path: Path) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    (tmp_path / "linked.yaml").write_text(SPECIFICATION)
    built = build_simulator(tmp_path / "linked.yaml", "verilator", build_root=tmp_path / "build", target="emulate")
    with SimulatedLine(Simulator([*built.command(), "+RAW=true"], built.folder)) as line:
        # What precedes the first zero byte is not a frame.
        line.send_bytes(b"\0")
        broken = 0
        for _ in range(FRAMES):
            frame = pack_frame(0, b"\x00\x01\x00\x00" + source.randbytes(24))
            if source.random() < 0.3:
                broken += 1
                line.send_bytes(_broken(frame, source))
            else:
                line.send(frame)
                burst = line.receive()
                assert burst and burst.data == frame
        status = read_status(line)
        words = {
            "link_errors": broken,
            "interrupt": LINK_FAULT,
            "control": 1,
            "subscriber[0].frames": FRAMES - broken,
            "publisher[0].frames": FRAMES - broken,
            "digest": status.digest,
        }
        assert broken > 5
        assert counted({**status.words, "digest": status.digest}) == words
        assert f"link errors {broken}," in status_text(status)
        sources = ["firm/firm_frame.c", "firm/firm_status.c"]
        for driver in (cpp_driver("status"), compile_c_driver("status", tmp_path, sources, [], {})):
            assert counted(told([driver.program, "1", status.digest], line)) == words
