"""The partition of a system into software and hardware, and the messages between the two.

A specification defines the connections; the type of an accelerator decides between hardware and software. A message
from hardware to a block in software leaves the hardware through an added publisher. A message from a block in software
to hardware enters the hardware through an added subscriber. All other messages of software stay on the host. A
subscriber that feeds only software, or a publisher that only software feeds, is therefore not a converter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import names_in_use, with_names_in_use
from fusesoc_firm.system.derived.ids import check_count
from fusesoc_firm.system.derived.model import AcceleratorBlock, Connection, End, MessageSide, Software, Topic
from fusesoc_firm.system.derived.quality import quality_of
from fusesoc_firm.system.written.specification import PUBLISHER, SUBSCRIBER, Block
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import distinct_identifiers, identifier
from fusesoc_firm.text.yaml_sections import keys_only_of
from fusesoc_firm.text.yaml_text import Text

Sides = Mapping[str, tuple[MessageSide, ...]]


@dataclass(frozen=True)
class Parts:
    """A partitioned system: the `software`, and the hardware as blocks by name, message sides and connections.

    `crossings` maps the name of each added converter to the message side in software that the converter represents.
    Added converters come last, in the order of the specification's blocks.
    """

    blocks: Mapping[str, Block]
    inputs: Sides
    outputs: Sides
    connections: tuple[Connection, ...]
    crossings: Mapping[str, End]
    software: Software

    def of_mode(self, mode: str) -> dict[str, Block]:
        """Return the hardware's subscribers or publishers."""
        return {name: block for name, block in self.blocks.items() if block.type is None and block.mode == mode}

    def check(self, blocks: Mapping[str, Block], id_bytes: int, faults: Diagnostics) -> None:
        """Note the faults in the hardware of a specification with these `blocks`."""
        first = next(iter(blocks.values())).name.source
        if not self.blocks:
            hint = "the hardware needs an accelerator, or a message that goes from a subscriber to a publisher"
            faults.error("all accelerators are software, so nothing is left for hardware", first, hint)
            return
        for mode in (SUBSCRIBER, PUBLISHER):
            found = [*self.of_mode(mode).values()]
            if not found:
                hint = f"a {mode} is a block with 'mode: {mode}', or a message between hardware and software"
                faults.error(f"the hardware has no {mode}, but needs at least one", first, hint)
            else:
                check_count("hardware", mode, found, id_bytes, faults)
        taking = {end.block for name, end in self.crossings.items() if self.blocks[name].mode == PUBLISHER}
        for block in self.software.blocks:
            if block.block not in taking:
                _check_no_publisher_keys(blocks[block.block], faults)


def message_names(blocks: Mapping[str, Block], inputs: Sides, outputs: Sides) -> dict[End, str]:
    """Return a name for each message side of each accelerator, `<block>_in`, that differs from all names of blocks."""
    ends = [
        End(name, side.prefix)
        for name, block in blocks.items()
        if block.type is not None
        for side in (*inputs.get(name, ()), *outputs.get(name, ()))
    ]
    taken = [identifier(name) for name in blocks]
    return dict(zip(ends, distinct_identifiers([(end.block, end.prefix) for end in ends], taken), strict=True))


@dataclass(frozen=True)
class Parting:
    """A system before partitioning, with its blocks in `software`; `names` is the result of `message_names`."""

    blocks: Mapping[str, Block]
    software: Sequence[AcceleratorBlock]
    inputs: Sides
    outputs: Sides
    connections: Sequence[Connection]
    names: Mapping[End, str]

    def parts(self) -> Parts:
        """Return the hardware and the software, each with its connections."""
        hardware = tuple(self._hardware_connections())
        host = tuple(self._host_connections())
        ends = {end.block for connection in hardware for end in (connection.source, *connection.sinks)}
        blocks = {name: block for name, block in self.blocks.items() if self._is_hardware(name) or name in ends}
        entering, leaving = [*self._entering()], [*self._leaving()]
        return Parts(
            blocks | {self.names[end]: self._converter(end, side) for end, side in (*entering, *leaving)},
            {**self.inputs, **{self.names[end]: (_bare(side),) for end, side in leaving}},
            {**self.outputs, **{self.names[end]: (_bare(side),) for end, side in entering}},
            hardware,
            {self.names[end]: end for end, _ in (*entering, *leaving)},
            self._software(host),
        )

    def _software(self, connections: tuple[Connection, ...]) -> Software:
        """Return the host's part of the system, whose publishers use only the driven fields."""
        sources = {connection.source.block for connection in connections}
        subscribers = [
            self._topic(name, self.outputs[name][0].frame) for name in self._converters(SUBSCRIBER) if name in sources
        ]
        publishers = []
        for name in self._converters(PUBLISHER):
            given = [
                frame
                for connection in connections
                for end, frame in zip(connection.sinks, connection.frames, strict=True)
                if end.block == name
            ]
            if given:
                publishers.append(self._topic(name, _joined(given)))
        return Software(tuple(self.software), tuple(subscribers), tuple(publishers), connections)

    def _topic(self, name: str, frame: Frame) -> Topic:
        """Return the topic of the converter with this name in the specification."""
        block = self.blocks[name]
        return Topic(name, frame, given_name=str(block.topic or ""), quality=quality_of(block))

    # --- locations of messages -------------------------------------------------------------------------------------

    @cached_property
    def _in_software(self) -> frozenset[str]:
        return frozenset(block.block for block in self.software)

    def _is_hardware(self, name: str) -> bool:
        """Return whether a block is an accelerator in hardware."""
        return self.blocks[name].type is not None and name not in self._in_software

    def _converters(self, mode: str) -> Iterator[str]:
        return (name for name, block in self.blocks.items() if block.type is None and block.mode == mode)

    @cached_property
    def _hardware_sinks(self) -> frozenset[End]:
        """The ends whose whole message is in hardware, even if the host sends part of the message.

        These ends are the accelerators in hardware, all sinks of accelerators in hardware, and the publishers that
        subscribers drive.
        """
        return frozenset(
            sink
            for connection in self.connections
            for sink in connection.sinks
            if self._is_hardware(sink.block)
            or self._is_hardware(connection.source.block)
            or not {sink.block, connection.source.block} & self._in_software
        )

    def _entering(self) -> Iterator[tuple[End, MessageSide]]:
        """Return the outputs in software that feed hardware."""
        sources = {connection.source for connection in self.connections if any(self._in_hardware(connection))}
        return self._sides(self.outputs, sources)

    def _leaving(self) -> Iterator[tuple[End, MessageSide]]:
        """Return the inputs in software that are driven by hardware."""
        return self._sides(self.inputs, self._hardware_sinks)

    def _sides(self, sides: Sides, wanted: Iterable[End]) -> Iterator[tuple[End, MessageSide]]:
        found = frozenset(wanted)
        for block in self.software:
            for side in sides[block.block]:
                if (end := End(block.block, side.prefix)) in found:
                    yield end, side

    # --- connections -----------------------------------------------------------------------------------------------

    def _in_hardware(self, connection: Connection) -> Iterator[tuple[End, Frame]]:
        """Return the sinks in hardware, with their messages."""
        return (pair for pair in _pairs(connection) if pair[0] in self._hardware_sinks)

    def _hardware_connections(self) -> Iterator[Connection]:
        for connection in self.connections:
            pairs = [(self._crossing(sink), frame) for sink, frame in self._in_hardware(connection)]
            if pairs:
                yield _connection(self._crossing(connection.source), pairs)

    def _host_connections(self) -> Iterator[Connection]:
        for end, side in self._leaving():
            yield _connection(self._crossing(end), [(end, side.frame)])
        for connection in self.connections:
            pairs = [pair for pair in _pairs(connection) if pair[0] not in self._hardware_sinks]
            entering = [frame for _, frame in self._in_hardware(connection)]
            if entering and connection.source.block in self._in_software:
                pairs.insert(0, (self._crossing(connection.source), _joined(entering)))
            if pairs:
                yield _connection(connection.source, pairs)

    def _crossing(self, end: End) -> End:
        """Return the end in hardware that represents an end in software; any other end is returned unchanged."""
        return End(self.names[end]) if end.block in self._in_software else end

    def _converter(self, end: End, side: MessageSide) -> Block:
        """Return the block of the converter that represents a side; copy the block's publisher keys to a publisher."""
        block = self.blocks[end.block]
        made = Block(name=Text(self.names[end], block.name.source), source=block.source, places=block.places)
        if side in self.outputs[end.block]:
            return replace(made, mode=Text(SUBSCRIBER))
        keys = {key: getattr(block, key) for key in keys_only_of(Block, PUBLISHER)}
        leaving = [side.frame for other, side in self._leaving() if other.block == end.block]
        if side.frame.is_fixed_size and not all(frame.is_fixed_size for frame in leaving):
            # Only a message of variable size uses the buffer.
            del keys["buffer"]
        return replace(made, mode=Text(PUBLISHER), **keys)


def _check_no_publisher_keys(block: Block, faults: Diagnostics) -> None:
    for key in keys_only_of(Block, PUBLISHER):
        if getattr(block, key) is not None:
            message = f"'{key}' is legal only for publishers, but no message goes from hardware to '{block.name}'"
            hint = "the key describes a message from hardware to a block in software"
            faults.error(message, block.place(key), hint)


def _bare(side: MessageSide) -> MessageSide:
    """Return the side without a prefix, as at a converter."""
    return MessageSide("", side.frame)


def _pairs(connection: Connection) -> Iterator[tuple[End, Frame]]:
    return zip(connection.sinks, connection.frames, strict=True)


def _connection(source: End, pairs: Sequence[tuple[End, Frame]]) -> Connection:
    return Connection(source, tuple(end for end, _ in pairs), tuple(frame for _, frame in pairs))


def _joined(frames: Sequence[Frame]) -> Frame:
    """Return a message with all fields that at least one of several frames uses."""
    names = reduce(frozenset.union, (names_in_use(frame) for frame in frames))
    return with_names_in_use(frames[0], names)
