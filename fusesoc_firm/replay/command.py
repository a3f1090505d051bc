"""The command `firm replay`: send a bag through a system, with a progress bar, error lines and a summary."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

from tqdm import tqdm

from fusesoc_firm.bags.calls import Exchange, with_calls
from fusesoc_firm.bags.events import EVENTS
from fusesoc_firm.bags.goals import BagOfGoals, Told, with_goals
from fusesoc_firm.bags.routes import Route, renamed, routes_of
from fusesoc_firm.bags.writer import BagWriter, RecordedTopic, check_writable, form_of, write_bag
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.bag_reader import Bag, Form, Recorded, Stream, open_bag
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.signature import signature
from fusesoc_firm.node.transport.simulator import WAITS_SECONDS, Simulator, Waits
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.node.watch import Control, Latency, Watch
from fusesoc_firm.replay.goals import GoalLine, Verdict
from fusesoc_firm.replay.run import Sent, StuckError, SystemRun, published
from fusesoc_firm.replay.sent_goals import SentGoals, ended_goals
from fusesoc_firm.simulation.functions import Functions, importable_sources
from fusesoc_firm.simulation.software_run import stimulated
from fusesoc_firm.system.derived.model import Action, DerivedSystem, ServiceEnd, Topic, absolute_name
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError, fail, nearest

# The maximum number of lines about rejected messages; further messages are only counted.
_SHOWN = 100
# What became of a response of the system to a recorded call, in the summary's words.
_EQUAL, _DIFFERENT = Verdict.EQUAL.value, Verdict.DIFFERENT.value
_MISSING, _NOT_RECORDED = Verdict.MISSING.value, Verdict.NOT_RECORDED.value
# What the hardware sends for goals, in the summary's words.
_OF_GOALS = ("feedback", "results", "goals", "cancellations")


@dataclass(frozen=True)
class Source:
    """The part of a bag to replay: at most `limit` messages.

    The part begins `start` seconds after the bag's beginning, and lasts `duration` seconds.
    """

    path: Path
    limit: int | None = None
    start: float = 0
    duration: float | None = None

    def messages(self, bag: Bag, topics: Collection[str]) -> Iterator[Recorded]:
        """Return the selected messages of some topics."""
        first, stop = self.window(bag)
        return islice((item for item in bag.messages(topics, stop) if item.stamp >= first), self.limit)

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
        bag = _with_exchanges(opened, loaded, subscribers)
        form = _form(target, bag.form)
        _check_speaks(publishers, target.path, form)
        routes = _routes(bag, loaded, subscribers, settings.names)
        ended = _ended(bag, system, source.window(bag)[1])
        warnings = _missing(bag, system, ended)
        for warning in warnings:
            print(warning, file=sys.stderr)
        with (
            importable_sources([type_.accelerator for type_ in system.software.types], loaded.folder),
            _started(start_simulator) as simulator,
            write_bag(target.path, form, list(topics.values())) as written,
        ):
            run = SystemRun(system, simulator, Functions.of(system.software, loaded.folder), settings.quiet)
            going = _Replay(bag, source, routes, run, topics, written, clock, settings, warnings, ended)
            if settings.watch:
                settings.watch.epoch_ns = bag.start
            going.play()
        if settings.is_json:
            print(json.dumps(going.summary(target.path), indent=2, ensure_ascii=False))
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
    # The ids of goals that the bag has results of, by the blocks of the actions to which the hardware sends goals.
    ended: Mapping[str, set[bytes]]
    played: Counter[Stream] = field(default_factory=Counter)
    sent: Counter[str] = field(default_factory=Counter)
    # The system's responses that are not yet compared, by stream and number of the request.
    answers: dict[tuple[Stream, int], Sent] = field(default_factory=dict)
    # The numbers of calls of each stream by how the system responded.
    compared: Counter[tuple[Stream, str]] = field(default_factory=Counter)
    # The hardware's requests without a response yet.
    unanswered: deque[Sent] = field(default_factory=deque)
    # The numbers of the hardware's requests by their blocks and by how they compare with the recorded ones.
    asked: Counter[tuple[str, str]] = field(default_factory=Counter)
    # The stamp of the last message that was played, and whether it was the last one of the selected time.
    last: int = 0
    is_whole: bool = False
    # When waits were requested last, by the monotonic clock.
    counted_at: float = 0.0
    refused: int = 0
    errors: int = 0
    is_over: bool = False
    # The first errors, each in one line.
    shown: list[str] = field(default_factory=list)

    def play(self) -> None:
        """Replay all messages, and report an early end."""
        source = self.source
        expected = sum(count for stream, count in self.bag.streams.items() if stream in self.routes)
        total = expected if source.limit is None else min(expected, source.limit)
        topics = {stream.topic for stream in self.routes}
        with tqdm(total=total, unit="msg", disable=None, file=sys.stderr) as bar:
            self._count_waits()
            try:
                for recorded in source.messages(self.bag, topics):
                    if self.settings.control and not self.settings.control.passes():
                        break
                    self._hear()
                    if not self.is_over:
                        self._play(recorded)
                        bar.update()
                    if self.is_over:
                        break
                else:
                    self.is_whole = self.played.total() != source.limit
                if not self.is_over:
                    self._hear()
            except InputError as error:
                self._report(str(error).removeprefix("error: "))
            for left in (self.run.unfinished, *(line.unfinished for line in self._served.values())):
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
            self._follow_up(recorded.stamp)
        except (StuckError, TransportError) as error:
            self._stop(error)
        self._count_waits()
        if recorded.stream in self._calls:
            self._compare()
            if answer := self._answer(route):
                self.answers[recorded.stream, recorded.number] = answer
            else:
                self.compared[recorded.stream, _MISSING] += 1
        self.refused += bool(faults)
        self._conclude(recorded)

    def _hear(self) -> None:
        """Take note of recorded messages of actions."""
        while self.bag.told and not self.is_over:
            told = self.bag.told.popleft()
            try:
                self._tell(told)
                self._follow_up(told.recorded.stamp)
            except (StuckError, TransportError) as error:
                self._stop(error)
            except (CodecError, ValueError) as error:
                self.run.faults.append(str(error))
            self._conclude(told.recorded)

    def _tell(self, told: Told) -> None:
        block, stamp = told.action.block, told.recorded.stamp
        if line := self._served.get(block):
            line.tell(told.block, told.owner, told.payload, stamp)
        elif stamp >= self.source.window(self.bag)[0]:
            self._sent_goals[block].tell(told)

    def _follow_up(self, stamp: int) -> None:
        """Give the hardware the responses to its calls and what is due for goals, which may lead to further ones."""
        while self._answer_call() or any(line.advance(stamp) for line in self._lines):
            pass

    def _stop(self, error: Exception) -> None:
        self.run.faults.append(f"the rest of the bag was not replayed: {error}")
        self.is_over = True

    def _conclude(self, recorded: Recorded) -> None:
        """Record what the system has sent at a recorded message, and report faults."""
        for sent in self.run.sent:
            self._record(sent)
        self.run.sent.clear()
        for fault in self.run.faults:
            self._report(f"{recorded.stream.topic}, message {recorded.number}, at {seconds(recorded.stamp)}: {fault}")
        self.run.faults.clear()

    def _give(self, subscriber: Topic, recorded: Recorded) -> None:
        """Give a message to a subscriber; goals and cancellations of actions may have to wait."""
        if line := self._to_lines.get(subscriber.block):
            line.give(subscriber.block, recorded.payload, recorded.stamp)
        else:
            self._take(subscriber, recorded.payload, recorded.stamp)

    def _send(self, block: str, payload: bytes, stamp: int) -> bool:
        """Send a message of an action to the hardware; return whether there was no fault."""
        known = len(self.run.faults)
        self._take(self._entering[block], payload, stamp)
        return len(self.run.faults) == known

    def _take(self, subscriber: Topic, payload: bytes, stamp: int) -> None:
        known = len(self.run.sent)
        self.run.take(subscriber, payload, stamp, self._seen(subscriber, payload, stamp))
        for sent in self.run.sent[known:]:
            if sent.topic.block in self._asked:
                self.unanswered.append(sent)
            for line in self._lines:
                try:
                    line.take(sent)
                except (CodecError, ValueError) as error:
                    self.run.faults.append(f"the hardware sent invalid data at '{sent.topic.block}': {error}")

    @cached_property
    def _action_topics(self) -> Mapping[str, Topic]:
        return {item.block: item for item in (*self.run.system.subscribers, *self.run.system.publishers)}

    @cached_property
    def _served(self) -> Mapping[str, GoalLine]:
        """The goals of the actions that the hardware serves, by the actions' blocks."""
        served = (item for item in self.run.system.actions if item.end is ServiceEnd.SERVER)
        return {action.block: GoalLine(action, self._action_topics, self._send) for action in served}

    @cached_property
    def _sent_goals(self) -> Mapping[str, SentGoals]:
        """The goals that the hardware sends to other nodes, by the actions' blocks."""
        return {
            action.block: SentGoals(action, self._action_topics, self._send, self.ended[action.block])
            for action in _asked_actions(self.run.system)
        }

    @cached_property
    def _lines(self) -> Sequence[GoalLine | SentGoals]:
        return [*self._served.values(), *self._sent_goals.values()]

    @cached_property
    def _to_lines(self) -> Mapping[str, GoalLine]:
        """The goals of actions that the hardware serves, by the blocks of goals and of cancellations."""
        return {block: line for line in self._served.values() for block in (line.action.goal, line.action.cancel)}

    @cached_property
    def _calls(self) -> set[Stream]:
        """The streams of requests."""
        return {calls.stream for calls in self.bag.calls.values()}

    def _answer_call(self) -> bool:
        """Give the hardware the recorded response to its first call without one; return whether there was a call."""
        if not self.unanswered:
            return False
        sent = self.unanswered.popleft()
        block = sent.topic.block
        exchange = next(self._asked[block], None)
        if exchange is None:
            self.asked[block, _NOT_RECORDED] += 1
            return True
        self.asked[block, _verdict(sent, exchange.request)] += 1
        if exchange.response is not None:
            self._take(self._takers[block], exchange.response, sent.cause.stamp)
        return True

    @cached_property
    def _asked(self) -> Mapping[str, Iterator[Exchange]]:
        """The recorded calls of services that the hardware calls, in their order, by the blocks of requests."""
        window = self.source.window(self.bag)
        return {block: self.bag.exchanges(block, *window) for block in self.bag.asked}

    @cached_property
    def _takers(self) -> Mapping[str, Topic]:
        """The topics of responses to the hardware, by the blocks of requests."""
        services = [item for item in self.run.system.services if item.end is ServiceEnd.CLIENT]
        return {item.request: self._entering[item.response] for item in services}

    @cached_property
    def _entering(self) -> Mapping[str, Topic]:
        """The topics to the hardware by block."""
        return {item.block: item for item in self.run.system.subscribers}

    def _answer(self, route: Route) -> Sent | None:
        """Return the response to the call that was sent last."""
        requests = {item.block for item in route.subscribers}
        responses = {service.response for service in self.run.system.services if service.request in requests}
        return next((sent for sent in self.run.sent if sent.topic.block in responses), None)

    def _compare(self) -> None:
        """Compare the system's responses with those that were read since."""
        for key, recorded in self.bag.responses.items():
            if sent := self.answers.pop(key, None):
                self.compared[key[0], _verdict(sent, recorded)] += 1
        self.bag.responses.clear()

    def _compared(self, stream: Stream) -> dict[str, Any]:
        """Return how many of the system's responses are as recorded, different, missing, and not recorded."""
        self._compare()
        counts = {kind: self.compared[stream, kind] for kind in (_EQUAL, _DIFFERENT, _MISSING)}
        rest = {_NOT_RECORDED: sum(key[0] == stream for key in self.answers)}
        return {"topic": stream.topic, "type": stream.type} | counts | rest

    def _requests(self, block: str) -> dict[str, Any]:
        """Return how many of the hardware's requests are as recorded, different, missing, and not recorded.

        A recorded request after the last message that was played is not missing, except after a whole replay.
        """
        counts = {kind: self.asked[block, kind] for kind in (_EQUAL, _DIFFERENT)}
        missing = sum(self.is_whole or item.stamp <= self.last for item in self._asked[block])
        counts |= {_MISSING: missing, _NOT_RECORDED: self.asked[block, _NOT_RECORDED]}
        _, calls = self.bag.asked[block]
        return {"topic": self.topics[block].name, "type": calls.events.type.request_name} | counts

    def _of_goals(self) -> dict[str, list[dict[str, Any]]]:
        """Return how much of what the hardware sends for goals is as recorded, for each action in the bag.

        This is feedback and results of actions that it serves, goals and cancellations of others.
        """
        rows: dict[str, list[dict[str, Any]]] = {kind: [] for kind in _OF_GOALS}
        used = {item.block for route in self.routes.values() for item in route.subscribers}
        for line in self._lines:
            action = line.action
            if action.goal in used | self.bag.blocks_of(action):
                names = {"topic": absolute_name(action.ros_name), "type": str(action.type)}
                for title, counts in line.counts():
                    rows[title].append(names | {verdict.value: count for verdict, count in counts.items()})
        return rows

    def _seen(self, subscriber: Topic, payload: bytes, stamp: int) -> int | None:
        watch = self.settings.watch
        return watch.saw(subscriber.block, payload, stamp - self.bag.start) if watch else None

    def _count_waits(self) -> None:
        """Record where messages have waited since the last count, if somebody watches."""
        watch, simulator, now = self.settings.watch, self.run.simulator, time.monotonic()
        if not watch or now < self.counted_at + WAITS_SECONDS:
            return
        self.counted_at = now
        # The end of a simulator is reported where a message needs it.
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
            watch.saw(sent.topic.block, sent.payload, since, Latency(sent.cause.seen, sent.cycles))

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
            "responses": [self._compared(stream) for stream in self.routes if stream in self._calls],
            "requests": [self._requests(block) for block in self.bag.asked],
            **self._of_goals(),
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
        verdicts += [(f"{kind} of {row['topic']}", row) for kind in _OF_GOALS for row in found[kind]]
        for title, row in verdicts:
            kinds = (verdict.value for verdict in Verdict if verdict.value in row)
            counts = (f"{row[kind]} {kind.replace('_', ' ')}" for kind in kinds)
            print(f"{title}: {', '.join(counts)}")
        print(
            f"{path}: {self.played.total()} in, {self.sent.total()} out,"
            f" {sum(row['count'] for row in found['dropped'])} dropped, {self.errors} errors, {found['cycles']} cycles"
        )


def _verdict(sent: Sent, recorded: bytes) -> str:
    """Return whether a message of the system is as recorded; only fields that the hardware sends count."""
    return _EQUAL if _value(sent.topic, sent.payload) == _value(sent.topic, recorded) else _DIFFERENT


def _value(topic: Topic, payload: bytes) -> bytes:
    """Return the payload of a response with defaults in padding and unused fields, or unchanged if it is not valid."""
    try:
        return encode_used(topic.frame, decode(topic.frame, payload))
    except CodecError:
        return payload


def _with_exchanges(bag: Bag, loaded: LoadedSystem, subscribers: Sequence[Topic]) -> BagOfGoals:
    """Return a bag with the calls of the system's services and the goals of its actions. May raise `InputError`."""
    names = {item.block: item.name for item in subscribers}
    system, libraries = loaded.system, loaded.libraries
    calls = with_calls(bag, system.services, libraries, names, plays_responses=False)
    return with_goals(calls, system.actions, libraries, names, compares=True)


def _asked_actions(system: DerivedSystem) -> list[Action]:
    """Return the actions of other nodes, to which the hardware sends goals."""
    return [action for action in system.actions if action.end is ServiceEnd.CLIENT]


def _ended(bag: BagOfGoals, system: DerivedSystem, stop: int | None) -> dict[str, set[bytes]]:
    """Return the ids of goals with results, by the blocks of the actions to which the hardware sends goals."""
    topics = {item.block: item for item in system.subscribers}
    return {
        action.block: ended_goals(bag.results(action, stop), action, topics[action.result])
        for action in _asked_actions(system)
    }


def _missing(bag: BagOfGoals, system: DerivedSystem, ended: Mapping[str, set[bytes]]) -> tuple[Diagnostic, ...]:
    """Return a warning for each action of another node of which the bag lacks the goals or all results."""
    faults = Diagnostics()
    for action in _asked_actions(system):
        block, name, is_first = action.block, absolute_name(action.ros_name), action.ros is ROS1
        if action.goal not in bag.blocks_of(action):
            effect = "and feedback and results come at their recorded times" if is_first else "and get no results"
            text = f"{bag.path} has no goals of '{block}', so those of the hardware are not compared, {effect}"
            record = f"{name}/goal" if is_first else f"the contents of {name}/_action/send_goal/{EVENTS}"
        elif not ended[block]:
            text = f"{bag.path} has no results of '{block}', so the goals of the hardware are lost"
            record = f"{name}/result" if is_first else f"the contents of {name}/_action/get_result/{EVENTS}"
        else:
            continue
        faults.warn(text, hint=f"record {record}")
    return faults.warnings


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
    # Messages for goals of the hardware have no other subscribers.
    told = {block for action in _asked_actions(loaded.system) for block in bag.blocks_of(action)}
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
