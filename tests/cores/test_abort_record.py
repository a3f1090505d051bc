"""The records of aborted frames for engines without `tuser`: no aborted frame has its length, and each has a record."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from fusesoc_firm.frame.faults import Fault
from fusesoc_firm.node.transport.abort_record import aborted_id
from fusesoc_firm.node.transport.simulator import Simulator
from fusesoc_firm.node.transport.transport import Burst
from tests.hdl.ghdl import Library, core_files
from tests.seeds import seeded

HERE = Path(__file__).parent
SEED = seeded(20261123)
ENTITY = "firm_axis_abort_record"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("abort_record"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse(core_files("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "sim/pipe"))
    library.analyse([HERE / "abort_record_bench.vhd"])
    library.make()
    return library


def _bursts(library: Library, width: int, stall: int, frames: list[tuple[bytes, bool]]) -> list[bytes]:
    """What follows from frames, some of which are aborted."""
    options = ["--std=93", "--work=firm", f"--workdir={library.directory}", f"-P{library.directory}"]
    generics = [f"-gWIDTH={width}", f"-gSTALL_PERCENT={stall}", f"-gSEED={SEED}"]
    found: list[bytes] = []
    with Simulator(["ghdl", "-r", *options, "abort_record_bench", *generics], library.directory) as simulator:
        for frame, is_aborted in frames:
            simulator.request(frame, is_aborted=is_aborted)
        while simulator.quiet < 300:
            found += [event.data for event in simulator.run(100) if isinstance(event, Burst)]
    return found


def _expected(frames: list[tuple[bytes, bool]], lanes: int) -> list[bytes]:
    found = []
    for frame, is_aborted in frames:
        if not is_aborted:
            found.append(frame)
            continue
        # All beats but the last one.
        sent = frame[: (len(frame) - 1) // lanes * lanes]
        found += [sent] if sent else []
        found.append(b"\xff" * 5 + bytes([frame[0], Fault.ABORTED]))
    return found


def _frames(lanes: int) -> list[tuple[bytes, bool]]:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    return [(source.randbytes(source.randint(1, 5 * lanes + 7)), source.random() < 0.4) for _ in range(80)]


@pytest.mark.parametrize("stall", [0, 40])
@pytest.mark.parametrize("width", [8, 16, 32, 64, 512])
def test_a_record_follows_each_aborted_frame(library: Library, width: int, stall: int) -> None:
    frames = _frames(width // 8)
    assert _bursts(library, width, stall, frames) == _expected(frames, width // 8)


@pytest.mark.parametrize("width", [8, 64])
def test_the_netlist_does_the_same(tmp_path: Path, width: int) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist(ENTITY, {"WIDTH": width})
    library.analyse([HERE / "abort_record_bench.vhd"])
    library.make()
    frames = _frames(width // 8)
    assert _bursts(library, width, 30, frames) == _expected(frames, width // 8)


@pytest.mark.parametrize("width", [8, 16, 512])
def test_it_is_latch_free(library: Library, width: int) -> None:
    assert library.latches(ENTITY, {"WIDTH": width}) == []


def test_an_illegal_width_is_named(library: Library) -> None:
    result = library.run(ENTITY, {"WIDTH": 24})
    assert result.exit_code != 0
    assert f"{ENTITY}: WIDTH is 24; legal: 8, 16, 32, 64, 128, 256, 512" in result.output


def test_only_a_record_is_read_as_one() -> None:
    record = b"\xff" * 5 + bytes([7, 10])
    assert aborted_id(record) == 7
    assert [aborted_id(burst) for burst in (b"", record[:-1], record + b"\0", b"\xfe" + record[1:])] == [None] * 4
