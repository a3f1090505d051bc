"""The calls and goals of a bag in a replay: stimuli for the hardware, and comparison of its responses."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.message import ROS1
from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.runs.bags.calls import with_calls
from fusesoc_firm.runs.bags.events import EVENTS
from fusesoc_firm.runs.bags.goals import BagOfGoals, Told, with_goals
from fusesoc_firm.runs.bags.routes import Route
from fusesoc_firm.runs.bags.writer import RecordedTopic
from fusesoc_firm.runs.replay.goals import GoalLine, Verdict
from fusesoc_firm.runs.replay.hardware_run import Sent
from fusesoc_firm.runs.replay.sent_goals import SentGoals, ended_goals
from fusesoc_firm.system.derived.model import Action, DerivedSystem, ServiceEnd, Topic, absolute_name
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics

# The verdicts on the system's response to a recorded call, in the summary's words.
_EQUAL, _DIFFERENT = Verdict.EQUAL.value, Verdict.DIFFERENT.value
_MISSING, _NOT_RECORDED = Verdict.MISSING.value, Verdict.NOT_RECORDED.value
# The hardware's messages for goals, in the summary's words.
OF_GOALS = ("feedback", "results", "goals", "cancellations")
# Sends a payload to a topic of the hardware at a stamp in ns, and returns whether the hardware accepted it without a
# fault. Before it returns, it passes the messages that the hardware has sent meanwhile to
# `Exchanges.take`.
Give = Callable[[Topic, bytes, int], bool]


class Exchanges:
    """The calls and goals of a bag, at both ends: those that the hardware serves, and those that it requests."""

    def __init__(
        self,
        bag: BagOfGoals,
        system: DerivedSystem,
        window: tuple[int, int | None],
        ended: Mapping[str, set[bytes]],
        give: Give,
    ) -> None:
        """Prepare the part of a bag between two stamps in ns; `ended` is the result of `ended_in`."""
        self._bag = bag
        self._system = system
        self._first = window[0]
        self._give = give
        # The topics to the hardware by block.
        self._entering = {item.block: item for item in system.subscribers}
        # The streams of requests to services of the hardware.
        self._calls = {calls.stream for calls in bag.calls.values()}
        # The system's responses before their comparison, by stream and number of the request.
        self._answers: dict[tuple[Stream, int], Sent] = {}
        # The numbers of calls of each stream by how the system responded.
        self._compared: Counter[tuple[Stream, str]] = Counter()
        # The recorded calls of services that the hardware calls, in their order, by the blocks of requests.
        self._asked = {block: bag.exchanges(block, *window) for block in bag.asked}
        # The hardware's requests without a response yet.
        self._unanswered: deque[Sent] = deque()
        # The numbers of the hardware's requests by their blocks and by how they compare with the recorded ones.
        self._requested: Counter[tuple[str, str]] = Counter()
        # The topics of responses to the hardware, by the blocks of requests.
        clients = [item for item in system.services if item.end is ServiceEnd.CLIENT]
        self._takers = {item.request: self._entering[item.response] for item in clients}
        # The goals of the actions that the hardware serves, and those that it sends to others, by the actions' blocks.
        topics = self._entering | {item.block: item for item in system.publishers}
        served = [item for item in system.actions if item.end is ServiceEnd.SERVER]
        self._served = {action.block: GoalLine(action, topics, self._send) for action in served}
        self._sent = {
            action.block: SentGoals(action, topics, self._send, ended[action.block]) for action in asked_actions(system)
        }
        self._lines: list[GoalLine | SentGoals] = [*self._served.values(), *self._sent.values()]

    # --- from the bag ----------------------------------------------------------------------------------------------

    def give(self, block: str, payload: bytes, stamp: int) -> bool:
        """Take a goal or a cancellation for an action that the hardware serves; return whether it is one."""
        for line in self._served.values():
            if block in (line.action.goal, line.action.cancel):
                line.give(block, payload, stamp)
                return True
        return False

    def tell(self, told: Told) -> None:
        """Process a recorded message of an action. Raise `ValueError` or `CodecError` if it is invalid."""
        block, stamp = told.action.block, told.recorded.stamp
        if line := self._served.get(block):
            line.tell(told.block, told.owner, told.payload, stamp)
        elif stamp >= self._first:
            self._sent[block].tell(told)

    # --- from and to the hardware ------------------------------------------------------------------------------------

    def take(self, sent: Sent) -> None:
        """Take a message that the hardware has sent. Raise `ValueError` or `CodecError` if it is invalid."""
        if sent.topic.block in self._asked:
            self._unanswered.append(sent)
        for line in self._lines:
            line.take(sent)

    def follow_up(self, stamp: int) -> None:
        """Send the hardware the responses to its calls and the messages due for goals, which may cause further ones."""
        while self._answer_call() or any(line.advance(stamp) for line in self._lines):
            pass

    def _send(self, block: str, payload: bytes, stamp: int) -> bool:
        return self._give(self._entering[block], payload, stamp)

    def _answer_call(self) -> bool:
        """Send the hardware the recorded response to its first unanswered call; return whether there was a call."""
        if not self._unanswered:
            return False
        sent = self._unanswered.popleft()
        block = sent.topic.block
        exchange = next(self._asked[block], None)
        if exchange is None:
            self._requested[block, _NOT_RECORDED] += 1
            return True
        self._requested[block, _verdict(sent, exchange.request)] += 1
        if exchange.response is not None:
            self._give(self._takers[block], exchange.response, sent.cause.stamp)
        return True

    # --- the comparison --------------------------------------------------------------------------------------------

    def note_call(self, recorded: Recorded, route: Route, sent: Iterable[Sent]) -> None:
        """Record the hardware's response since a recorded message, if that is a request."""
        if recorded.stream not in self._calls:
            return
        self._compare()
        requests = {item.block for item in route.subscribers}
        responses = {service.response for service in self._system.services if service.request in requests}
        answer = next((item for item in sent if item.topic.block in responses), None)
        if answer:
            self._answers[recorded.stream, recorded.number] = answer
        else:
            self._compared[recorded.stream, _MISSING] += 1

    def _compare(self) -> None:
        """Compare the system's responses with the recorded ones read since then."""
        for key, recorded in self._bag.responses.items():
            if sent := self._answers.pop(key, None):
                self._compared[key[0], _verdict(sent, recorded)] += 1
        self._bag.responses.clear()

    def responses(self, streams: Iterable[Stream]) -> list[dict[str, Any]]:
        """Return how many responses are as recorded, different, missing, and not recorded, for streams of requests."""
        self._compare()
        return [self._responses(stream) for stream in streams if stream in self._calls]

    def _responses(self, stream: Stream) -> dict[str, Any]:
        counts = {kind: self._compared[stream, kind] for kind in (_EQUAL, _DIFFERENT, _MISSING)}
        rest = {_NOT_RECORDED: sum(key[0] == stream for key in self._answers)}
        return {"topic": stream.topic, "type": stream.type} | counts | rest

    def requests(self, topics: Mapping[str, RecordedTopic], last: int | None) -> list[dict[str, Any]]:
        """Return how many of the hardware's requests are as recorded, different, missing, and not recorded.

        `topics` are those of the requests by block. A recorded request after `last`, the stamp in ns of the last played
        message, does not count as missing; after a whole replay, `last` is None.
        """
        return [self._requests(block, topics[block].name, last) for block in self._asked]

    def _requests(self, block: str, topic: str, last: int | None) -> dict[str, Any]:
        counts = {kind: self._requested[block, kind] for kind in (_EQUAL, _DIFFERENT)}
        missing = sum(last is None or item.stamp <= last for item in self._asked[block])
        counts |= {_MISSING: missing, _NOT_RECORDED: self._requested[block, _NOT_RECORDED]}
        _, calls = self._bag.asked[block]
        return {"topic": topic, "type": calls.events.type.request_name} | counts

    def of_goals(self, used: Collection[str]) -> dict[str, list[dict[str, Any]]]:
        """Return how many of the hardware's messages for goals are as recorded, for each action in the bag.

        These are feedback and results of actions that it serves, and goals and cancellations of others. `used` are the
        blocks with messages.
        """
        rows: dict[str, list[dict[str, Any]]] = {kind: [] for kind in OF_GOALS}
        for line in self._lines:
            action = line.action
            if action.goal in {*used, *self._bag.blocks_of(action)}:
                names = {"topic": absolute_name(action.ros_name), "type": str(action.type)}
                for title, counts in line.counts():
                    rows[title].append(names | {verdict.value: count for verdict, count in counts.items()})
        return rows

    def unfinished(self) -> Iterator[str]:
        """Yield the faults of goals without a result from the hardware for which further goals wait."""
        return (line.unfinished for line in self._served.values())


def _verdict(sent: Sent, recorded: bytes) -> str:
    """Return whether a message of the system is as recorded; only fields that the hardware sends count."""
    return _EQUAL if _value(sent.topic, sent.payload) == _value(sent.topic, recorded) else _DIFFERENT


def _value(topic: Topic, payload: bytes) -> bytes:
    """Return the payload of a response with defaults in padding and unused fields, or unchanged if it is not valid."""
    try:
        return encode_used(topic.frame, decode(topic.frame, payload))
    except CodecError:
        return payload


def with_exchanges(bag: Bag, loaded: LoadedSystem, subscribers: Sequence[Topic]) -> BagOfGoals:
    """Return a bag with the calls of the system's services and the goals of its actions. May raise `InputError`."""
    names = {item.block: item.name for item in subscribers}
    system, libraries = loaded.system, loaded.libraries
    calls = with_calls(bag, system.services, libraries, names, plays_responses=False)
    return with_goals(calls, system.actions, libraries, names, compares=True)


def asked_actions(system: DerivedSystem) -> list[Action]:
    """Return the actions of other nodes, to which the hardware sends goals."""
    return [action for action in system.actions if action.end is ServiceEnd.CLIENT]


def ended_in(bag: BagOfGoals, system: DerivedSystem, stop: int | None) -> dict[str, set[bytes]]:
    """Return the ids of goals with results, by the blocks of the actions to which the hardware sends goals."""
    topics = {item.block: item for item in system.subscribers}
    return {
        action.block: ended_goals(bag.results(action, stop), action, topics[action.result])
        for action in asked_actions(system)
    }


def missing_in(bag: BagOfGoals, system: DerivedSystem, ended: Mapping[str, set[bytes]]) -> tuple[Diagnostic, ...]:
    """Return a warning for each action of another node of which the bag lacks the goals or all results."""
    faults = Diagnostics()
    for action in asked_actions(system):
        block, name, is_first = action.block, absolute_name(action.ros_name), action.ros is ROS1
        if action.goal not in bag.blocks_of(action):
            effect = "and feedback and results come at their recorded times" if is_first else "and get no results"
            text = f"{bag.path} has no goals of '{block}', so those of the hardware are not compared, {effect}"
            record = f"{name}/goal" if is_first else f"the contents of {name}/_action/send_goal/{EVENTS}"
        elif not ended[block]:
            text = f"{bag.path} has no results of '{block}', so the goals of the hardware are lost or do not end"
            record = f"{name}/result" if is_first else f"the contents of {name}/_action/get_result/{EVENTS}"
        else:
            continue
        faults.warn(text, hint=f"record {record}")
    return faults.warnings
