"""Play a bag: send each message to the system, record the responses, and report faults."""

from __future__ import annotations

import sys
from collections import Counter
from typing import Any

from tqdm import tqdm

from fusesoc_firm.frame.codec import CodecError
from fusesoc_firm.message.bag_reader import Recorded, Stream
from fusesoc_firm.node.engine.watch import Control
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.runs.bags.goals import Told
from fusesoc_firm.runs.replay.errors import Errors
from fusesoc_firm.runs.replay.exchanges import Exchanges
from fusesoc_firm.runs.replay.hardware_run import StuckError, SystemRun
from fusesoc_firm.runs.replay.plan import Plan
from fusesoc_firm.runs.replay.recorder import Recorder
from fusesoc_firm.system.derived.model import Topic
from fusesoc_firm.text.diagnostics import InputError


class Player:
    """A replay in progress.

    `played` are the numbers of messages by stream, and `refused` is the number of those with errors.
    """

    def __init__(self, plan: Plan, run: SystemRun, recorder: Recorder, errors: Errors) -> None:
        """Prepare a replay in a run of the system."""
        self.plan = plan
        self.played: Counter[Stream] = Counter()
        self.refused = 0
        # The stamp of the last message, or None after the last one of the selected time.
        self.last: int | None = 0
        self._is_begun = False
        self.exchanges = Exchanges(plan.bag, run.system, plan.window, plan.ended, self._take)
        self._run = run
        self._recorder = recorder
        self._errors = errors

    def play(self, control: Control | None) -> None:
        """Play all messages until `control` ends the replay, and report what is missing at the end."""
        for topic in self.plan.silent:
            self._errors.add(f"{topic} has no messages")
        is_running = self._play_all(control)
        if not (self._is_begun or self.plan.silent):
            self._errors.add("the selected part has no messages for the system")
        for left in (self._run.unfinished, *self.exchanges.unfinished()):
            if left:
                self._errors.add(left)
        if is_running:
            self._quit()

    def summary(self) -> dict[str, Any]:
        """Return the numbers of messages by topic, and how calls and goals compare with the recorded ones."""
        blocks = {item.block for route in self.plan.routes.values() for item in route.subscribers}
        return {
            "in": [
                _count(stream.topic, stream.type, self.played[stream])
                | {"blocks": [item.block for item in route.subscribers]}
                for stream, route in self.plan.routes.items()
            ],
            "out": [
                _count(topic.name, topic.type, self._recorder.counts[block]) | {"block": block}
                for block, topic in self.plan.topics.items()
            ],
            "dropped": [
                _count(stream.topic, stream.type, count)
                for stream, count in self.plan.bag.streams.items()
                if stream not in self.plan.routes
            ],
            "foreign": [
                _count(item.topic, item.type, item.count) | {"reason": item.reason} for item in self.plan.bag.foreign
            ],
            "responses": self.exchanges.responses(self.plan.routes),
            "requests": self.exchanges.requests(self.plan.topics, self.last),
            **self.exchanges.of_goals(blocks),
        }

    def _play_all(self, control: Control | None) -> bool:
        """Play the messages, and return whether the simulator still runs."""
        audience = self._recorder.audience
        with tqdm(total=self.plan.count, unit="msg", disable=None, file=sys.stderr) as bar:
            audience.count_waits()
            try:
                for item in self.plan.items():
                    self._is_begun = True
                    if control and not control.passes():
                        return True
                    self._step(item)
                    if isinstance(item, Recorded):
                        audience.count_waits()
                        bar.update()
            except (StuckError, TransportError):
                return False
            except InputError as error:
                self._errors.add(str(error).removeprefix("error: "))
                return True
        if self.played.total() != self.plan.source.limit:
            self.last = None
        return True

    def _step(self, item: Recorded | Told) -> None:
        """Process a message of the bag. Raise `StuckError` or `TransportError` if no further message can follow."""
        recorded = item if isinstance(item, Recorded) else item.recorded
        try:
            if isinstance(item, Recorded):
                self._play(item)
            else:
                self.exchanges.tell(item)
            self.exchanges.follow_up(recorded.stamp)
        except (StuckError, TransportError) as error:
            self._run.faults.append(f"the rest of the bag was not replayed: {error}")
            raise
        except (CodecError, ValueError) as error:
            self._run.faults.append(str(error))
        finally:
            if isinstance(item, Recorded):
                self.exchanges.note_call(item, self.plan.routes[item.stream], self._run.sent)
                self.refused += bool(self._run.faults)
            self._conclude(recorded)

    def _play(self, recorded: Recorded) -> None:
        """Give a message to its subscribers."""
        self.played[recorded.stream] += 1
        self.last = recorded.stamp
        route = self.plan.routes[recorded.stream]
        if route.misfit:
            self._run.faults.append(route.misfit)
            return
        for subscriber in route.subscribers:
            # Goals and cancellations of actions may have to wait.
            if not self.exchanges.give(subscriber.block, recorded.payload, recorded.stamp):
                self._take(subscriber, recorded.payload, recorded.stamp)

    def _take(self, subscriber: Topic, payload: bytes, stamp: int) -> bool:
        """Send a message to the system; return whether there was no fault."""
        run = self._run
        sent, faults = len(run.sent), len(run.faults)
        run.take(subscriber, payload, stamp, self._recorder.audience.received(subscriber.block, payload, stamp))
        is_right = len(run.faults) == faults
        for message in run.sent[sent:]:
            try:
                self.exchanges.take(message)
            except (CodecError, ValueError) as error:
                run.faults.append(f"the hardware sent invalid data at '{message.topic.block}': {error}")
        return is_right

    def _conclude(self, recorded: Recorded) -> None:
        """Record the system's messages since a recorded message, and report faults."""
        for sent in self._run.sent:
            self._recorder.record(sent)
        self._run.sent.clear()
        for fault in self._run.faults:
            self._errors.add(
                f"{recorded.stream.topic}, message {recorded.number}, at {seconds(recorded.stamp)}: {fault}"
            )
        self._run.faults.clear()

    def _quit(self) -> None:
        """End the simulation, and report its errors."""
        try:
            self._run.simulator.quit()
        except TransportError as error:
            self._errors.add(str(error))


def _count(topic: str, type_: str, count: int) -> dict[str, Any]:
    return {"topic": topic, "type": type_, "count": count}


def seconds(stamp: int) -> str:
    """Return the text of a time in seconds with all digits; `stamp` is in ns."""
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"
