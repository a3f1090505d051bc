"""Queues of subscribers, in Python and in C++: the same histories against a model that thinks of nothing else."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Sequence

import pytest

from fusesoc_firm.node.engine.queues import (
    ClosedError,
    EarliestDeadlineFirst,
    EmptyError,
    FixedPriority,
    LeastRecentlyUsed,
    LeastSlackTime,
    Overflow,
    Policy,
    RoundRobin,
    SubscriberQueues,
)
from tests.node.drivers import Driver, cpp_driver
from tests.seeds import seeded

SEED = seeded(20240613)
SUBSCRIBERS = [1, 2, 3, 5, 32]

POLICIES: dict[str, Callable[[list[int], list[int]], Policy]] = {
    "fixed_priority": lambda _deadlines, _transfers: FixedPriority(),
    "round_robin": lambda deadlines, _transfers: RoundRobin(len(deadlines)),
    "lru": lambda deadlines, _transfers: LeastRecentlyUsed(len(deadlines)),
    "edf": lambda deadlines, _transfers: EarliestDeadlineFirst(deadlines),
    "lst": LeastSlackTime,
}


@pytest.fixture(scope="module")
def driver() -> Driver:
    return cpp_driver("queues")


class Model:
    """What is expected, written from the policies' definitions with nothing kept that could be computed."""

    def __init__(self, words: Sequence[str]) -> None:
        self.policy, self.overflow = words[:2]
        self.capacity, self.subscribers = map(int, words[2:4])
        times = [*map(int, words[4:])]
        self.deadlines, self.transfers = times[: self.subscribers], times[self.subscribers :]
        self.waiting: list[tuple[int, int, int]] = []  # subscriber, item, arrival
        self.served: list[int] = []
        self.dropped = [0] * self.subscribers
        self.is_closed = False
        self.now = 0

    def put(self, subscriber: int, item: int, now: int) -> str:
        self.now = now
        if self.is_closed:
            return "closed"
        mine = [each for each in self.waiting if each[0] == subscriber]
        is_full = len(mine) == self.capacity
        self.dropped[subscriber] += is_full and self.overflow != "block"
        if is_full and self.overflow == "drop_oldest":
            self.waiting.remove(mine[0])
        if not is_full or self.overflow == "drop_oldest":
            self.waiting.append((subscriber, item, now))
            return f"kept {self.dropped[subscriber]}"
        return f"refused {self.dropped[subscriber]}"

    def get(self) -> str:
        if not self.waiting:
            return "closed" if self.is_closed else "empty"
        asking = {subscriber for subscriber, _, _ in self.waiting}
        subscriber = next(candidate for candidate in self._order() if candidate in asking)
        first = next(each for each in self.waiting if each[0] == subscriber)
        self.waiting.remove(first)
        self.served.append(subscriber)
        return f"{subscriber} {first[1]}"

    def _order(self) -> list[int]:
        """All subscribers, the one that is to be served first ahead."""
        everybody = [*range(self.subscribers)]
        if self.policy == "round_robin":
            turn = self.served[-1] + 1 if self.served else 0
            return everybody[turn:] + everybody[:turn]
        if self.policy == "lru":
            by_last_use = list(dict.fromkeys(reversed(self.served)))[::-1]
            return [each for each in everybody if each not in by_last_use] + by_last_use
        if self.policy in {"edf", "lst"}:
            return sorted(everybody, key=self._urgency)
        return everybody

    def _urgency(self, subscriber: int) -> int:
        arrivals = [arrival for each, _, arrival in self.waiting if each == subscriber]
        if not arrivals:
            return 0
        until_deadline = arrivals[0] + self.deadlines[subscriber] - self.now
        return until_deadline - self.transfers[subscriber] if self.policy == "lst" else until_deadline


def _history(source: random.Random, policy: str, overflow: str, subscribers: int) -> list[str]:
    """Lines for the driver: bursts of writing and of reading, then an end."""
    times = [source.randint(10, 400) for _ in range(2 * subscribers)]
    lines = [" ".join(map(str, ["queues", policy, overflow, source.randint(1, 4), subscribers, *times]))]
    now = 0
    for _ in range(40):
        for _ in range(source.randint(0, 2 * subscribers)):
            now += source.randint(0, 20)
            lines.append(f"put {source.randrange(subscribers)} {now}")
        lines += ["get"] * source.randint(0, 2 * subscribers)
    return [*lines, "close", f"put 0 {now}", *["get"] * (4 * subscribers + 1)]


def _model_answers(lines: Sequence[str]) -> list[str]:
    model = Model(lines[0].split()[1:])
    answers = ["ready"]
    for number, line in enumerate(lines[1:], 1):
        command, *words = line.split()
        if command == "put":
            answers.append(model.put(int(words[0]), number, int(words[1])))
        elif command == "get":
            answers.append(model.get())
        else:
            model.is_closed = True
            answers.append("closed")
    return answers


class Player:
    """The Python class behind the driver's words."""

    def __init__(self, words: Sequence[str]) -> None:
        subscribers, times = int(words[3]), [*map(int, words[4:])]
        # Least recently used is what one gets without asking.
        policy = None if words[0] == "lru" else POLICIES[words[0]](times[:subscribers], times[subscribers:])
        self.now = 0
        self.queues: SubscriberQueues[int] = SubscriberQueues(
            subscribers, int(words[2]), policy, Overflow(words[1]), lambda: self.now
        )

    def answer(self, number: int, command: str, words: Sequence[str]) -> str:
        try:
            if command == "put":
                subscriber, self.now = map(int, words)
                kept = self.queues.put(subscriber, number, 0)
                return f"{'kept' if kept else 'refused'} {self.queues.dropped(subscriber)}"
            if command == "get":
                return "{} {}".format(*self.queues.get(0))
            self.queues.close()
        except EmptyError:
            return "empty"
        except ClosedError:
            pass
        return "closed"


def _python_answers(lines: Sequence[str]) -> list[str]:
    player = Player(lines[0].split()[1:])
    numbered = ((number, line.split()) for number, line in enumerate(lines))
    return ["ready", *(player.answer(number, words[0], words[1:]) for number, words in numbered if number)]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("overflow", [rule.value for rule in Overflow])
@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_serves_as_it_is_defined(driver: Driver, policy: str, overflow: str) -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    for subscribers in SUBSCRIBERS:
        lines = _history(source, policy, overflow, subscribers)
        expected = _model_answers(lines)
        assert _python_answers(lines) == expected
        assert driver.answers(lines) == expected
        refused = sum(answer.startswith("refused") for answer in expected)
        assert (refused == 0) == (overflow == "drop_oldest")


def test_least_recently_used_lets_nobody_wait_for_more_than_all_others() -> None:
    print(f"seed {SEED}")
    source = random.Random(SEED)
    queues: SubscriberQueues[int] = SubscriberQueues(5, 2)
    waited = [0] * 5
    for _ in range(2000):
        queues.put(source.randrange(5), 0)
        queues.put(source.randrange(5), 0)
        waiting = [bool(queue) for queue in queues._queues]
        served, _ = queues.get()
        waited = [0 if each == served else waited[each] + waiting[each] for each in range(5)]
        assert max(waited) <= 4


def test_threads_lose_nothing() -> None:
    subscribers, items = 4, 300
    queues: SubscriberQueues[int] = SubscriberQueues(subscribers, 3, overflow=Overflow.BLOCK)
    found: list[list[int]] = [[] for _ in range(subscribers)]

    def write(subscriber: int) -> None:
        for item in range(items):
            assert queues.put(subscriber, item)

    def read() -> None:
        for subscriber, item in queues:
            found[subscriber].append(item)

    writers = [threading.Thread(target=write, args=[subscriber], daemon=True) for subscriber in range(subscribers)]
    reader = threading.Thread(target=read, daemon=True)
    for thread in (*writers, reader):
        thread.start()
    for thread in writers:
        thread.join()
    queues.close()
    reader.join()
    assert found == [[*range(items)]] * subscribers


def test_threads_lose_nothing_in_cpp() -> None:
    cpp_driver("queues", "thread").run("threads")


def test_a_writer_that_waits_is_told_of_the_end() -> None:
    queues: SubscriberQueues[int] = SubscriberQueues(1, 1, overflow=Overflow.BLOCK)
    queues.put(0, 1)
    told = threading.Event()

    def write() -> None:
        with pytest.raises(ClosedError):
            queues.put(0, 2)
        told.set()

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    queues.close()
    writer.join()
    assert told.is_set()
    assert [*queues] == [(0, 1)]


def test_times_are_kept() -> None:
    queues: SubscriberQueues[int] = SubscriberQueues(1, 1, overflow=Overflow.BLOCK)
    begun = time.monotonic()
    with pytest.raises(EmptyError, match=r"no frame arrived in 0.05 s"):
        queues.get(0.05)
    queues.put(0, 1)
    assert not queues.put(0, 2, 0.05)
    assert time.monotonic() - begun >= 0.1


def test_illegal_numbers_are_named() -> None:
    with pytest.raises(ValueError, match="subscribers is 0, capacity is 1; legal: 1 or more"):
        SubscriberQueues(0, 1)
    with pytest.raises(ValueError, match="subscribers is 1, capacity is 0; legal: 1 or more"):
        SubscriberQueues(1, 0)
    queues: SubscriberQueues[int] = SubscriberQueues(2, 1)
    with pytest.raises(IndexError, match="subscriber is 2; legal: 0 to 1"):
        queues.put(2, 0)
    with pytest.raises(ValueError, match="zip"):
        LeastSlackTime([1, 2], [1])


SHARED = ["put 0 1", "put 1 2", "put 1 3", "put 0 4", "put 0 5", "put 2 6", "get", "get", "get", "get", "get", "get"]


@pytest.mark.parametrize(
    ("overflow", "puts", "gets"),
    [
        ("drop_oldest", ["kept 0"] * 4 + ["kept 1", "kept 0"], ["1 2", "2 6", "1 3", "0 4", "0 5", "empty"]),
        ("drop_newest", ["kept 0"] * 4 + ["refused 1", "kept 0"], ["0 1", "2 6", "1 2", "1 3", "0 4", "empty"]),
        ("block", ["kept 0"] * 4 + ["refused 0", "kept 0"], ["0 1", "2 6", "1 2", "1 3", "0 4", "empty"]),
    ],
)
def test_subscribers_that_share_a_queue_have_a_capacity_each(
    driver: Driver, overflow: str, puts: list[str], gets: list[str]
) -> None:
    """Subscriber 1 shares the queue of 0, and loses nothing."""
    assert driver.answers([f"shared {overflow} 2", *SHARED]) == ["ready", *puts, *gets]
    player = Player(["lru", overflow, "2", "3", *["0"] * 6])
    player.queues = SubscriberQueues(3, [2, None, 2], None, Overflow(overflow), lambda: player.now)
    player.queues.share(1, 0)
    lines = [(number, line.split()) for number, line in enumerate(SHARED, 1)]
    assert [player.answer(number, words[0], words[1:]) for number, words in lines] == [*puts, *gets]


def test_drops_of_the_first_queues_are_counted_without_those_of_others() -> None:
    """A node's last queue is that of the status, whose requests are not messages."""
    queues: SubscriberQueues[int] = SubscriberQueues(3, 1)
    for subscriber in (0, 0, 1, 2, 2, 2):
        queues.put(subscriber, 0)
    assert [queues.dropped_by_first(count) for count in (1, 2, 3)] == [1, 1, 3]
