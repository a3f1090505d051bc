"""Specification -> derived System: data types and data flow.

This module resolves every message, assigns ids, and uses `connections` to find the block and port at each end of every
connection. Faults are reported at their places in the specification; as many checks as possible run before an error is
raised.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Names, names_in_use, select, with_names_in_use
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_name
from fusesoc_firm.system.derived.actions import actions_of
from fusesoc_firm.system.derived.bypass import with_bypass
from fusesoc_firm.system.derived.clocks import clocks_of
from fusesoc_firm.system.derived.connections import Wiring, places
from fusesoc_firm.system.derived.cpp_function import check_kernel
from fusesoc_firm.system.derived.entities import check_entities
from fusesoc_firm.system.derived.ids import check_count
from fusesoc_firm.system.derived.lateness import with_lateness_buffers
from fusesoc_firm.system.derived.length import output_length, publisher_buffers, with_lengths
from fusesoc_firm.system.derived.link import link_of
from fusesoc_firm.system.derived.longest import with_longest_payloads, with_longest_sent
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    AcceleratorType,
    Connection,
    Converter,
    DerivedSystem,
    End,
    MessageSide,
    PayloadLength,
    Topic,
)
from fusesoc_firm.system.derived.network import network_of
from fusesoc_firm.system.derived.partition import Parting, Parts, message_names
from fusesoc_firm.system.derived.pins import check_pins
from fusesoc_firm.system.derived.python_function import check_function
from fusesoc_firm.system.derived.quality import check_quality, quality_of
from fusesoc_firm.system.derived.queue import queue_of
from fusesoc_firm.system.derived.services import services_of
from fusesoc_firm.system.derived.status import has_time_stamps, status_of
from fusesoc_firm.system.derived.timing import clock_frequency, scheduling_of
from fusesoc_firm.system.derived.topics import TopicUse, check_topic_name, check_topics
from fusesoc_firm.system.derived.tree import tree_of
from fusesoc_firm.system.derived.watchdog import watchdog_of
from fusesoc_firm.system.written.sources import declares_width
from fusesoc_firm.system.written.specification import (
    CONVERTER,
    CONVERTER_KEYS,
    PUBLISHER,
    SOURCE_SUFFIXES,
    SUBSCRIBER,
    TOPIC_MODES,
    Accelerator,
    Block,
    InterfaceType,
    OutputType,
    Specification,
)
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, nearest
from fusesoc_firm.text.files import is_file
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_sections import keys_of, keys_only_of
from fusesoc_firm.text.yaml_text import Text

Libraries = Mapping[Middleware, MessageLibrary]
_KINDS_OF_BLOCKS = "a block is either an accelerator with 'type' or a converter with 'middleware', 'mode' and 'message'"


def derive(
    specification: Specification,
    folder: Path,
    libraries: Libraries,
    faults: Diagnostics,
    *,
    needs_sources: bool = True,
) -> DerivedSystem:
    """Derive the system of a specification in `folder`; unless `needs_sources` is set, source files may be missing.

    `with_services` and `with_actions` have replaced the servers and clients of the specification.
    Raise `InputError` with the faults found here and the faults already in `faults`.
    """
    analysis = _Analysis(specification, folder, libraries, faults, needs_sources)
    analysis.check_names()
    analysis.resolve_accelerators()
    analysis.resolve_blocks()
    clock = clock_frequency(specification.project, faults)
    clocks = clocks_of(specification, clock, faults)
    names = message_names(analysis.blocks, analysis.inputs, analysis.outputs)
    check_topics(analysis.topic_uses(names), faults)
    parts = analysis.parts(analysis.wiring().connect(), names)
    services = services_of(analysis.blocks, parts, faults)
    actions = actions_of(analysis.blocks, parts, faults)
    connections = with_lengths(parts.connections, parts.outputs, parts.blocks, faults)
    faults.raise_if_any()
    parts.check(analysis.blocks, specification.project.id_bytes, faults)
    buffers = publisher_buffers(connections, parts.of_mode(PUBLISHER), faults)
    faults.raise_if_any()
    project = specification.project
    publishers = tuple(
        replace(item, buffer=buffers.get(item.block, 0)) for item in _converters(parts, PUBLISHER, connections)
    )
    subscribers = with_longest_payloads(_converters(parts, SUBSCRIBER, connections), project, parts.blocks, faults)
    subscribers = tuple(
        replace(item, queue=queue_of(parts.blocks[item.block], item, project, faults)) for item in subscribers
    )
    publishers = with_longest_sent(publishers, subscribers, project, parts.blocks, faults)
    scheduling = scheduling_of(project, clock, parts.blocks, publishers, faults)
    link = link_of(project, clock, scheduling, subscribers, faults)
    network = network_of(specification, scheduling, parts.software, (subscribers, publishers), faults)
    tree = tree_of(project, scheduling, link, faults)
    faults.raise_if_any()
    system = DerivedSystem(
        name=identifier(project.name).lower(),
        fpga_part=str(project.fpga_part or ""),
        width=project.width,
        scheduling=scheduling,
        subscribers=subscribers,
        publishers=publishers,
        accelerators=analysis.instances(is_software=False),
        connections=connections,
        clock=clock,
        clocks=clocks,
        software=parts.software,
        names=names,
        link=link,
        status=status_of(project, link, len(subscribers), len(publishers), faults),
        has_time_stamps=has_time_stamps(project, faults),
        tree=tree,
        pipeline=None if project.pipeline is None else str(project.pipeline),
        network=network,
        watchdog=watchdog_of(project, scheduling, publishers, faults),
        services=services,
        actions=actions,
    )
    check_entities(system, parts.blocks, faults)
    faults.raise_if_any()
    return with_lateness_buffers(system, project, faults)


def source_files(specification: Specification, folder: Path) -> list[Path]:
    """Return the source files of all accelerators, in the order of the specification."""
    return [folder / source for accelerator in specification.accelerators for source in accelerator.sources]


@dataclass
class _Analysis:
    """The state of an analysis: the types and blocks resolved so far.

    `blocks` are the possible ends of connections: the first block of each name. If the messages of a block are unknown
    because of a fault, the inputs and outputs of this block are missing from the tables.
    """

    specification: Specification
    folder: Path
    libraries: Libraries
    faults: Diagnostics
    needs_sources: bool
    frames: dict[tuple[Middleware, MessageName], Frame] = field(default_factory=dict)
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
        for name in filter(None, names):
            # VHDL ignores case, so names that differ only in case would collide.
            twin = seen.setdefault(identifier(name).lower(), name)
            if twin is not name and twin == name:
                self.faults.error(f"duplicate {what} '{name}'; the first is at {twin.source}", name.source)
            elif twin is not name:
                self.faults.error(
                    f"{what} '{name}' has the same name in VHDL as '{twin}' at {twin.source}",
                    name.source,
                    "VHDL ignores case, and allows only letters, digits and single '_' between them",
                )

    # --- types -------------------------------------------------------------------------------------------------

    def resolve_accelerators(self) -> None:
        for accelerator in self.specification.accelerators:
            self._check_sources(accelerator)
            inputs = self._sides("in", accelerator.interface.input)
            outputs = self._sides("out", accelerator.interface.output)
            if inputs is None or outputs is None or not accelerator.interface.is_sound or not accelerator.name:
                continue
            sources = [self.folder / source for source in accelerator.sources]
            width = accelerator.width or self.specification.project.width
            found = AcceleratorType(accelerator, inputs, outputs, width, declares_width(accelerator, sources))
            found = with_bypass(found, self.faults)
            self.types.setdefault(accelerator.name, found)
            if accelerator.type == "HLS" and accelerator.sources:
                check_kernel(found.own, self.faults)
            if accelerator.is_software and accelerator.sources:
                check_function(found, sources[0], self.faults)
            check_pins(found, self.faults)

    def _check_sources(self, accelerator: Accelerator) -> None:
        legal = SOURCE_SUFFIXES.get(accelerator.type, ())
        for source in accelerator.sources:
            if self.needs_sources and not is_file(self.folder / source):
                hint = "paths are relative to the specification; 'firm system skeleton' writes a first version"
                self.faults.error(f"there is no source file '{source}'", source.source, hint)
            elif legal and PurePosixPath(source).suffix.lower() not in legal:
                hint = f"legal here: {', '.join(legal)}"
                self.faults.error(f"'{source}' is not a source file for type {accelerator.type}", source.source, hint)

    def _sides(self, word: str, interface: Sequence[InterfaceType]) -> tuple[MessageSide, ...] | None:
        """Return an interface's message sides, numbered if there are several, or None if a message has a fault."""
        frames = [self._frame(item.middleware, item.message, item.include, item.exclude) for item in interface]
        prefixes = [f"{word}_"] if len(frames) == 1 else [f"{word}{number}_" for number in range(len(frames))]
        sides = [
            MessageSide(prefix, frame, self._length(item, frame))
            for prefix, frame, item in zip(prefixes, frames, interface, strict=True)
            if frame
        ]
        return tuple(sides) if len(sides) == len(frames) else None

    def _length(self, item: InterfaceType, frame: Frame) -> PayloadLength | None:
        return output_length(item, frame, self.faults) if isinstance(item, OutputType) else None

    def _frame(self, middleware: Text, message: Text, include: Sequence[Text], exclude: Sequence[Text]) -> Frame | None:
        """Return the frame of a message's fields; if it has a fault, note it at the message's name and return None."""
        if not middleware or not message:
            return None
        library = self.libraries[MIDDLEWARES[middleware]]
        try:
            name = parse_name(message)
            library.get(name, message.source)
            key = library.ros, name
            if key not in self.frames:
                self.frames[key] = frame_of(name, library.closure(name))
            frame = self.frames[key]
            return select(frame, places(include), places(exclude)) if include or exclude else frame
        except InputError as error:
            self.faults.take(error, message.source)
            return None

    # --- blocks ------------------------------------------------------------------------------------------------

    def resolve_blocks(self) -> None:
        for block in self.specification.blocks:
            if not block.name or self.blocks.setdefault(block.name, block) is not block:
                continue
            if block.type is not None:
                self._resolve_accelerator_block(block)
            else:
                self._resolve_converter(block)
        # With software, the hardware part is not known yet.
        if not any(accelerator.is_software for accelerator in self.specification.accelerators):
            for mode in TOPIC_MODES:
                self._check_count(mode)

    def _resolve_accelerator_block(self, block: Block) -> None:
        assert block.type is not None
        names = [accelerator.name for accelerator in self.specification.accelerators]
        # The block's accelerator may be unreadable.
        are_known = all(names) and (names or self.specification.is_sound) and not self.specification.is_cut
        if are_known and block.type not in names:
            hint = nearest(block.type, names) or "add this accelerator to 'accelerators'"
            self.faults.error(f"unknown accelerator '{block.type}'", block.type.source, hint)
        for key, (field_name, entry) in keys_of(Block).items():
            if entry.only_of == CONVERTER and (value := getattr(block, field_name)):
                source = value[0].source if isinstance(value, tuple) else block.place(field_name)
                message = f"'{key}' is legal only for converters, but '{block.name}' has a 'type'"
                self.faults.error(message, source, _KINDS_OF_BLOCKS)
        self._check_no_keys_of(SUBSCRIBER, block)
        if not any(item.is_software for item in self.specification.accelerators if item.name == block.type):
            self._check_no_keys_of(PUBLISHER, block)
        if found := self.types.get(block.type):
            self.inputs[block.name] = found.inputs
            self.outputs[block.name] = found.outputs

    def _resolve_converter(self, block: Block) -> None:
        missing = [key for key in CONVERTER_KEYS if getattr(block, key) is None]
        if missing:
            # The faults in an unreadable block are already noted.
            if block.is_sound:
                words = ", ".join(f"'{key}'" for key in missing)
                self.faults.error(f"block '{block.name}' needs {words}", block.name.source, _KINDS_OF_BLOCKS)
            return
        assert block.middleware is not None and block.message is not None
        if block.topic is not None and block.service_block is None:
            check_topic_name(block.topic, self.faults)
        check_quality(block, self.faults)
        frame = self._frame(block.middleware, block.message, block.include, block.exclude)
        if frame is not None:
            is_subscriber = block.mode == "subscriber"
            self._check_no_keys_of(PUBLISHER if is_subscriber else SUBSCRIBER, block)
            self.inputs[block.name] = () if is_subscriber else (MessageSide("", frame),)
            self.outputs[block.name] = (MessageSide("", frame),) if is_subscriber else ()

    def _check_no_keys_of(self, mode: str, block: Block) -> None:
        for key in keys_only_of(Block, mode):
            if getattr(block, key) is not None:
                message = f"'{key}' is legal only for {mode}s, but '{block.name}' is not a {mode}"
                self.faults.error(message, block.place(key), f"a {mode} is a block with 'mode: {mode}'")

    def _check_count(self, mode: str) -> None:
        blocks = self.specification.blocks
        found = [block for block in blocks if block.type is None and block.mode == mode]
        are_known = blocks and all(block.is_sound and (block.type or block.mode) for block in blocks)
        if not found and are_known:
            message = f"the system has no {mode}, but needs at least one"
            self.faults.error(message, blocks[0].name.source, f"a {mode} is a block with 'mode: {mode}'")
        else:
            check_count("system", mode, found, self.specification.project.id_bytes, self.faults)

    def topic_uses(self, names: Mapping[End, str]) -> Iterator[TopicUse]:
        """Yield the topics of all converters and of software in other programs; `names` are from `message_names`."""
        for name, block in self.blocks.items():
            is_elsewhere = block.type in self.types and self.types[block.type].is_elsewhere
            if (block.type is not None and not is_elsewhere) or block.service_block is not None:
                continue
            for sides, is_published in ((self.inputs, True), (self.outputs, False)):
                for side in sides.get(name, ()):
                    called = names[End(name, side.prefix)] if is_elsewhere else str(name)
                    topic = Topic(called, side.frame, given_name=str(block.topic or ""))
                    yield TopicUse(topic, is_published, block.topic.source if block.topic else block.name.source)

    def wiring(self) -> Wiring:
        """Return the wiring of the resolved blocks."""
        blocks = self.specification.blocks
        lost = [block for block in blocks if self.blocks.get(block.name) is not block]
        unsound = [block for block in self.blocks.values() if not block.is_sound]
        return Wiring(
            self.blocks,
            self.inputs,
            self.outputs,
            self.faults,
            has_more_blocks=self.specification.is_cut or not all(block.name for block in blocks),
            has_more_messages=self.specification.is_cut
            or bool(lost)
            or any(block.name not in self.outputs for block in unsound),
            strays={side.kind for block in unsound for side in self.outputs.get(block.name, ())},
            ambiguous={block.name for block in lost},
        )

    def parts(self, connections: Sequence[Connection], names: Mapping[End, str]) -> Parts:
        """Return the system, partitioned into hardware and software."""
        software = self.instances(is_software=True)
        return Parting(self.blocks, software, self.inputs, self.outputs, connections, names).parts()

    def instances(self, *, is_software: bool) -> tuple[AcceleratorBlock, ...]:
        """Return the accelerators' blocks with known types, in hardware or in software."""
        found = [
            AcceleratorBlock(str(block.name), self.types[block.type], str(block.clock or ""))
            for block in self.blocks.values()
            if block.type in self.types
        ]
        return tuple(block for block in found if block.type.accelerator.is_software is is_software)


def _converters(parts: Parts, mode: str, connections: Iterable[Connection]) -> tuple[Converter, ...]:
    """Return the converters with the fields that connections carry; unconnected fields need no ports."""
    names: dict[str, set[Names]] = {}
    for connection in connections:
        for sink, frame in zip(connection.sinks, connection.frames, strict=True):
            end = connection.source if mode == SUBSCRIBER else sink
            names.setdefault(end.block, set()).update(names_in_use(frame))
    sides = parts.outputs if mode == SUBSCRIBER else parts.inputs
    suffixes: dict[Frame, str] = {}
    found = []
    for number, name in enumerate(parts.of_mode(mode)):
        whole = select(sides[name][0].frame)
        frame = with_names_in_use(whole, names[name])
        # Converters with the same fields share the entity of the first one.
        suffix = "" if frame == whole else suffixes.setdefault(frame, f"_{identifier(name).lower()}")
        block = parts.blocks[name]
        service = str(block.service_block.name) if block.service_block else ""
        topic: dict[str, Any] = {"service": service, "given_name": str(block.topic or ""), "quality": quality_of(block)}
        found.append(Converter(str(name), frame, number, suffix, software=parts.crossings.get(name), **topic))
    return tuple(found)
