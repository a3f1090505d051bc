"""The node between a line and a system's streams, and the frames of several sources in one stream."""

from __future__ import annotations

import random
from itertools import chain
from pathlib import Path

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts")
# All of the node but its user.
NODE = (
    "axis/package",
    "axis/axis",
    "net/mac",
    "net/streams",
    "net/package",
    "net/responder",
    "net/reassembly",
    "net/presence",
    "net/dhcp",
    "net/status",
    "net/udp",
    "net/rtps",
    "net/builder",
    "net/net_node",
)


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    rtl = [path for path in core_files("net/net_node") if path.stem != "firm_net_link"]
    library.analyse([*core_files(*CORES), *rtl, *core_files("net/net_node", fileset="tb")])
    return library


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("link"))


def _check(library: Library, folder: Path, **generics: Generic) -> tuple[list[bytes], list[list[bytes]]]:
    """The frames that leave, and those of each source."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    sources = [[chance.randbytes(chance.choice((1, 2, 3, 60, 200))) for _ in range(150)] for _ in range(2)]
    for name, frames in zip(("first", "second"), sources, strict=True):
        rows = [" ".join(map(str, (0, 0, len(frame), *frame))) for frame in frames]
        (folder / f"{name}.txt").write_text("\n".join(rows) + "\n", encoding="ascii")
    result = library.run("firm_net_merge_tb", {"SEED": SEED, **generics}, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "merged.txt").read_text(encoding="ascii").splitlines()
    came = [bytes(map(int, line.split()[1:])) for line in lines]
    assert sorted(came) == sorted(chain(*sources))
    for frames in sources:
        # The order holds for each source.
        left = iter(came)
        assert all(frame in left for frame in frames)
    return came, sources


@pytest.mark.parametrize(("slow", "stall"), [(0, 0), (30, 40)])
def test_whole_frames_leave_in_the_order_of_each_source(
    library: Library, tmp_path: Path, slow: int, stall: int
) -> None:
    _check(library, tmp_path, SLOW_PERCENT=slow, STALL_PERCENT=stall)


def test_no_source_keeps_another_from_sending(library: Library, tmp_path: Path) -> None:
    """Both always have a frame: they take turns."""
    came, sources = _check(library, tmp_path)
    assert came == list(chain.from_iterable(zip(*sources, strict=True)))


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_net_merge", {"SOURCES": 2})
    library.analyse(core_files("net/net_node", fileset="tb"))
    _check(library, tmp_path, SLOW_PERCENT=20, STALL_PERCENT=20)


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_net_merge") == []


@pytest.mark.check
def test_the_node_has_no_combinational_loop(tmp_path: Path) -> None:
    *parts, link = core_files(*NODE)
    assert loops("firm_net_link", tmp_path, [link], parts) == []


@pytest.mark.parametrize(
    ("entity", "generic", "value", "legal"),
    [
        ("firm_net_merge", "SOURCES", 0, "1 or more"),
        ("firm_net_link", "CLOCK_HZ", 0, "1 and more"),
        ("firm_net_link", "REASSEMBLIES", 5, "0 to 4"),
    ],
)
def test_illegal_generics_are_refused(tmp_path: Path, entity: str, generic: str, value: int, legal: str) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files(*NODE))
    result = library.run(entity, {generic: value}, directory=tmp_path)
    assert result.exit_code != 0
    assert f"{entity}: {generic} is {value}; legal: {legal}" in result.output, result.output
