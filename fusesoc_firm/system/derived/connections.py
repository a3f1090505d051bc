"""Find the ports and fields to which each `outgoing` refers, and report faults in the data flow.

An impossible connection is reported as one fault; messages that are missing as a consequence are not reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Names, Paths, names_in_use, select, with_names_in_use
from fusesoc_firm.frame.values import dotted
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.system.derived.bypass import passing_hint
from fusesoc_firm.system.derived.model import Connection, End, MessageSide
from fusesoc_firm.system.written.specification import Block, Outgoing
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, nearest
from fusesoc_firm.text.yaml_text import Text

Sides = Mapping[str, tuple[MessageSide, ...]]
Pair = tuple[MessageSide, MessageSide]

# A placeholder for the fields of a message without fields.
_NO_FIELD: Names = ()


@dataclass
class Wiring:
    """The connections between named `blocks` whose message sides (`inputs`, `outputs`) are known.

    The other attributes prevent follow-up errors in faulty specifications. `has_more_blocks` is set if some blocks have
    unreadable names, `has_more_messages` if some connections have unknown messages. `strays` are the messages of
    unreadable connections. `ambiguous` are names that several blocks share; the tables contain the first such block.
    `software` are the blocks in software.
    """

    blocks: Mapping[str, Block]
    inputs: Sides
    outputs: Sides
    faults: Diagnostics
    has_more_blocks: bool = False
    has_more_messages: bool = False
    strays: set[tuple[MessageName, Middleware]] = field(default_factory=set)
    ambiguous: set[str] = field(default_factory=set)
    software: frozenset[str] = frozenset()
    # The fields carried from each source to each of its sinks, and the connection that drives each field of a sink.
    sinks: dict[End, dict[End, frozenset[Names]]] = field(default_factory=dict)
    frames: dict[End, Frame] = field(default_factory=dict)
    driven: dict[End, dict[Names, Outgoing]] = field(default_factory=dict)
    # The sinks that several blocks feed with whole messages.
    merged: set[End] = field(default_factory=set)
    # The ends of connections that could not be made.
    broken_sources: set[str] = field(default_factory=set)
    broken_sinks: set[str] = field(default_factory=set)

    def connect(self) -> tuple[Connection, ...]:
        """Make all connections, one for each side that provides a message, in the order of the specification."""
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
            Connection(
                source, tuple(ends), tuple(with_names_in_use(self.frames[source], names) for names in ends.values())
            )
            for source, ends in self.sinks.items()
        )

    def _connect(self, block: Block, outgoing: Outgoing) -> bool:
        """Make one connection; if it is impossible, note the fault and return False."""
        if not self._are_known(block, outgoing):
            return False
        pairs = self._pairs(block, outgoing)
        if not pairs:
            return False
        free = [pair for pair in pairs if self._rivals(outgoing, pair, pairs[pair]) is None]
        if not free and (pair := self._mergeable(block, outgoing, pairs)):
            source, sink = self._source(block, pair), self._sink(outgoing, pair)
            self.frames[source] = pair[0].frame
            self.merged.add(sink)
            self.sinks.setdefault(source, {})[sink] = pairs[pair]
            return True
        if not free:
            rival = self._rivals(outgoing, *next(iter(pairs.items())))
            if outgoing.name not in self.ambiguous and rival:
                name, first = rival
                what = f"'{dotted(name)}'" if outgoing.include or outgoing.exclude else "this message"
                hint = (
                    f"the first connection is at {first.name.source}; messages of several blocks can meet at an input"
                )
                hint += " if each block provides the same fields"
                self.faults.error(f"'{outgoing.name}' already receives {what}", outgoing.name.source, hint)
            return False
        pair = self._chosen(block, free)
        source, sink = self._source(block, pair), self._sink(outgoing, pair)
        self.frames[source] = pair[0].frame
        self.driven.setdefault(sink, {}).update(dict.fromkeys(pairs[pair], outgoing))
        ends = self.sinks.setdefault(source, {})
        ends[sink] = ends.get(sink, frozenset()) | pairs[pair]
        return True

    def _are_known(self, block: Block, outgoing: Outgoing) -> bool:
        name = outgoing.name
        if not name:
            return False
        if name not in self.blocks:
            if not self.has_more_blocks:
                hint = nearest(name, self.blocks.keys() - self.ambiguous)
                if len(self.ambiguous) == 1:
                    hint = f"rename one of the blocks '{next(iter(self.ambiguous))}' to '{name}'?"
                self.faults.error(f"unknown block '{name}'", name.source, hint)
            self.strays |= {side.kind for side in self.outputs.get(block.name, ())}
            return False
        target = self.blocks[name]
        if block.type is None and block.mode == "publisher":
            message = f"'{block.name}' is a publisher, whose message goes to the host"
            self.faults.error(message, name.source, "'outgoing' is legal only in subscribers and accelerators")
            return False
        if target.type is None and target.mode == "subscriber":
            message = f"'{name}' is a subscriber, whose message comes from the host"
            self.faults.error(message, name.source, "'outgoing' can name only accelerators and publishers")
            return False
        return block.name in self.outputs and name in self.inputs

    def _pairs(self, block: Block, outgoing: Outgoing) -> dict[Pair, frozenset[Names]]:
        """Return the pairs of sides with the same message, each with the fields that this connection carries."""
        gives, takes = self.outputs[block.name], self.inputs[outgoing.name]
        alike = [(given, taken) for given in gives for taken in takes if given.kind == taken.kind]
        if not alike:
            self.faults.error(
                f"'{block.name}' outputs {_messages(gives)}, but '{outgoing.name}' takes {_messages(takes)}",
                outgoing.name.source,
                _what_lacks(block, gives, "output")
                or _what_lacks(self.blocks[outgoing.name], takes, "input")
                or "both ends of a connection must have the same message in the same ROS version",
            )
            return {}
        try:
            pairs = {pair: _fields(outgoing, *pair) for pair in alike}
        except InputError as error:
            self.faults.take(error, None)
            return {}
        pairs = {pair: names for pair, names in pairs.items() if names}
        if not pairs:
            self.faults.error(
                f"the connection from '{block.name}' to '{outgoing.name}' carries no field",
                outgoing.name.source,
                "a connection carries the fields that both ends have and that 'include' and 'exclude' select",
            )
        return pairs

    def _rivals(self, outgoing: Outgoing, pair: Pair, names: Iterable[Names]) -> tuple[Names, Outgoing] | None:
        """Return a field that another connection already drives, with that connection, or None."""
        driven = self.driven.get(self._sink(outgoing, pair), {})
        return next(((name, driven[name]) for name in sorted(names) if name in driven), None)

    def _mergeable(self, block: Block, outgoing: Outgoing, pairs: Mapping[Pair, frozenset[Names]]) -> Pair | None:
        """Return the sides if another block already feeds the only fitting input with the same fields."""
        if len(pairs) != 1:
            return None
        ((pair, names),) = pairs.items()
        sink = self._sink(outgoing, pair)
        sources = [source for source, ends in self.sinks.items() if sink in ends]
        fits = all(source.block != block.name and self.sinks[source][sink] == names for source in sources)
        is_hardware = self.software.isdisjoint({block.name, outgoing.name, *(source.block for source in sources)})
        return pair if sources and fits and is_hardware and outgoing.name not in self.ambiguous else None

    def _chosen(self, block: Block, free: Sequence[Pair]) -> Pair:
        """Return the first pair whose output is unused; otherwise the last pair, whose output gets another sink."""
        unused = [pair for pair in free if self._source(block, pair) not in self.sinks]
        last = free[-1][0]
        return unused[0] if unused else next(pair for pair in free if pair[0] == last)

    @staticmethod
    def _source(block: Block, pair: Pair) -> End:
        return End(str(block.name), pair[0].prefix)

    @staticmethod
    def _sink(outgoing: Outgoing, pair: Pair) -> End:
        return End(str(outgoing.name), pair[1].prefix)

    def _check_sinks(self) -> None:
        for block in self.blocks.values():
            for side in self.inputs.get(block.name, ()):
                if block.name not in self.broken_sinks and side.kind not in self.strays:
                    self._check_sink(block, side)

    def _check_sink(self, block: Block, side: MessageSide) -> None:
        """Check that a sink is driven; publishers send defaults for missing fields, accelerators need all fields."""
        sink = End(str(block.name), side.prefix)
        driven = self.driven.get(sink, {})
        missing = sorted(dotted(name) for name in _names(side.frame) - driven.keys())
        if not driven:
            self.faults.error(
                f"{_words('input', side)} of '{block.name}' ({side.frame.message}) has no source",
                block.name.source,
                f"add '{block.name}' to 'outgoing' of a block that outputs {side.frame.message}",
            )
        elif missing and block.type is not None:
            types = [self.blocks[source.block].type for source, ends in self.sinks.items() if sink in ends]
            hint = f"'include' each field in a connection, or 'exclude' it in the input of '{block.type}'"
            self.faults.error(
                f"{_words('input', side)} of '{block.name}' ({side.frame.message}) has no source for"
                f" {', '.join(missing)}",
                block.name.source,
                "; ".join([hint, *(passing_hint(type_) for type_ in types if type_)]),
            )

    def _check_sources(self) -> None:
        for block in self.blocks.values():
            for side in self.outputs.get(block.name, ()):
                is_excused = not block.is_sound or block.name in self.broken_sources
                if not is_excused and End(str(block.name), side.prefix) not in self.sinks:
                    written = block.service_block or block
                    self.faults.error(
                        f"{_words('output', side)} of '{block.name}' ({side.frame.message}) has no destination",
                        block.name.source,
                        f"add a block that takes {side.frame.message} to 'outgoing' of '{written.name}'",
                    )

    def _check_cycles(self) -> None:
        """Check that no message depends on itself."""
        # Lists, since the order of sets of strings differs from run to run.
        graph: dict[str, list[str]] = {}
        for source, sinks in self.sinks.items():
            for sink in sinks:
                graph.setdefault(sink.block, []).append(source.block)
        for way in cycles_of(graph, list(self.blocks)):
            self.faults.error(f"these blocks wait for each other: {' -> '.join(way)}", self.blocks[way[0]].name.source)


def cycles_of(graph: Mapping[str, Sequence[str]], order: Sequence[str]) -> Iterator[list[str]]:
    """Yield cycles of a graph of predecessors, in the direction of the messages, until none is left.

    A cycle begins and ends with the same block, the first one in `order`.
    """
    left = {block: list(before) for block, before in graph.items()}
    while cycle := _cycle(left):
        start = min(range(len(cycle)), key=lambda position: order.index(cycle[position]))
        way = [*cycle[start:], *cycle[: start + 1]]
        yield way
        # Removing this edge breaks the cycle; there may be other cycles.
        left[way[1]] = [block for block in left[way[1]] if block != way[0]]


def _cycle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the blocks of a cycle, each once, in the direction of the messages; without a cycle, an empty list."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        # Each block is the predecessor of the next one; the first block is repeated at the end.
        return list(error.args[1][:-1])
    return []


def _fields(outgoing: Outgoing, given: MessageSide, taken: MessageSide) -> frozenset[Names]:
    """Return the fields carried from one side to another; raise `InputError` for an unknown path."""
    carried = _names(given.frame) & _names(taken.frame)
    if outgoing.include or outgoing.exclude:
        carried &= _names(select(given.frame, places(outgoing.include), places(outgoing.exclude)))
    return carried


def places(paths: Iterable[Text]) -> Paths:
    """Return the paths of `include` or `exclude`, in the form that `select` expects."""
    return {path: path.source for path in paths}


def _names(frame: Frame) -> frozenset[Names]:
    return names_in_use(frame) if frame.names else frozenset({_NO_FIELD})


def _messages(sides: Sequence[MessageSide]) -> str:
    return " and ".join(f"{side.frame.message} ({side.frame.ros.title})" for side in sides) or "no message"


def _what_lacks(block: Block, sides: Sequence[MessageSide], key: str) -> str:
    """Return the fault if an accelerator's interface has no messages under `key`, otherwise an empty string."""
    return "" if sides else f"the interface of accelerator '{block.type}' has no '{key}'"


def _words(what: str, side: MessageSide) -> str:
    return f"{what} '{side.prefix}'" if side.prefix else f"the {what}"
