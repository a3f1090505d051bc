"""Specification -> derived System: data types and data flow.

Resolves every message, gives out ids, and finds which port of which block each connection means. What does not
fit is reported where it was written; as much as can be checked is checked before anything is raised.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from fusesoc_firm.converter.limits import check_fixed_size
from fusesoc_firm.diagnostics import Diagnostics, InputError, nearest
from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.model import RosVersion
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.naming import identifier
from fusesoc_firm.system.derived import (
    AcceleratorBlock,
    AcceleratorType,
    Connection,
    Converter,
    DerivedSystem,
    End,
    MessageSide,
)
from fusesoc_firm.system.specification import (
    MIDDLEWARES,
    Accelerator,
    Block,
    InterfaceType,
    Outgoing,
    Specification,
)
from fusesoc_firm.yaml_text import Text

Libraries = Mapping[RosVersion, MessageLibrary]
_MOST_CONVERTERS = 256


def derive(specification: Specification, folder: Path, libraries: Libraries, faults: Diagnostics) -> DerivedSystem:
    """The system that a specification in `folder` describes.

    Raises `InputError` with the faults found here and those already in `faults`.
    """
    analysis = _Analysis(specification, folder, libraries, faults)
    analysis.check_names()
    analysis.resolve_accelerators()
    analysis.resolve_blocks()
    connections = analysis.connect()
    analysis.check_flow(connections)
    faults.raise_if_any()
    project = specification.project
    return DerivedSystem(
        name=identifier(project.name).lower(),
        fpga_part=str(project.fpga_part or ""),
        width=project.width,
        scheduler=str(project.scheduler),
        subscribers=analysis.converters("subscriber"),
        publishers=analysis.converters("publisher"),
        accelerators=tuple(
            AcceleratorBlock(str(block.name), analysis.types[block.type])
            for block in specification.blocks
            if block.type is not None
        ),
        connections=connections,
    )


def source_files(specification: Specification, folder: Path) -> list[Path]:
    """The source files of all accelerators, in the order of the specification."""
    return [folder / source for accelerator in specification.accelerators for source in accelerator.sources]


@dataclass
class _Analysis:
    """The state of one analysis: what has been resolved so far. A block whose type is wrong is in no table."""

    specification: Specification
    folder: Path
    libraries: Libraries
    faults: Diagnostics
    types: dict[str, AcceleratorType] = field(default_factory=dict)
    blocks: dict[str, Block] = field(default_factory=dict)
    inputs: dict[str, tuple[MessageSide, ...]] = field(default_factory=dict)
    outputs: dict[str, tuple[MessageSide, ...]] = field(default_factory=dict)

    # --- names -------------------------------------------------------------------------------------------------

    def check_names(self) -> None:
        self._check_distinct("accelerator", [item.name for item in self.specification.accelerators])
        self._check_distinct("block", [item.name for item in self.specification.blocks])

    def _check_distinct(self, what: str, names: Iterable[Text]) -> None:
        seen: dict[str, Text] = {}
        for name in names:
            # VHDL knows no case, so names that differ in it alone would meet there.
            twin = seen.setdefault(identifier(name).lower(), name)
            if twin is not name and twin == name:
                self.faults.error(f"a second {what} is called '{name}'; the first is at {twin.source}", name.source)
            elif twin is not name:
                self.faults.error(f"{what} '{name}' and '{twin}' have the same name in VHDL", name.source)

    # --- types -------------------------------------------------------------------------------------------------

    def resolve_accelerators(self) -> None:
        for accelerator in self.specification.accelerators:
            self._check_sources(accelerator)
            inputs = self._sides("in", accelerator.interface.input)
            outputs = self._sides("out", accelerator.interface.output)
            if inputs is not None and outputs is not None:
                self.types[accelerator.name] = AcceleratorType(accelerator, inputs, outputs)

    def _check_sources(self, accelerator: Accelerator) -> None:
        for source in accelerator.sources:
            if not (self.folder / source).is_file():
                hint = "paths are relative to the specification"
                self.faults.error(f"there is no source file '{source}'", source.source, hint)

    def _sides(self, word: str, interface: Sequence[InterfaceType]) -> tuple[MessageSide, ...] | None:
        """The message sides of an interface, numbered if there are several; None if a message is wrong."""
        frames = [self._frame(item.middleware, item.message) for item in interface]
        prefixes = [f"{word}_"] if len(frames) == 1 else [f"{word}{number}_" for number in range(len(frames))]
        sides = [MessageSide(prefix, frame) for prefix, frame in zip(prefixes, frames, strict=True) if frame]
        return tuple(sides) if len(sides) == len(frames) else None

    def _frame(self, middleware: Text, message: Text) -> Frame | None:
        """The frame of a message, or None where it has a fault, which is noted at the specification's word."""
        library = self.libraries[MIDDLEWARES[middleware]]
        try:
            name = parse_name(message)
            library.get(name, message.source)
            frame = frame_of(name, library.closure(name))
            check_fixed_size(frame)
        except InputError as error:
            for fault in error.diagnostics:
                self.faults.error(fault.message, fault.source or message.source, fault.hint)
            return None
        return frame

    # --- blocks ------------------------------------------------------------------------------------------------

    def resolve_blocks(self) -> None:
        for block in self.specification.blocks:
            self.blocks.setdefault(block.name, block)
            if block.type is not None:
                self._resolve_accelerator_block(block)
            else:
                self._resolve_converter(block)
        for mode in ("subscriber", "publisher"):
            self._check_count(mode)

    def _resolve_accelerator_block(self, block: Block) -> None:
        assert block.type is not None
        names = [accelerator.name for accelerator in self.specification.accelerators]
        if block.type not in names:
            self.faults.error(f"no accelerator is called '{block.type}'", block.type.source, nearest(block.type, names))
        for key in ("middleware", "mode", "message"):
            value = getattr(block, key)
            if value is not None:
                self.faults.error(f"'{key}' belongs to a converter, but '{block.name}' has a type", value.source)
        if found := self.types.get(block.type):
            self.inputs[block.name] = found.inputs
            self.outputs[block.name] = found.outputs

    def _resolve_converter(self, block: Block) -> None:
        missing = [key for key in ("middleware", "mode", "message") if getattr(block, key) is None]
        if missing:
            words = " and ".join(f"'{key}'" for key in missing)
            hint = "a block is an accelerator, with 'type', or a converter, with 'middleware', 'mode' and 'message'"
            self.faults.error(f"block '{block.name}' needs {words}", block.name.source, hint)
            return
        assert block.middleware is not None and block.message is not None
        frame = self._frame(block.middleware, block.message)
        if frame is not None:
            is_subscriber = block.mode == "subscriber"
            self.inputs[block.name] = () if is_subscriber else (MessageSide("", frame),)
            self.outputs[block.name] = (MessageSide("", frame),) if is_subscriber else ()

    def _check_count(self, mode: str) -> None:
        found = [block for block in self.specification.blocks if block.mode == mode]
        if not found:
            self.faults.error(f"the system has no {mode}; it needs at least one", self.specification.source)
        elif len(found) > _MOST_CONVERTERS:
            self.faults.error(
                f"the system has {len(found)} {mode}s; an id of one byte tells {_MOST_CONVERTERS} apart",
                found[_MOST_CONVERTERS].name.source,
            )

    def converters(self, mode: str) -> tuple[Converter, ...]:
        blocks = [block for block in self.specification.blocks if block.type is None and block.mode == mode]
        sides = self.outputs if mode == "subscriber" else self.inputs
        return tuple(Converter(str(block.name), sides[block.name][0].frame, n) for n, block in enumerate(blocks))

    # --- connections -------------------------------------------------------------------------------------------

    def connect(self) -> tuple[Connection, ...]:
        """The connections, one a message side that gives; the ends of one that does not fit are left out."""
        sinks: dict[End, list[End]] = {}
        frames: dict[End, Frame] = {}
        driven: dict[End, Outgoing] = {}
        taken: Counter[tuple[str, Frame]] = Counter()
        given: Counter[tuple[str, Frame]] = Counter()
        for block in self.specification.blocks:
            for outgoing in block.outgoing:
                sides = self._match(block, outgoing)
                if sides is None:
                    continue
                gives, takes = sides
                frame = takes[0].frame
                source = End(str(block.name), _in_turn(gives, given[block.name, frame]).prefix)
                given[block.name, frame] += 1
                sink = End(str(outgoing.name), _in_turn(takes, taken[outgoing.name, frame]).prefix)
                taken[outgoing.name, frame] += 1
                if sink in driven:
                    first = driven[sink].name.source
                    self.faults.error(
                        f"'{outgoing.name}' takes one message, and has it from {first}", outgoing.name.source
                    )
                    continue
                driven[sink] = outgoing
                frames[source] = frame
                sinks.setdefault(source, []).append(sink)
        self._check_all_used(set(sinks), set(driven))
        return tuple(Connection(frames[source], source, tuple(ends)) for source, ends in sinks.items())

    def _match(self, block: Block, outgoing: Outgoing) -> tuple[list[MessageSide], list[MessageSide]] | None:
        """The sides at both ends that carry the same message; None, with the fault noted, if there are none."""
        target = self.blocks.get(outgoing.name)
        if target is None:
            self.faults.error(
                f"no block is called '{outgoing.name}'", outgoing.name.source, nearest(outgoing.name, self.blocks)
            )
            return None
        if block.type is None and block.mode == "publisher":
            self.faults.error(f"'{block.name}' is a publisher; its message goes to the host", outgoing.name.source)
            return None
        if target.type is None and target.mode == "subscriber":
            self.faults.error(f"'{target.name}' is a subscriber; its message comes from the host", outgoing.name.source)
            return None
        if block.name not in self.outputs or target.name not in self.inputs:
            return None  # The fault of its type is noted already.
        gives, takes = self.outputs[block.name], self.inputs[target.name]
        matching = {side.frame for side in gives} & {side.frame for side in takes}
        if not matching:
            self.faults.error(
                f"'{block.name}' gives {_messages(gives)}, but '{target.name}' takes {_messages(takes)}",
                outgoing.name.source,
            )
            return None
        # The first message, in the giver's order, that both know.
        frame = next(side.frame for side in gives if side.frame in matching)
        return [side for side in gives if side.frame == frame], [side for side in takes if side.frame == frame]

    def _check_all_used(self, sources: set[End], sinks: set[End]) -> None:
        for block in self.specification.blocks:
            for side in self.inputs.get(block.name, ()):
                if End(str(block.name), side.prefix) not in sinks:
                    self.faults.error(
                        f"nothing goes to {_words('input', side)} of '{block.name}' ({side.frame.message})",
                        block.name.source,
                        f"name '{block.name}' as 'outgoing' of a block that gives {side.frame.message}",
                    )
            for side in self.outputs.get(block.name, ()):
                if End(str(block.name), side.prefix) not in sources:
                    self.faults.error(
                        f"{_words('output', side)} of '{block.name}' ({side.frame.message}) goes nowhere",
                        block.name.source,
                        f"name a block that takes {side.frame.message} as 'outgoing' of '{block.name}'",
                    )

    def check_flow(self, connections: Iterable[Connection]) -> None:
        """A message cannot be waited for by what it is made of."""
        graph: dict[str, set[str]] = {}
        for connection in connections:
            for sink in connection.sinks:
                graph.setdefault(sink.block, set()).add(connection.source.block)
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            cycle = list(reversed(error.args[1]))
            start = cycle.index(min(cycle))
            way = " -> ".join([*cycle[start:-1], *cycle[:start], cycle[start]])
            self.faults.error(f"these blocks wait for each other: {way}", self.blocks[cycle[start]].name.source)


def _in_turn(sides: Sequence[MessageSide], number: int) -> MessageSide:
    """The side for the `number`-th connection of a message: one side serves all, several are taken in turn."""
    return sides[min(number, len(sides) - 1)]


def _messages(sides: Sequence[MessageSide]) -> str:
    return " and ".join(f"{side.frame.message} (ROS {int(side.frame.ros)})" for side in sides) or "no message"


def _words(what: str, side: MessageSide) -> str:
    return f"{what} '{side.prefix}'" if side.prefix else f"the {what}"
