"""A node in lock-step with the reference participant: each packet and each frame, in their order."""

from __future__ import annotations

import re
import shutil
from collections import Counter
from pathlib import Path

import pytest

from fusesoc_firm.fabric.control import main_of
from fusesoc_firm.fabric.rtps import PUBLICATIONS_WRITER
from tests.cores.announcements import (
    ASSEMBLED,
    LONG,
    ROOM,
    SAMPLE,
    SURE,
    WRITTEN,
    Event,
    Kind,
    Peers,
    Results,
    a_node,
    expected,
    rushed,
    sent,
    without_counts,
)
from tests.cores.ethernet import fcs, udp_frame, write_capture
from tests.cores.rtps_data import DATA, SIZES, write_data, write_memories
from tests.cores.rtps_world import HARDWARE, World
from tests.fabric.dissection import read_alike
from tests.fabric.memories import bits
from tests.fabric.messages import AckNack, Data, DataFrag, Gap, Heartbeat, InfoDestination, NackFrag, parse
from tests.fabric.participant import DISCOVERY_REQUEST
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/builder", "net/rtps")
NODE = a_node()
# Peers, stall and seed of a case in which all happens, and the events of such a case.
FULL = (9, 30, SEED + 2)
EVENTS = 2000
# Bytes of payloads that wait, of which there are fewer than in the longest samples.
SHORT = 1024
# The same of cases in which samples are sent in fragments, also of the longest ones.
LONG_FULL = (2, 0, SEED + 3)
LONG_CASES = [LONG_FULL, (5, 30, SEED + 1), pytest.param(1, 10, SEED + 6, marks=pytest.mark.thorough)]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("node"))


def _library(directory: Path, standard: str = "93") -> Library:
    library = Library("firm", directory, standard)
    library.analyse([*core_files(*CORES), *core_files("net/rtps", fileset="tb")])
    return library


def _results(library: Library, folder: Path, events: list[Event], **generics: Generic) -> Results:
    (folder / "events.txt").write_text("".join(event.row for event in events), encoding="ascii")
    write_memories(folder)
    given = {**SIZES, **bits(NODE), "MAIN": main_of(NODE), **generics}
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


def test_the_data_of_the_core_are_those_of_the_program(tmp_path: Path) -> None:
    """`python -m tools.rtps_data` writes them again."""
    write_data(tmp_path)
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (DATA / path.name).read_bytes(), path.name
    bench = (DATA.parent / "firm_rtps_node_tb.vhd").read_text(encoding="ascii")
    defaults = {name: int(value) for name, value in re.findall(r"^    (\w+) +: integer := (\d+)", bench, re.MULTILINE)}
    wanted = {**SIZES, **bits(NODE), "MAIN": main_of(NODE)}
    assert {name: defaults[name] for name in wanted} == wanted


def _check(found: Results, wanted: Results) -> None:
    both = zip(without_counts(found.sent), without_counts(wanted.sent), strict=False)
    for place, (ours, theirs) in enumerate(both):
        assert ours == theirs, f"packet {place}: {ours[0]} {parse(ours[1])} instead of {theirs[0]} {parse(theirs[1])}"
    assert len(found.sent) == len(wanted.sent)
    assert found.frames == wanted.frames
    assert found.refused == wanted.refused


def _check_kinds(wanted: Results) -> None:
    """All that a node does happens."""
    ids = Counter(frame[0] for frame in wanted.frames)
    messages = [message for _, packet in wanted.sent if (message := parse(packet))]
    kinds = Counter(type(item).__name__ for message in messages for item in message.submessages)
    print(ids, kinds)
    assert min(ids[0], ids[1], ids[SURE], kinds["AckNack"], kinds["Heartbeat"], kinds["Gap"], kinds["Data"]) >= 2


def test_the_sources_do_what_the_reference_does(library: Library, tmp_path: Path) -> None:
    # With this seed, all kinds of packets and frames are among few events.
    seed = 20261302
    print(f"seed {seed}")
    events = Peers(2, seed).run(90)
    wanted = expected(events)
    _check_kinds(wanted)
    _check(_results(library, tmp_path, events, SEED=seed), wanted)


@pytest.mark.check
def test_frames_that_come_with_the_first_cycle_are_kept() -> None:
    """They wait until the program has written where they belong; readers ask for them later."""
    # With this seed, some of them are sent again.
    seed = 20261428
    print(f"seed {seed}")
    first = [
        Event(Kind.FRAME, bytes([number, 8, 0, 0, 0]) + bytes(range(8)), before=0) for number in range(len(WRITTEN))
    ]
    events = [*first, *Peers(2, seed).run(60)]
    wanted = expected(events)
    assert any(bytes(range(8)) in packet for _, packet in wanted.sent)
    with World() as world:
        _check(world.all(events), wanted)


def test_milliseconds_that_the_program_cannot_take_at_once_are_taken_together() -> None:
    print(f"seed {SEED}")
    events = [
        part
        for event in Peers(2, SEED).run(40)
        for part in (rushed(event.count) if event.kind is Kind.TICKS else [event])
    ]
    with World() as world:
        _check(world.all(events), expected(events))


def test_an_early_sample_of_a_writer_is_not_counted_for_its_successor() -> None:
    print(f"seed {SEED}")
    events = Peers(1, SEED).succession()
    wanted = expected(events)
    messages = [message for _, packet in wanted.sent if (message := parse(packet))]
    items = [item for message in messages for item in message.submessages]
    assert (1, 2) in [tuple(item.missing) for item in items if isinstance(item, AckNack)]
    with World() as world:
        _check(world.all(events), wanted)


@pytest.mark.check
@pytest.mark.parametrize(
    ("peers", "stall", "seed"),
    [(4, 0, SEED), FULL, (6, 10, SEED + 2), (1, 0, SEED + 3)],
)
def test_the_netlist_does_what_the_reference_does(peers: int, stall: int, seed: int) -> None:
    print(f"seed {seed}")
    events = Peers(peers, seed).run(EVENTS)
    wanted = expected(events)
    _check_kinds(wanted)
    with World(stall) as world:
        _check(world.all(events), wanted)


@pytest.mark.check
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
@pytest.mark.parametrize("sample", [SAMPLE, LONG])
def test_tshark_reads_the_same_in_all_packets_of_the_node(tmp_path: Path, sample: int) -> None:
    """They are those of the netlist in other tests of this file."""
    peers, _, seed = FULL if sample == SAMPLE else LONG_FULL
    print(f"seed {seed}")
    packets = [packet for _, packet in expected(Peers(peers, seed, sample=sample).run(EVENTS), sample=sample).sent]
    frames = [udp_frame(packet) for packet in packets]
    write_capture(tmp_path / "node.pcap", [frame + fcs(frame) for frame in frames])
    found = list(read_alike(tmp_path / "node.pcap"))
    assert [payload for payload, _ in found] == packets
    kinds = {type(item) for _, message in found for item in message.submessages}
    assert kinds == {AckNack, Data, Gap, Heartbeat, InfoDestination, *([DataFrag] if sample == LONG else [])}


@pytest.mark.check
@pytest.mark.parametrize(
    ("peers", "stall", "seed"),
    [(2, 0, SEED), (4, 30, SEED + 1), pytest.param(1, 10, SEED + 2, marks=pytest.mark.thorough)],
)
def test_samples_in_fragments_are_put_together(peers: int, stall: int, seed: int) -> None:
    print(f"seed {seed}")
    events = Peers(peers, seed, is_long=True).run(3000)
    wanted = expected(events, ASSEMBLED)
    sizes = [len(frame) - 5 for frame in wanted.frames]
    items = [item for _, packet in wanted.sent if (message := parse(packet)) for item in message.submessages]
    requests = [item for item in items if isinstance(item, NackFrag)]
    print(Counter(sizes), len(requests))
    assert sizes.count(ASSEMBLED) >= 3 and len(requests) >= 5
    with World(stall, assembled=ASSEMBLED) as world:
        _check(world.all(events), wanted)


@pytest.mark.check
@pytest.mark.parametrize(
    ("peers", "stall", "seed"),
    [pytest.param(2, 0, SEED, marks=pytest.mark.thorough), (4, 30, SEED + 1), (1, 10, SEED + 2)],
)
def test_samples_that_find_no_room_are_put_together(peers: int, stall: int, seed: int) -> None:
    """Samples of all sizes in one submessage each, between fragments; what finds no room at all is counted."""
    print(f"seed {seed}")
    events = Peers(peers, seed, is_long=True, waiting=SHORT).run(3000)
    wanted = expected(events, ASSEMBLED, waiting=SHORT)
    sizes = Counter(len(frame) - 5 for frame in wanted.frames)
    print(sizes, wanted.lossy)
    assert min(sizes[SHORT], sizes[SHORT + 1], sizes[ASSEMBLED]) >= 5 and sizes[1] >= 2 and wanted.lossy >= 20
    with World(stall, assembled=ASSEMBLED, waiting=SHORT) as world:
        found = world.all(events)
    _check(found, wanted)
    assert (found.lossy, found.skipped) == (wanted.lossy, wanted.skipped)


@pytest.mark.check
@pytest.mark.parametrize(("peers", "stall", "seed"), LONG_CASES)
def test_long_samples_are_sent_in_fragments(peers: int, stall: int, seed: int) -> None:
    """All sizes from 4 to 65,536 bytes, and longer ones are refused; peers ask for samples and fragments again."""
    print(f"seed {seed}")
    events = Peers(peers, seed, sample=LONG).run(EVENTS)
    wanted = expected(events, sample=LONG)
    items = [item for _, packet in wanted.sent if (message := parse(packet)) for item in message.submessages]
    parts = Counter(item.size for item in items if isinstance(item, DataFrag))
    print(sorted(parts.items()), wanted.refused)
    assert {1345, 2688, 2689, 65280} <= {*parts} and wanted.refused > 2
    with World(stall, sample=LONG) as world:
        _check(world.all(events), wanted)


@pytest.mark.check
def test_a_host_that_takes_nothing_loses_samples_but_no_discovery() -> None:
    """Whole samples are lost: those that come are unchanged. One that comes late counts if later ones were lost."""
    events = Peers(4, SEED, is_sure=False, burst=60).run(600)
    wanted = expected(events)
    with World(97) as world:
        found = world.all(events)
        assert world.pulses["lost"] > 5
    assert 5 < len(found.frames) < len(wanted.frames)
    assert all(any(frame[5:] in event.data for event in events) for frame in found.frames)
    assert without_counts(found.sent) == without_counts(wanted.sent)


@pytest.mark.check
def test_a_host_that_takes_little_loses_whole_long_samples() -> None:
    """They come while another one leaves: those that are taken are unchanged, and the loss is counted."""
    print(f"seed {SEED}")
    events = Peers(3, SEED, is_sure=False, waiting=SHORT).run(1500)
    wanted = expected(events, ASSEMBLED, waiting=1 << 17)
    with World(90, assembled=ASSEMBLED, waiting=SHORT) as world:
        found = world.all(events)
    sizes = [len(frame) - 5 for frame in found.frames]
    print(len(wanted.frames), Counter(sizes), found.lossy)
    assert found.lossy > 20 and sum(size > SHORT for size in sizes) > 20
    assert len(found.frames) < len(wanted.frames)
    sent = b"".join(event.data for event in events)
    assert all(frame[5:] in sent for frame in found.frames)
    assert without_counts(found.sent) == without_counts(wanted.sent)


@pytest.mark.check
def test_announcements_that_find_no_room_are_counted_and_asked_for() -> None:
    """A packet has more of them than the memory; the node asks for two at a time."""
    peers = Peers(1, SEED)
    announced = peers.flood(ROOM.sources)
    with World() as world:
        world.all(peers.events)
        assert (world.pulses["lost"], world.entries[1]) == (1, 0)
        for _ in range(ROOM.sources):
            sent = world.do(Event(Kind.TICKS, count=DISCOVERY_REQUEST)).sent
            items = [item for _, packet in sent if (message := parse(packet)) for item in message.submessages]
            asked = [item for item in items if isinstance(item, AckNack) and item.writer == PUBLICATIONS_WRITER]
            assert all(item.missing.size <= 2 for item in asked)
            for number in sorted({number for item in asked for number in item.missing}):
                world.do(announced[number])
        assert world.entries[1] == ROOM.sources


@pytest.mark.check
def test_a_list_of_very_many_encodings_counts() -> None:
    """Its number is a multiple of 65536, of which the lower half is that of a list that is not told."""
    seed = SEED + 3
    print(f"seed {seed}")
    events = Peers(4, seed, exaggerate=True).run(300)
    with World() as world:
        _check(world.all(events), expected(events))


def _assembled(sample: int) -> int:
    """A node that sends long messages takes them, too."""
    return ASSEMBLED if sample > SAMPLE else 0


@pytest.mark.parametrize("sample", [SAMPLE, 2048])
def test_the_node_has_no_latch(library: Library, sample: int) -> None:
    assert library.latches("firm_rtps_node", {**SIZES, "SAMPLE": sample, "ASSEMBLED": _assembled(sample)}) == []


@pytest.mark.check
@pytest.mark.parametrize("sample", [SAMPLE, 2048])
def test_the_node_has_no_combinational_loop(tmp_path: Path, sample: int) -> None:
    *others, node = core_files(*HARDWARE)
    generics = {"SAMPLE": sample, "ASSEMBLED": _assembled(sample)}
    assert loops("firm_rtps_node", tmp_path, [node], others, generics) == []


@pytest.mark.check
def test_too_large_a_history_is_refused(library: Library) -> None:
    result = library.run("firm_rtps_history", {"SAMPLE": 65536, "SLOTS": 32})
    assert result.exit_code != 0
    assert "firm_rtps_history: SAMPLE is 65536 with 32 SLOTS; legal: up to 1048576 bytes" in result.output


@pytest.mark.parametrize(
    ("entity", "generic", "value", "legal"),
    [
        ("firm_net_keys", "ENTRIES", 65, "1 to 64"),
        ("firm_net_keys", "KEY_BYTES", 17, "2 to 16"),
        ("firm_net_keys", "TAIL", 16, "1 to 15"),
        ("firm_rtps_control", "ENDPOINTS", 25, "1 to 24"),
        ("firm_rtps_control", "SOURCES", 65, "1 to 64"),
        ("firm_rtps_control", "SINKS", 129, "1 to 128"),
        ("firm_rtps_endpoint", "READERS", 9, "0 to 8"),
        ("firm_rtps_endpoint", "WRITERS", 10, "1 to 9"),
        ("firm_rtps_history", "WRITERS", 9, "1 to 8"),
        ("firm_rtps_history", "SAMPLE", 48, "powers of two, 2 to 65536"),
        ("firm_rtps_history", "SLOTS", 512, "powers of two, 2 to 256"),
        ("firm_rtps_readers", "READERS", 9, "0 to 8"),
        ("firm_rtps_readers", "FIRST", 256, "0 to 256-READERS"),
        ("firm_rtps_readers", "BYTES", 1000, "powers of two, 4 to 131072"),
        ("firm_rtps_readers", "SAMPLES", 3, "powers of two, 2 or more"),
        ("firm_rtps_sequencer", "ENTRIES", 193, "1 to 192"),
    ],
)
def test_bad_generics_are_refused(library: Library, entity: str, generic: str, value: int, legal: str) -> None:
    result = library.run(entity, {generic: value})
    assert result.exit_code != 0
    assert f"{entity}: {generic} is {value}; legal: {legal}" in result.output
