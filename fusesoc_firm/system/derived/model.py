"""The derived System: every converter, accelerator, id and connection, with nothing left to decide.

It is what `analysis` makes of a specification and what all templates, and `firm system show`, are filled from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.system.written.specification import Accelerator
from fusesoc_firm.text.naming import identifier


def absolute_name(topic: str) -> str:
    """A topic's name in the root namespace."""
    return topic if topic.startswith("/") else f"/{topic}"


@dataclass(frozen=True)
class Topic:
    """A message between the system and others; unless it has a `given_name`, its topic is called as the block."""

    block: str
    frame: Frame
    given_name: str = field(default="", kw_only=True)

    @property
    def ros_name(self) -> str:
        """The topic as a node calls it: without a leading `/` it is relative to the node's namespace."""
        return self.given_name or identifier(self.block, avoid=())

    @property
    def name(self) -> str:
        """The topic of a node without a namespace, and so in bags."""
        return absolute_name(self.ros_name)


@dataclass(frozen=True)
class End:
    """One end of a connection: a block, and the prefix of the message there (empty at a converter)."""

    block: str
    prefix: str = ""


@dataclass(frozen=True)
class Converter(Topic):
    """An instance of a converter; `id` counts subscribers and publishers apart, from 0, in the order of the blocks.

    The fields that are used in `frame` are its ports. One without all of them has an entity with a `suffix`. `buffer`
    are the bytes of the longest payload of a publisher that stores its frames whole, 0 of any other. Those that the
    specification does not have come last: each stands between hardware and a message side of a block in `software`.
    """

    id: int
    suffix: str = ""
    buffer: int = 0
    software: End | None = None


class LengthSource(Enum):
    """Where the length of a payload of variable size comes from."""

    COMPUTED = "computed"
    GIVEN = "given"
    BUFFERED = "buffered"


@dataclass(frozen=True)
class PayloadLength:
    """How a publisher learns the length of its payloads, and why so.

    `suffix` is that of the entity that computes it.
    """

    source: LengthSource
    reason: str
    suffix: str = ""


@dataclass(frozen=True)
class MessageSide:
    """A message at a block: its ports begin with `prefix` (`in_`, `out1_`, nothing at a converter).

    An accelerator's output of variable size has a `length`.
    """

    prefix: str
    frame: Frame
    length: PayloadLength | None = None

    @property
    def kind(self) -> tuple[MessageName, Middleware]:
        """What connects two sides: the message, whichever fields of it they use."""
        return self.frame.message, self.frame.ros


@dataclass(frozen=True)
class AcceleratorType:
    """An accelerator with its messages resolved; its streams have `width` bits, which it is told if `has_width`."""

    accelerator: Accelerator
    inputs: tuple[MessageSide, ...]
    outputs: tuple[MessageSide, ...]
    width: int
    has_width: bool = False

    @property
    def entity(self) -> str:
        """The unit that the top level instantiates: the user's entity or module, or the wrapper of a C++ function."""
        name = identifier(self.accelerator.name)
        return f"{name}_wrapper" if self.accelerator.type == "HLS" else name

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is software that others run, which is reached by topics."""
        return self.accelerator.is_software and not self.accelerator.sources

    @property
    def is_component(self) -> bool:
        """Whether the top level declares it, since it is no entity: a module in Verilog."""
        return self.accelerator.type == "Verilog"


@dataclass(frozen=True)
class AcceleratorBlock:
    """An instance of an accelerator; `clock` is the name of the one it runs at, empty for that of the system."""

    block: str
    type: AcceleratorType
    clock: str = ""


@dataclass(frozen=True)
class Connection:
    """A message's way from where it arises to all who take it, in the order of the specification.

    `frames` is the message for each sink: the fields that are used in it go there from here. A message of variable size
    is the same for all sinks, and has a `length`.
    """

    source: End
    sinks: tuple[End, ...]
    frames: tuple[Frame, ...]
    length: PayloadLength | None = None

    @property
    def frame(self) -> Frame:
        """The message, as the first sink has it."""
        return self.frames[0]


@dataclass(frozen=True)
class PublisherTimes:
    """What is known of a publisher's times, in cycles.

    From message to message, to send a frame, and from the request to send it until it is to be sent.
    """

    period: int | None
    transfer_time: int | None
    deadline: int | None


@dataclass(frozen=True)
class Scheduling:
    """Who may send to the host next: a policy, with the times of the publishers in the order of their ids.

    A preemptive policy interrupts a frame after `shortest_run` beats at the soonest. Its times have `time_bits`. If the
    policy was not given but chosen, `reasons` say why so.
    """

    policy: str
    times: tuple[PublisherTimes, ...]
    is_preemptive: bool
    shortest_run: int
    time_bits: int
    reasons: tuple[str, ...] = ()


class LinkKind(Enum):
    """What carries bytes between the host and a board without a processor."""

    UART = "uart"
    SPI = "spi"


@dataclass(frozen=True)
class Link:
    """The link between the host and the system, and the frequency of clk where it is needed or known."""

    kind: LinkKind
    clock_hz: int


@dataclass(frozen=True)
class Software:
    """The host's part of a system: `blocks` in software, and all connections that a message takes on the host.

    It comes from one of the `subscribers`, from the hardware's publisher that stands for a block's input, or from a
    block; and goes to a block, to the hardware's subscriber that stands for a block's output, or to one of the
    `publishers`. A subscriber may be in hardware as well; a publisher is only here.
    """

    blocks: tuple[AcceleratorBlock, ...] = ()
    subscribers: tuple[Topic, ...] = ()
    publishers: tuple[Topic, ...] = ()
    connections: tuple[Connection, ...] = ()

    @property
    def types(self) -> tuple[AcceleratorType, ...]:
        """Every type that has an instance, once."""
        return tuple(dict.fromkeys(block.type for block in self.blocks))


@dataclass(frozen=True)
class Clock:
    """A clock beside that of the system: its `frequency` in Hz, and `ratio` of its edges to those of clk."""

    name: str
    frequency: Fraction
    ratio: Fraction

    @property
    def port(self) -> str:
        """The clock at the top level."""
        return f"clk_{self.name}"

    @property
    def reset(self) -> str:
        """The reset of its domain, synchronous and low."""
        return f"rst_{self.name}_n"


@dataclass(frozen=True)
class DerivedSystem:
    """The whole system; `name` is an identifier, `width` the streams' bits, `clocks` those beside clk.

    `clock` is the frequency of clk in Hz, if it is given.

    Without a `link` its streams are ports. Converters, accelerators and connections are those of the hardware. `names`
    are what messages at accelerators are called outside of these: `<block>_in`, `<block>_out1` and so on.
    """

    name: str
    fpga_part: str
    width: int
    scheduling: Scheduling
    subscribers: tuple[Converter, ...]
    publishers: tuple[Converter, ...]
    accelerators: tuple[AcceleratorBlock, ...]
    connections: tuple[Connection, ...]
    software: Software
    names: Mapping[End, str]
    link: Link | None = None
    clock: Fraction | None = None
    clocks: tuple[Clock, ...] = ()

    def clock_of(self, block: str) -> Clock | None:
        """The clock that a block runs at; None for that of the system."""
        name = self._accelerators[block].clock if block in self._accelerators else ""
        return next((clock for clock in self.clocks if clock.name == name), None)

    def width_of(self, block: str) -> int:
        """The bits of a block's streams."""
        return self._accelerators[block].type.width if block in self._accelerators else self.width

    @cached_property
    def _accelerators(self) -> dict[str, AcceleratorBlock]:
        return {item.block: item for item in self.accelerators}

    @property
    def entity(self) -> str:
        """The top level's name."""
        return f"{self.name}_system"

    @property
    def error_blocks(self) -> tuple[str, ...]:
        """The converters that report errors, in the order of `frame_error`: publishers of variable size come last."""
        publishers = (item.block for item in self.publishers if not item.frame.is_fixed_size)
        return (*(item.block for item in self.subscribers), *publishers)

    @property
    def computed_lengths(self) -> dict[Frame, str]:
        """Every frame whose payload's length is computed, with the suffix of the entity that does so."""
        return {
            item.frame: item.length.suffix
            for item in self.connections
            if item.length and item.length.source is LengthSource.COMPUTED
        }

    def length_to(self, publisher: Converter) -> PayloadLength | None:
        """How a publisher learns the length of its payloads; None if it is always the same."""
        return next(item.length for item in self.connections if End(publisher.block) in item.sinks)

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Every frame of a converter, once."""
        return tuple(dict.fromkeys(converter.frame for converter in (*self.subscribers, *self.publishers)))

    @property
    def kernels(self) -> tuple[AcceleratorType, ...]:
        """The types in C++, of which an HLS tool makes hardware."""
        return tuple(type_ for type_ in self.accelerator_types if type_.accelerator.type == "HLS")

    @property
    def accelerator_types(self) -> tuple[AcceleratorType, ...]:
        """Every type that has an instance, once."""
        return tuple(dict.fromkeys(block.type for block in self.accelerators))
