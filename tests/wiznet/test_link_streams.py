"""The streams of the link to a chip: no byte is lost while the chip starts, and damaged frames are aborted."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.fabric.sequencer import Assembler, Rom
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

SEED = seeded(20261126)
END, DAMAGED = 0xFF, 0xEE
# Gives what it takes. A frame ends with END; the last byte of an aborted one becomes DAMAGED.
PROGRAM = f"""\
local next 2
here:
  jump_frame go
  jump here
go:
  take
  jump_aborted gone
  comparei {END}
  jump_zero ended
  give
  jump here
gone:
  set {DAMAGED}
ended:
  give_last
  jump here
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    library = Library("firm", tmp_path_factory.mktemp("link"))
    library.analyse(core_files("axis/package", "axis/axis", "cdc/sync", "net/streams", "net/wiznet", "net/wiznet_node"))
    library.analyse([Path(__file__).with_name("link_bench.vhd")])
    return library


Beat = tuple[list[int], list[int], bool, bool]


def _beats(frame: bytes, lanes: int) -> list[Beat]:
    """A frame as beats: bytes, tkeep, tuser and tlast."""
    beats = []
    for at in range(0, len(frame), lanes):
        part = frame[at : at + lanes]
        rest = lanes - len(part)
        beats.append(([*part, *[0] * rest], [1] * len(part) + [0] * rest, False, at + lanes >= len(frame)))
    return beats


@pytest.mark.parametrize("width", [8, 16, 64])
def test_all_frames_arrive_from_the_first_cycle_on(library: Library, tmp_path: Path, width: int) -> None:
    """A source that offers beats without a pause, also while the chip is in reset; some frames are damaged."""
    print(f"seed {SEED}")
    rng, lanes = random.Random(SEED), width // 8
    beats: list[Beat] = []
    wanted: list[list[bytes]] = []
    for number in range(40):
        frame = bytes(rng.randrange(DAMAGED) for _ in range(rng.choice([3, 30, 100, 200])))
        kind = number % 4
        parts = _beats(frame + bytes([END]), lanes)
        possible = [frame + bytes([END])]
        if kind == 1:
            data, keep, _, last = parts[-1]
            parts[-1] = data, keep, True, last
            possible = [frame + bytes([DAMAGED])]
        elif kind == 3 and lanes > 1:
            # A hole in a beat breaks the frame there; the byte before carries the mark, or a void one if that has left.
            at = rng.randrange(len(parts))
            data, _, user, last = parts[at]
            parts[at] = data, [0, *[1] * (lanes - 1)], user, last
            begin = frame[: at * lanes]
            possible = [part + bytes([DAMAGED]) for part in (begin, begin[:-1])]
        beats += parts
        wanted.append(possible)
    rom = Rom()
    Assembler(rom, {}).read(PROGRAM)
    (tmp_path / "rom.txt").write_text("".join(f"{byte}\n" for byte in rom.image()))
    rows = (" ".join(map(str, [*data, *keep, int(user), int(last)])) for data, keep, user, last in beats)
    (tmp_path / "beats.txt").write_text("".join(f"{row}\n" for row in rows))
    options = ("--ieee-asserts=disable",)
    result = library.run("link_bench", {"WIDTH": width, "FRAMES": 40}, directory=tmp_path, options=options)
    assert result.exit_code == 0, result.output
    found = [b""]
    for row in (tmp_path / "results.txt").read_text().splitlines():
        byte, is_last = map(int, row.split())
        found[-1] += bytes([byte])
        found += [b""] * is_last
    assert found.pop() == b""
    assert len(found) == len(wanted)
    assert all(frame in possible for frame, possible in zip(found, wanted, strict=True))
