"""Fragments of UDP datagrams against a model: interleaved, lost, repeated and damaged, between other frames."""

from __future__ import annotations

import random
from itertools import chain
from pathlib import Path

import pytest

from tests.cores.fragments import HOSTS, Reassembly, fragments, is_fragment, packet
from tests.cores.requests import MAC, echo_request
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/mac", "net/reassembly")
BYTES = 2048


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/reassembly", fileset="tb")])
    return library


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("reassembly"))


Row = tuple[int, bool, bytes]


def _run(library: Library, folder: Path, rows: list[Row], **generics: Generic) -> tuple[list[bytes], list[str]]:
    """The good frames that leave, and the other events."""
    lines = (" ".join(map(str, (before, int(aborted), len(frame), *frame))) for before, aborted, frame in rows)
    (folder / "frames.txt").write_text("\n".join(lines) + "\n", encoding="ascii")
    result = library.run("firm_ipv4_reassembly_tb", {"BYTES": BYTES, **generics}, directory=folder)
    assert result.exit_code == 0, result.output
    shown = (folder / "packets.txt").read_text(encoding="ascii").splitlines()
    frames = [bytes(map(int, line.split()[2:])) for line in shown if line.startswith("0 ")]
    return frames, [line for line in shown if line[0] not in "01"]


def _passing(sent: list[bytes]) -> list[bytes]:
    """The frames that pass without being aborted."""
    return [frame for frame in sent if not is_fragment(frame)]


def _parts(frames: list[bytes], sent: list[bytes]) -> tuple[list[bytes], list[bytes]]:
    """The frames that passed, and those that were reassembled."""
    known = set(sent)
    return [frame for frame in frames if frame in known], [frame for frame in frames if frame not in known]


def _traffic(chance: random.Random, hosts: int, count: int) -> list[Row]:
    """Packets of several hosts, interleaved; some fragments are lost, repeated, aborted, swapped or damaged."""
    queues = [
        list(chain.from_iterable(_packet(chance, host, number) for number in range(count))) for host in range(hosts)
    ]
    rows: list[Row] = []
    while any(queues):
        queue = chance.choice([queue for queue in queues if queue])
        frame, way = queue.pop(0), chance.random()
        if way < 0.03:
            continue
        if way < 0.06:
            rows.append((chance.randrange(20), False, frame))
        elif way < 0.09:
            rows.append((0, True, frame[: chance.randrange(1, len(frame))]))
        elif way < 0.12:
            place = chance.choice((*range(14), *range(14, 34)))
            frame = frame[:place] + bytes([frame[place] ^ 1 << chance.randrange(8)]) + frame[place + 1 :]
        rows.append((chance.randrange(20), False, frame))
        if chance.random() < 0.2:
            other = echo_request(chance.randbytes(chance.randrange(200)))
            rows.append((0, False, chance.choice((other, packet(HOSTS[0], 7, chance.randbytes(50))))))
    return rows


def _packet(chance: random.Random, host: int, number: int) -> list[bytes]:
    data = chance.randbytes(chance.choice((9, 64, 600, 1481, BYTES, BYTES + 1)))
    return fragments(HOSTS[host], 100 * host + number, data, chance.choice((8 * chance.randrange(20, 90), 1480)))


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("packets", "slow"), [(1, 0), (2, 0), (4, 20)])
def test_packets_are_whole_and_other_frames_pass(library: Library, tmp_path: Path, packets: int, slow: int) -> None:
    seed = SEED + packets
    print(f"seed {seed}")
    rows = _traffic(random.Random(seed), 3, 8)
    # A packet leaves before the next frame comes, so that the model knows which places are free.
    rows = [(before + BYTES + 100, aborted, frame) for before, aborted, frame in rows]
    sent = [frame for _, aborted, frame in rows if not aborted]
    model = Reassembly(packets, BYTES)
    model.take(sent)
    assert len(model.whole) > packets
    frames, events = _run(library, tmp_path, rows, PACKETS=packets, SLOW_PERCENT=slow, TICKS=65535, SEED=seed)
    passed, made = _parts(frames, sent)
    assert made == model.whole
    assert passed == _passing(sent)
    assert events == ["dropped"] * model.dropped


@pytest.mark.parametrize("gap", [0, 14])
def test_frames_that_come_while_a_packet_leaves_wait(library: Library, tmp_path: Path, gap: int) -> None:
    """Two hosts send at once, with the shortest gaps and those of Ethernet; all leave whole, in their order."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    sent = []
    data = [chance.randbytes(2000) for _ in range(8)]
    for number in range(0, len(data), 2):
        pairs = zip(*(fragments(HOSTS[host], number, data[number + host]) for host in range(2)), strict=True)
        sent += list(chain.from_iterable(pairs))
        sent += [echo_request(bytes([number]) * 30), echo_request(bytes([number + 1]) * 60)]
    frames, events = _run(library, tmp_path, [(gap, False, frame) for frame in sent], PACKETS=4, DEPTH=65536)
    passed, made = _parts(frames, sent)
    assert events == []
    assert passed == _passing(sent)
    model = Reassembly(4, BYTES)
    model.take(sent)
    assert sorted(made) == sorted(model.whole)
    assert sorted(frame[34:] for frame in made) == sorted(data)


@pytest.mark.check
def test_the_longest_packet_of_ipv4(library: Library, tmp_path: Path) -> None:
    data = random.Random(SEED).randbytes(65515)
    sent = fragments(HOSTS[0], 1, data)
    rows = [(0, False, frame) for frame in sent]
    frames, events = _run(library, tmp_path, rows, PACKETS=1, BYTES=65536, LAST_CYCLES=70000)
    assert events == []
    assert [frame[34:] for frame in frames] == [data]
    too_long = [*sent[:-1], packet(HOSTS[0], 1, data[65120:] + b"a", offset=65120)]
    rows = [(0, False, frame) for frame in too_long]
    frames, events = _run(library, tmp_path, rows, PACKETS=1, BYTES=65536, LAST_CYCLES=70000)
    assert (frames, events) == ([], ["dropped"])


def test_a_packet_that_stops_is_given_up(library: Library, tmp_path: Path) -> None:
    """The only place is taken by a packet without an end, until its time is over."""
    stopped, good = fragments(HOSTS[0], 1, bytes(2000)), fragments(HOSTS[1], 2, bytes(range(250)) * 8)
    for wait, whole in ((500, 0), (5000, 1)):
        rows = [
            (0, False, stopped[0]),
            *((wait if place == 0 else 0, False, frame) for place, frame in enumerate(good)),
        ]
        frames, events = _run(library, tmp_path, rows, PACKETS=1, TICKS=4, TICK_CYCLES=1000)
        assert len(frames) == whole
        # The packet that is given up, and before that each fragment without a place.
        assert events == ["dropped"] * (1 if whole else 1 + len(good))


def test_a_packet_is_whole_or_given_up_but_not_both(library: Library, tmp_path: Path) -> None:
    """The time of each is over before, in, or after its last fragment."""
    rows: list[Row] = []
    for number in range(24):
        first, last = fragments(HOSTS[0], number, bytes([number]) * 2000)
        rows += [(5000, False, first), (1800 + 100 * number, False, last)]
    frames, events = _run(library, tmp_path, rows, PACKETS=1, TICKS=4, TICK_CYCLES=1000)
    assert 4 < len(frames) < 20
    # The packet, and its last fragment.
    assert events == ["dropped"] * 2 * (24 - len(frames))


def test_a_frame_without_room_is_lost(library: Library, tmp_path: Path) -> None:
    others = [echo_request(bytes([number]) * 200) for number in range(10)]
    rows = [(0, False, frame) for frame in [*fragments(HOSTS[0], 1, bytes(2048)), *others]]
    frames, events = _run(library, tmp_path, rows, DEPTH=512)
    assert events == ["lost"] * (len(others) + 1 - len(frames))
    assert len(events) > 3


@pytest.mark.parametrize(("hold", "busy"), [(300, 20_000), (4, 1_000_000)])
def test_a_long_packet_waits_until_the_one_before_is_out(
    library: Library, tmp_path: Path, hold: int, busy: int
) -> None:
    """But not for ever; other packets pass it. The bench has the time at which each begins."""
    print(f"seed {SEED}")
    chance = random.Random(SEED)
    long = [chance.randbytes(2000) for _ in range(4)]
    short = [chance.randbytes(700) for _ in range(4)]
    sent: list[tuple[int, bytes]] = []
    for number in range(4):
        parts = [
            *fragments(HOSTS[0], number, long[number], 1000),
            *fragments(HOSTS[1], number, short[number], 400),
            echo_request(bytes([number]) * 30),
        ]
        sent += [(0, part) for part in parts]
        # Two of them wait together.
        sent[-1] = (6000 if number == 1 else 0, parts[-1])
    rows = [(before, False, frame) for before, frame in sent]
    generics = {"PACKETS": 4, "LONG": 1024, "BUSY_CYCLES": busy, "HOLD_TICKS": hold, "LAST_CYCLES": 100000}
    frames, events = _run(library, tmp_path, rows, **generics)
    assert events == []
    passed, made = _parts(frames, [frame for _, frame in sent])
    assert passed == _passing([frame for _, frame in sent])
    data = [frame[34:] for frame in made]
    assert [item for item in data if len(item) == 2000] == long
    assert [item for item in data if len(item) == 700] == short
    # The second long one comes before the second short one, and leaves after it.
    assert data.index(short[1]) < data.index(long[1])


def test_frames_of_others_are_never_reassembled(library: Library, tmp_path: Path) -> None:
    data = bytes(2000)
    sent = [frame.replace(MAC, b"\x02\0\0\0\0\3", 1) for frame in fragments(HOSTS[0], 1, data)]
    sent += [packet(HOSTS[0], 2, data[:1480], more=True, protocol=1), packet(HOSTS[0], 2, data[1480:], offset=1480)]
    frames, events = _run(library, tmp_path, [(0, False, frame) for frame in sent])
    # The last one is of UDP, and has no beginning.
    assert (frames, events) == (sent[:-1], ["dropped"])


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    library.replace_by_netlist("firm_ipv4_reassembly", {"PACKETS": 2, "BYTES": BYTES})
    library.analyse(core_files("net/reassembly", fileset="tb"))
    rows = [(before + BYTES + 100, aborted, frame) for before, aborted, frame in _traffic(random.Random(SEED), 2, 3)]
    sent = [frame for _, aborted, frame in rows if not aborted]
    model = Reassembly(2, BYTES)
    model.take(sent)
    frames, events = _run(library, tmp_path, rows, PACKETS=2)
    assert _parts(frames, sent) == (_passing(sent), model.whole)
    assert events == ["dropped"] * model.dropped


def test_it_has_no_latch(library: Library) -> None:
    assert library.latches("firm_ipv4_reassembly") == []


@pytest.mark.check
def test_it_has_no_combinational_loop(tmp_path: Path) -> None:
    assert loops("firm_ipv4_reassembly", tmp_path, core_files(CORES[-1]), core_files(*CORES[:2], "net/mac")) == []


@pytest.mark.parametrize(
    ("generic", "value"),
    [
        ("PACKETS", 0),
        ("PACKETS", 9),
        ("BYTES", 1024),
        ("TICKS", 0),
        ("LONG", 1000),
        ("HOLD_TICKS", 0),
    ],
)
def test_illegal_generics_are_refused(library: Library, tmp_path: Path, generic: str, value: int) -> None:
    result = library.run("firm_ipv4_reassembly", {generic: value}, directory=tmp_path)
    assert result.exit_code != 0
    assert f"firm_ipv4_reassembly: {generic} is {value}; legal: " in result.output
