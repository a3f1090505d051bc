"""The parts of firm_net_link: payloads out of the Manager's frames, and the frames of several sources in one stream."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops

SEED = 20261127
DEPTH = 64
HEAD_BYTES = 5
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac")
# All of the node but its user.
NODE = (
    "axis/package",
    "axis/axis",
    "net/mac",
    "net/streams",
    "net/responder",
    "net/presence",
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


Frames = list[tuple[bytes, bool]]


def _frames(chance: random.Random) -> Frames:
    """Frames with their ends: some are aborted, some are too long, and some end before the payload."""
    return [
        (chance.randbytes(HEAD_BYTES + chance.choice((0, 1, 2, 32, DEPTH - 2, DEPTH - 1, DEPTH, 200))), is_aborted)
        if chance.random() < 0.9
        else (chance.randbytes(chance.randrange(1, HEAD_BYTES)), True)
        for is_aborted in (chance.random() < 0.2 for _ in range(150))
    ]


def _good(frames: Frames) -> list[bytes]:
    payloads = (frame[HEAD_BYTES:] for frame, is_aborted in frames if not is_aborted)
    return [payload for payload in payloads if 0 < len(payload) < DEPTH]


def _check(library: Library, folder: Path, **generics: Generic) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    streams = _frames(chance), _frames(chance)
    for name, frames in zip(("first", "second"), streams, strict=True):
        rows = [" ".join(map(str, (int(aborted), len(frame), *frame))) for frame, aborted in frames]
        (folder / f"{name}.txt").write_text("\n".join(rows) + "\n", encoding="ascii")
    result = library.run("firm_net_samples_tb", {"DEPTH": DEPTH, "SEED": SEED, **generics}, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "samples.txt").read_text(encoding="ascii").splitlines()
    came = [bytes(map(int, line.split()[1:])) for line in lines if not line.startswith("long")]
    wanted = [_good(frames) for frames in streams]
    assert sorted(came) == sorted(payload for payloads in wanted for payload in payloads)
    for payloads in wanted:
        # The order holds for each stream.
        left = iter(came)
        assert all(payload in left for payload in payloads)
    for number, frames in enumerate(streams):
        refused = sum(len(frame) - HEAD_BYTES >= DEPTH and not is_aborted for frame, is_aborted in frames)
        assert lines.count(f"long {number}") == refused > 10


@pytest.mark.parametrize(("slow", "stall"), [(0, 0), (30, 40)])
def test_whole_payloads_leave_in_order_and_no_others(library: Library, tmp_path: Path, slow: int, stall: int) -> None:
    _check(library, tmp_path, SLOW_PERCENT=slow, STALL_PERCENT=stall)


def test_the_netlists_do_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_net_samples", {"DEPTH": DEPTH})
    library.replace_by_netlist("firm_net_merge", {"SOURCES": 2})
    library.analyse(core_files("net/net_node", fileset="tb"))
    _check(library, tmp_path, SLOW_PERCENT=20, STALL_PERCENT=20)


@pytest.mark.parametrize("entity", ["firm_net_samples", "firm_net_merge"])
def test_it_has_no_latch(library: Library, entity: str) -> None:
    assert library.latches(entity) == []


@pytest.mark.check
def test_the_node_has_no_combinational_loop(tmp_path: Path) -> None:
    *parts, link = core_files(*NODE)
    assert loops("firm_net_link", tmp_path, [link], parts) == []


@pytest.mark.parametrize(("entity", "generic"), [("firm_net_merge", "SOURCES"), ("firm_net_link", "CLOCK_HZ")])
def test_illegal_generics_are_refused(tmp_path: Path, entity: str, generic: str) -> None:
    library = Library("firm", tmp_path)
    library.analyse(core_files(*NODE))
    result = library.run(entity, {generic: 0}, directory=tmp_path)
    assert result.exit_code != 0
    assert re.search(f"{entity}: {generic} is 0; legal: 1 ", result.output), result.output
