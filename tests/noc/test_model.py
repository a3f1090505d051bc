"""The model of an exchange against the hardware: the same handshakes in every cycle."""

from __future__ import annotations

from pathlib import Path

import pytest

from fusesoc_firm.noc.model import Arrival, Beat, Frame, Model, arrivals, latency, merged, random_frames, throughput
from fusesoc_firm.noc.network import Flow, Network, chain, crossbar, mesh
from tests.noc.exchanges import all_to_all, analysed, network
from tests.noc.test_exchange import NETWORKS, simulated
from tests.seeds import seeded
from tools.bench.noc import Relays

SEED = seeded(190)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("buffers", [2, 8])
@pytest.mark.parametrize("name", NETWORKS)
def test_every_cycle_is_that_of_the_hardware(name: str, buffers: int, tmp_path: Path) -> None:
    made = NETWORKS[name]
    library = analysed(made, 8, tmp_path, buffers=buffers)
    for seed, source_stall, sink_stall in (SEED, 0, 0), (SEED + 1, 20, 30):
        print(f"seed {seed}")
        stalls: dict[str, int] = {"SOURCE_STALL": source_stall, "SINK_STALL": sink_stall}
        simulated(library, SEED=seed, FRAMES=300, TRACE="trace.txt", **stalls)
        _compare(made, buffers, (tmp_path / "trace.txt").read_text(encoding="ascii").splitlines())


def _compare(made: Network, buffers: int, lines: list[str]) -> None:
    model = Model(made, buffers)
    endpoints = range(made.endpoints)
    numbers = {flow: number for number, flow in enumerate(made.flows)}
    flows = [made.flows_of(source) for source in endpoints]
    bits = max(1, (made.destinations - 1).bit_length())
    for cycle, line in enumerate(lines):
        # The lowest bit is the last one.
        valid, ready, last, tdest, taking, taken = (word[::-1] for word in line.split())
        offered = model.offered()
        assert [model.is_ready(source) for source in endpoints] == [bit == "1" for bit in ready], cycle
        assert [sink in offered for sink in endpoints] == [bit == "1" for bit in taking], cycle
        offers = {
            source: Beat(
                numbers[flows[source][int(tdest[bits * source : bits * (source + 1)][::-1], 2)]], last[source] == "1"
            )
            for source in endpoints
            if valid[source] == "1"
        }
        model.step(offers, lambda sink, taken=taken: taken[sink] == "1")  # type: ignore[misc]


def test_arrivals() -> None:
    """A cycle for each router, and one for the change of an idle output; none for that of a busy one."""
    made = network(mesh(3, 1), (Flow(0, (2,)), Flow(1, (2,))))
    frames = [Frame(0, 0, 4), Frame(10, 0, 2), Frame(10, 1, 3)]
    # The second router changes to the first frame, then to the third one, which is there a cycle before the second one.
    assert arrivals(made, frames, 40) == [Arrival(3 + 1 + 3, 2, 0), Arrival(12 + 1 + 2, 2, 2), Arrival(15 + 2, 2, 1)]


def test_a_merge_turns_as_in_hardware() -> None:
    """Its turn stays with the last source, goes on at the end of a message, or after a cycle without one."""
    assert [*merged([[0, 1, 5], [1, 1, 9], []], 12)] == [
        (0, 0, 0),
        (0, 1, 1),
        (1, 0, 2),
        (1, 1, 3),
        (0, 2, 6),
        (1, 2, 10),
    ]


def test_a_deaf_sink_stops_only_frames_that_need_it() -> None:
    made = network(crossbar(4), all_to_all(4))
    places = {(flow.source, flow.sinks[0]): place for place, flow in enumerate(made.flows)}
    frames = [
        Frame(0, places[0, 3], 8),
        Frame(0, places[1, 2], 8),
        Frame(20, places[1, 3], 8),
        Frame(20, places[2, 1], 8),
    ]
    assert {arrival.frame for arrival in arrivals(made, frames, 100, deaf=[3])} == {1, 3}


def test_throughput_is_that_of_the_narrowest_channel() -> None:
    assert throughput(network(crossbar(4), (Flow(0, (1,)), Flow(2, (3,)))), cycles=500) == 2
    assert throughput(network(crossbar(4), (Flow(0, (3,)), Flow(1, (3,)), Flow(2, (3,)))), cycles=500) == 1
    # A copy counts at each endpoint that it reaches; its first beat needs a cycle for each of them.
    assert throughput(network(crossbar(3), (Flow(0, (1, 2)),)), beats=9, cycles=1000) == pytest.approx(1.8, abs=0.01)


def test_flows_are_chosen_by_their_rates() -> None:
    made = network(crossbar(3), (Flow(0, (1,), 3.0), Flow(0, (2,), 1.0)))
    frames = random_frames(made, 0.8, 4, 20_000)
    assert len(frames) == pytest.approx(0.8 / 4 * 20_000, rel=0.05)
    assert sum(frame.flow == 0 for frame in frames) == pytest.approx(0.75 * len(frames), rel=0.05)


def test_latency_at_a_low_load_is_that_of_the_way() -> None:
    """The routers, and the frame's beats: its last one is taken in the cycle in which it arrives."""
    assert latency(network(chain(4), (Flow(0, (3,)),)), 0.001, beats=5, cycles=20_000) == 4 + 5
    assert latency(network(crossbar(2), (Flow(0, (1,)),)), 0.001, beats=5, cycles=20_000) == 1 + 5


def test_relays_share_the_channels_of_the_manager() -> None:
    """The frames of accelerators pass both of its channels, those to and from the host one of them."""
    assert Relays(network(crossbar(4), (Flow(1, (2,)), Flow(3, (1,))))).throughput() == pytest.approx(1, abs=0.01)
    assert Relays(network(crossbar(3), (Flow(1, (0,)), Flow(0, (2,))))).throughput() == pytest.approx(2, abs=0.01)
    assert Relays(network(crossbar(4), (Flow(1, (2,)), Flow(2, (0,))))).throughput() == pytest.approx(1, abs=0.01)
