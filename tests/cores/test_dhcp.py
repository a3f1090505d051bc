"""The client of DHCP: what it asks for, what it takes, and when, against a model."""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from tests.cores.dhcp import (
    ACK,
    ADDRESS,
    DECLINE,
    DISCOVER,
    NAK,
    OFFER,
    REQUEST,
    SERVER,
    SERVER_ADDRESS,
    SERVER_MAC,
    Message,
    answer,
    is_offer,
    meaning,
    offer,
    random_message,
)
from tests.hdl.ghdl import Generic, Library, core_files
from tests.hdl.verilog import loops
from tests.seeds import seeded

SEED = seeded(20261127)
CORES = ("axis/package", "axis/axis", "sim/checker", "sim/host", "sim/parts", "net/package", "net/dhcp")
TICK_CYCLES = 2
NEXT, TAKEN, DUE = "2\n", "3\n", "4\n"
NOTHING = bytes(4)
# Milliseconds in which a message is read, and what follows from it is sent.
READING = 1000
# Rounding of a second, and of what is sent.
SLACK = 1100


def pause(ms: int) -> str:
    return f"1 {ms}\n"


def busy(ms: int) -> str:
    """The builder is busy from now on."""
    return f"5 {ms}\n"


@dataclass(frozen=True)
class Event:
    """What the client does, and when, in milliseconds; a packet has the bytes that the builder gets."""

    ms: int
    what: str
    own: bytes = b""

    @property
    def type(self) -> int:
        return self.own[0]

    @property
    def current(self) -> bytes:
        return self.own[1:5]

    @property
    def chosen(self) -> tuple[bytes, bytes]:
        """Option 50 and option 54."""
        return self.own[5:11], self.own[11:17]

    @property
    def sender(self) -> bytes:
        return self.own[17:23]

    @property
    def address(self) -> bytes:
        return self.own[23:27]

    @property
    def number(self) -> bytes:
        return self.own[27:31]

    @property
    def is_ended(self) -> bool:
        """Whether the message lacks the last options."""
        return self.own[31:] == b"\xff"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return _library(tmp_path_factory.mktemp("dhcp"))


def _library(directory: Path) -> Library:
    library = Library("firm", directory)
    library.analyse([*core_files(*CORES), *core_files("net/dhcp", fileset="tb")])
    return library


def _events(library: Library, folder: Path, rows: list[str], **generics: Generic) -> list[Event]:
    (folder / "offers.txt").write_text("".join(rows), encoding="ascii")
    result = library.run(
        "firm_dhcp_client_tb", {"TICK_CYCLES": TICK_CYCLES, "SEED": SEED, **generics}, directory=folder
    )
    assert result.exit_code == 0, result.output
    lines = (folder / "lease.txt").read_text(encoding="ascii").splitlines()
    return [Event(int(ms), what, bytes(map(int, own))) for ms, what, *own in map(str.split, lines)]


def _chosen(address: bytes, server: bytes) -> tuple[bytes, bytes]:
    return bytes([50, 4]) + address, bytes([SERVER, 4]) + server


NOT_CHOSEN = bytes(6), bytes(6)
ACCEPTED = [NEXT, offer().row(), NEXT]


def _is_after(before: Event, after: Event, least: float, most: float) -> bool:
    """Whether so many seconds are between two events."""
    return 1000 * least - 1 <= after.ms - before.ms <= 1000 * most + SLACK


def test_without_a_server_it_asks_less_and_less(library: Library, tmp_path: Path) -> None:
    events = _events(library, tmp_path, [NEXT] * 8)
    assert [(event.what, event.type, event.current, event.chosen) for event in events] == [
        ("message", DISCOVER, NOTHING, NOT_CHOSEN)
    ] * 8
    assert len({event.number for event in events}) == 1
    assert events[0].ms <= 2100
    pauses = [after.ms - before.ms for before, after in pairwise(events)]
    for seconds, took in zip((4, 8, 16, 32, 64, 64, 64), pauses, strict=True):
        assert abs(took - 1024 * seconds) <= 1050
    assert len({took % 1024 for took in pauses}) > 3


def test_a_lease_is_renewed_at_its_server_then_anywhere_and_ends(library: Library, tmp_path: Path) -> None:
    """Of 64 s: renewed after 32 s; nobody answers later, so it is asked of all after 56 s, and ends."""
    other = {"sender": b"\2\0\0\0\0\7", "mac": b"\xff" * 6}
    renewed = [NEXT, offer(ACK, 64, **other).row()]
    rows = [*ACCEPTED, offer(ACK, 64).row(), NEXT, NEXT, *renewed, pause(90_000)]
    events = _events(library, tmp_path, rows)
    kinds = [event.what for event in events]
    assert kinds[:7] == ["message", "message", "checking", "bound", "announcement", "announcement", "renewal"]
    discover, request, checking, bound, first, second, renewal, *rest = events
    assert (request.type, request.current, request.number) == (REQUEST, NOTHING, discover.number)
    assert request.chosen == _chosen(ADDRESS, SERVER_ADDRESS)
    assert _is_after(checking, bound, 5, 6)
    assert _is_after(bound, first, 0, 0)
    assert _is_after(first, second, 2, 3)
    assert first.address == ADDRESS
    assert (renewal.type, renewal.current, renewal.chosen) == (REQUEST, ADDRESS, NOT_CHOSEN)
    assert renewal.sender == SERVER_MAC
    assert renewal.number != request.number
    assert _is_after(checking, renewal, 31, 32)
    # From the renewal on, without an answer.
    repeated = [event for event in rest if event.what == "renewal"]
    asked = [event for event in rest if event.what == "message" and event.current == ADDRESS]
    (lost,) = [event for event in rest if event.what == "lost"]
    assert _is_after(renewal, repeated[0], 31, 32)
    assert {event.sender for event in repeated} == {b"\2\0\0\0\0\7"}
    assert len(repeated) == 3
    assert _is_after(renewal, asked[0], 55, 56)
    assert (asked[0].type, asked[0].chosen) == (REQUEST, NOT_CHOSEN)
    assert asked[0].number != repeated[0].number
    assert _is_after(renewal, lost, 63, 64)
    assert rest.index(lost) == 5
    last = rest[6]
    assert (last.what, last.type, last.current, last.chosen) == ("message", DISCOVER, NOTHING, NOT_CHOSEN)


def test_times_of_the_server_replace_those_of_the_lease(library: Library, tmp_path: Path) -> None:
    rows = [*ACCEPTED, offer(ACK, 100, times=(10, 15)).row(), pause(24_000)]
    events = _events(library, tmp_path, rows)
    checking = next(event for event in events if event.what == "checking")
    renewal = next(event for event in events if event.what == "renewal")
    asked = next(event for event in events if event.what == "message" and event.current == ADDRESS)
    assert _is_after(checking, renewal, 9, 10)
    assert _is_after(checking, asked, 14, 15)


def test_a_renewed_lease_begins_anew_and_the_address_stays(library: Library, tmp_path: Path) -> None:
    renewed = [offer(ACK, 20).row(), NEXT] * 4
    rows = [*ACCEPTED, offer(ACK, 20).row(), NEXT, NEXT, NEXT, *renewed]
    events = _events(library, tmp_path, rows)
    renewals = [event for event in events if event.what == "renewal"]
    assert len(renewals) == 5
    assert all(_is_after(before, after, 9, 10) for before, after in pairwise(renewals))
    assert "lost" not in [event.what for event in events]


@pytest.mark.parametrize("refusal", [offer(NAK), offer(ACK, address=bytes([192, 0, 2, 51]))])
def test_an_address_that_is_refused_is_given_up(library: Library, tmp_path: Path, refusal: Message) -> None:
    rows = [*ACCEPTED, offer(ACK, 20).row(), NEXT, NEXT, NEXT, refusal.row(), NEXT]
    *_, renewal, lost, discover = _events(library, tmp_path, rows)
    assert (renewal.what, lost.what, discover.type) == ("renewal", "lost", DISCOVER)
    assert discover.current == NOTHING


@pytest.mark.parametrize("refusal", [offer(ACK, 20), offer(NAK)])
def test_only_the_server_that_was_chosen_answers_a_request(library: Library, tmp_path: Path, refusal: Message) -> None:
    """After a renewal that nobody answers, any server may answer, but it tells its address."""
    kind = meaning(refusal)
    assert kind
    others = [offer(kind.type, 40, server=server).row() for server in (bytes([192, 0, 2, 2]), b"")]
    rows = [*ACCEPTED, *[row for other in others for row in (other, pause(READING))], offer(ACK, 40).row()]
    # Two announcements, three renewals, and a request to all.
    rows += [*[NEXT] * 6, others[1], pause(500), others[0], pause(8000)]
    events = _events(library, tmp_path, rows)
    kinds = ["message"] * 2 + ["checking", "bound"] + ["announcement"] * 2 + ["renewal"] * 3 + ["message"]
    assert [event.what for event in events[:10]] == kinds
    losses = [event.ms - events[9].ms for event in events if event.what == "lost"]
    assert len(losses) == (kind.type == NAK)
    assert all(500 < ms < READING for ms in losses)


def test_a_lease_begins_with_its_request(library: Library, tmp_path: Path) -> None:
    late = [pause(2500), offer(ACK, 30).row()]
    events = _events(library, tmp_path, [*ACCEPTED, *late, NEXT, NEXT, NEXT, *late, NEXT])
    _, request, first, second = [event for event in events if event.what in ("message", "renewal")]
    assert _is_after(request, first, 14, 15)
    assert _is_after(first, second, 14, 15)


def test_seconds_of_a_lease_pass_while_a_packet_waits(library: Library, tmp_path: Path) -> None:
    rows = [*ACCEPTED, offer(ACK, 20).row(), NEXT, NEXT, DUE, busy(30_000), NEXT, pause(3000)]
    *_, renewal, request, lost, discover = _events(library, tmp_path, rows)
    assert (renewal.what, request.type, lost.what, discover.type) == ("renewal", REQUEST, "lost", DISCOVER)
    assert _is_after(renewal, lost, 30, 30)


@pytest.mark.parametrize("row", [TAKEN, offer(NAK).row()])
def test_a_packet_stays_as_it_is_until_it_is_sent(library: Library, tmp_path: Path, row: str) -> None:
    rows = [*ACCEPTED, offer(ACK, 20).row(), NEXT, NEXT, NEXT, DUE, row, NEXT, pause(READING)]
    events = _events(library, tmp_path, rows)
    first, second = [event for event in events if event.what == "renewal"]
    assert first.own == second.own
    assert events.index(second) < [event.what for event in events].index("lost")


def test_the_next_address_waits_until_the_last_one_rests(library: Library, tmp_path: Path) -> None:
    rows = [*ACCEPTED, offer(ACK, 20).row(), NEXT, NEXT, NEXT, offer(NAK).row(), NEXT]
    *_, lost, discover = _events(library, tmp_path, rows, STOP_CYCLES=20_000 * TICK_CYCLES)
    assert (lost.what, discover.type) == ("lost", DISCOVER)
    assert _is_after(lost, discover, 20, 20)


ENDLESS = (1 << 32) - 1


@pytest.mark.one_in(4)
@pytest.mark.parametrize(
    ("seconds", "times", "what"),
    [
        (ENDLESS, (), {}),
        (0, (), {"lost": 0}),
        (3, (), {"lost": 3}),
        (40, (30, 20), {"message": 20, "lost": 40}),
        (40, (0,), {"renewal": 0, "message": 35, "lost": 40}),
        (20, (10, 60), {"renewal": 10, "lost": 20}),
        (20, (60, 90), {"lost": 20}),
        (20, (ENDLESS, ENDLESS), {"lost": 20}),
    ],
)
def test_times_of_a_server_that_make_no_sense(
    library: Library, tmp_path: Path, seconds: int, times: tuple[int, ...], what: dict[str, int]
) -> None:
    """A time that has passed when the address is bound has its effect then, and none is later than the lease's end."""
    rows = [*ACCEPTED, offer(ACK, seconds, times=times).row(), pause(42_000)]
    _, request, checking, *events = _events(library, tmp_path, rows)
    end = next((place for place, event in enumerate(events) if event.what == "lost"), len(events))
    first = {event.what: event for event in reversed(events[: end + 1])}
    bound = first.pop("bound", checking)
    first.pop("announcement", None)
    if seconds < 5:
        assert not any(event.what in ("bound", "renewal") for event in events[:end])
    else:
        assert set(first) == set(what)
        for kind, second in what.items():
            since = bound if second < 5 else request
            assert _is_after(since, first[kind], max(0, second - 1) if second >= 5 else 0, second)


def test_a_request_that_nobody_answers_ends(library: Library, tmp_path: Path) -> None:
    discover, *requests, last = _events(library, tmp_path, [*ACCEPTED, *[NEXT] * 3])
    assert [event.type for event in requests] == [REQUEST] * 3
    assert {event.number for event in requests} == {discover.number}
    assert last.type == DISCOVER
    assert last.number != discover.number


@pytest.mark.parametrize("is_bound", [False, True])
def test_an_address_that_another_host_has_is_declined(library: Library, tmp_path: Path, is_bound: bool) -> None:
    until = [NEXT, NEXT] if is_bound else [pause(3000)]
    events = _events(library, tmp_path, [*ACCEPTED, offer(ACK).row(), *until, TAKEN, NEXT, NEXT])
    assert [event.what for event in events].count("lost") == is_bound
    decline, discover = events[-2:]
    assert (decline.type, decline.current) == (DECLINE, NOTHING)
    assert decline.chosen == _chosen(ADDRESS, SERVER_ADDRESS)
    assert discover.type == DISCOVER
    assert _is_after(decline, discover, 10, 12)
    assert [event.is_ended for event in events if event.own] == [event.type == DECLINE for event in events if event.own]


def test_without_an_address_nothing_is_taken(library: Library, tmp_path: Path) -> None:
    events = _events(library, tmp_path, [NEXT, TAKEN, *ACCEPTED[1:], TAKEN, offer(ACK).row(), NEXT, NEXT])
    assert [event.what for event in events] == [
        *["message", "message", "checking", "bound"],
        *["announcement"] * 2,
    ]


def test_of_two_offers_the_first_is_taken(library: Library, tmp_path: Path) -> None:
    other = offer(address=bytes([192, 0, 2, 99]))
    rows = [NEXT, offer().row(), other.row(), pause(READING), other.row(), offer(ACK).row(), NEXT]
    discover, *others = [event for event in _events(library, tmp_path, rows) if event.own]
    assert discover.type == DISCOVER
    assert {event.address for event in others} == {ADDRESS}


def _trial(chance: random.Random) -> tuple[list[str], list[tuple[int, bytes, bytes]], bool]:
    """Rows from a DISCOVER to the next one; type, address and server of the packets; whether there was a lease."""
    rows, packets = [NEXT], [(DISCOVER, b"", b"")]
    messages = [random_message(chance, (OFFER, OFFER, OFFER, ACK, NAK)) for _ in range(4)]
    taken = next((number for number, message in enumerate(messages) if is_offer(message)), None)
    if taken is None:
        taken = len(messages)
        messages.append(offer())
    rows += [row for message in messages[: taken + 1] for row in (message.row(), pause(READING))]
    found = meaning(messages[taken])
    assert found
    address = messages[taken].address
    packets.append((REQUEST, address, found.values[SERVER]))
    messages = [random_message(chance, (ACK, ACK, ACK, NAK, OFFER)) for _ in range(4)]
    messages.append(offer(NAK, server=found.values[SERVER]))
    for message in messages:
        rows += [message.row(), pause(READING)]
        if result := answer(message, address, found.values[SERVER]):
            break
    if result == "lease":
        rows += [TAKEN, NEXT]
        packets.append((DECLINE, address, found.values[SERVER]))
    return rows, packets, result == "lease"


def _concerns(library: Library, folder: Path, seed: int, trials: int, slow: int) -> None:
    print(f"seed {seed}")
    chance = random.Random(seed)
    rows: list[str] = []
    packets: list[tuple[int, bytes, bytes]] = []
    leases = 0
    for _ in range(trials):
        more, sent, is_lease = _trial(chance)
        rows += more
        packets += sent
        leases += is_lease
    events = _events(library, folder, rows, SLOW_PERCENT=slow)
    came: list[tuple[int, bytes, bytes]] = []
    last = b""
    for event in events:
        # A packet may have been repeated meanwhile.
        if event.own and event.own != last:
            options = (event.chosen[0][2:], event.chosen[1][2:]) if any(event.chosen[0]) else (b"", b"")
            came.append((event.type, *options))
            last = event.own
    assert came == packets
    # A lease of less than a second may be over before.
    assert [event.what for event in events].count("checking") == leases
    assert 0.2 * trials < leases < 0.8 * trials


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("seed", "slow"), [(SEED, 0), (SEED + 1, 30)])
def test_messages_of_all_kinds_do_what_the_model_says(library: Library, tmp_path: Path, seed: int, slow: int) -> None:
    _concerns(library, tmp_path, seed, 60, slow)


def test_the_netlist_does_the_same(tmp_path: Path) -> None:
    library = _library(tmp_path)
    assert library.latches("firm_dhcp_client") == []
    hardware = core_files("net/package", "net/dhcp")
    assert loops("firm_dhcp_client", tmp_path, hardware, hardware) == []
    library.replace_by_netlist("firm_dhcp_client", {})
    library.analyse(path for path in core_files("net/dhcp", fileset="tb") if path.stem == "firm_dhcp_client_tb")
    _concerns(library, tmp_path, SEED, 8, 0)
