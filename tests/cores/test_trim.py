"""The trimmer of robot:axis:firm_axis alone: a frame has the length that it announces, or is aborted."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.hdl.frames import write_stimulus
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

WIDTHS = [8, 16, 32, 64, 128, 512]
SEED = seeded(20240608)
HEADER_BYTES = 5
STALLS = [(0, 0), (40, 0), (0, 60), (30, 30)]

Generics = dict[str, Generic]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("trim"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    _analyse_bench(library)
    return library


def _analyse_bench(library: Library) -> None:
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == "firm_axis_trim_tb"])


def _frames(width: int) -> list[bytes]:
    """Frames with a true length, and as many with one that lies, close by or far off."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    frames = []
    for _ in range(150):
        size = source.choice((0, 1, source.randrange(12), source.randrange(2 * width // 8 + 2), source.randrange(300)))
        lie = source.choice((0, 0, 0, 1, 2, 3, 4, 5, -1, -2, width // 8, -width // 8, 300, -300))
        announced = max(0, size + lie).to_bytes(4, "little")
        frames.append(source.randbytes(1) + announced + source.randbytes(size))
    return frames


def _expected(frame: bytes, slack: int) -> str:
    """A line of the bench: the bytes, and what the trimmer must say."""
    announced = int.from_bytes(frame[1:HEADER_BYTES], "little")
    payload = frame[HEADER_BYTES:]
    missing = announced - len(payload)
    if 0 <= missing <= slack:
        return (frame + bytes(missing)).hex()
    return f"{frame[:HEADER_BYTES].hex()} aborted {'cut' if missing < 0 else 'lacking'}"


def _run(library: Library, directory: Path, width: int, **generics: Generic) -> str:
    frames = _frames(width)
    write_stimulus(directory / "stimulus.txt", frames)
    result = library.run("firm_axis_trim_tb", {"WIDTH": width, "SEED": SEED, **generics}, directory=directory)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS", result.output
    assert "warning" not in result.output
    trimmed = (directory / "trimmed.txt").read_text(encoding="ascii").splitlines()
    slack = int(generics.get("SLACK", 0))
    assert trimmed == [_expected(frame, slack) for frame in frames]
    return result.output


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("slack", [0, 3])
@pytest.mark.parametrize(("source_stall", "sink_stall"), STALLS)
@pytest.mark.parametrize("width", WIDTHS)
def test_every_frame_has_its_length_or_is_aborted(
    library: Library, tmp_path: Path, width: int, source_stall: int, sink_stall: int, slack: int
) -> None:
    stalls: Generics = {"SOURCE_STALL_PERCENT": source_stall, "SINK_STALL_PERCENT": sink_stall}
    for is_full in (False, True):
        _run(library, tmp_path, width, SLACK=slack, FULL_PIECES=is_full, **stalls)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", WIDTHS)
def test_only_an_abort_holds_the_input_up(library: Library, tmp_path: Path, width: int) -> None:
    """The end of an aborted frame waits for two cycles at most, regardless of the missing bytes."""
    aborted = sum("aborted" in _expected(frame, 0) for frame in _frames(width))
    waits = re.search(r"^(\d+) waits$", _run(library, tmp_path, width), re.MULTILINE)
    assert waits and int(waits[1]) <= 2 * aborted


@pytest.mark.parametrize("width", [8, 16, 64])
def test_the_netlist_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_axis_trim", {"WIDTH": width, "SLACK": 3})
    _analyse_bench(library)
    _run(library, tmp_path, width, SLACK=3, SOURCE_STALL_PERCENT=30, SINK_STALL_PERCENT=30)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [*WIDTHS, 256])
def test_it_is_latch_free(library: Library, width: int) -> None:
    assert library.latches("firm_axis_trim", {"WIDTH": width}) == []


@pytest.mark.parametrize("width", [24, 1024])
def test_an_illegal_width_is_named(library: Library, width: int) -> None:
    result = library.run("firm_axis_trim", {"WIDTH": width})
    assert result.exit_code != 0
    assert f"firm_axis_trim: WIDTH is {width}; legal: 8, 16, 32, 64, 128, 256, 512" in result.output
