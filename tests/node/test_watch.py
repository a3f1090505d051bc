"""The record of a run: bounded, never waiting, honest about what a reader has missed; and the source that it pauses."""

from __future__ import annotations

import random
import statistics
import threading
import time
import tracemalloc

import pytest

from fusesoc_firm.node.engine.carrier import Taken
from fusesoc_firm.node.engine.player import Player
from fusesoc_firm.node.engine.watch import Control, Latency, Percentiles, Waits, Watch


def test_the_record_is_bounded_and_tells_what_is_missing() -> None:
    watch = Watch(most_bytes=1000, most_messages=30)
    for number in range(100):
        assert watch.saw("a", bytes([number]) * 10, number) == number
    news = watch.since(-1, 20)
    assert [seen.number for seen in news.messages] == [*range(80, 100)]
    assert (news.skipped, news.last, watch.first) == (80, 99, 70)
    assert watch.since(97, 20).messages[0].payload == bytes([98]) * 10
    assert watch.since(99, 20) == watch.since(500, 20)
    assert watch.since(99, 20).messages == ()
    assert watch.find(69) is None
    assert watch.find(100) is None
    found = watch.find(70)
    assert found
    assert found.payload == bytes([70]) * 10
    assert [seen.number for seen in watch.before(75, 3)] == [72, 73, 74]
    assert [seen.number for seen in watch.before(75, 300)] == [*range(70, 75)]
    assert [seen.number for seen in watch.before(9999, 2)] == [98, 99]
    # A message that is larger than the bound stands alone.
    watch.saw("b", bytes(5000), 100)
    assert watch.first == 100
    assert watch.counts()["a"].messages == 100
    assert watch.counts()["b"].bytes == 5000


def test_waits_are_kept_and_summed_over_the_counted_cycles() -> None:
    watch = Watch()
    assert (watch.waits_of_all, watch.waits(10)) == (None, [])
    # A count that begins has no cycles.
    watch.waited(1000, 1000, [0, 0])
    assert watch.waits_of_all is None
    watch.waited(1000, 1100, [10, 90])
    watch.waited(1100, 1400, [0, 150])
    parts = [Waits(1000, 1100, 100, (10, 90)), Waits(1100, 1400, 300, (0, 150))]
    assert watch.waits(10) == parts
    assert watch.waits_of_all == Waits.of(parts) == Waits(1000, 1400, 400, (10, 240))
    assert watch.waits(10, 1099, 1099) == parts[:1]
    assert watch.waits(10, 1100) == watch.waits(1) == parts[1:]
    # Nobody watched before cycle 2000.
    watch.waited(2000, 2000, [0, 0])
    for cycle in range(2000, 40_000):
        watch.waited(cycle, cycle + 1, [0, 1])
    assert watch.waits_of_all == Waits(1000, 40_000, 400 + 38_000, (10, 240 + 38_000))
    # A long run keeps the counts of all its cycles, the older ones in sums; none spans the time without watchers.
    kept = watch.waits(10_000)
    assert len(kept) <= 5000
    assert Waits.of(kept) == watch.waits_of_all
    assert kept[0].end == 1400
    assert kept[-1] == Waits(39_999, 40_000, 1, (0, 1))
    assert [part for part in watch.waits(10_000, 2000, 2000) if not part.first <= 2000 < part.end] == []
    assert watch.waits(10_000, 2000, 2000)


def test_times_without_watchers_do_not_add_to_the_memory() -> None:
    watch = Watch()
    for cycle in range(0, 20_000, 2):
        watch.waited(cycle, cycle + 1, [1])
    assert len(watch.waits(10_000)) == 5000
    assert watch.waits(1) == [Waits(19_998, 19_999, 1, (1,))]


def test_what_belongs_to_cycles_of_an_earlier_simulator_is_forgotten() -> None:
    """The cycles of another simulator begin at 0 again; messages of the record keep theirs."""
    watch = Watch()
    watch.granted("a", 1100, 1110)
    watch.waited(1000, 1400, [10, 90])
    old = watch.find(watch.saw("a", b"", 0, Latency(cycles=60), (1100, 1110)))
    assert old
    assert watch.waits_during(old, 10) == Waits(1000, 1400, 400, (10, 90))
    watch.begin_cycles()
    assert (watch.grants(10), watch.waits(10), watch.waits_of_all) == ([], [], None)
    watch.waited(1000, 1200, [1, 2])
    new = watch.find(watch.saw("a", b"", 0, Latency(cycles=60), (1100, 1110)))
    assert new
    assert watch.waits_during(new, 10) == watch.waits_of_all == Waits(1000, 1200, 200, (1, 2))
    assert watch.waits_during(old, 10) is None


def test_a_long_run_needs_no_more_memory() -> None:
    watch = Watch(most_bytes=100_000, most_messages=1000)

    def run() -> int:
        for number in range(20_000):
            watch.saw("a", bytes(50), number, Latency(number - 1, number % 77, number))
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        first = run()
        assert run() < first + 20_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("size", [1, 2, 99, 100, 101, 5000])
def test_percentiles_are_those_of_the_latest_thousand(size: int) -> None:
    seed = random.randrange(2**32)
    print("seed", seed)
    values = [random.Random(seed + number).randrange(10**9) for number in range(size)]
    watch = Watch()
    for value in values:
        watch.saw("a", b"", 0, Latency(None, value, 2 * value))
    latest = sorted(values[-1000:])
    found = watch.counts()["a"]
    assert found.cycles
    assert found.wall_ns
    assert found.cycles.median == statistics.median_high(latest)
    # At most one value in a hundred is above.
    assert sum(value > found.cycles.most for value in latest) <= len(latest) / 100
    assert sum(value >= found.cycles.most for value in latest) >= len(latest) / 100
    assert found.cycles.maximum == max(latest)
    assert found.wall_ns.maximum == 2 * max(latest)
    assert Percentiles.of([]) is None


def test_many_threads_report_at_once() -> None:
    watch = Watch(most_messages=100)

    def report() -> None:
        for _ in range(2000):
            watch.saw("a", b"x", 0)

    threads = [threading.Thread(target=report) for _ in range(4)]
    for thread in threads:
        thread.start()
    last, seen = -1, 0
    while any(thread.is_alive() for thread in threads) or watch.since(last, 0).skipped:
        news = watch.since(last, 50)
        seen += len(news.messages) + news.skipped
        last = news.last
    assert seen == 8000
    assert watch.counts()["a"].messages == 8000


def test_a_player_is_paused_and_steps() -> None:
    control = Control()
    control.pause()
    got: list[int] = []
    more = threading.Semaphore(0)
    player = Player([(0, b"a"), (1, b"b"), (0, b"c")], control, rounds=None)

    def take() -> None:
        for event in player.receive():
            assert isinstance(event, Taken)
            got.append(event.topic)
            more.release()

    thread = threading.Thread(target=take)
    thread.start()
    assert not more.acquire(timeout=0.05)
    for expected in ([0], [0, 1], [0, 1, 0], [0, 1, 0, 0]):
        control.step()
        assert more.acquire(timeout=60)
        assert got == expected
    assert not more.acquire(timeout=0.05)
    control.resume()
    for _ in range(10):
        assert more.acquire(timeout=60)
    control.pause()
    assert not player.wait_until_stopped(0)
    player.stop()
    assert player.wait_until_stopped(60)
    thread.join(60)
    assert not thread.is_alive()


def test_a_player_keeps_its_rate_and_ends() -> None:
    """On a busy machine it is slower, never faster."""
    player = Player([(0, b"a")] * 10, Control(), rate=100, rounds=2)
    start = time.monotonic()
    assert len([*player.receive()]) == 20
    assert time.monotonic() - start >= 19 / 100
    assert player.wait_until_stopped(0)


def test_a_step_that_nobody_took_is_forgotten_when_all_pass() -> None:
    control = Control()
    control.step()
    control.step()
    control.resume()
    control.pause()
    passed = threading.Event()

    def wait() -> None:
        control.passes()
        passed.set()

    thread = threading.Thread(target=wait)
    thread.start()
    assert not passed.wait(0.05)
    control.end()
    assert passed.wait(60)
    assert not control.passes()


def test_bursts_and_the_messages_of_a_block_are_kept_within_bounds() -> None:
    watch = Watch(most_messages=10)
    for number in range(6000):
        watch.granted("ab"[number % 2], 10 * number, 10 * number + 4)
        watch.saw("ab"[number % 2], bytes([number % 251]), number)
    grants = watch.grants(3)
    assert [(grant.block, grant.first, grant.last) for grant in grants] == [
        ("b", 59970, 59974),
        ("a", 59980, 59984),
        ("b", 59990, 59994),
    ]
    assert len(watch.grants(10_000)) == 5000
    assert [seen.number for seen in watch.of("a", 3)] == [5994, 5996, 5998]
    # Only ten messages are in the record.
    assert [seen.number for seen in watch.of("b", 100)] == [5991, 5993, 5995, 5997, 5999]
    assert watch.of("c", 5) == []
