"""A simulator's end of the pipe (docs/reference/transports.md) before a model of a system: each frame comes back.

With `--word ADDRESS=WORD`, in hexadecimal digits, it has a status whose other registers are zero.

It is started as a command. `--fault` says what is to go wrong, when the frame with number `--at` has been taken.
"""

from __future__ import annotations

import argparse
import heapq
import os
import signal
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.node.engine.bursts import split_frame
from fusesoc_firm.system.status_frames import answered, status_answer

FAULTS = ("exit", "kill", "cut", "garbage", "hang", "unsent", "backwards", "long", "deaf", "error", "later")


@dataclass
class Simulator:
    """A frame of n beats takes n cycles to come in, a latency, and n cycles to go out, in bursts if asked."""

    width: int
    latency: int
    run_beats: int
    fault: str
    at: int
    words: dict[int, int] = field(default_factory=dict)
    percents: list[int] = field(default_factory=list)
    cycle: int = 0
    counted: int = 0
    moved: int = 0
    taken: int = 0
    begun: int = 0
    waiting: deque[bytes] = field(default_factory=deque)
    events: list[tuple[int, int, bytes]] = field(default_factory=list)
    out_free: int = 0

    def beats(self, data: bytes) -> int:
        return -(-len(data) * 8 // self.width)

    def put(self, frame: bytes) -> None:
        """A frame that is to be sent."""
        if not self.waiting:
            self.begun = self.cycle
        self.waiting.append(frame)

    def run(self, cycles: int) -> bytes:
        """The reports of a run."""
        end = self.cycle + cycles
        taking = self.begun + self.beats(self.waiting[0]) if self.waiting else end + 1
        leaving = self.events[0][0] if self.events else end + 1
        first = min(taking, leaving)
        if first > end:
            self.cycle = end
            return b""
        self.moved = first
        self.cycle = max(self.cycle, first + 1)
        return self.take(first) if taking <= leaving else self.leave(first)

    def take(self, now: int) -> bytes:
        frame = self.waiting.popleft()
        self.begun = now
        if self.words and (request := answered(frame)):
            frame = status_answer(request[0], self.words.get(request[0], 0))
        runs = [self.run_beats] * ((self.beats(frame) - 1) // self.run_beats) if self.run_beats else []
        out = max(now + self.latency, self.out_free)
        for number, burst in enumerate(split_frame(frame, self.width, runs)):
            out += self.beats(burst)
            heapq.heappush(self.events, (out, number, burst))
        self.out_free = out
        # What is answered may be longer than what was taken.
        begin = max(now - self.beats(frame) + 1, 0)
        report = b"T" + begin.to_bytes(8, "little") + now.to_bytes(8, "little")
        if self.taken == self.at:
            report += self.misbehave()
        self.taken += 1
        return report

    def leave(self, now: int) -> bytes:
        _, _, burst = heapq.heappop(self.events)
        cycles = (now - self.beats(burst) + 1).to_bytes(8, "little") + now.to_bytes(8, "little")
        return b"B" + burst[:1] + bytes(2) + cycles + len(burst).to_bytes(4, "little") + burst

    def misbehave(self) -> bytes:
        """What goes wrong now, if it is not the end."""
        if self.fault == "exit":
            sys.exit(3)
        if self.fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.fault == "cut":
            os.write(4, b"B" + bytes(19) + (100).to_bytes(4, "little") + b"half")
            sys.exit(4)
        if self.fault == "hang":
            time.sleep(1000)
        if self.fault == "later":
            threading.Timer(1, os._exit, [5]).start()
        return {
            "garbage": b"\xff" * 100,
            "unsent": (b"T" + bytes(16)) * 100,
            "backwards": b"S" + bytes(12),
            "long": b"B" + bytes(19) + b"\xff" * 4,
            "error": b"E\1\0\7" + self.cycle.to_bytes(8, "little") + b"I" + self.cycle.to_bytes(8, "little"),
        }.get(self.fault, b"")

    def waits(self) -> bytes:
        """The report of the cycles in which each wire waited: a percentage of all."""
        cycles, self.counted = self.cycle - self.counted, self.cycle
        counts = b"".join((cycles * percent // 100).to_bytes(4, "little") for percent in self.percents)
        return b"W" + self.cycle.to_bytes(8, "little") + len(self.percents).to_bytes(2, "little") + counts

    def standing(self) -> bytes:
        leaves = any(last - self.beats(burst) <= self.cycle for last, _, burst in self.events)
        quiet = 0 if self.waiting or leaves else min(self.cycle - self.moved, 2**32 - 1)
        return b"S" + self.cycle.to_bytes(8, "little") + quiet.to_bytes(4, "little")


@dataclass(frozen=True)
class Gate:
    """A file for which a model waits, and one that tells that it does."""

    path: Path

    @property
    def reached(self) -> Path:
        return self.path.with_suffix(".reached")

    def wait(self) -> None:
        """Wait in the model until the gate is opened, or its parent has ended."""
        self.reached.touch()
        # The shell between them has to run the model by `exec`.
        node = os.getppid()
        while not self.path.exists() and os.getppid() == node:
            time.sleep(0.01)

    def open(self) -> None:
        self.path.touch()

    def close(self) -> None:
        for path in (self.path, self.reached):
            path.unlink(missing_ok=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--width", type=int, default=8)
    parser.add_argument("--latency", type=int, default=10, help="cycles")
    parser.add_argument("--run-beats", type=int, default=0, help="beats of a burst; 0: frames are whole")
    parser.add_argument("--fault", choices=FAULTS, default="")
    parser.add_argument("--at", type=int, default=0)
    parser.add_argument("--word", action="append", default=[], metavar="ADDRESS=WORD")
    parser.add_argument("--waits", type=int, nargs="*", default=[], help="percent of the cycles on each wire")
    # The options of a real simulator are for its test bench.
    arguments, _ = parser.parse_known_args()
    words = {int(address, 16): int(word, 16) for address, _, word in (item.partition("=") for item in arguments.word)}
    options = arguments.width, arguments.latency, arguments.run_beats, arguments.fault, arguments.at
    simulator = Simulator(*options, words, arguments.waits)
    with open(3, "rb") as requests, open(4, "wb") as reports:
        reports.write(b"V\5")
        while (letter := requests.read(1)) not in (b"", b"Q"):
            if letter == b"W":
                reports.write(simulator.waits())
                continue
            if letter == b"N":
                continue
            number = int.from_bytes(requests.read(4), "little")
            if letter == b"F":
                simulator.put(requests.read(number))
            elif letter == b"R":
                reports.write(simulator.run(number) + simulator.standing())
                reports.flush()
            else:
                sys.exit(f"request {letter!r} is none")
        while arguments.fault == "deaf":
            time.sleep(1)
        reports.write(simulator.standing())


if __name__ == "__main__":
    main()
