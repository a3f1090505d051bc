"""Messages as frames: what firm_message_send sends, firm_message_receive receives, once, whole and in order."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hdl.ghdl import Library, core_files

BENCH = "firm_message_frames_tb"
# Widths with fields of less than a beat, a whole beat, and many beats, which are selected in several groups.
SIZES = [(8, 1), (8, 8), (8, 9), (8, 20), (8, 1041), (64, 64), (64, 192), (512, 100), (512, 1537)]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("frames"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host"))
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    return library


def _generics(width: int, bits: int, copies: int) -> dict[str, int | str]:
    return {"WIDTH": width, "FIELD_BITS": bits, "COPIES": copies}


@pytest.mark.one_in(9)
@pytest.mark.parametrize(("width", "bits"), SIZES)
@pytest.mark.parametrize("copies", [1, 2, 3, 5])
@pytest.mark.parametrize(("seed", "stall", "sink"), [(1, 30, 60), (2, 0, 30), (3, 70, 100)])
def test_random_sides(library: Library, width: int, bits: int, copies: int, seed: int, stall: int, sink: int) -> None:
    print(f"seed {seed}, stalls {stall} %, the sinks take in {sink} %")
    sides = {"SEED": seed, "STALL_PERCENT": stall, "SINK_PERCENT": sink, "MESSAGES": 60}
    result = library.run(BENCH, _generics(width, bits, copies) | sides)
    assert result.exit_code == 0, result.output
    assert f"PASS 60 messages, {copies} copies of each" in result.output


@pytest.mark.parametrize(("width", "bits", "copies"), [(8, 8, 1), (8, 20, 3), (64, 192, 1)])
def test_a_beat_a_cycle(library: Library, width: int, bits: int, copies: int) -> None:
    result = library.run(BENCH, _generics(width, bits, copies))
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("width", "bits", "copies"), [(8, 20, 1), (8, 20, 3), (64, 60, 2)])
@pytest.mark.parametrize("entity", ["firm_message_send", "firm_message_receive"])
def test_the_netlist_does_the_same(tmp_path: Path, entity: str, width: int, bits: int, copies: int) -> None:
    generics = _generics(width, bits, copies)
    library = _library(tmp_path)
    own = {name: value for name, value in generics.items() if name != "COPIES" or entity.endswith("send")}
    library.replace_by_netlist(entity, own)
    library.analyse([path for path in core_files("axis/axis", fileset="tb") if path.stem == BENCH])
    result = library.run(BENCH, generics | {"SEED": 5, "STALL_PERCENT": 30, "SINK_PERCENT": 50})
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(("width", "bits", "copies"), [(8, 8, 1), (8, 1041, 3), (512, 1537, 2)])
def test_there_is_no_latch(library: Library, width: int, bits: int, copies: int) -> None:
    assert library.latches("firm_message_send", _generics(width, bits, copies)) == []
    assert library.latches("firm_message_receive", {"WIDTH": width, "FIELD_BITS": bits}) == []


@pytest.mark.parametrize(
    ("entity", "generics", "fault"),
    [
        ("firm_message_send", {"WIDTH": 9}, "WIDTH is 9; legal: 8, 16, 32, 64, 128, 256, 512"),
        ("firm_message_send", {"FIELD_BITS": 0}, "FIELD_BITS is 0; legal: 1 or more"),
        ("firm_message_send", {"COPIES": 0}, "COPIES is 0; legal: 1 or more"),
        ("firm_message_receive", {"WIDTH": 1024}, "WIDTH is 1024; legal: 8, 16, 32, 64, 128, 256, 512"),
        ("firm_message_receive", {"FIELD_BITS": 0}, "FIELD_BITS is 0; legal: 1 or more"),
    ],
)
def test_an_illegal_generic_is_named(library: Library, entity: str, generics: dict[str, int | str], fault: str) -> None:
    result = library.run(entity, generics)
    assert result.exit_code != 0
    assert f"{entity}: {fault}" in result.output
