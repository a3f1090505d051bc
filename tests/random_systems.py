"""Random specifications that are right, of any size, of messages that rosbags ships.

Data flows from subscribers through accelerators in VHDL to publishers. There are chains, messages that go to several
blocks, publishers that get parts of a message from two blocks, accelerators of several inputs and outputs and of parts
of messages, types with several blocks, buffers, and every width, pipeline and scheduler that needs no times.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from typing import Any

import yaml

from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.length import length_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.scheduling.policies import POLICIES

# The longest payload that is stored, and how often a thing is done that may be done.
_BUFFER = 4096
_OFTEN, _SELDOM = 0.6, 0.25
_MOST_INPUTS, _MOST_OUTPUTS, _MOST_SINKS = 2, 2, 3


@dataclass(frozen=True)
class Message:
    """A message, its fields at the top and whether all of its payloads have one size."""

    ros: Middleware
    name: MessageName
    fields: tuple[str, ...]
    is_fixed_size: bool

    @property
    def can_be_parted(self) -> bool:
        """Whether its fields can go different ways."""
        return self.is_fixed_size and len(self.fields) > 1

    @property
    def keys(self) -> dict[str, Any]:
        """How a specification names it."""
        return {"middleware": f"ROS{self.ros.number}", "message": str(self.name)}


@dataclass(frozen=True)
class Kind:
    """A type of accelerator: what it takes and gives, each message once; of `parts` it has one field."""

    name: str
    inputs: tuple[Message, ...]
    outputs: tuple[Message, ...]
    parts: frozenset[Message]


@dataclass
class Output:
    """A message that a block gives, whole or just its first field, and to whom."""

    block: str
    message: Message
    is_part: bool
    sinks: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class RandomSystem:
    """A specification, and the blocks that get each message of each block."""

    text: str
    sinks: Mapping[tuple[str, MessageName], tuple[str, ...]]


def random_system(chance: random.Random, blocks: int, messages: int) -> RandomSystem:
    """A system of `blocks` blocks, 2 or more, of `messages` types of message if so many find a place."""
    return _Maker(chance, blocks, messages).made()


@cache
def known_messages(ros: Middleware) -> tuple[Message, ...]:
    """Every message that an accelerator may be made of: those of services and such without fields are left out."""
    library = MessageLibrary(ros)
    found = []
    for name in library.names():
        frame = frame_of(name, library.closure(name))
        fields = tuple(leaf.name for leaf in library.get(name).fields)
        if fields and frame.names and "_" not in name.name and length_of(frame).minimum <= _BUFFER:
            found.append(Message(ros, name, fields, frame.is_fixed_size))
    return tuple(found)


class _Maker:
    """Adds blocks until just those have room that take what goes nowhere yet."""

    def __init__(self, chance: random.Random, blocks: int, messages: int) -> None:
        self.chance = chance
        self.blocks = blocks
        both = [*known_messages(ROS1), *known_messages(ROS2)]
        names = chance.sample(sorted({message.name for message in both}), messages)
        # A message in one ROS version: a system has one entity of each name.
        self.messages = [chance.choice([message for message in both if message.name == name]) for name in names]
        self.unused = list(self.messages)
        self.kinds: list[Kind] = []
        self.made_blocks: list[dict[str, Any]] = []
        self.outputs: list[Output] = []

    def made(self) -> RandomSystem:
        while self._room() > 0:
            if not self._add_accelerator() and not self._add_subscriber():
                self._add_publisher(self.chance.choice(list(self._whole())))
        for output in self.outputs:
            if not output.sinks:
                self._add_publisher(output)
        text = yaml.safe_dump(self._specification(), sort_keys=False, width=1000)
        sinks = {
            (output.block, output.message.name): tuple(dict.fromkeys(sink["name"] for sink in output.sinks))
            for output in self.outputs
        }
        return RandomSystem(text, sinks)

    def _room(self) -> int:
        """Blocks that may still be added, as each output that goes nowhere gets a publisher."""
        return self.blocks - len(self.made_blocks) - sum(not output.sinks for output in self.outputs)

    def _is_tight(self) -> bool:
        """Whether what is added must bring new messages, so that all find a place."""
        return self._room() < len(self.unused) + 3

    def _often(self) -> bool:
        return self.chance.random() < _OFTEN

    def _seldom(self) -> bool:
        return self.chance.random() < _SELDOM

    def _message(self) -> Message:
        return self.unused.pop() if self.unused else self.chance.choice(self.messages)

    def _name(self, word: str) -> str:
        return f"{word}_{len(self.made_blocks)}"

    # --- blocks ------------------------------------------------------------------------------------------------

    def _add_subscriber(self) -> bool:
        """False if there is no room for it and its publisher."""
        if self._room() < 2:
            return False
        message = self._message()
        name = self._name("sub")
        self.made_blocks.append({"name": name, **message.keys, "mode": "subscriber"})
        self.outputs.append(Output(name, message, is_part=False))
        return True

    def _add_accelerator(self) -> bool:
        """A block of a new type or of one that is there; False if nothing gives what it takes, or at times."""
        kind = self._known_kind() if not self._is_tight() and self._often() else self._new_kind()
        if kind is None or (not self._is_tight() and self._seldom()):
            return False
        if kind not in self.kinds:
            self.kinds.append(kind)
        name = self._name("acc")
        self.made_blocks.append({"name": name, "type": kind.name})
        for output in self._sources(kind.inputs):
            output.sinks.append({"name": name})
        self.outputs += [Output(name, message, message in kind.parts) for message in kind.outputs]
        self.unused = [message for message in self.unused if message not in kind.outputs]
        return True

    def _cost(self, inputs: Sequence[Message], outputs: int) -> int:
        """The room that an accelerator takes: its own, and that of publishers that come and go with it."""
        return 1 + outputs - sum(not output.sinks for output in self._sources(inputs))

    def _known_kind(self) -> Kind | None:
        """A type whose inputs some outputs can give."""
        fitting = [
            kind
            for kind in self.kinds
            if len(self._sources(kind.inputs)) == len(kind.inputs)
            and self._cost(kind.inputs, len(kind.outputs)) <= self._room()
        ]
        return self.chance.choice(fitting) if fitting else None

    def _new_kind(self) -> Kind | None:
        given = list(dict.fromkeys(item.message for item in self._whole() if not (item.sinks and self._is_tight())))
        inputs = tuple(self.chance.sample(given, min(len(given), self.chance.randint(1, _MOST_INPUTS))))
        # Two messages of one block may be all that there is of both.
        inputs = tuple(output.message for output in self._sources(inputs))
        most = min(_MOST_OUTPUTS, self._room() - self._cost(inputs, 0))
        if not inputs or most < 1:
            return None
        others = self.unused or self.messages
        outputs = tuple(self.chance.sample(others, min(len(others), self.chance.randint(1, most))))
        parted = [message for message in (*inputs, *outputs) if message.can_be_parted and self._seldom()]
        return Kind(f"kind_{len(self.kinds)}", inputs, outputs, frozenset(parted))

    def _sources(self, inputs: Sequence[Message]) -> list[Output]:
        """An output for each message, those that go nowhere yet before others; fewer if some have none."""
        found: list[Output] = []
        for message in inputs:
            fitting = [
                output
                for output in self._whole()
                if output.message == message
                and output.block not in (other.block for other in found)
                and self._is_unambiguous(output, inputs)
            ]
            found += islice(sorted(fitting, key=lambda output: len(output.sinks)), 1)
        return found

    def _whole(self) -> Iterator[Output]:
        """Outputs that may still go somewhere, with all fields."""
        return (output for output in self.outputs if not output.is_part and len(output.sinks) < _MOST_SINKS)

    def _is_unambiguous(self, output: Output, inputs: Iterable[Message]) -> bool:
        """Whether no other output of the block is meant as well."""
        twins = [other for other in self.outputs if other.block == output.block and other is not output]
        return not any(twin.message in inputs for twin in twins)

    def _add_publisher(self, source: Output) -> None:
        """A publisher of what goes nowhere, at times of its first field and the others of what goes somewhere."""
        message, name = source.message, self._name("pub")
        block: dict[str, Any] = {"name": name, **message.keys, "mode": "publisher"}
        others = [item for item in self._whole() if item.message == message and item is not source and item.sinks]
        if message.can_be_parted and not source.is_part and others and self._often():
            first, *rest = message.fields
            source.sinks.append({"name": name, "include": [first]})
            others[0].sinks.append(
                {"name": name, "include": rest} if self._often() else {"name": name, "exclude": first}
            )
        else:
            source.sinks.append({"name": name})
            if message.can_be_parted and self._seldom():
                block["exclude"] = [message.fields[-1]]
        if not message.is_fixed_size:
            block["buffer"] = _BUFFER
        self.made_blocks.append(block)

    # --- text --------------------------------------------------------------------------------------------------

    def _specification(self) -> dict[str, Any]:
        timeless = [name for name, policy in POLICIES.items() if not policy.has_deadlines]
        project = {
            "name": "random",
            "width": self.chance.choice(WIDTHS[:5]),
            "scheduler": self.chance.choice(timeless),
            "pipeline": self.chance.choice(PIPELINES),
        }
        outgoing: dict[str, list[dict[str, Any]]] = {}
        for output in self.outputs:
            outgoing.setdefault(output.block, []).extend(output.sinks)
        blocks = [
            {**block, **({"outgoing": outgoing[block["name"]]} if block["name"] in outgoing else {})}
            for block in self.chance.sample(self.made_blocks, len(self.made_blocks))
        ]
        types = [self._type(kind) for kind in self.kinds]
        return {"project": project, **({"accelerators": types} if types else {}), "blocks": blocks}

    @staticmethod
    def _type(kind: Kind) -> dict[str, Any]:
        def side(message: Message) -> dict[str, Any]:
            return {**message.keys, **({"include": [message.fields[0]]} if message in kind.parts else {})}

        interface = {"input": [side(item) for item in kind.inputs], "output": [side(item) for item in kind.outputs]}
        return {"name": kind.name, "type": "VHDL", "sources": f"{kind.name}.vhd", "interface": interface}
