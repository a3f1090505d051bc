"""The goals of actions in bags: topics of actionlib in ROS 1; in ROS 2 the events of three services, and feedback.

The calls of ROS 2 become messages of the action's converters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.bag_reader import Bag, Recorded, Stream
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MessageDefinition, Middleware
from fusesoc_firm.message.model import InterfaceKind, MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.services import EVENT_INFO, Interface
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.bags.calls import BagOfCalls
from fusesoc_firm.runs.bags.events import EVENTS, Events, EventType, Key, events_in
from fusesoc_firm.system.derived.actions import action_messages
from fusesoc_firm.system.derived.model import Action, ServiceEnd, absolute_name
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, fail

_SEND_GOAL, _CANCEL_GOAL, _GET_RESULT = "send_goal", "cancel_goal", "get_result"
# rosbags does not have this service.
_CANCELING = MessageName("action_msgs", "CancelGoal")
_CANCELING_TEXT = "GoalInfo goal_info\n---\nint8 return_code\nGoalInfo[] goals_canceling\n"


class Told(NamedTuple):
    """Feedback or a result of a goal, at a recorded message; of an action of another node, also a goal or cancellation.

    `block` is that of the converter. `owner` is a message that begins with the goal's id, or in ROS 1 with a header
    before that; of a cancellation, it is the message itself. A goal without `payload` was rejected, which has no result
    in ROS 2.
    """

    action: Action
    block: str
    recorded: Recorded
    owner: bytes
    payload: bytes | None


@dataclass(frozen=True)
class _Source:
    """The messages of an action in a stream: its converter, and in ROS 2 the events that contain them, if any.

    `stream` replaces a stream with goals or cancellations for the hardware.
    """

    action: Action
    block: str
    stream: Stream | None = None
    events: Events | None = None


@dataclass(frozen=True)
class BagOfGoals(BagOfCalls):
    """A bag with the goals of actions: `goals` are the streams that contain them.

    For actions that the hardware serves, goals and cancellations are messages to the hardware.
    """

    goals: Mapping[Stream, _Source] = field(default_factory=dict)

    def messages(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded]:
        """Yield messages like `BagOfCalls`. Raise `InputError` if the bag is damaged."""
        return (item for item in self.items(topics, stop) if isinstance(item, Recorded))

    def items(self, topics: Collection[str], stop: int | None = None) -> Iterator[Recorded | Told]:
        """Yield the same messages, and in between the bag's records of goals.

        These are the feedback and results of actions that the hardware serves, and all four kinds of messages of
        actions to which it sends goals.
        """
        return self._items(topics, self.goals, stop)

    def results(self, action: Action, stop: int | None = None) -> Iterator[Told]:
        """Yield the results of an action up to a stamp in ns."""
        blocks = (action.goal, action.result)
        sources = {stream: source for stream, source in self.goals.items() if source.block in blocks}
        for item in self._items((), sources, stop):
            if isinstance(item, Told) and item.block == action.result:
                yield item

    def blocks_of(self, action: Action) -> set[str]:
        """Return the blocks of an action whose messages the bag contains."""
        return {source.block for source in self.goals.values() if source.action is action}

    def _items(
        self, topics: Collection[str], sources: Mapping[Stream, _Source], stop: int | None
    ) -> Iterator[Recorded | Told]:
        own = {
            stream.topic for stream, source in sources.items() if source.stream is None or source.stream.topic in topics
        }
        owners: dict[tuple[Stream, Key], bytes] = {}
        numbers: dict[Stream, int] = {}
        for recorded in super().messages({*topics, *own}, stop):
            source = sources.get(recorded.stream)
            if source is None:
                yield recorded
            elif source.events is None:
                yield Told(source.action, source.block, recorded, recorded.payload, recorded.payload)
            elif told := _told_in(source, source.events, recorded, owners):
                if source.stream is None or told.block != source.block:
                    yield told
                    continue
                number = numbers[source.stream] = numbers.get(source.stream, -1) + 1
                yield Recorded(source.stream, number, recorded.stamp, told.owner)


def _told_in(
    source: _Source, events: Events, recorded: Recorded, owners: dict[tuple[Stream, Key], bytes]
) -> Told | None:
    """Return the record of a goal in an event, or None; `owners` are the requests without a response yet."""
    part = events.part_of(recorded)
    if part is None:
        return None
    (key, request, response), action = part, source.action
    if request is not None:
        owners[recorded.stream, key] = request
        return None if source.block == action.result else Told(action, source.block, recorded, request, request)
    owner = owners.pop((recorded.stream, key), None)
    if owner is None or response is None:
        return None
    if source.block == action.result:
        return Told(action, action.result, recorded, owner, response)
    if source.block == action.goal and not _is_accepted(response):
        return Told(action, action.result, recorded, owner, None)
    return None


def with_goals(
    bag: BagOfCalls,
    actions: Iterable[Action],
    libraries: Mapping[Middleware, MessageLibrary],
    names: Mapping[str, str],
    *,
    compares: bool,
) -> BagOfGoals:
    """Return the bag with the goals of the actions; `names` are the topics of the messages to the hardware, by block.

    If the topic of the goals or, of an action of another node, of the feedback is renamed to that of another action, or
    if the only goals of the type are those of another action, all are read from that action. Without goals, feedback
    and results are unchanged; without `compares`, so are all messages except goals and cancellations for the hardware.
    Raise `InputError` if a definition differs from the system's, or if two actions have the same topic.
    """
    goals: dict[Stream, _Source] = {}
    ends = {ServiceEnd.SERVER, ServiceEnd.CLIENT} if compares else {ServiceEnd.SERVER}
    known = [item for item in actions if item.ros is bag.form.ros and item.end in ends]
    for action in known:
        is_only = [item.type for item in known].count(action.type) == 1
        found = _ActionInBag(bag, action, libraries[action.ros], names, is_only).sources()
        for stream, own in found.items():
            if not compares and own.stream is None:
                continue
            if (owner := goals.setdefault(stream, own)) is not own:
                message = f"topic {stream.topic} in {bag.path} belongs to two actions"
                fail(f"{message}, '{owner.action.block}' and '{action.block}'", hint="a bag cannot tell them apart")
    streams: dict[Stream, int] = {}
    for stream, count in bag.streams.items():
        source = goals.get(stream)
        if source is None:
            streams[stream] = count
        elif source.events is not None:
            if source.stream:
                streams[source.stream] = source.events.count
            if source.events.invalid:
                streams[stream] = source.events.invalid
    return BagOfGoals(**{**vars(bag), "streams": streams}, goals=goals)


@dataclass(frozen=True)
class _ActionInBag:
    """The search for the streams of an action in a bag."""

    bag: Bag
    action: Action
    library: MessageLibrary
    names: Mapping[str, str]
    is_only: bool

    def sources(self) -> dict[Stream, _Source]:
        """Return the streams that the replay converts to messages or compares; none without goals."""
        if self.action.ros is ROS1:
            goals = absolute_name(f"{self._base}/goal")
            has_goals = any(absolute_name(stream.topic) == goals for stream in self.bag.streams)
            ends = ("feedback", "result") if self._is_served else ("goal", "cancel", "feedback", "result")
            found = [self._told(end, end) for end in ends] if has_goals else []
        else:
            found = self._events()
        return {stream: source for streams in found for stream, source in streams.items()}

    def _events(self) -> list[dict[Stream, _Source]]:
        action = self.action
        interface = self.library.interface(action.type, InterfaceKind.ACTION)
        assert interface is not None, "the system could be derived"
        if len(interface.messages) == len(interface.exchanged):
            return []
        definitions = self.library.joint_closure(interface.messages)
        send, get = (
            EventType.of(MessageName(action.type.package, f"{action.type.name}_{end}"), interface.kind, definitions)
            for end in ("SendGoal", "GetResult")
        )
        entering = (send.request_name, "action_msgs/msg/GoalInfo") if self._is_served else ("", "")
        goals = self._of(_SEND_GOAL, send, action.goal, entering[0])
        if not goals:
            return []
        cancel = EventType.of(_CANCELING, InterfaceKind.SERVICE, _canceling(self.library))
        return [
            goals,
            self._of(_CANCEL_GOAL, cancel, action.cancel, entering[1]),
            self._of(_GET_RESULT, get, action.result),
            self._told("_action/feedback", "feedback"),
        ]

    def _of(self, service: str, type_: EventType, block: str, entering: str = "") -> dict[Stream, _Source]:
        """Return the stream of a service's events, if it contains requests.

        `entering` is the type of the messages to the hardware in them, if any.
        """
        topic = absolute_name(f"{self._base}/_action/{service}/{EVENTS}")
        for stream in self.bag.streams:
            if absolute_name(stream.topic) == topic and stream.type == type_.name:
                type_.check(self.bag, stream)
                if events := events_in(self.bag, stream, type_):
                    given = Stream(self.names[block], entering, "", "") if entering else None
                    return {stream: _Source(self.action, block, given, events)}
        return {}

    def _told(self, ending: str, end: str) -> dict[Stream, _Source]:
        """Return the streams of one of the messages on a topic of the action."""
        action = self.action
        topic = absolute_name(f"{self._base}/{ending}")
        name = action_messages(action.type, action.ros)[end]
        blocks = {"goal": action.goal, "cancel": action.cancel, "feedback": action.feedback, "result": action.result}
        ours = signature(name, self.library.closure(name))
        found = {}
        for stream in self.bag.streams:
            if absolute_name(stream.topic) != topic or _name_of(stream) != name:
                continue
            if stream.signature not in ("", "*", ours):
                text = f"its definition of {name} differs from the system's"
                fail(f"topic {stream.topic} in {self.bag.path}: {text}: {stream.signature}, not {ours}")
            found[stream] = _Source(action, blocks[end])
        return found

    @property
    def _is_served(self) -> bool:
        return self.action.end is ServiceEnd.SERVER

    @cached_property
    def _base(self) -> str:
        """The name of the action in the bag."""
        is_first = self.action.ros is ROS1
        ending = "/goal" if is_first else f"/_action/{_SEND_GOAL}/{EVENTS}"
        entering = ending if self._is_served else "/feedback" if is_first else "/_action/feedback"
        block = self.action.goal if self._is_served else self.action.feedback
        given, own = self.names[block], absolute_name(self.action.ros_name)
        if given.endswith(entering) and given != f"{own}{entering}":
            return given.removesuffix(entering)
        goal = action_messages(self.action.type, self.action.ros)["goal"]
        name = goal if is_first else MessageName(goal.package, f"{self.action.type.name}_SendGoal_Event")
        topics = {absolute_name(stream.topic) for stream in self.bag.streams if _name_of(stream) == name}
        found = {topic.removesuffix(ending) for topic in topics if topic.endswith(ending)}
        return found.pop() if self.is_only and own not in found and len(found) == 1 else own


def _canceling(library: MessageLibrary) -> dict[MessageName, MessageDefinition]:
    """Return the definitions of the service that cancels goals, and of its nested messages."""
    interface = Interface(_CANCELING, InterfaceKind.SERVICE, ROS2, has_events=True)
    contained = library.joint_closure((parse_name("action_msgs/GoalInfo"), EVENT_INFO))
    return contained | interface.parse(_CANCELING_TEXT, "", Diagnostics())


def _name_of(stream: Stream) -> MessageName | None:
    try:
        return parse_name(stream.type)
    except InputError:
        return None


def _is_accepted(response: bytes) -> bool:
    """Return whether a response accepts a goal: the first byte after the CDR header."""
    return bool(response[4])
