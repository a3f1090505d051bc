"""The command `firm replay`: send a bag through a system, with a progress bar, error lines and a summary."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

from tqdm import tqdm

from fusesoc_firm.accelerator.functions import Functions, importable_sources
from fusesoc_firm.frame.codec import CodecError
from fusesoc_firm.message.bag_reader import Bag, Form, Recorded, Stream, open_bag
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.node.engine.watch import Control, Latency, Watch
from fusesoc_firm.node.transport.simulator import WAITS_SECONDS, Simulator, Waits
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.bags.goals import BagOfGoals, Told
from fusesoc_firm.runs.bags.routes import Route, renamed, routes_of
from fusesoc_firm.runs.bags.writer import BagWriter, RecordedTopic, check_writable, form_of, write_bag
from fusesoc_firm.runs.replay.exchanges import OF_GOALS, Exchanges, asked_actions, ended_in, missing_in, with_exchanges
from fusesoc_firm.runs.replay.goals import Verdict
from fusesoc_firm.runs.replay.hardware_run import Sent, StuckError, SystemRun, published
from fusesoc_firm.runs.simulation.software_run import stimulated
from fusesoc_firm.system.derived.model import Topic, absolute_name
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError, fail, nearest
from fusesoc_firm.text.json_text import json_text

# The maximum number of lines about rejected messages; further messages are only counted.
_SHOWN = 100


@dataclass(frozen=True)
class Source:
    """The part of a bag to replay: at most `limit` messages.

    The part begins `start` seconds after the bag's beginning, and lasts `duration` seconds.
    """

    path: Path
    limit: int | None = None
    start: float = 0
    duration: float | None = None

    def items(self, bag: BagOfGoals, topics: Collection[str]) -> Iterator[Recorded | Told]:
        """Yield the selected messages of some topics, and the bag's records of goals up to the last of them."""
        first, stop = self.window(bag)
        selected = 0
        for item in bag.items(topics, stop):
            if isinstance(item, Recorded):
                if item.stamp < first:
                    continue
                selected += 1
            yield item
            if selected == self.limit:
                return

    def window(self, bag: Bag) -> tuple[int, int | None]:
        """Return the stamps in ns from which on and before which messages are selected."""
        first = bag.start + round(self.start * 10**9)
        return first, None if self.duration is None else first + round(self.duration * 10**9)


@dataclass(frozen=True)
class Target:
    """The bag for the responses; without `form`, the name's ending or else the source determines the format."""

    path: Path
    form: Form | None = None
    force: bool = False


@dataclass(frozen=True)
class Settings:
    """The settings of a replay: `names` renames topics of blocks.

    The hardware is at rest after `quiet` cycles without a beat. If latency is included, a response's stamp is the
    cause's stamp plus the hardware's latency. The summary is a table, or JSON if `is_json` is set. `watch` records all
    messages, and `control` pauses the replay.
    """

    names: Mapping[str, str]
    quiet: int
    has_latency: bool = False
    is_json: bool = False
    watch: Watch | None = None
    control: Control | None = None


def replay(
    loaded: LoadedSystem,
    source: Source,
    target: Target,
    settings: Settings,
    start_simulator: Callable[[], Simulator],
) -> None:
    """Replay a bag and print a summary; `start_simulator` is called after all other checks.

    May raise `InputError`, also if messages were rejected; the responses to all other messages are then recorded.
    """
    if source.path.exists() and target.path.exists() and source.path.samefile(target.path):
        fail(f"cannot write {target.path}: it is the bag to replay")
    check_writable(target.path, force=target.force)
    system = loaded.system
    if settings.has_latency and system.clock is None:
        fail("cannot compute the latency in seconds: the specification has no 'clock'")
    clock = system.clock if settings.has_latency else None
    _check_names(settings.names, [item.block for item in (*stimulated(system), *published(system))])
    subscribers = renamed(stimulated(system), settings.names)
    publishers = renamed(published(system), settings.names)
    topics = {item.block: _recorded(item, loaded) for item in publishers}
    with open_bag(source.path) as opened:
        bag = with_exchanges(opened, loaded, subscribers)
        form = _form(target, bag.form)
        _check_speaks(publishers, target.path, form)
        routes = _routes(bag, loaded, subscribers, settings.names)
        ended = ended_in(bag, system, source.window(bag)[1])
        warnings = missing_in(bag, system, ended)
        for warning in warnings:
            print(warning, file=sys.stderr)
        with (
            importable_sources([type_.accelerator for type_ in system.software.types], loaded.folder),
            _started(start_simulator) as simulator,
            write_bag(target.path, form, list(topics.values())) as written,
        ):
            functions = Functions.of(system.software, loaded.folder)
            run = SystemRun(system, simulator, functions, settings.quiet, settings.watch)
            going = _Replay(bag, source, routes, run, topics, written, clock, settings, warnings, ended)
            if settings.watch:
                settings.watch.epoch_ns = bag.start
            going.play()
        if settings.is_json:
            print(json_text(going.summary(target.path), 2))
        else:
            going.print_summary(target.path)
    if going.errors:
        errors = "1 error" if going.errors == 1 else f"{going.errors} errors"
        fail(f"{errors}; {going.refused} of {going.played.total()} messages had errors")


@dataclass
class _Replay:
    """A replay in progress: the numbers of messages played from each stream and sent by each block."""

    bag: BagOfGoals
    source: Source
    routes: Mapping[Stream, Route]
    run: SystemRun
    topics: Mapping[str, RecordedTopic]
    written: BagWriter
    clock: Fraction | None
    settings: Settings
    warnings: Sequence[Diagnostic]
    # The ids of goals with results in the bag, by the blocks of the actions to which the hardware sends goals.
    ended: Mapping[str, set[bytes]]
    played: Counter[Stream] = field(default_factory=Counter)
    sent: Counter[str] = field(default_factory=Counter)
    # The stamp of the last message that was played, and whether it was the last one of the selected time.
    last: int = 0
    is_whole: bool = False
    # The time of the last request of waits, by the monotonic clock.
    counted_at: float = 0.0
    refused: int = 0
    errors: int = 0
    is_over: bool = False
    # The first errors, each in one line.
    shown: list[str] = field(default_factory=list)

    @cached_property
    def exchanges(self) -> Exchanges:
        """The calls and goals of the bag."""
        window = self.source.window(self.bag)
        return Exchanges(self.bag, self.run.system, window, self.ended, self._take)

    def play(self) -> None:
        """Replay all messages, and report an early end."""
        source = self.source
        expected = sum(count for stream, count in self.bag.streams.items() if stream in self.routes)
        total = expected if source.limit is None else min(expected, source.limit)
        topics = {stream.topic for stream in self.routes}
        with tqdm(total=total, unit="msg", disable=None, file=sys.stderr) as bar:
            self._count_waits()
            try:
                for item in source.items(self.bag, topics):
                    if self.settings.control and not self.settings.control.passes():
                        break
                    if isinstance(item, Told):
                        self._hear(item)
                    else:
                        self._play(item)
                        bar.update()
                    if self.is_over:
                        break
                else:
                    self.is_whole = self.played.total() != source.limit
            except InputError as error:
                self._report(str(error).removeprefix("error: "))
            for left in (self.run.unfinished, *self.exchanges.unfinished()):
                if left:
                    self._report(left)
            if not self.is_over:
                self._end()

    def _play(self, recorded: Recorded) -> None:
        """Send a message to the system, record the responses, and report faults."""
        self.played[recorded.stream] += 1
        self.last = recorded.stamp
        route, faults = self.routes[recorded.stream], self.run.faults
        if route.misfit:
            faults.append(route.misfit)
        try:
            for subscriber in () if route.misfit else route.subscribers:
                self._give(subscriber, recorded)
            self.exchanges.follow_up(recorded.stamp)
        except (StuckError, TransportError) as error:
            self._stop(error)
        self._count_waits()
        self.exchanges.note_call(recorded, route, self.run.sent)
        self.refused += bool(faults)
        self._conclude(recorded)

    def _hear(self, told: Told) -> None:
        """Process a recorded message of an action."""
        try:
            self.exchanges.tell(told)
            self.exchanges.follow_up(told.recorded.stamp)
        except (StuckError, TransportError) as error:
            self._stop(error)
        except (CodecError, ValueError) as error:
            self.run.faults.append(str(error))
        self._conclude(told.recorded)

    def _stop(self, error: Exception) -> None:
        self.run.faults.append(f"the rest of the bag was not replayed: {error}")
        self.is_over = True

    def _conclude(self, recorded: Recorded) -> None:
        """Record the system's messages since a recorded message, and report faults."""
        for sent in self.run.sent:
            self._record(sent)
        self.run.sent.clear()
        for fault in self.run.faults:
            self._report(f"{recorded.stream.topic}, message {recorded.number}, at {seconds(recorded.stamp)}: {fault}")
        self.run.faults.clear()

    def _give(self, subscriber: Topic, recorded: Recorded) -> None:
        """Give a message to a subscriber; goals and cancellations of actions may have to wait."""
        if not self.exchanges.give(subscriber.block, recorded.payload, recorded.stamp):
            self._take(subscriber, recorded.payload, recorded.stamp)

    def _take(self, subscriber: Topic, payload: bytes, stamp: int) -> bool:
        """Send a message to the system; return whether there was no fault."""
        sent, faults = len(self.run.sent), len(self.run.faults)
        self.run.take(subscriber, payload, stamp, self._seen(subscriber, payload, stamp))
        is_right = len(self.run.faults) == faults
        for message in self.run.sent[sent:]:
            try:
                self.exchanges.take(message)
            except (CodecError, ValueError) as error:
                self.run.faults.append(f"the hardware sent invalid data at '{message.topic.block}': {error}")
        return is_right

    def _seen(self, subscriber: Topic, payload: bytes, stamp: int) -> int | None:
        watch = self.settings.watch
        return watch.saw(subscriber.block, payload, stamp - self.bag.start) if watch else None

    def _count_waits(self) -> None:
        """Record the waits of messages since the last count, if the run is watched."""
        watch, simulator, now = self.settings.watch, self.run.simulator, time.monotonic()
        if not watch or now < self.counted_at + WAITS_SECONDS:
            return
        self.counted_at = now
        # The next message reports the end of a simulator.
        with suppress(TransportError):
            if not watch.is_watched():
                simulator.end_waits()
                return
            simulator.request_waits()
            for event in simulator.run(0):
                if isinstance(event, Waits):
                    watch.waited(event.first, event.cycle, event.counts)

    def _end(self) -> None:
        """End the simulation, and report its errors."""
        try:
            self.run.simulator.quit()
        except TransportError as error:
            self._report(str(error))

    def _record(self, sent: Sent) -> None:
        latency = sent.latency(self.clock) if self.clock else 0
        self.written.write(self.topics[sent.topic.block], sent.cause.stamp + latency, sent.payload)
        self.sent[sent.topic.block] += 1
        if watch := self.settings.watch:
            since = sent.cause.stamp + latency - self.bag.start
            watch.saw(sent.topic.block, sent.payload, since, Latency(sent.cause.seen, sent.cycles), sent.beats)

    def _report(self, fault: str) -> None:
        self.errors += 1
        if self.errors <= _SHOWN:
            self.shown.append(fault)
            tqdm.write(f"error: {self.bag.path}: {fault}", file=sys.stderr)

    def summary(self, path: Path) -> dict[str, Any]:
        """Return the numbers of received, sent and dropped messages by topic, and the first errors.

        The responses to calls are compared with those that the bag contains.
        """
        return {
            "bag": str(path),
            "in": [
                _count(stream.topic, stream.type, self.played[stream])
                | {"blocks": [item.block for item in route.subscribers]}
                for stream, route in self.routes.items()
            ],
            "out": [
                _count(topic.name, topic.type, self.sent[block]) | {"block": block}
                for block, topic in self.topics.items()
            ],
            "dropped": [
                _count(stream.topic, stream.type, count)
                for stream, count in self.bag.streams.items()
                if stream not in self.routes
            ],
            "responses": self.exchanges.responses(self.routes),
            "requests": self.exchanges.requests(self.topics, None if self.is_whole else self.last),
            **self.exchanges.of_goals({item.block for route in self.routes.values() for item in route.subscribers}),
            "warnings": [warning.data() for warning in self.warnings],
            "errors": self.errors,
            "messages_with_errors": self.refused,
            "first_errors": self.shown,
            "cycles": self.run.simulator.cycle,
        }

    def print_summary(self, path: Path) -> None:
        """Print the summary as a table."""
        found = self.summary(path)
        if self.errors > _SHOWN:
            print(f"and {self.errors - _SHOWN} more errors", file=sys.stderr)
        rows = [("in", ", ".join(row["blocks"]), row["topic"], row["type"], str(row["count"])) for row in found["in"]]
        rows += [("out", row["block"], row["topic"], row["type"], str(row["count"])) for row in found["out"]]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for *words, count in rows:
            print(*(word.ljust(width) for word, width in zip(words, widths, strict=False)), count.rjust(widths[-1]))
        for row in found["dropped"]:
            print(f"no subscriber for {row['topic']} ({row['type']}): {row['count']}")
        verdicts = [(f"responses to {row['topic']}", row) for row in found["responses"]]
        verdicts += [(f"requests on {row['topic']}", row) for row in found["requests"]]
        verdicts += [(f"{kind} of {row['topic']}", row) for kind in OF_GOALS for row in found[kind]]
        for title, row in verdicts:
            kinds = (verdict.value for verdict in Verdict if verdict.value in row)
            counts = (f"{row[kind]} {kind.replace('_', ' ')}" for kind in kinds)
            print(f"{title}: {', '.join(counts)}")
        print(
            f"{path}: {self.played.total()} in, {self.sent.total()} out,"
            f" {sum(row['count'] for row in found['dropped'])} dropped, {self.errors} errors, {found['cycles']} cycles"
        )


def _count(topic: str, type_: str, count: int) -> dict[str, Any]:
    return {"topic": topic, "type": type_, "count": count}


def seconds(stamp: int) -> str:
    """Return the text of a time in seconds with all digits; `stamp` is in ns."""
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def _started(start_simulator: Callable[[], Simulator]) -> Simulator:
    try:
        return start_simulator()
    except TransportError as error:
        fail(str(error))


def _recorded(topic: Topic, loaded: LoadedSystem) -> RecordedTopic:
    return RecordedTopic.of(topic.name, loaded.libraries[topic.frame.ros].closure(topic.frame.message))


def _check_names(names: Mapping[str, str], blocks: Sequence[str]) -> None:
    faults = Diagnostics()
    for block in names:
        if block not in blocks:
            faults.error(f"the system has no subscriber or publisher '{block}'", hint=nearest(block, blocks))
    faults.raise_if_any()


def _form(target: Target, like: Form) -> Form:
    """Return the format of the bag to write."""
    said = form_of(target.path)
    if target.form and said and target.form is not said:
        fail(f"cannot write {target.path}: --format is {target.form.value}, but the extension implies {said.value}")
    return target.form or said or like


def _check_speaks(topics: Sequence[Topic], path: Path, form: Form) -> None:
    """Raise `InputError` if the format of the bag cannot represent the messages that the system publishes."""
    faults = Diagnostics()
    for topic in topics:
        if topic.frame.ros != form.ros:
            message = f"'{topic.block}' uses {topic.frame.ros.title}, but {path} would be a {form.ros.title} bag"
            faults.error(message, hint="select another format with --format")
    faults.raise_if_any()


def _routes(
    bag: BagOfGoals, loaded: LoadedSystem, subscribers: Sequence[Topic], names: Mapping[str, str]
) -> dict[Stream, Route]:
    """Return the route of each stream. Raise `InputError` if there is no route, or if a requested topic is missing."""
    faults = Diagnostics()
    asked = [stream for stream, _ in bag.asked.values()]
    topics = {absolute_name(stream.topic) for stream in (*bag.streams, *asked, *bag.goals)}
    for item in subscribers:
        if item.block in names and item.name not in topics:
            faults.error(f"{bag.path} has no topic {item.name} for '{item.block}'", hint=nearest(item.name, topics))
    faults.raise_if_any()
    # Exclude feedback and results of the hardware's goals, so that no topic with another name replaces them.
    asking = [action for action in asked_actions(loaded.system) if action.goal in bag.blocks_of(action)]
    told = {block for action in asking for block in (action.feedback, action.result)}
    others = [item for item in subscribers if item.block not in told]
    routes = routes_of(bag, others, _signatures(loaded, others))
    if not routes:
        wanted = ", ".join(f"{item.name} ({item.frame.message})" for item in subscribers)
        there = ", ".join(f"{stream.topic} ({stream.type})" for stream in bag.streams) or "nothing"
        fail(f"{bag.path} contains no topic for the system, which takes {wanted}", hint=f"the bag contains {there}")
    return routes


def _signatures(loaded: LoadedSystem, topics: Sequence[Topic]) -> dict[tuple[Middleware, MessageName], str]:
    frames = dict.fromkeys((item.frame.ros, item.frame.message) for item in topics)
    return {(ros, name): signature(name, loaded.libraries[ros].closure(name)) for ros, name in frames}
