"""Run the software of a system for its simulation: the user's functions run while the simulation is generated.

The model supplies the messages from hardware to a block in software. A message from a block in software to hardware
becomes a stimulus, after the stimulus that caused it. A message from a block in software to a publisher bypasses the
hardware and is compared here, if the model has messages for this publisher.

A block without sources is software in another program; the stimuli contain its messages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from fusesoc_firm.accelerator.functions import Functions, Message, importable_sources
from fusesoc_firm.accelerator.software import sent_elsewhere, way_to
from fusesoc_firm.accelerator.user_code import UserFunction
from fusesoc_firm.frame.codec import decode
from fusesoc_firm.frame.defaults import encode_used
from fusesoc_firm.frame.values import shown
from fusesoc_firm.runs.simulation.host_files import differences
from fusesoc_firm.runs.simulation.reference import Response, answers
from fusesoc_firm.runs.simulation.stimuli import Stimulus, read_stimuli
from fusesoc_firm.system.derived.model import Converter, DerivedSystem, End, Topic
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.text.diagnostics import Diagnostics, fail


@dataclass(frozen=True)
class Traffic:
    """All messages to the hardware in order, and all messages that it must send, in order for each publisher.

    `published` are the messages from software to publishers, which bypass the hardware.
    """

    stimuli: list[Stimulus] = field(default_factory=list)
    responses: list[Response] = field(default_factory=list)
    published: list[Response] = field(default_factory=list)


def stimulated(system: DerivedSystem) -> list[Topic]:
    """Return the topics of stimuli: all inputs of the system except inputs from the system's software."""
    converters = [item for item in system.subscribers if item.software is None]
    blocks = {item.block for item in converters}
    topics = [item for item in system.software.subscribers if item.block not in blocks]
    return [*converters, *topics, *sent_elsewhere(system)]


def system_stimuli(path: Path, loaded: LoadedSystem, most: int | None = None) -> list[Stimulus]:
    """Return the stimuli of a system in a file or, `most` at most, in a bag. May raise `InputError`."""
    return read_stimuli(path, stimulated(loaded.system), loaded.system, loaded.libraries, most)


def answered(system: DerivedSystem) -> list[Topic]:
    """Return the topics of a model: all outputs of hardware or software, and all inputs of software."""
    found: dict[str, Topic] = {item.block: item for item in (*system.publishers, *system.software.publishers)}
    for block in (*system.accelerators, *system.software.blocks):
        for side in block.type.inputs:
            name = system.names[End(block.block, side.prefix)]
            found.setdefault(name, Topic(name, side.frame))
    return [*found.values()]


def published(system: DerivedSystem) -> list[str]:
    """Return the names with which a model answers: publishers, and messages from hardware to software."""
    return [item.block for item in (*system.publishers, *system.software.publishers)]


def responses_of(model: UserFunction, stimuli: Sequence[Stimulus], system: DerivedSystem) -> list[Response]:
    """Return the responses of a system's model to all stimuli. May raise `InputError`."""
    return answers(model, stimuli, answered(system), published(system))


def traffic(system: DerivedSystem, folder: Path, stimuli: Sequence[Stimulus], responses: Sequence[Response]) -> Traffic:
    """Return the messages to and from the hardware, including those that the software in `folder` causes.

    Raise `InputError` for messages that are missing in the stimuli or the model, and for faults in the software.
    """
    _check_complete(system, stimuli, responses)
    caused: dict[int | None, list[Response]] = {}
    for response in responses:
        caused.setdefault(response.cause, []).append(response)
    with importable_sources([type_.accelerator for type_ in system.software.types], folder):
        run = _Run(system, Functions.of(system.software, folder))
        for number, stimulus in enumerate(stimuli):
            run.take(stimulus, caused.get(number, ()))
    _check_published(system, run.traffic.published, responses)
    return run.traffic


def _check_complete(system: DerivedSystem, stimuli: Sequence[Stimulus], responses: Sequence[Response]) -> None:
    """Raise `InputError` if the stimuli or the model lack messages for a topic that software requires."""
    faults = Diagnostics()
    sent = {stimulus.subscriber.block for stimulus in stimuli}
    for topic, end in sent_elsewhere(system).items():
        if topic.block not in sent:
            hint = f"'{end.block}' has no sources, so the stimuli must contain its messages"
            faults.error(f"the stimuli contain no message for '{topic.block}'", hint=hint)
    said = {response.publisher.block for response in responses}
    here = {block.block for block in system.software.blocks if block.type.accelerator.sources}
    for publisher in system.publishers:
        if publisher.software and publisher.software.block in here and publisher.block not in said:
            message = f"the model returns no message from hardware to '{publisher.software.block}'"
            faults.error(message, hint=f"'respond' must also return ('{publisher.block}', message)")
    faults.raise_if_any()


@dataclass
class _Run:
    """The state of a run of software: the traffic so far."""

    system: DerivedSystem
    functions: Functions
    traffic: Traffic = field(default_factory=Traffic)

    @cached_property
    def _publishers(self) -> dict[str, Topic]:
        return {topic.block: topic for topic in self.system.software.publishers}

    @cached_property
    def _subscribers(self) -> dict[str, Converter]:
        return {item.block: item for item in self.system.subscribers}

    @cached_property
    def _ends(self) -> dict[str, End]:
        return {topic.block: end for topic, end in sent_elsewhere(self.system).items()}

    @cached_property
    def _ways(self) -> dict[str, set[str]]:
        return {item.block: way_to(item.block, self.system) for item in self.system.publishers}

    def take(self, stimulus: Stimulus, responses: Sequence[Response]) -> None:
        """Send a message, and run the software for this message and for the hardware's responses."""
        block = stimulus.subscriber.block
        if block in self._subscribers and block not in self._ends:
            self.traffic.stimuli.append(stimulus)
        self._give(self._ends.get(block, End(block)), stimulus.message)
        sent = [response for response in responses if response.publisher.block in self._ways]
        for response in sent:
            self._give(End(response.publisher.block), decode(response.publisher.frame, response.payload))
        for response in sent:
            self.traffic.responses.append(replace(response, cause=self._cause(response.publisher.block)))

    def _give(self, source: End, message: Message) -> None:
        for name, given in self.functions.take(source, message):
            if subscriber := self._subscribers.get(name):
                payload = encode_used(subscriber.frame, given)
                self.traffic.stimuli.append(Stimulus(subscriber, payload, decode(subscriber.frame, payload)))
            else:
                topic = self._publishers[name]
                payload = encode_used(topic.frame, given)
                cause = len(self.traffic.stimuli) - 1
                message = decode(topic.frame, payload)
                self.traffic.published.append(Response(topic, payload, message, cause if cause >= 0 else None))

    def _cause(self, publisher: str) -> int | None:
        """Return the number of the last stimulus so far on the route to a publisher, or None."""
        stimuli = self.traffic.stimuli
        way = self._ways[publisher]
        numbers = (number for number in reversed(range(len(stimuli))) if stimuli[number].subscriber.block in way)
        return next(numbers, None)


def _check_published(system: DerivedSystem, published: Sequence[Response], responses: Sequence[Response]) -> None:
    """Raise `InputError` if the messages from software to publishers differ from the model's.

    For a publisher without messages of the model, the software's functions are the model.
    """
    for topic in system.software.publishers:
        wanted = [response for response in responses if response.publisher.block == topic.block]
        if not wanted:
            continue
        found = [response for response in published if response.publisher.block == topic.block]
        for number, (own, response) in enumerate(zip(found, wanted, strict=False)):
            if own.payload != response.payload:
                sent, said = own.message, decode(topic.frame, response.payload)
                name, *values = next(differences(sent, said), ("", sent, said))
                one, other = map(shown, values)
                what = f"'{name}'" if name else "it"
                fail(f"message {number} from software to '{topic.block}': {what} is {one}, but the model has {other}")
        if len(found) != len(wanted):
            fail(f"software sends {len(found)} messages to '{topic.block}', but the model sends {len(wanted)}")
