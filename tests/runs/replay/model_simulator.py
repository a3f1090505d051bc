"""A simulator without a system (docs/reference/transports.md): `model_simulator.py WIDTH KIND...`.

The k-th of these kinds determines the response to a frame for subscriber k:

    echo      publisher k sends the payload, 20 cycles after the last input beat
    across    publisher 1 - k sends it
    twice     publisher k sends it again 300 cycles later
    late      publisher k sends it after 5000 cycles
    broken    as echo, unless the payload begins with 0xee: then the converter's frame_error pulses
    parts     publishers k and k + 1 send the payload as two interleaved bursts each
    garbled   publisher k sends more than it announces, and then a frame with an unknown id
    beginning only the first of these bursts is sent
    stuck     only the first frame is accepted
    unknown   id_error pulses
    grumpy    as echo, but the simulator exits with status 4
    dies      the simulator exits with status 3 at once
    silent    no response
"""

from __future__ import annotations

import os
import sys
from collections import deque
from heapq import heappop, heappush
from typing import BinaryIO

Report = tuple[int, int, bytes]
HEADER = 5


def le(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little")


class Model:
    """The model; `queue` holds pending reports, by the cycle of their event and the order of creation."""

    def __init__(self, width: int, kinds: list[str]) -> None:
        self.lanes = width // 8
        self.kinds = kinds
        self.cycle = 0
        self.last_beat = -1
        self.frames: deque[bytes] = deque()
        self.queue: list[Report] = []
        self.made = 0
        self.taken: set[int] = set()
        self.is_stuck = False

    def report(self, cycle: int, data: bytes) -> None:
        self.made += 1
        heappush(self.queue, (cycle, self.made, data))

    def send(self, publisher: int, data: bytes, first: int) -> int:
        """Send a burst from cycle `first` on; return its last cycle."""
        last = first + -(-len(data) // self.lanes) - 1
        self.report(last, b"B" + le(publisher, 2) + le(0, 1) + le(first, 8) + le(last, 8) + le(len(data), 4) + data)
        return last

    def take(self, frame: bytes) -> None:
        subscriber, payload = frame[0], frame[HEADER:]
        kind = self.kinds[subscriber]
        if kind == "dies":
            print("it is dead", flush=True)
            os._exit(3)
        if kind == "stuck" and subscriber in self.taken:
            self.is_stuck = True
        if self.is_stuck:
            return
        self.taken.add(subscriber)
        first = max(self.cycle, self.last_beat + 1)
        last = first + -(-len(frame) // self.lanes) - 1
        self.last_beat = last
        self.report(last, b"T" + le(first, 8) + le(last, 8))
        self.answer(kind, subscriber, payload, last)

    def answer(self, kind: str, subscriber: int, payload: bytes, last: int) -> None:
        frames = [le(subscriber + number, 1) + le(len(payload), 4) + payload for number in range(2)]
        if kind == "broken" and payload[:1] == b"\xee":
            self.report(last, b"E" + le(subscriber, 2) + le(7, 1) + le(last, 8))
        elif kind in ("echo", "twice", "broken", "grumpy"):
            end = self.send(subscriber, frames[0], last + 20)
            if kind == "twice":
                self.send(subscriber, frames[0], end + 300)
        elif kind == "across":
            self.send(1 - subscriber, le(1 - subscriber, 1) + frames[0][1:], last + 20)
        elif kind == "late":
            self.send(subscriber, frames[0], last + 5000)
        elif kind in ("parts", "beginning"):
            begun = [frame[: 2 * self.lanes] for frame in frames]
            rest = [frame[:1].ljust(self.lanes, b"\0") + frame[2 * self.lanes :] for frame in frames]
            end = last + 20
            for number, burst in enumerate(begun + rest if kind == "parts" else begun[:1]):
                end = self.send(subscriber + number % 2, burst, end + 1)
        elif kind == "garbled":
            self.send(subscriber, frames[0] + bytes(9), last + 20)
            self.send(200, le(200, 1) + frames[0][1:], last + 60)
        elif kind == "unknown":
            self.report(last, b"I" + le(last, 8))

    def run(self, cycles: int) -> bytes:
        """Run to the end of `cycles`, or of a cycle with reports; return these reports and the report of standstill."""
        while self.frames and not self.is_stuck:
            self.take(self.frames.popleft())
        end = self.cycle + cycles
        reports = b""
        if self.queue and self.queue[0][0] < end:
            event = self.queue[0][0]
            end = event + 1
            while self.queue and self.queue[0][0] == event:
                data = heappop(self.queue)[2]
                self.last_beat = max(self.last_beat, event if data[:1] not in (b"E", b"I") else 0)
                reports += data
        self.cycle = end
        return reports + b"S" + le(self.cycle, 8) + le(max(0, self.cycle - 1 - self.last_beat), 4)


def main(requests: BinaryIO, reports: BinaryIO) -> None:
    model = Model(int(sys.argv[1]), sys.argv[2:])
    reports.write(b"V\5")
    while letter := requests.read(1):
        if letter == b"F":
            model.frames.append(requests.read(int.from_bytes(requests.read(4), "little")))
            continue
        if letter == b"N":
            continue
        if letter == b"W":
            reports.write(b"W" + le(model.cycle, 8) + le(1, 2) + le(model.cycle, 4))
            continue
        if letter not in b"RQ":
            sys.exit(f"{letter!r} is no request")
        cycles = int.from_bytes(requests.read(4), "little") if letter == b"R" else 0
        reports.write(model.run(cycles))
        reports.flush()
        if letter == b"Q":
            sys.exit(4 if "grumpy" in model.kinds else 0)


if __name__ == "__main__":
    main(os.fdopen(3, "rb"), os.fdopen(4, "wb"))
