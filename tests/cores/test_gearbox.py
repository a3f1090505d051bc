"""The byte gearboxes of robot:axis:firm_axis, window and packer, against the bytes that went in."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.hdl.frames import random_frames, traffic, write_expected, write_stimulus
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

WIDTHS = [8, 16, 32, 64, 128, 512]
SEED = seeded(20240601)

# Chances in percent: of the source, and of the reader or sink.
STALLS = [(0, 0), (40, 0), (0, 60), (30, 30)]

Generics = dict[str, Generic]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("gearbox"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts"))
    library.analyse(core_files("axis/axis", fileset="tb"))
    return library


def _write_frames(directory: Path, width: int) -> list[bytes]:
    """Frames of 1 byte to some hundreds, in random order; many are short, many end with a beat or next to its end."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    lanes = width // 8
    sizes = [source.randint(1, source.choice([3, lanes, 4 * lanes, 300])) for _ in range(100)]
    sizes += [max(1, lanes * source.randint(1, 4) + source.randint(-1, 1)) for _ in range(50)]
    source.shuffle(sizes)
    return _write(directory, [source.randbytes(size) for size in sizes])


def _write_long_frames(directory: Path, width: int) -> list[bytes]:
    """Frames of 30 beats and some bytes."""
    print(f"frames from seed {SEED}")
    source = random.Random(SEED)
    lanes = width // 8
    return _write(directory, [source.randbytes(30 * lanes + source.randrange(lanes)) for _ in range(20)])


def _write(directory: Path, frames: list[bytes]) -> list[bytes]:
    write_stimulus(directory / "stimulus.txt", frames)
    return frames


def _beats(frames: list[bytes], width: int) -> int:
    return sum(-(-len(frame) * 8 // width) for frame in frames)


def _run(library: Library, directory: Path, bench: str, generics: Generics) -> str:
    result = library.run(bench, generics, directory=directory)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS", result.output
    return result.output


def _figures(report: str, *names: str) -> list[int]:
    """The numbers before these words in a bench's report."""
    found = [re.search(rf"(\d+) {name}", report) for name in names]
    return [int(match[1]) for match in found if match]


def _window(library: Library, directory: Path, frames: list[bytes], generics: Generics) -> str:
    """Run the bench of the window and compare what was taken, frame by frame."""
    report = _run(library, directory, "firm_axis_window_tb", generics)
    void = int(generics.get("VOID_LANES", 0))
    lines = (directory / "taken.txt").read_text(encoding="ascii").split()
    assert len(lines) == len(frames)
    for frame, line in zip(frames, lines, strict=True):
        taken, is_skipped = line[:-1], line.endswith("~")
        expected = frame[void:].hex()
        assert expected.startswith(taken) if is_skipped else taken == expected
    assert any(line.endswith("~") for line in lines) == ("SKIP_PERCENT" in generics)
    return report


def _pack(library: Library, directory: Path, frames: list[bytes], generics: Generics) -> str:
    """Run the bench of the packer and compare the frames."""
    report = _run(library, directory, "firm_axis_pack_tb", generics)
    assert (directory / "packed.txt").read_text(encoding="ascii").split() == [frame.hex() for frame in frames]
    return report


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("source_stall", "reader_stall"), STALLS)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_window_shows_every_byte(
    library: Library, tmp_path: Path, width: int, source_stall: int, reader_stall: int
) -> None:
    frames = _write_frames(tmp_path, width)
    stalls: Generics = {"SOURCE_STALL_PERCENT": source_stall, "READER_STALL_PERCENT": reader_stall}
    for take in ("random", "all", "full"):
        generics: Generics = {"WIDTH": width, "SEED": SEED, "TAKE": take, **stalls}
        _window(library, tmp_path, frames, {**generics, "VOID_LANES": min(1, width // 8 - 1)})


@pytest.mark.parametrize("void", [0, 1, 2, 7])
def test_the_window_leaves_void_lanes_out(library: Library, tmp_path: Path, void: int) -> None:
    """Frames of nothing but void lanes are among them: they show as no byte, the last."""
    frames = _write_frames(tmp_path, 64)
    assert void == 0 or any(len(frame) <= void for frame in frames)
    _window(library, tmp_path, frames, {"WIDTH": 64, "VOID_LANES": void, "SEED": SEED, "SOURCE_STALL_PERCENT": 20})


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("source_stall", "reader_stall"), STALLS)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_window_skips_the_rest_of_a_frame(
    library: Library, tmp_path: Path, width: int, source_stall: int, reader_stall: int
) -> None:
    frames = _write_frames(tmp_path, width)
    stalls: Generics = {"SOURCE_STALL_PERCENT": source_stall, "READER_STALL_PERCENT": reader_stall}
    for skip in (5, 30, 100):
        generics: Generics = {"WIDTH": width, "SEED": SEED, "SKIP_PERCENT": skip, **stalls}
        _window(library, tmp_path, frames, {**generics, "VOID_LANES": min(1, width // 8 - 1)})


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_window_takes_a_beat_a_cycle_in(library: Library, tmp_path: Path, width: int) -> None:
    """Across frames too; the window is empty for one cycle at most, where a frame's last bytes were in two beats."""
    frames = _write_frames(tmp_path, width)
    generics: Generics = {"WIDTH": width, "SEED": SEED, "TAKE": "all", "VOID_LANES": min(1, width // 8 - 1)}
    report = _window(library, tmp_path, frames, generics)
    beats, waits, idle = _figures(report, "beats", "waits", "cycles idle between frames")
    assert (beats, waits) == (_beats(frames, width), 0)
    assert idle <= (width > 8)


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_window_skips_a_beat_a_cycle(library: Library, tmp_path: Path, width: int) -> None:
    frames = _write_long_frames(tmp_path, width)
    report = _window(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "SKIP_PERCENT": 100})
    assert _figures(report, "beats", "waits") == [_beats(frames, width), 0]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_window_gives_whole_windows_at_any_offset(library: Library, tmp_path: Path, width: int) -> None:
    """A frame whose first bytes are taken alone can need one cycle more than it has beats."""
    frames = _write_long_frames(tmp_path, width)
    report = _window(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "TAKE": "full"})
    beats, waits = _figures(report, "beats", "waits")
    assert beats == _beats(frames, width)
    assert waits <= len(frames)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize(("source_stall", "sink_stall"), STALLS)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_packer_keeps_every_byte(
    library: Library, tmp_path: Path, width: int, source_stall: int, sink_stall: int
) -> None:
    frames = _write_frames(tmp_path, width)
    stalls: Generics = {"SOURCE_STALL_PERCENT": source_stall, "SINK_STALL_PERCENT": sink_stall}
    for pieces in ("random", "shifted", "full"):
        _pack(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "PIECES": pieces, **stalls})


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_packer_makes_nothing_of_an_empty_frame(library: Library, tmp_path: Path, width: int) -> None:
    frames = _write_frames(tmp_path, width)
    for pieces in ("random", "full"):
        _pack(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "PIECES": pieces, "EMPTY_FRAMES": True})


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_packer_shows_a_beat_before_it_is_asked(library: Library, tmp_path: Path, width: int) -> None:
    frames = _write_frames(tmp_path, width)
    _pack(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "LATE_READY": True})


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("pieces", ["random", "shifted", "full"])
@pytest.mark.parametrize("width", WIDTHS)
def test_the_packer_never_holds_its_input_up(library: Library, tmp_path: Path, width: int, pieces: str) -> None:
    """And full pieces, across frames, leave no gap behind it."""
    frames = _write_frames(tmp_path, width)
    report = _pack(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "PIECES": pieces})
    waits, beats, gaps = _figures(report, "waits", "beats", "gaps")
    assert (waits, beats) == (0, _beats(frames, width))
    assert gaps == 0 or pieces != "full"


@pytest.mark.one_in(4)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_packer_gives_a_beat_a_cycle_at_any_offset(library: Library, tmp_path: Path, width: int) -> None:
    """A frame that begins with a short piece has one piece more than beats at most."""
    frames = _write_long_frames(tmp_path, width)
    report = _pack(library, tmp_path, frames, {"WIDTH": width, "SEED": SEED, "PIECES": "shifted"})
    waits, beats, gaps = _figures(report, "waits", "beats", "gaps")
    assert (waits, beats) == (0, _beats(frames, width))
    assert gaps <= len(frames)


@pytest.mark.one_in(7, 3)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("stall", [0, 20, 50])
def test_the_packer_joins_what_the_window_cuts(library: Library, tmp_path: Path, width: int, stall: int) -> None:
    frames = random_frames(range(256), 100, max(40, width // 2), SEED)
    write_stimulus(tmp_path / "stimulus.txt", (frame.to_bytes() for frame in frames))
    write_expected(tmp_path / "expected.txt", ((n, frame.to_bytes()) for n, frame in enumerate(frames)))
    generics: Generics = {"PART": "gearbox", "WIDTH": width, "SEED": SEED, "STALL_PERCENT": stall}
    result = library.run("firm_axis_pipe_tb", generics, directory=tmp_path)
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1] == "PASS 100/100"
    if stall == 0:
        latency = 2 if width == 8 else 4
        assert traffic(result.output).cycles == sum(frame.beats(width) for frame in frames) + latency


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_gearboxes_give_no_warnings(library: Library, tmp_path: Path, width: int) -> None:
    """Of numbers with undefined bits, though undefined is what lies in unused lanes and before the first frame."""
    frames = _write_frames(tmp_path, width)
    assert "warning" not in _window(library, tmp_path, frames, {"WIDTH": width})
    assert "warning" not in _pack(library, tmp_path, frames, {"WIDTH": width})


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [8, 16, 32, 64])
def test_the_netlist_of_the_window_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    void: Generics = {"WIDTH": width, "VOID_LANES": min(1, width // 8 - 1)}
    library.replace_by_netlist("firm_axis_window", void)
    library.analyse(core_files("axis/axis", fileset="tb"))
    frames = _write_frames(tmp_path, width)
    stalls: Generics = {"SEED": SEED, "SOURCE_STALL_PERCENT": 30, "READER_STALL_PERCENT": 30}
    _window(library, tmp_path, frames, {**void, **stalls, "SKIP_PERCENT": 10})


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [8, 16, 32, 64])
def test_the_netlist_of_the_packer_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_axis_pack", {"WIDTH": width})
    library.analyse(core_files("axis/axis", fileset="tb"))
    frames = _write_frames(tmp_path, width)
    stalls: Generics = {"SEED": SEED, "SOURCE_STALL_PERCENT": 30, "SINK_STALL_PERCENT": 30}
    _pack(library, tmp_path, frames, {"WIDTH": width, **stalls})


@pytest.mark.one_in(3)
@pytest.mark.parametrize("width", [*WIDTHS, 256])
def test_the_gearboxes_are_latch_free(library: Library, width: int) -> None:
    assert library.latches("firm_axis_window", {"WIDTH": width, "VOID_LANES": min(1, width // 8 - 1)}) == []
    assert library.latches("firm_axis_pack", {"WIDTH": width}) == []


@pytest.mark.parametrize(
    ("entity", "generics", "legal"),
    [
        ("firm_axis_window", {"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_window", {"WIDTH": 1024}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_window", {"VOID_LANES": 1, "WIDTH": 8}, "0 to 0"),
        ("firm_axis_window", {"VOID_LANES": 8, "WIDTH": 64}, "0 to 7"),
        ("firm_axis_window", {"VOID_LANES": -1, "WIDTH": 64}, "0 to 7"),
        ("firm_axis_pack", {"WIDTH": 24}, "8, 16, 32, 64, 128, 256, 512"),
        ("firm_axis_pack", {"WIDTH": 1024}, "8, 16, 32, 64, 128, 256, 512"),
    ],
)
def test_illegal_generics_are_named(library: Library, entity: str, generics: Generics, legal: str) -> None:
    result = library.run(entity, generics)
    assert result.exit_code != 0
    (name, value) = next(iter(generics.items()))
    assert f"{entity}: {name} is {value}; legal: {legal}" in result.output
