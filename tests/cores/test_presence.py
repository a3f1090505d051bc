"""Membership reports, probes for the board's address, and hosts that have it: frames against a model."""

from __future__ import annotations

import random
import shutil
import subprocess
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from fusesoc_firm.fabric.presence import PROBE, REPORT, frames_of
from fusesoc_firm.system.derived.model import Network
from tests.cores.ethernet import fcs, is_set, padded, write_capture
from tests.cores.presence import is_conflict, is_probe, is_query, query, random_frame
from tests.cores.requests import ADDRESS, MAC
from tests.hdl.ghdl import Generic, Library, core_files
from tests.seeds import seeded

SEED = seeded(20261127)
TICK_CYCLES = 8
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/package", "net/presence")
# The lower bits of the MAC address tell the delay of an answer.
DELAY = 8 * (MAC[-1] & 63)
NETWORK = Network(MAC, IPv4Address(ADDRESS), IPv4Address("255.255.255.0"), None, "board", "/", 0)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("presence"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/presence", fileset="tb")])
    return library


def _row(frame: bytes, before: int, *, is_aborted: bool = False) -> str:
    return " ".join(map(str, (before, int(is_aborted), len(frame), *frame))) + "\n"


def _events(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[tuple[int, str]]:
    """Each event with its millisecond."""
    (folder / "frames.txt").write_text("".join(rows), encoding="ascii")
    result = library.run("firm_net_presence_tb", {"TICK_CYCLES": TICK_CYCLES, **generics}, directory=folder)
    assert result.exit_code == 0, result.output
    lines = (folder / "presence.txt").read_text(encoding="ascii").splitlines()
    return [(int(ms), what) for ms, what in map(str.split, lines)]


def test_reports_and_probes_are_repeated(library: Library, tmp_path: Path) -> None:
    events = _events(library, tmp_path, [], LAST_TICKS=69_000)
    seconds = [1, 2, 3, 4, 65, 66, 67, 68]
    for kind in ("report", "probe"):
        assert [ms // 1000 for ms, what in events if what == kind] == seconds
    assert all(ms % 1000 <= 1 for ms, _ in events)


def _concerns(library: Library, folder: Path, seed: int, *, in_use: bool = True) -> None:
    """Frames that are far apart: each has its own answer, besides those of the first seconds."""
    print(f"seed {seed}")
    chance = random.Random(seed)
    frames = [random_frame(chance) for _ in range(400)]
    aborted = [chance.random() < 0.1 for _ in frames]
    # All come after the repetitions of the first seconds, and before those of the next ones.
    rows = [
        _row(frame, 4200 * TICK_CYCLES if number == 0 else chance.randrange(400, 800), is_aborted=is_aborted)
        for number, (frame, is_aborted) in enumerate(zip(frames, aborted, strict=True))
    ]
    events = _events(library, folder, rows, SEED=seed, SLOW_PERCENT=20, IN_USE=in_use)
    later = [what for ms, what in events if ms > 4100]
    known = [frame for frame, is_aborted in zip(frames, aborted, strict=True) if not is_aborted]
    probes = 0 if in_use else sum(map(is_probe, known))
    assert (probes > 10) != in_use
    assert later.count("taken") == sum(map(is_conflict, known)) + probes > 20
    if in_use:
        assert later.count("report") == sum(map(is_query, known)) > 20
    else:
        assert "report" not in [what for _, what in events]
        assert [what for _, what in events].count("probe") == 4
    assert later.count("probe") == 0


@pytest.mark.parametrize("seed", [SEED, SEED + 1])
def test_queries_are_answered_and_conflicts_reported(library: Library, tmp_path: Path, seed: int) -> None:
    _concerns(library, tmp_path, seed)


def test_an_address_that_is_not_in_use_yet_is_only_probed_for(library: Library, tmp_path: Path) -> None:
    _concerns(library, tmp_path, SEED, in_use=False)


def test_an_answer_is_delayed_and_given_once(library: Library, tmp_path: Path) -> None:
    first = 4200
    events = _events(library, tmp_path, [_row(query(), first * TICK_CYCLES), _row(query(), 0)])
    (ms,) = [ms for ms, what in events if what == "report" and ms >= first]
    # A frame takes some milliseconds here.
    assert first + DELAY < ms <= first + DELAY + 2 * 60 // TICK_CYCLES


def _answers(library: Library, folder: Path, *queries: tuple[int, int]) -> list[int]:
    """The milliseconds of the answers after the first query; each comes at a millisecond and allows some tenths."""
    rows, now = [], 0
    for ms, tenths in queries:
        frame = query(tenths=tenths)
        rows.append(_row(frame, (4200 + ms) * TICK_CYCLES - now))
        now = (4200 + ms) * TICK_CYCLES + len(frame)
    events = _events(library, folder, rows, MAC_END=63)
    return [ms - 4200 for ms, what in events if what == "report" and ms >= 4200]


@pytest.mark.parametrize(
    ("tenths", "wait"), [(0, 504), (1, 56), (2, 120), (3, 248), (5, 248), (6, 504), (100, 504), (255, 504)]
)
def test_an_answer_comes_within_the_time_that_the_query_allows(
    library: Library, tmp_path: Path, tenths: int, wait: int
) -> None:
    (ms,) = _answers(library, tmp_path, (0, tenths))
    # A frame takes some milliseconds here.
    assert wait < ms <= wait + 2 * 60 // TICK_CYCLES


@pytest.mark.parametrize(
    ("queries", "wait"),
    [(((0, 10), (100, 1)), 156), (((0, 10), (100, 2), (110, 1)), 166), (((0, 1), (30, 10)), 56)],
)
def test_the_query_that_is_answered_first_counts(
    library: Library, tmp_path: Path, queries: tuple[tuple[int, int], ...], wait: int
) -> None:
    (ms,) = _answers(library, tmp_path, *queries)
    assert wait < ms <= wait + 2 * 60 // TICK_CYCLES


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_net_presence", {})
    library.analyse(core_files("net/presence", fileset="tb"))
    _concerns(library, tmp_path, SEED)


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_net_presence") == []


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_sees_a_report_and_a_probe(tmp_path: Path) -> None:
    frames = frames_of(NETWORK)
    assert [*frames] == [REPORT, PROBE]
    write_capture(tmp_path / "sent.pcap", [padded(frame) + fcs(padded(frame)) for frame in frames.values()])
    checks = ["-o", "ip.check_checksum:TRUE"]
    names = ["ip.checksum.status", "igmp.type", "igmp.version", "igmp.checksum.status", "igmp.maddr", "ip.ttl"]
    names += ["arp.isprobe", "arp.dst.proto_ipv4", "arp.src.hw_mac", "_ws.malformed"]
    shown = [word for name in names for word in ("-e", name)]
    done = subprocess.run(
        ["tshark", "-r", "sent.pcap", *checks, "-T", "fields", *shown],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    report, probe = [line.split("\t") for line in done.stdout.splitlines()]
    assert report == ["1", "0x16", "2", "1", "239.255.0.1", "1", "", "", "", ""]
    assert is_set(probe[6])
    assert probe[7:] == ["192.0.2.2", "02:00:00:00:00:02", ""]
