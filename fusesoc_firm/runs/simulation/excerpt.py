"""Take the beginning of a recorded topic as the stimuli of a new project.

The excerpt is a bag in the format of the recording. It contains the definitions of all messages of the project, so that
the project does not depend on the recording.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.frame.codec import CodecError, decode, trimmed
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message.bag_reader import Bag, Foreign, Form, Recorded, definitions_in, open_bag
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Definitions, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.bags.routes import routes_of
from fusesoc_firm.runs.bags.writer import RecordedTopic, write_bag
from fusesoc_firm.system.derived.model import Topic, absolute_name
from fusesoc_firm.system.scaffold.project import Project, RecordedStimuli
from fusesoc_firm.text.diagnostics import InputError, fail

# Without a limit on the number of messages, an excerpt is short enough for a simulation of seconds to minutes.
_MESSAGES, _BYTES = 10, 100_000
# The topic of an output that the recording lacks.
_UNRECORDED = "/pub"
_SUFFIXES = {Form.ROS1: ".bag", Form.MCAP: ".mcap", Form.SQLITE3: ".db3"}


@dataclass(frozen=True)
class Recording:
    """A bag from which a project can be started: the ROS version, the topics and whether it has definitions.

    `topics` are sorted, each with its message and the number of recorded messages. Topics whose types a specification
    cannot name are omitted. `foreign` are the channels that are not of ROS.
    """

    path: Path
    ros: Middleware
    topics: Mapping[str, tuple[MessageName, int]]
    has_definitions: bool
    foreign: Sequence[Foreign] = ()

    @classmethod
    def of(cls, path: Path) -> Recording:
        """Return the recording at a path. Raise `InputError` if it is not a bag or has no topics."""
        with open_bag(path) as bag:
            topics = _topics_of(bag)
            if not topics:
                others = [str(item) for item in bag.foreign]
                others += [f"{stream.topic}: '{stream.type}' is not the name of a message" for stream in bag.streams]
                fail(f"{path} contains no topics of ROS", hint="; ".join(others))
            found = definitions_in(path)
            return cls(path, bag.form.ros, topics, bool(found.texts or found.empty), bag.foreign)

    @property
    def table(self) -> list[str]:
        """The lines of a table of the topics."""
        rows = [("topic", "message", "count")]
        rows += [(topic, str(message), str(count)) for topic, (message, count) in self.topics.items()]
        first, second, third = (max(len(row[column]) for row in rows) for column in range(3))
        lines = [f"{topic:{first}}  {message:{second}}  {count:>{third}}" for topic, message, count in rows]
        return [*lines, *(f"not offered: {item}" for item in self.foreign)]

    def named(self, topic: str) -> str:
        """Return the topic that a relative name means, or the name unchanged if there is none."""
        return absolute_name(topic) if absolute_name(topic) in self.topics else topic

    def stimuli(self, project: Project, library: MessageLibrary, limit: int | None = None) -> RecordedStimuli:
        """Return the first messages of a project's input topic, with the definitions of both messages.

        Without `limit`, there are at most 10 messages and, after the first, at most 100,000 bytes. Raise `InputError`
        if there are no messages, or if they do not have the definition in `library`.
        """
        names = {
            project.input_topic: parse_name(project.input),
            project.output_topic or _UNRECORDED: parse_name(project.output),
        }
        definitions = {topic: library.closure(name) for topic, name in names.items()}
        topics = {topic: RecordedTopic.of(topic, found) for topic, found in definitions.items()}
        form, found, longest = self._first(project.input_topic, definitions[project.input_topic], limit)

        def write(path: Path) -> None:
            with write_bag(path, form, list(topics.values())) as written:
                for item in found:
                    written.write(topics[project.input_topic], item.stamp, item.payload)

        return RecordedStimuli(f"stimuli{_SUFFIXES[form]}", longest, write)

    def _first(self, topic: str, definitions: Definitions, limit: int | None) -> tuple[Form, list[Recorded], int]:
        """Return the first messages of a topic, and the bytes of the longest payload of all its messages."""
        message = list(definitions)[-1]
        taker = Topic(topic, frame_of(message, definitions), given_name=topic)
        with open_bag(self.path) as bag:
            routes = routes_of(bag, [taker], {(self.ros, message): signature(message, definitions)})
            if misfit := next((route.misfit for route in routes.values() if route.misfit), ""):
                fail(f"topic {topic} in {self.path}: {misfit}")
            topics = {stream.topic for stream in routes}
            found = list(_excerpt(bag.messages(topics), limit))
            longest = max((len(trimmed(taker.frame, item.payload)) for item in bag.messages(topics)), default=0)
        if not found:
            fail(f"{self.path} contains no message of topic {topic}")
        for item in found:
            try:
                decode(taker.frame, item.payload)
            except CodecError as error:
                fail(f"{self.path}: {topic}, message {item.number}: {error}")
        return bag.form, found, longest


def _topics_of(bag: Bag) -> dict[str, tuple[MessageName, int]]:
    found: dict[str, tuple[MessageName, int]] = {}
    for stream, count in sorted(bag.streams.items()):
        try:
            name = parse_name(stream.type)
        except InputError:
            continue
        known, others = found.get(absolute_name(stream.topic), (name, 0))
        found[absolute_name(stream.topic)] = known, others + count
    return found


def _excerpt(messages: Iterable[Recorded], limit: int | None) -> Iterator[Recorded]:
    size = 0
    for count, item in enumerate(messages):
        size += len(item.payload)
        if count == (_MESSAGES if limit is None else limit) or (limit is None and count and size > _BYTES):
            return
        yield item
