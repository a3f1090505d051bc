"""RTPS submessages from packets, against the reference's parser, which is compared with tshark in tests/fabric."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.cores.walks import masked, mixed_packets, walked
from tests.fabric.test_messages import random_packets
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/builder", "net/rtps")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("walker"))


def _library(directory: Path, standard: str = "93") -> Library:
    library = Library("firm", directory, standard)
    library.analyse([*core_files(*CORES), *core_files("net/rtps", fileset="tb")])
    return library


def _row(packet: bytes, before: int = 0, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (before, int(is_aborted), len(packet), *packet))) + "\n"


def _results(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[str]:
    (folder / "packets.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_rtps_walker_tb", generics, directory=folder)
    assert result.exit_code == 0, result.output
    return list(map(masked, (folder / "submessages.txt").read_text(encoding="ascii").splitlines()))


@pytest.mark.parametrize(("count", "slow"), [(300, 0), pytest.param(2000, 40, marks=pytest.mark.check)])
def test_each_field_is_where_the_reference_finds_it(library: Library, tmp_path: Path, count: int, slow: int) -> None:
    packets = mixed_packets(count, SEED + slow)
    wanted = [row for packet in packets for row in walked(packet)]
    kinds = Counter(" ".join(row.split()[:2]) if row[0] == "s" else row for row in wanted)
    assert len(kinds) == 8 + 3 and min(kinds.values()) > 10, kinds
    assert _results(library, tmp_path, list(map(_row, packets)), SLOW_PERCENT=slow, SEED=SEED) == wanted


def test_a_packet_that_is_aborted_anywhere_does_not_disturb_the_next(library: Library, tmp_path: Path) -> None:
    packets = [packet for packet, _, _ in random_packets(6, SEED)]
    cut = [(packet[: size + 1], packet) for packet in packets for size in range(0, len(packet), 3)]
    rows = [row for part, packet in cut for row in (_row(part, is_aborted=True), _row(packet))]
    found = _results(library, tmp_path, rows)
    ends = [place for place, row in enumerate(found) if not row.startswith("submessage")]
    wholes = [found[first + 1 : last + 1] for first, last in zip(ends[::2], ends[1::2], strict=True)]
    assert [found[place] for place in ends[::2]] == ["aborted"] * len(cut)
    assert wholes == [walked(packet) for _, packet in cut]


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_rtps_walker")
    library.analyse(core_files("net/rtps", fileset="tb"))
    packets = mixed_packets(40, SEED + 1)
    wanted = [row for packet in packets for row in walked(packet)]
    assert _results(library, tmp_path, list(map(_row, packets))) == wanted


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_rtps_walker") == []


def test_it_has_no_combinational_loop(tmp_path: Path) -> None:
    package, walker, *_ = core_files("net/rtps")
    assert loops("firm_rtps_walker", tmp_path, [walker], [package]) == []
