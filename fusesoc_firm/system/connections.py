"""Which message goes where: the ports that each `outgoing` means, and what is wrong with the data flow.

A connection that cannot be made is one fault. What lacks a message only because of it is not reported as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

from fusesoc_firm.diagnostics import Diagnostics, nearest
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.system.derived import Connection, End, MessageSide
from fusesoc_firm.system.specification import Block, Outgoing

Sides = Mapping[str, tuple[MessageSide, ...]]
Pair = tuple[MessageSide, MessageSide]


@dataclass
class Wiring:
    """The connections between `blocks`, by name, whose message sides are known (`inputs`, `outputs`).

    Where the specification has faults: `has_more_blocks` tells that there are blocks whose names could not be read,
    `has_more_messages` that there are connections of messages that are not known; `strays` are messages of connections
    that could not be read. `ambiguous` are names of several blocks; the first is in the tables.
    """

    blocks: Mapping[str, Block]
    inputs: Sides
    outputs: Sides
    faults: Diagnostics
    has_more_blocks: bool = False
    has_more_messages: bool = False
    strays: set[Frame] = field(default_factory=set)
    ambiguous: set[str] = field(default_factory=set)
    sinks: dict[End, list[End]] = field(default_factory=dict)
    sides: dict[End, MessageSide] = field(default_factory=dict)
    driven: dict[End, Outgoing] = field(default_factory=dict)
    # The two ends of connections that could not be made.
    broken_sources: set[str] = field(default_factory=set)
    broken_sinks: set[str] = field(default_factory=set)

    def connect(self) -> tuple[Connection, ...]:
        """One connection a message side that gives, in the order of the specification."""
        for block in self.blocks.values():
            for outgoing in block.outgoing:
                if not self._connect(block, outgoing):
                    self.broken_sources.add(block.name)
                    self.broken_sinks.add(outgoing.name)
        if not self.has_more_messages:
            self._check_sinks()
        self._check_sources()
        self._check_cycles()
        return tuple(
            Connection(self.sides[source].frame, source, tuple(ends), self.sides[source].length)
            for source, ends in self.sinks.items()
        )

    def _connect(self, block: Block, outgoing: Outgoing) -> bool:
        """Make one connection; False where there is none, with the fault noted unless it is already."""
        if not self._are_known(block, outgoing):
            return False
        pairs = self._pairs(block, outgoing)
        if not pairs:
            return False
        free = [pair for pair in pairs if self._sink(outgoing, pair) not in self.driven]
        if not free:
            first = self.driven[self._sink(outgoing, pairs[0])].name.source
            if outgoing.name not in self.ambiguous:
                hint = f"an input takes its messages from one block; this one is named at {first}"
                self.faults.error(f"'{outgoing.name}' gets this message already", outgoing.name.source, hint)
            return False
        source, sink = self._chosen(block, outgoing, free)
        self.driven[sink] = outgoing
        self.sinks.setdefault(source, []).append(sink)
        return True

    def _are_known(self, block: Block, outgoing: Outgoing) -> bool:
        name = outgoing.name
        if not name:
            return False
        if name not in self.blocks:
            if not self.has_more_blocks:
                self.faults.error(f"no block is called '{name}'", name.source, nearest(name, self.blocks))
            self.strays |= {side.frame for side in self.outputs.get(block.name, ())}
            return False
        target = self.blocks[name]
        if block.type is None and block.mode == "publisher":
            self.faults.error(f"'{block.name}' is a publisher; its message goes to the host", name.source)
            return False
        if target.type is None and target.mode == "subscriber":
            self.faults.error(f"'{name}' is a subscriber; its message comes from the host", name.source)
            return False
        return block.name in self.outputs and name in self.inputs

    def _pairs(self, block: Block, outgoing: Outgoing) -> list[Pair]:
        """The sides at both ends that carry the same message."""
        gives, takes = self.outputs[block.name], self.inputs[outgoing.name]
        pairs = [(given, taken) for given in gives for taken in takes if given.frame == taken.frame]
        if not pairs:
            self.faults.error(
                f"'{block.name}' gives {_messages(gives)}, but '{outgoing.name}' takes {_messages(takes)}",
                outgoing.name.source,
            )
        return pairs

    def _chosen(self, block: Block, outgoing: Outgoing, free: Sequence[Pair]) -> tuple[End, End]:
        """The first pair with an output that goes nowhere yet; else the last output that fits gets one more sink."""
        unused = [pair for pair in free if self._source(block, pair) not in self.sinks]
        last = free[-1][0]
        given, taken = unused[0] if unused else next(pair for pair in free if pair[0] == last)
        source = End(str(block.name), given.prefix)
        self.sides[source] = given
        return source, End(str(outgoing.name), taken.prefix)

    @staticmethod
    def _source(block: Block, pair: Pair) -> End:
        return End(str(block.name), pair[0].prefix)

    @staticmethod
    def _sink(outgoing: Outgoing, pair: Pair) -> End:
        return End(str(outgoing.name), pair[1].prefix)

    def _check_sinks(self) -> None:
        for block in self.blocks.values():
            for side in self.inputs.get(block.name, ()):
                is_excused = block.name in self.broken_sinks or side.frame in self.strays
                if not is_excused and End(str(block.name), side.prefix) not in self.driven:
                    self.faults.error(
                        f"nothing goes to {_words('input', side)} of '{block.name}' ({side.frame.message})",
                        block.name.source,
                        f"name '{block.name}' as 'outgoing' of a block that gives {side.frame.message}",
                    )

    def _check_sources(self) -> None:
        for block in self.blocks.values():
            for side in self.outputs.get(block.name, ()):
                is_excused = not block.is_sound or block.name in self.broken_sources
                if not is_excused and End(str(block.name), side.prefix) not in self.sinks:
                    self.faults.error(
                        f"{_words('output', side)} of '{block.name}' ({side.frame.message}) goes nowhere",
                        block.name.source,
                        f"name a block that takes {side.frame.message} as 'outgoing' of '{block.name}'",
                    )

    def _check_cycles(self) -> None:
        """A message cannot be waited for by what it is made of."""
        # Lists, as the order in sets of strings differs from run to run.
        graph: dict[str, list[str]] = {}
        for source, sinks in self.sinks.items():
            for sink in sinks:
                graph.setdefault(sink.block, []).append(source.block)
        while cycle := _cycle(graph):
            order = list(self.blocks)
            start = min(range(len(cycle)), key=lambda position: order.index(cycle[position]))
            way = [*cycle[start:], *cycle[: start + 1]]
            self.faults.error(f"these blocks wait for each other: {' -> '.join(way)}", self.blocks[way[0]].name.source)
            # Without this step it is no cycle; there may be others.
            graph[way[1]] = [block for block in graph[way[1]] if block != way[0]]


def _cycle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """The blocks of a cycle in the direction of its messages, each once; empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        # Each is the predecessor of the next; the first comes again at the end.
        return list(error.args[1][:-1])
    return []


def _messages(sides: Sequence[MessageSide]) -> str:
    return " and ".join(f"{side.frame.message} (ROS {int(side.frame.ros)})" for side in sides) or "no message"


def _words(what: str, side: MessageSide) -> str:
    return f"{what} '{side.prefix}'" if side.prefix else f"the {what}"
