"""A node's readers: the writers of peers that match them, and their samples as frames, against the reference."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm.fabric.names import names
from tests.cores.announcements import Peers, Results, Step, a_node, expected
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops

SEED = 20261127
SOURCES = 8
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/rtps")
NODE: dict[str, Generic] = {"WRITERS": 2, "READERS": 2, "SOURCES": SOURCES, "DEPTH": 4096, "SAMPLES": 16}
REQUEST = 17
LONG = 0  # a sample that is too long


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("readers"))


def _library(directory: Path, standard: str = "93") -> Library:
    library = Library("firm", directory, standard)
    library.analyse([*core_files(*CORES), *core_files("net/rtps", fileset="tb")])
    return library


def _results(library: Library, folder: Path, steps: list[Step], **generics: Generic) -> Results:
    (folder / "packets.txt").write_text("".join(step.row for step in steps), encoding="ascii")
    words = [str(int.from_bytes(word)) for word in names(a_node().readers)]
    (folder / "names.txt").write_text("\n".join(words) + "\n", encoding="ascii")
    result = library.run("firm_rtps_node_tb", {"SOURCES": SOURCES, **generics}, directory=folder)
    assert result.exit_code == 0, result.output
    found = Results()
    for row in (folder / "results.txt").read_text(encoding="ascii").splitlines():
        kind, *numbers = row.split()
        if kind in ("sample", "long"):
            found.samples.append(int(numbers[0]) if numbers else LONG)
            continue
        content = bytes(map(int, numbers[kind == "request" :]))
        if kind == "frame":
            found.frames.append(content)
        else:
            found.requests.append(_request(content, has_set=int(numbers[0]) == REQUEST))
    return found


def _request(fields: bytes, *, has_set: bool) -> tuple[bytes, bytes, bytes, int, int]:
    """The fields of an answer to a heartbeat, which is little-endian and final, and goes to where the peer listens."""
    assert fields[:7] + fields[8:14] == bytes.fromhex("02000000000103 c0000201 1cf4")
    assert fields[40:44] == bytes(4)
    size = int.from_bytes(fields[64:68], "little") if has_set else 0
    assert not has_set or int.from_bytes(fields[68:72], "little") == (1 << 32) - (1 << 32 - size)
    return fields[16:28], fields[28:32], fields[32:36], int.from_bytes(fields[44:48], "little"), size


@pytest.mark.parametrize(
    ("turns", "peers", "stall", "seed"),
    [(60, 4, 0, SEED), *(pytest.param(500, 9, 30, SEED + more, marks=pytest.mark.check) for more in range(1, 4))],
)
def test_what_peers_announce_and_send_becomes_frames_and_requests(
    library: Library, tmp_path: Path, turns: int, peers: int, stall: int, seed: int
) -> None:
    print(f"seed {seed}")
    steps = Peers(peers, seed).run(turns)
    wanted = expected(steps, SOURCES)
    ids = Counter(frame[0] for frame in wanted.frames)
    print(len(steps), ids, len(wanted.requests))
    assert min(ids[0], ids[1]) > 5 and len(wanted.requests) > 5
    found = _results(library, tmp_path, steps, STALL_PERCENT=stall, SEED=seed)
    assert found.requests == wanted.requests
    assert found.frames == wanted.frames


def test_a_host_that_takes_nothing_loses_samples_but_no_discovery(library: Library, tmp_path: Path) -> None:
    """Whole samples are lost: those that come are unchanged. One that comes late counts if later ones were lost."""
    steps = Peers(4, SEED).run(60)
    wanted = expected(steps, SOURCES)
    found = _results(library, tmp_path, steps, STALL_PERCENT=97, SEED=SEED, SAMPLES=2)
    assert 5 < len(found.frames) < len(wanted.frames)
    assert all(any(frame[5:] in step.packet for step in steps) for frame in found.frames)
    assert found.requests == wanted.requests


def test_a_list_of_very_many_encodings_counts(library: Library, tmp_path: Path) -> None:
    """Its number is a multiple of 65536, of which the lower half is that of a list that is not told."""
    seed = SEED + 3
    print(f"seed {seed}")
    steps = Peers(4, seed, exaggerate=True).run(60)
    found = _results(library, tmp_path, steps)
    assert found.frames == expected(steps, SOURCES).frames


def test_a_sample_that_is_too_long_is_dropped_and_reported(library: Library, tmp_path: Path) -> None:
    steps = Peers(4, SEED).run(60)
    found = _results(library, tmp_path, steps, SAMPLE=16, SENT_BYTES=20)
    assert found.requests == expected(steps, SOURCES).requests
    assert set(found.samples) == {*range(1, 17), LONG}


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_rtps_node", NODE)
    library.analyse(core_files("net/rtps", fileset="tb")[-1:])
    steps = Peers(4, SEED).run(40)
    wanted = expected(steps, SOURCES)
    found = _results(library, tmp_path, steps)
    assert found.requests == wanted.requests
    assert found.frames == wanted.frames


def test_the_node_has_no_latch(library: Library) -> None:
    assert library.latches("firm_rtps_node", NODE) == []


def test_the_node_has_no_combinational_loop(tmp_path: Path) -> None:
    *others, node = core_files("axis/package", "axis/axis", "net/mac", "net/rtps")
    assert loops("firm_rtps_node", tmp_path, [node], others) == []


@pytest.mark.parametrize(
    ("entity", "generic", "value", "legal"),
    [
        ("firm_net_keys", "ENTRIES", 33, "1 to 32"),
        ("firm_net_keys", "KEY_BYTES", 17, "2 to 16"),
        ("firm_net_keys", "TAIL", 16, "1 to 15"),
        ("firm_rtps_control", "PEERS", 0, "1 to 8"),
        ("firm_rtps_control", "PEERS", 9, "1 to 8"),
        ("firm_rtps_control", "WRITERS", 1, "2 to 234"),
        ("firm_rtps_control", "READERS", 9, "0 to 8"),
        ("firm_rtps_control", "SAMPLE", 48, "powers of two, 2 to 128"),
        ("firm_rtps_control", "SAMPLE", 256, "powers of two, 2 to 128"),
        ("firm_rtps_endpoint", "READERS", 9, "1 to 8"),
        ("firm_rtps_readers", "READERS", 9, "1 to 8"),
        ("firm_rtps_readers", "FIRST", 256, "0 to 256-READERS"),
        ("firm_rtps_readers", "BYTES", 1000, "powers of two, 4 to 65536"),
        ("firm_rtps_readers", "SAMPLES", 3, "powers of two, 2 or more"),
    ],
)
def test_bad_generics_are_refused(library: Library, entity: str, generic: str, value: int, legal: str) -> None:
    result = library.run(entity, {generic: value})
    assert result.exit_code != 0
    assert f"{entity}: {generic} is {value}; legal: {legal}" in result.output
