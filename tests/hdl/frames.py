"""Frames and the files of the simulated host (docs/reference/simulation-host.md), for tests of the cores."""

from __future__ import annotations

import random
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

BYTES_PER_LINE = 64


@dataclass(frozen=True)
class Frame:
    """A frame with a true length."""

    id: int
    payload: bytes

    def to_bytes(self, id_bytes: int = 1) -> bytes:
        """Id, length, payload."""
        return self.id.to_bytes(id_bytes, "little") + len(self.payload).to_bytes(4, "little") + self.payload

    def beats(self, width: int, id_bytes: int = 1) -> int:
        """The beats it takes on a stream of `width` bits."""
        return -(-len(self.to_bytes(id_bytes)) * 8 // width)


def random_frames(ids: Sequence[int], count: int, longest: int, seed: int) -> list[Frame]:
    """`count` frames with ids drawn from `ids` and payloads of 0 to `longest` bytes; prints the seed."""
    print(f"frames from seed {seed}")
    source = random.Random(seed)
    return [Frame(source.choice(ids), source.randbytes(source.randint(0, longest))) for _ in range(count)]


def write_stimulus(path: Path, frames: Iterable[bytes], aborted: Collection[int] = (), id_bytes: int = 1) -> None:
    """A stimulus file; frame n has the label `frame n`, and is aborted if n is in `aborted`."""
    text = "".join(
        f"> frame {n}\n{_hex_lines(frame)}"
        + (f"! aborted {int.from_bytes(frame[:id_bytes], 'little')} 10\n" if n in aborted else "")
        for n, frame in enumerate(frames)
    )
    path.write_text(text, encoding="ascii")


def write_expected(path: Path, frames: Iterable[tuple[int, bytes]], id_errors: int = 0) -> None:
    """An expected file of (index of the causing stimulus, frame)."""
    text = f"! id_error {id_errors}\n" if id_errors else ""
    text += "".join(f"< @{cause} answer to {cause}\n{_hex_lines(frame)}" for cause, frame in frames)
    path.write_text(text, encoding="ascii")


def _hex_lines(frame: bytes) -> str:
    starts = range(0, len(frame), BYTES_PER_LINE)
    return "".join(f"  {frame[start : start + BYTES_PER_LINE].hex()}\n" for start in starts)


@dataclass(frozen=True)
class Traffic:
    """The figures of the host's report: `cycles` from the first beat in to the last beat out."""

    cycles: int
    beats_in: int
    beats_out: int


def traffic(report: str) -> Traffic:
    """Read the figures from the host's report."""
    cycles = re.search(r"(\d+) cycles from the first beat in to the last beat out", report)
    beats = re.search(r"in: (\d+) beats, .*; out: (\d+) beats", report)
    assert cycles and beats, report
    return Traffic(int(cycles[1]), int(beats[1]), int(beats[2]))
