"""A node in lock-step with the reference participant: each packet and each frame, in their order."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm.fabric.control import main_of, slots_of, words_of
from fusesoc_firm.fabric.names import names
from fusesoc_firm.fabric.packets import programs_of
from tests.cores.announcements import SURE, Event, Kind, Peers, Results, a_node, expected, sent
from tests.fabric.messages import parse
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops

SEED = 20261127
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/builder", "net/rtps")
NODE = a_node()
SIZES: dict[str, Generic] = {
    "WRITERS": len(NODE.writers),
    "READERS": len(NODE.readers),
    "SOURCES": 8,
    "DEPTH": 4096,
    "SAMPLES": 16,
    "SLOTS": slots_of(NODE),
}
BITS: dict[str, Generic] = {
    "RELIABLE": sum(item.quality.is_reliable << place for place, item in enumerate(NODE.compared)),
    "TRANSIENT": sum(item.quality.is_transient_local << place for place, item in enumerate(NODE.compared)),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("node"))


def _library(directory: Path, standard: str = "93") -> Library:
    library = Library("firm", directory, standard)
    library.analyse([*core_files(*CORES), *core_files("net/rtps", fileset="tb")])
    return library


def _write(path: Path, rows: list[str]) -> None:
    path.write_text("".join(f"{row}\n" for row in rows), encoding="ascii")


def write_memories(folder: Path) -> None:
    """The files of the node's memories for the bench."""
    programs = programs_of(NODE)
    _write(folder / "names.txt", [f"{int.from_bytes(word):0{8 * len(word)}b}" for word in names(NODE.compared)])
    _write(folder / "program.txt", [f"{word:036b}" for word in words_of(NODE)])
    _write(folder / "packets.txt", [f"{word:011b}" for word in programs.words])
    _write(folder / "entries.txt", list(map(str, programs.entries.values())))


def _results(library: Library, folder: Path, events: list[Event], **generics: Generic) -> Results:
    (folder / "events.txt").write_text("".join(event.row for event in events), encoding="ascii")
    write_memories(folder)
    given = {**SIZES, **BITS, "MAIN": main_of(NODE), **generics}
    result = library.run("firm_rtps_node_tb", given, directory=folder, seconds=600)
    assert result.exit_code == 0, result.output
    found = Results()
    for row in (folder / "results.txt").read_text(encoding="ascii").splitlines():
        kind, *numbers = row.split()
        content = bytes(map(int, numbers))
        if kind == "frame":
            found.frames.append(content)
        elif kind == "sent":
            found.sent.append(sent(content))
        found.refused += kind == "refused"
    return found


def _check(found: Results, wanted: Results) -> None:
    for place, (ours, theirs) in enumerate(zip(found.sent, wanted.sent, strict=False)):
        assert ours == theirs, f"packet {place}: {ours[0]} {parse(ours[1])} instead of {theirs[0]} {parse(theirs[1])}"
    assert len(found.sent) == len(wanted.sent)
    assert found.frames == wanted.frames
    assert found.refused == wanted.refused


@pytest.mark.parametrize(
    ("turns", "peers", "stall", "seed"),
    [(300, 4, 0, SEED), *(pytest.param(800, 9, 30, SEED + more, marks=pytest.mark.check) for more in range(1, 4))],
)
def test_the_node_does_what_the_reference_does(
    library: Library, tmp_path: Path, turns: int, peers: int, stall: int, seed: int
) -> None:
    print(f"seed {seed}")
    events = Peers(peers, seed).run(turns)
    wanted = expected(events)
    ids = Counter(frame[0] for frame in wanted.frames)
    kinds = Counter(type(item).__name__ for _, packet in wanted.sent for item in parse(packet).submessages)
    print(len(events), ids, kinds)
    assert min(ids[0], ids[1], ids[SURE], kinds["AckNack"], kinds["Heartbeat"], kinds["Gap"]) >= 1
    _check(_results(library, tmp_path, events, STALL_PERCENT=stall, SEED=seed), wanted)
