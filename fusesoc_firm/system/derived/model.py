"""The derived System: all converters, accelerators, ids and connections, with all decisions made.

`derivation` derives the System from a specification. All templates and `firm system show` use the System as data.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property
from ipaddress import IPv4Address
from itertools import chain

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.wire import WireType
from fusesoc_firm.noc import network as noc
from fusesoc_firm.system.written.specification import Accelerator
from fusesoc_firm.text.naming import identifier


def absolute_name(topic: str) -> str:
    """Return the absolute name of a topic; a relative name is resolved in the root namespace."""
    return topic if topic.startswith("/") else f"/{topic}"


@dataclass(frozen=True)
class Quality:
    """The quality of service of a topic: `depth` is the capacity of its queues in messages."""

    is_reliable: bool = True
    is_transient_local: bool = False
    depth: int = 100


@dataclass(frozen=True)
class Topic:
    """A topic that connects the system to other programs; without a `given_name`, the topic has the block's name."""

    block: str
    frame: Frame
    given_name: str = field(default="", kw_only=True)
    quality: Quality = field(default=Quality(), kw_only=True)
    # The longest payload that the hardware accepts, if it is limited.
    max_length: int | None = field(default=None, kw_only=True)

    @property
    def ros_name(self) -> str:
        """The topic's name as a node uses it: a name without a leading `/` is relative to the node's namespace."""
        return self.given_name or identifier(self.block, avoid=())

    @property
    def name(self) -> str:
        """The topic's name for a node without a namespace, and in bags."""
        return absolute_name(self.ros_name)


@dataclass(frozen=True)
class End:
    """One end of a connection: a block, and the prefix of the block's ports for the message (empty at a converter)."""

    block: str
    prefix: str = ""


class Overflow(Enum):
    """The action of a full queue on a further frame; a frame that has begun to leave is never dropped."""

    BLOCK = "block"
    DROP_NEWEST = "drop_newest"
    DROP_OLDEST = "drop_oldest"


@dataclass(frozen=True)
class Queue:
    """The queue of a subscriber: `frames` whole frames with payloads of at most `longest` bytes.

    With 0 frames, it is a watchdog: a frame that the subscriber does not accept is dropped after `limit` cycles.
    """

    frames: int
    longest: int
    overflow: Overflow = Overflow.BLOCK
    limit: int = 0


@dataclass(frozen=True)
class Converter(Topic):
    """An instance of a converter; `id` counts subscribers and publishers separately, from 0, in the blocks' order.

    With `has_default_length`, `max_length` is a default, since neither bounds nor the specification limit the payload.
    A publisher's `late_bytes` are the capacity of the FIFO for late frames (section 6.3.2). If the converter carries
    messages of a service or an action, `service` is the block of the service or action.
    """

    id: int
    suffix: str = ""
    buffer: int = 0
    has_default_length: bool = False
    software: End | None = None
    queue: Queue | None = None
    late_bytes: int = 0
    service: str = ""

    @property
    def may_pause(self) -> bool:
        """Whether the frames of this publisher may pause; a publisher of fixed size or with a buffer never pauses."""
        return not self.frame.is_fixed_size and not self.buffer


class ServiceEnd(Enum):
    """The role of a system in a service or an action: a server serves calls or goals, a client sends them."""

    SERVER = "server"
    CLIENT = "client"


@dataclass(frozen=True)
class Service:
    """A service that a system serves or calls: `block` is its block in the specification, `type` is the service's name.

    `request` and `response` are the blocks of the converters. A call is answered within `time_limit` seconds.
    """

    block: str
    end: ServiceEnd
    type: MessageName
    ros: Middleware
    ros_name: str
    request: str
    response: str
    time_limit: float


@dataclass(frozen=True)
class Action:
    """An action that a system serves or sends goals to: `block` is its block in the specification.

    `type` is the action's name; `goal`, `cancel`, `feedback` and `result` are the blocks of the converters. A goal
    fails if the side that pursues it sends nothing about it for `time_limit` seconds. After `accept_limit` seconds, a
    goal in the hardware is accepted in any case.
    """

    block: str
    end: ServiceEnd
    type: MessageName
    ros: Middleware
    ros_name: str
    goal: str
    cancel: str
    feedback: str
    result: str
    time_limit: float
    accept_limit: float


class LengthSource(Enum):
    """The source of the length of a payload of variable size."""

    COMPUTED = "computed"
    GIVEN = "given"
    BUFFERED = "buffered"


@dataclass(frozen=True)
class PayloadLength:
    """The source of a payload's length for a publisher, with the reason for the choice.

    `suffix` is the suffix of the entity that computes the length.
    """

    source: LengthSource
    reason: str
    suffix: str = ""


@dataclass(frozen=True)
class MessageSide:
    """A message at a block; the message's port names begin with `prefix` (`in_`, `out1_`, empty at a converter)."""

    prefix: str
    frame: Frame
    length: PayloadLength | None = None

    @property
    def kind(self) -> tuple[MessageName, Middleware]:
        """The key that matching sides share: the message, regardless of the used fields."""
        return self.frame.message, self.frame.ros


@dataclass(frozen=True)
class Parameter:
    """A number that software sets at run time, between `least` and `most`, as the port `name` of an accelerator."""

    name: str
    type: WireType
    default: float
    least: float
    most: float

    @property
    def is_float(self) -> bool:
        """Whether the number is a float32."""
        return self.type.code == "f"

    @property
    def port_bits(self) -> int | None:
        """The bits of the port, or None for a `std_logic`."""
        return None if self.type.bits == 1 else self.type.bits

    @property
    def range(self) -> str:
        """The legal values, for messages."""
        return "true, false" if self.type.code == "?" else f"{self.least:.9g} to {self.most:.9g}"

    def word(self, value: float) -> int:
        """Return the register's word of a value. Raise `ValueError`, with the legal values, for an illegal one."""
        is_number = isinstance(value, float | int) and isinstance(value, bool) == (self.type.code == "?")
        if not is_number or not (self.is_float or isinstance(value, int)):
            raise ValueError(f"{value!r} is not a {self.type.name}; legal: {self.range}")
        with suppress(OverflowError):
            # The sum has no negative zero, which the hardware orders below zero.
            rounded = struct.unpack("<f", struct.pack("<f", value))[0] + 0.0 if self.is_float else value
            if self.least <= rounded <= self.most:
                return int.from_bytes(struct.pack("<f" if self.is_float else "<q", rounded)[:4], "little")
        raise ValueError(f"{value} is outside of the range; legal: {self.range}")

    def value(self, word: int) -> float:
        """Return the value of a register's word."""
        data = word.to_bytes(4, "little")
        if self.type.code == "?":
            return bool(word & 1)
        found: float = struct.unpack_from(f"<{self.type.code}", data)[0]
        return found


@dataclass(frozen=True)
class BlockParameter:
    """A parameter of a block; `number` is its place among all parameters of the system."""

    number: int
    block: str
    parameter: Parameter

    @property
    def name(self) -> str:
        """The name of the node's parameter."""
        return f"{self.block}.{self.parameter.name}"


@dataclass(frozen=True)
class AcceleratorType:
    """An accelerator with resolved messages and `width`-bit streams; with `has_width`, WIDTH sets the width.

    If only a part of its message is the user's, `inner` is the user's accelerator.
    """

    accelerator: Accelerator
    inputs: tuple[MessageSide, ...]
    outputs: tuple[MessageSide, ...]
    width: int
    has_width: bool = False
    inner: AcceleratorType | None = None
    parameters: tuple[Parameter, ...] = ()

    @property
    def own(self) -> AcceleratorType:
        """The user's accelerator."""
        return self.inner or self

    @property
    def entity(self) -> str:
        """The unit that the top level instantiates: the user's entity or module, or a unit around it."""
        name = identifier(self.accelerator.name)
        if self.inner:
            return f"{name}_bypass"
        return f"{name}_wrapper" if self.accelerator.type == "HLS" else name

    def parameter_port(self, parameter: Parameter) -> str:
        """Return the name of a parameter's port; that of a compiled function is none of its own signals."""
        return f"parameter_{parameter.name}" if self.accelerator.is_compiled else parameter.name

    @property
    def is_elsewhere(self) -> bool:
        """Whether the accelerator is software that runs in another program and is reached through topics."""
        return self.accelerator.is_software and not self.accelerator.sources

    @property
    def is_component(self) -> bool:
        """Whether the top level declares the unit as a component, since a Verilog module is not an entity."""
        return self.accelerator.type == "Verilog" and self.inner is None


@dataclass(frozen=True)
class AcceleratorBlock:
    """An instance of an accelerator; `clock` is the name of the instance's clock, empty for the system's clock."""

    block: str
    type: AcceleratorType
    clock: str = ""


@dataclass(frozen=True)
class Connection:
    """The route of a message from its source to all its sinks, in the order of the specification.

    `frames` contains the message for each sink; its used fields are those that this connection carries to the sink. A
    message of variable size is the same for all sinks and has a `length`.
    """

    source: End
    sinks: tuple[End, ...]
    frames: tuple[Frame, ...]
    length: PayloadLength | None = None

    @property
    def frame(self) -> Frame:
        """The message for the first sink."""
        return self.frames[0]


@dataclass(frozen=True)
class Junction:
    """A unit between connections: a merge of messages, a queue of messages to a reader, or a topic of the exchange.

    `block` is its name in the top level, and `topic` the name of the topic whose messages pass, if there is one. A
    merge has two or more `sources`; a queue has one, and up to `depth` messages of fixed size. In the exchange, each of
    the `sources` reaches each of the `readers`. `frame` is the message with the fields that the sinks use.
    """

    block: str
    frame: Frame
    topic: str = ""
    sources: int = 1
    readers: int = 0
    depth: int = 0
    overflow: Overflow = Overflow.BLOCK
    length: PayloadLength | None = None

    @property
    def inputs(self) -> tuple[MessageSide, ...]:
        """The inputs, numbered if there are several."""
        return tuple(MessageSide(prefix, self.frame) for prefix in _numbered("in", self.sources))

    @property
    def outputs(self) -> tuple[MessageSide, ...]:
        """The outputs, numbered if there are several."""
        return tuple(MessageSide(prefix, self.frame, self.length) for prefix in _numbered("out", max(1, self.readers)))

    @property
    def output(self) -> MessageSide:
        """The only output of a merge or a queue, or the first one."""
        return self.outputs[0]

    @property
    def drops(self) -> bool:
        """Whether it is a queue that drops messages."""
        return self.depth > 0 and self.overflow is not Overflow.BLOCK

    @property
    def is_exchanged(self) -> bool:
        """Whether the messages pass the exchange."""
        return self.readers > 0


def _numbered(side: str, count: int) -> list[str]:
    return [f"{side}_"] if count == 1 else [f"{side}{number}_" for number in range(count)]


@dataclass(frozen=True)
class ExchangeEnd:
    """An endpoint of the exchange at a block: where the block's messages enter, and where it receives messages.

    `source` is an input and `sink` an output of a junction; one of them may be missing.
    """

    block: str
    source: End | None = None
    sink: End | None = None


@dataclass(frozen=True)
class Exchange:
    """The routers through which topics pass, with what is at each of the network's endpoints."""

    network: noc.Network
    ends: tuple[ExchangeEnd, ...]


@dataclass(frozen=True)
class InnerTopic:
    """A topic that the system both publishes and subscribes to, by the names of the blocks.

    Each of `publishers` sends to each of `readers` within the FPGA, and `to_host` also send to the host. `from_host`
    are the readers that receive from the host as well. Without publishers and readers, all messages pass the host, for
    a `reason`. `wires` are the sources and sinks of the topic's messages that pass no merge and no queue.
    """

    name: str
    publishers: tuple[str, ...] = ()
    readers: tuple[str, ...] = ()
    to_host: tuple[str, ...] = ()
    from_host: tuple[str, ...] = ()
    reason: str = ""
    wires: tuple[tuple[End, End], ...] = ()


@dataclass(frozen=True)
class PublisherTimes:
    """The times of a publisher, in cycles; an unknown time is None.

    The times are the period between messages, the time to send a frame, and the time from a request to its deadline.
    """

    period: int | None
    transfer_time: int | None
    deadline: int | None


@dataclass(frozen=True)
class Group:
    """Publishers with consecutive ids and a separate scheduler: their blocks and the scheduler's policy."""

    policy: str
    blocks: tuple[str, ...]


@dataclass(frozen=True)
class Scheduling:
    """The scheduler that chooses the next frame to the host: its policy, with the publishers' times by id.

    If there are groups, `policy` chooses among them, and the scheduler is a combined one (section 4.3.5).
    A preemptive policy interrupts a frame after `shortest_run` beats at the earliest. The scheduler counts time in
    `time_bits` bits. If the policy was chosen automatically, `reasons` explains the choice.
    """

    policy: str
    times: tuple[PublisherTimes, ...]
    is_preemptive: bool
    shortest_run: int
    time_bits: int
    reasons: tuple[str, ...] = ()
    groups: tuple[Group, ...] = ()


@dataclass(frozen=True)
class Tree:
    """A Manager of Managers: the ids of each group's publishers, the policy of each group and that among the groups."""

    groups: tuple[tuple[int, ...], ...]
    policy: str
    top_policy: str


class LinkKind(Enum):
    """The kind of link that carries bytes between the host and a board without a processor."""

    UART = "uart"
    SPI = "spi"


@dataclass(frozen=True)
class Link:
    """The link between the host and the system; `clock_hz` is the frequency of clk, or 0 if it is unknown.

    `longest` is the number of payload bytes in the longest frame from the host that the link accepts.
    """

    kind: LinkKind
    clock_hz: int
    longest: int


class NetworkKind(Enum):
    """The network connection of a system that is itself a node."""

    ETHERNET = "ethernet"
    W5500 = "w5500"
    W5200 = "w5200"


class Phy(Enum):
    """The interface of the PHY that connects a node to Ethernet."""

    GMII = "gmii"
    MII = "mii"
    RGMII = "rgmii"
    RMII = "rmii"


@dataclass(frozen=True)
class Host:
    """Another host in the network."""

    name: str
    address: IPv4Address


@dataclass(frozen=True)
class Network:
    """The network settings of a system that is itself a node: its MAC address (six bytes), IPv4 addresses and names.

    `namespace` is absolute, such as `/` or `/arm`. A ROS 1 node has a `master`, with address and port, and knows the
    names of `hosts`. `reassemblies` is the maximum number of fragmented IPv4 packets that may arrive at the same time.
    `reassembly` is the size in bytes of the longest such packet, unless the topics need more. Without an `address`
    (0.0.0.0), the node requests one by DHCP.
    """

    mac: bytes
    address: IPv4Address
    netmask: IPv4Address
    gateway: IPv4Address | None
    name: str
    namespace: str
    domain: int
    kind: NetworkKind = NetworkKind.ETHERNET
    master: tuple[IPv4Address, int] | None = None
    hosts: tuple[Host, ...] = ()
    phy: Phy = Phy.GMII
    reassemblies: int = 1
    reassembly: int = 0

    @property
    def has_dhcp(self) -> bool:
        """Whether the node gets its address by DHCP."""
        return self.address == IPv4Address(0)


class StatusAccess(Enum):
    """How the registers of a system's status are accessed."""

    FRAMES = "frames"
    AXI_LITE = "axi_lite"


@dataclass(frozen=True)
class Software:
    """The host's part of a system: `blocks` in software, and all connections on the host.

    The source of a connection is one of the `subscribers`, a block, or the hardware's publisher that represents a
    block's input. The sinks of a connection are blocks, the `publishers`, or the hardware's subscribers that represent
    blocks' outputs. A subscriber may be in hardware as well; the `publishers` are in software only.
    """

    blocks: tuple[AcceleratorBlock, ...] = ()
    subscribers: tuple[Topic, ...] = ()
    publishers: tuple[Topic, ...] = ()
    connections: tuple[Connection, ...] = ()

    @property
    def types(self) -> tuple[AcceleratorType, ...]:
        """All types with an instance, each once."""
        return tuple(dict.fromkeys(block.type for block in self.blocks))


@dataclass(frozen=True)
class Clock:
    """A clock other than clk: its `frequency` in Hz, and the `ratio` of its frequency to that of clk."""

    name: str
    frequency: Fraction
    ratio: Fraction

    @property
    def port(self) -> str:
        """The clock's port at the top level."""
        return f"clk_{self.name}"

    @property
    def reset(self) -> str:
        """The synchronous, active-low reset of the clock's domain."""
        return f"rst_{self.name}_n"


@dataclass(frozen=True)
class DerivedSystem:
    """The whole system; `name` is an identifier, `width` the width of the streams, `clocks` all clocks except clk.

    The messages of `services` and `actions` have converters, but no topics. `junctions` are the merges and queues
    between connections, and `inner_topics` the topics between the system's own blocks;
    some of these may pass the `exchange`.

    `clock` is the frequency of clk in Hz, or None. If `watchdog` is not 0, a publisher that stops in the middle of a
    frame is cut off after `watchdog` cycles.

    Without a `link` or a `network`, the streams are ports of the system. Converters, accelerators and connections in
    software are not included. `names` maps each accelerator's message sides to their names outside the accelerator:
    `<block>_in`, `<block>_out1` and so on. If ids have two bytes, `tree` is the Manager of Managers. `pipeline` is the
    key's value, or None.
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
    status: StatusAccess | None = None
    has_time_stamps: bool = False
    watchdog: int = 0
    tree: Tree | None = None
    pipeline: str | None = None
    services: tuple[Service, ...] = ()
    actions: tuple[Action, ...] = ()
    network: Network | None = None
    junctions: tuple[Junction, ...] = ()
    inner_topics: tuple[InnerTopic, ...] = ()
    exchange: Exchange | None = None

    @property
    def id_bytes(self) -> int:
        """The number of bytes in a frame's id."""
        return 2 if self.tree else 1

    @property
    def is_compiled(self) -> bool:
        """Whether the system's functions in Python are its model: those of all accelerators in hardware."""
        return bool(self.accelerators) and all(item.type.own.accelerator.is_compiled for item in self.accelerators)

    @cached_property
    def places(self) -> Mapping[int, int]:
        """The index of each publisher's Manager input, by id."""
        order = chain.from_iterable(self.tree.groups) if self.tree else range(len(self.publishers))
        return {number: place for place, number in enumerate(order)}

    @cached_property
    def parameters(self) -> tuple[BlockParameter, ...]:
        """The parameters of all accelerators, in the order of the blocks."""
        found = ((item.block, parameter) for item in self.accelerators for parameter in item.type.parameters)
        return tuple(BlockParameter(number, *each) for number, each in enumerate(found))

    def clock_of(self, block: str) -> Clock | None:
        """Return the clock of a block, or None for the system's clock."""
        name = self._accelerators[block].clock if block in self._accelerators else ""
        return next((clock for clock in self.clocks if clock.name == name), None)

    def width_of(self, block: str) -> int:
        """Return the width of a block's streams in bits."""
        return self._accelerators[block].type.width if block in self._accelerators else self.width

    @cached_property
    def _accelerators(self) -> dict[str, AcceleratorBlock]:
        return {item.block: item for item in self.accelerators}

    @property
    def entity(self) -> str:
        """The name of the top level."""
        return f"{self.name}_system"

    @property
    def error_blocks(self) -> tuple[str, ...]:
        """The converters that report errors, in the order of `frame_error`: publishers of variable size are last."""
        publishers = (item.block for item in self.publishers if not item.frame.is_fixed_size)
        return (*(item.block for item in self.subscribers), *publishers)

    @property
    def computed_lengths(self) -> dict[Frame, str]:
        """Every frame with a computed payload length, with the suffix of the entity that computes it."""
        return {
            item.frame: item.length.suffix
            for item in self.connections
            if item.length and item.length.source is LengthSource.COMPUTED
        }

    def length_to(self, publisher: Converter) -> PayloadLength | None:
        """Return the source of a payload's length for a publisher, or None if the length is constant."""
        return next(item.length for item in self.connections if End(publisher.block) in item.sinks)

    @property
    def frames(self) -> tuple[Frame, ...]:
        """All frames of converters, each once."""
        return tuple(dict.fromkeys(converter.frame for converter in (*self.subscribers, *self.publishers)))

    @property
    def kernels(self) -> tuple[AcceleratorType, ...]:
        """The C++ accelerators that an HLS tool turns into hardware."""
        return tuple(type_.own for type_ in self.accelerator_types if type_.accelerator.type == "HLS")

    @property
    def accelerator_types(self) -> tuple[AcceleratorType, ...]:
        """All types with an instance, each once."""
        return tuple(dict.fromkeys(block.type for block in self.accelerators))
