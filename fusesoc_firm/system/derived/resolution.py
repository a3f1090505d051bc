"""Specification -> messages: the types of accelerators, and the message sides of all blocks.

Faults are reported at their places in the specification. If the messages of a block are unknown because of a fault, the
block has no message sides, and later checks ignore it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import select
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import MIDDLEWARES, Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.system.derived.bypass import with_bypass
from fusesoc_firm.system.derived.connections import Wiring, places
from fusesoc_firm.system.derived.cpp_function import check_kernel, check_varying
from fusesoc_firm.system.derived.ids import check_count
from fusesoc_firm.system.derived.length import output_length
from fusesoc_firm.system.derived.model import AcceleratorBlock, AcceleratorType, End, MessageSide, PayloadLength, Topic
from fusesoc_firm.system.derived.parameters import check_parameters, parameters_of
from fusesoc_firm.system.derived.pins import check_pins
from fusesoc_firm.system.derived.python_function import check_function
from fusesoc_firm.system.derived.quality import check_quality
from fusesoc_firm.system.derived.topics import TopicUse, check_topic_name
from fusesoc_firm.system.written.sources import declares_width
from fusesoc_firm.system.written.specification import (
    BUDGETS,
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
    Resources,
    Specification,
)
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, nearest
from fusesoc_firm.text.files import is_file
from fusesoc_firm.text.naming import identifier
from fusesoc_firm.text.yaml_sections import keys_of, keys_only_of
from fusesoc_firm.text.yaml_text import Text

Libraries = Mapping[Middleware, MessageLibrary]
# The most operators of a kind in an accelerator.
MOST_OPERATORS = 16
_KINDS_OF_BLOCKS = "a block is either an accelerator with 'type' or a converter with 'middleware', 'mode' and 'message'"


def resolve(
    specification: Specification, folder: Path, libraries: Libraries, faults: Diagnostics, *, needs_sources: bool
) -> Resolved:
    """Resolve the messages of a specification in `folder`; unless `needs_sources` is set, source files may be missing.

    Note all faults in names, sources and messages.
    """
    resolver = _Resolver(specification, folder, libraries, faults, needs_sources)
    resolver.check_names()
    resolver.resolve_accelerators()
    resolver.resolve_blocks()
    return Resolved(specification, resolver.types, resolver.blocks, resolver.inputs, resolver.outputs)


@dataclass(frozen=True)
class Resolved:
    """The accelerators' types and the blocks of a specification, by name, with the known message sides of each block.

    `blocks` are the possible ends of connections: the first block of each name.
    """

    specification: Specification
    types: Mapping[str, AcceleratorType]
    blocks: Mapping[str, Block]
    inputs: Mapping[str, tuple[MessageSide, ...]]
    outputs: Mapping[str, tuple[MessageSide, ...]]

    def topic_uses(self, names: Mapping[End, str]) -> Iterator[TopicUse]:
        """Yield the topics of all converters and of software in other programs; `names` are from `message_names`."""
        for name, block in self.blocks.items():
            type_ = self._type_of(block)
            is_elsewhere = type_ is not None and type_.is_elsewhere
            if (block.type is not None and not is_elsewhere) or block.service_block is not None:
                continue
            for sides, is_published in ((self.inputs, True), (self.outputs, False)):
                for side in sides.get(name, ()):
                    called = names[End(name, side.prefix)] if is_elsewhere else str(name)
                    topic = Topic(called, side.frame, given_name=str(block.topic or ""))
                    yield TopicUse(topic, is_published, block.topic.source if block.topic else block.name.source)

    def wiring(self, faults: Diagnostics) -> Wiring:
        """Return the wiring of the resolved blocks."""
        blocks = self.specification.blocks
        lost = [block for block in blocks if self.blocks.get(block.name) is not block]
        unsound = [block for block in self.blocks.values() if not block.is_sound]
        return Wiring(
            self.blocks,
            self.inputs,
            self.outputs,
            faults,
            has_more_blocks=self.specification.is_cut or not all(block.name for block in blocks),
            has_more_messages=self.specification.is_cut
            or bool(lost)
            or any(block.name not in self.outputs for block in unsound),
            strays={side.kind for block in unsound for side in self.outputs.get(block.name, ())},
            ambiguous={block.name for block in lost},
            software=frozenset(block.block for block in self.instances(is_software=True)),
        )

    def instances(self, *, is_software: bool) -> tuple[AcceleratorBlock, ...]:
        """Return the accelerators' blocks with known types, in hardware or in software."""
        found = [
            AcceleratorBlock(str(block.name), type_, str(block.clock or ""))
            for block in self.blocks.values()
            if (type_ := self._type_of(block))
        ]
        return tuple(block for block in found if block.type.accelerator.is_software is is_software)

    def _type_of(self, block: Block) -> AcceleratorType | None:
        return self.types.get(block.type) if block.type else None


@dataclass
class _Resolver:
    """The types and blocks that have been resolved so far."""

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
            self._check_pace(accelerator)
            self._check_compiled(accelerator)
            inputs = self._sides("in", accelerator.interface.input)
            outputs = self._sides("out", accelerator.interface.output)
            if inputs is None or outputs is None or not accelerator.interface.is_sound or not accelerator.name:
                continue
            sources = [self.folder / source for source in accelerator.sources]
            width = accelerator.width or self.specification.project.width
            found = AcceleratorType(
                accelerator,
                inputs,
                outputs,
                width,
                declares_width(accelerator, sources),
                parameters=parameters_of(accelerator, self.specification.project, self.faults),
            )
            found = with_bypass(found, self.faults)
            self.types.setdefault(accelerator.name, found)
            if accelerator.type == "HLS" and accelerator.sources:
                check_kernel(found.own, self.faults)
            if (accelerator.is_software or accelerator.is_compiled) and accelerator.sources:
                check_function(found, sources[0], self.faults)
            if accelerator.is_compiled:
                check_varying(found.own, self.faults)
            check_pins(found, self.faults)
            check_parameters(found, self.faults)

    def _check_sources(self, accelerator: Accelerator) -> None:
        legal = SOURCE_SUFFIXES.get(accelerator.type, ())
        for source in accelerator.sources:
            if self.needs_sources and not is_file(self.folder / source):
                folder = self.folder / source
                hint = "paths are relative to the specification; 'firm system skeleton' writes a first version"
                if folder.is_dir():
                    hint = f"it is a folder; its files: {', '.join(sorted(item.name for item in folder.iterdir()))}"
                self.faults.error(f"there is no source file '{source}'", source.source, hint)
            elif legal and PurePosixPath(source).suffix.lower() not in legal:
                hint = f"legal here: {', '.join(legal)}"
                self.faults.error(f"'{source}' is not a source file for type {accelerator.type}", source.source, hint)
        if accelerator.standard is not None and accelerator.type and accelerator.type != "VHDL":
            message = f"'standard' is legal only for VHDL, but '{accelerator.name}' has the type {accelerator.type}"
            self.faults.error(message, accelerator.place("standard"), "remove the key")

    def _check_pace(self, accelerator: Accelerator) -> None:
        """Note promised cycles of software, and negative ones."""
        for key in ("latency", "interval"):
            cycles = getattr(accelerator, key)
            if cycles is not None and accelerator.is_software:
                message = f"'{key}' has no effect: '{accelerator.name}' is software"
                self.faults.error(message, accelerator.place(key), "remove the key")
            elif cycles is not None and cycles < 0:
                message = f"'{key}' of '{accelerator.name}' cannot be {cycles}"
                self.faults.error(message, accelerator.place(key), "legal here: 0 or more cycles")

    def _check_compiled(self, accelerator: Accelerator) -> None:
        """Note keys of compiled functions at an accelerator in another language, and illegal numbers of operators."""
        for key in ("numbers", "resources", "element"):
            if key in accelerator.places and accelerator.type and not accelerator.is_compiled:
                message = f"'{key}' is legal only for Python, but '{accelerator.name}' has the type {accelerator.type}"
                self.faults.error(message, accelerator.place(key), "remove the key")
        if resources := accelerator.resources:
            for name, (key, _) in keys_of(Resources).items():
                count = getattr(resources, key)
                least, most = (0, math.inf) if key in BUDGETS else (1, MOST_OPERATORS)
                if count is not None and not least <= count <= most:
                    message = f"'{name}' of '{accelerator.name}' cannot be {count}"
                    legal = "0 or more" if key in BUDGETS else f"1 to {MOST_OPERATORS}"
                    self.faults.error(message, resources.place(key), f"legal here: {legal}")

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
            name = library.parse(message)
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
        # With software, the hardware is not known yet.
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
