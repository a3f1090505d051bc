"""The system specification as its author wrote it: the grammar of the dissertation's listing 6.6.

This module is the single source of the grammar. Each section is a class, and each key is a field that defines the key's
spelling, form, legal values and meaning. Rules across sections (known names, connections) are part of `derivation`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fusesoc_firm.compiler.fixed import MOST_BITS, format_of
from fusesoc_firm.converter.pipeline import PIPELINES
from fusesoc_firm.converter.stream import WIDTHS
from fusesoc_firm.message.middleware import MIDDLEWARES
from fusesoc_firm.scheduling.policies import DEFAULT, POLICIES
from fusesoc_firm.text.diagnostics import Diagnostics, SourceRef, fail
from fusesoc_firm.text.naming import LONGEST_PATH, text_fault
from fusesoc_firm.text.yaml_sections import Section, key, read
from fusesoc_firm.text.yaml_text import Text, is_null, parse_yaml, read_yaml

# The type of an accelerator that is a function in software, and of one that is compiled from such a function.
SOFTWARE = "ROS-SW"
PYTHON = "Python"
# The types of accelerators, with the suffixes of their source files.
SOURCE_SUFFIXES = {
    "HLS": (".cpp", ".cc", ".cxx", ".c", ".hpp", ".h"),
    "VHDL": (".vhd", ".vhdl"),
    "Verilog": (".v", ".sv", ".vh", ".svh"),
    PYTHON: (".py",),
    SOFTWARE: (".py",),
}
ACCELERATOR_TYPES = tuple(SOURCE_SUFFIXES)
SUBSCRIBER, PUBLISHER = TOPIC_MODES = ("subscriber", "publisher")
SERVER, CLIENT = SERVICE_MODES = ("server", "client")
MODES = (*TOPIC_MODES, *SERVICE_MODES)
# The keys of an accelerator's resources that limit its cells.
BUDGETS = ("lut", "dsp")
# The two kinds of blocks.
CONVERTER, ACCELERATOR = "converter", "accelerator"
# The keys that make a block a converter.
CONVERTER_KEYS = ("middleware", "mode", "message")
# The keys of servers and clients, and the keys for messages and topics of other converters.
SERVICE_KEYS = frozenset({"service", "action", "timeLimit", "acceptLimit"})
MESSAGE_KEYS = frozenset({"message", "qos", "deliver", "include", "exclude"})
# The keyword for the smallest scheduler that meets all deadlines.
AUTO_SCHEDULER = "auto"
# The routes of frames between the host and the system: streams of the top level, or a byte link (cores/board).
AXI_STREAM = "axi_stream"
LINKS = ("uart", "spi")
# The system is itself a node: of ROS 2 by Ethernet, or of ROS 1 with a TCP/IP chip.
ETHERNET = "ethernet"
CHIPS = W5500, W5200 = ("w5500", "w5200")
NETWORKS = (ETHERNET, *CHIPS)
DHCP = "dhcp"
# The PHY interfaces of an Ethernet node.
PHYS = ("gmii", "mii", "rgmii", "rmii")
# The accesses to the registers of a system's status, if it has one.
NO_STATUS = "none"
STATUS_FRAMES, STATUS_AXI_LITE = STATUS = ("frames", "axi_lite")
# The action of a subscriber's full queue on a further frame.
BLOCK, DROP_NEWEST, DROP_OLDEST = OVERFLOWS = ("block", "drop_newest", "drop_oldest")
RELIABLE, BEST_EFFORT = RELIABILITIES = ("reliable", "best_effort")
VOLATILE, TRANSIENT_LOCAL = DURABILITIES = ("volatile", "transient_local")
# The profiles of ROS 2 (rmw/qos_profiles.h) as reliability, durability and depth.
PROFILES = {
    "default": (RELIABLE, VOLATILE, 10),
    "sensor_data": (BEST_EFFORT, VOLATILE, 5),
    "parameters": (RELIABLE, VOLATILE, 1000),
    "services_default": (RELIABLE, VOLATILE, 10),
    "action_status_default": (RELIABLE, TRANSIENT_LOCAL, 1),
}
# The ways of messages within the FPGA: as wires, or by an exchange of routers with a topology.
WIRED = AUTO_FABRIC, WIRES = ("auto", "wires")
TOPOLOGIES = ("crossbar", "mesh", "concentrated_mesh", "chain", "tree", "ring", "torus")
# The ways of a topic that the system both publishes and subscribes to.
FABRIC, HOST, BOTH = DELIVERIES = ("fabric", "host", "both")
PASS = "pass"
LENGTHS = ("computed", "given", "buffered")
DIRECTIONS = ("in", "out")
# The types of an accelerator's parameters: numbers that fit a register of the status.
PARAMETER_TYPES = ("bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32")
NUMBERS = ("float32", "float64")
"""The floats of an accelerator in Python; fixed-point numbers are another choice."""
VHDL_93, VHDL_2008 = VHDL_STANDARDS = (93, 2008)
# Whether the top level has a synchroniser after an input pin, a FIFO after a publisher, or time stamps.
ADDED, NOT_ADDED = ADDITIONS = ("added", "none")
# `vendor:library:name`, with an optional version.
_CORE = re.compile(r"[^:/]*:[^:/]*:[^:/]+(:[^:/]+)?")

# Tools write the names of sources into makefiles, scripts and command lines, mostly without quotes.
_SOURCE = re.compile(r"/?([A-Za-z0-9_.+][A-Za-z0-9_.+-]{0,199}/)*[A-Za-z0-9_.+][A-Za-z0-9_.+-]{0,199}")


def source_fault(text: str) -> tuple[str, str] | None:
    """Return the reason why `text` is not a legal name of a source file, or None if the name is legal."""
    if fault := text_fault(text, LONGEST_PATH):
        return fault
    if text.endswith("/"):
        return f"must be a file, not the folder '{text}'", "list its files: [rtl/one.vhd, rtl/two.vhd]"
    legal = "legal here: names of up to 200 letters, digits, '_', '.', '+' and '-', not starting with '-'"
    return None if _SOURCE.fullmatch(text) else (f"cannot be '{text}', which some tools do not accept as a file", legal)


def numbers_fault(text: str) -> tuple[str, str] | None:
    """Return the reason why `text` is not a type of an accelerator's numbers, or None if it is one."""
    if text in NUMBERS or format_of(text):
        return None
    legal = f"legal here: float32, float64, fixed(W, F) with 2 to {MOST_BITS} bits, F of them as fraction, F < W"
    return f"cannot be '{text}'", legal


_FIELDS: dict[str, Any] = {"form": "texts", "rule": partial(text_fault, longest=LONGEST_PATH)}
_INCLUDE: dict[str, Any] = {
    **_FIELDS,
    "meaning": "fields to include, such as pose.position, each with all nested fields",
}
_EXCLUDE: dict[str, Any] = {**_FIELDS, "meaning": "fields to exclude"}
_MIDDLEWARE = {"is_required": True, "choices": tuple(MIDDLEWARES)}


@dataclass(frozen=True)
class ClockDomain(Section):
    """A clock other than the system's."""

    name: Text = key("the clock's name; its port at the top level is clk_<name>", is_required=True)
    frequency: Text = key("the clock's frequency, such as 150 MHz", is_required=True)


@dataclass(frozen=True)
class PublisherGroup(Section):
    """Publishers with a scheduler of their own."""

    scheduler: Text = key("the policy that selects a publisher of the group", choices=tuple(POLICIES), is_required=True)
    publishers: tuple[Text, ...] = key("the names of the group's publishers", form="texts", is_required=True)


@dataclass(frozen=True)
class NetworkHost(Section):
    """The address of a host that URIs of ROS 1 call by its name."""

    name: Text = key("the host's name in URIs, such as robot-pc", is_required=True)
    address: Text = key("its IPv4 address, such as 192.168.1.10", is_required=True)


@dataclass(frozen=True)
class NodeNetwork(Section):
    """The place of a system that is a node itself in its network, and its name in ROS."""

    mac: Text = key("the board's MAC address, such as 02:00:00:00:00:01", is_required=True)
    address: Text = key(
        "the board's IPv4 address, such as 192.168.1.20, or dhcp: one of a DHCP server; dhcp only with ethernet",
        is_required=True,
    )
    netmask: Text = key("the mask of the network's addresses; not with dhcp", default=Text("255.255.255.0"))
    gateway: Text | None = key("the router to other networks (default: none); not with dhcp")
    name: Text | None = key("the node's name (default: the system's name)")
    namespace: Text = key("the node's namespace, such as /arm", default=Text("/"))
    domain: int = key("the domain of ROS 2 (ROS_DOMAIN_ID); only used with ethernet", form="integer", default=0)
    master: Text | None = key(
        "address and port of the master of ROS 1, such as 192.168.1.10:11311; required with w5500 and w5200"
    )
    hosts: tuple[NetworkHost, ...] = key(
        "hosts whose nodes have URIs with names instead of addresses; only used with w5500 and w5200",
        form="sections",
        section=NetworkHost,
        is_asked=False,
    )
    phy: Text = key("the interface of the PHY; only used with ethernet", choices=PHYS, default=Text(PHYS[0]))
    reassemblies: int = key(
        "packets of IPv4 in fragments that may arrive at the same time, 1 to 4; only used with ethernet",
        form="integer",
        default=1,
    )
    reassembly: int = key(
        "bytes of the longest packet of IPv4 in fragments, up to 65535, if the topics need fewer; 0: as the topics need"
        "; only used with ethernet",
        form="integer",
        default=0,
    )


@dataclass(frozen=True)
class Project(Section):
    """The settings of the whole system."""

    name: Text = key("the system's name; the top level is <name>_system", is_required=True)
    # The dissertation's listings 6.1, 6.6 and 5.1 use three spellings.
    fpga_part: Text | None = key("the FPGA's part number", name="fpgaPart", aliases=("fpgaPartpart", "FPGA"))
    width: int = key(
        "width in bits of the streams between host and converters", form="integer", choices=WIDTHS, default=8
    )
    scheduler: Text = key(
        "the policy that selects the next publisher to send, or the next group if there are groups",
        choices=(*POLICIES, AUTO_SCHEDULER),
        default=Text(DEFAULT),
    )
    groups: tuple[PublisherGroup, ...] = key(
        "groups of publishers with a scheduler each, in the order of the publishers' blocks",
        form="sections",
        section=PublisherGroup,
        is_asked=False,
    )
    lateness_buffers: Text = key(
        "FIFO after each publisher whose frames may be later than its deadline, for the data of that time",
        name="latenessBuffers",
        choices=ADDITIONS,
        default=Text(ADDED),
        is_asked=False,
    )
    shortest_run: int = key(
        "minimum number of beats before a preemptive scheduler interrupts a publisher",
        name="shortestRun",
        form="integer",
        default=16,
    )
    id_bytes: int = key(
        "bytes of a frame's id: 1 for up to 256 subscribers and 256 publishers, 2 for up to 65,536",
        name="idBytes",
        form="integer",
        choices=(1, 2),
        default=1,
        is_asked=False,
    )
    watchdog: int = key(
        "cycles of clk after which a publisher that stops in the middle of a frame, or a subscriber without a queue"
        " that drops frames, is cut off; 0: never",
        form="integer",
        default=1 << 20,
        is_asked=False,
    )
    pipeline: Text | None = key(
        "register stages of subscribers of variable size (default: none; if clock is above 100 MHz, borders at 8"
        " bits and full at more; full for messages with more than 256 bytes of fields)",
        choices=PIPELINES,
        is_asked=False,
    )
    fabric: Text = key(
        "the way of topics within the FPGA: as wires, or by an exchange with this topology; auto: wires, which need"
        " fewer cells than any exchange",
        choices=(*WIRED, *TOPOLOGIES),
        default=Text(AUTO_FABRIC),
        is_asked=False,
    )
    interconnect: Text = key(
        "connection between host and system: streams for a DMA engine, a serial link, or a network without a host"
        " (w5500 and w5200: by that chip)",
        choices=(AXI_STREAM, *LINKS, *NETWORKS),
        default=Text(AXI_STREAM),
    )
    network: NodeNetwork | None = key(
        "addresses and names of a system with interconnect ethernet, w5500 or w5200",
        form="section",
        section=NodeNetwork,
        is_asked=False,
    )
    status: Text = key(
        "access to the status registers, if the system has any: frames of the status id (255, or 65,535 with "
        "idBytes: 2), or a port for AXI4-Lite",
        choices=(NO_STATUS, *STATUS),
        default=Text(NO_STATUS),
    )
    time_stamps: Text = key(
        "time stamps in the status: the cycle of the first beat to each subscriber, and of the last beat from each"
        " publisher",
        name="timeStamps",
        choices=ADDITIONS,
        default=Text(NOT_ADDED),
        is_asked=False,
    )
    clock: Text | None = key("frequency of clk, such as 100 MHz; required for times with a unit and for clocks")
    clocks: tuple[ClockDomain, ...] = key("additional clocks for accelerators", form="sections", section=ClockDomain)


@dataclass(frozen=True)
class InterfaceType(Section):
    """A message that an accelerator receives."""

    middleware: Text = key("the middleware that defines the message", **_MIDDLEWARE)
    message: Text = key("the message's type, such as geometry_msgs/Quaternion", is_required=True)
    include: tuple[Text, ...] = key(**_INCLUDE)
    exclude: tuple[Text, ...] = key(**_EXCLUDE)


@dataclass(frozen=True)
class OutputType(InterfaceType):
    """A message that an accelerator sends."""

    length: Text | None = key("source of the payload's length, if the size is variable", choices=LENGTHS)
    others: Text | None = key(
        "pass: the fields that are not selected are those of the input, which has the same message", choices=(PASS,)
    )


@dataclass(frozen=True)
class Interface(Section):
    """All messages of an accelerator."""

    input: tuple[InterfaceType, ...] = key("input messages", form="sections", section=InterfaceType)
    output: tuple[OutputType, ...] = key("output messages", form="sections", section=OutputType)


@dataclass(frozen=True)
class Pin(Section):
    """An accelerator's port that is not part of a message; the top level exports the port."""

    name: Text = key("the port's name, which becomes <block>_<name> at the top level", is_required=True)
    direction: Text = key("direction of the port at the accelerator", is_required=True, choices=DIRECTIONS)
    bits: int | None = key("width in bits of a std_logic_vector (default: a std_logic)", form="integer")
    synchroniser: Text = key(
        "synchroniser of an input to the block's clock; none for clocks and for pins that the accelerator synchronises",
        choices=ADDITIONS,
        default=Text(ADDED),
    )

    @property
    def is_synchronised(self) -> bool:
        """Whether the top level synchronises the pin to its block's clock."""
        return self.direction == "in" and self.synchroniser == ADDED


@dataclass(frozen=True)
class ParameterSection(Section):
    """A number that ROS sets at run time: a port or an attribute of an accelerator that changes between messages."""

    name: Text = key("name of the port or attribute; the parameter of the node is <block>.<name>", is_required=True)
    type: Text = key("the number's type", is_required=True, choices=PARAMETER_TYPES)
    default: Text = key("the value after reset", is_required=True)
    range: tuple[Text, ...] = key(
        "the least and the most value, such as [0, 10] (default: all of the type, for float32 all finite ones)",
        form="texts",
    )


@dataclass(frozen=True)
class Resources(Section):
    """The operators of an accelerator in Python: how many operations of a kind may run at the same time.

    With a key of `BUDGETS`, the accelerator has the fastest operators whose estimated cells are not more.
    """

    add: int | None = key("adders, 1 to 16 (default: 1)", form="integer")
    multiply: int | None = key("multipliers, 1 to 16 (default: 1)", form="integer")
    divide: int | None = key("dividers, 1 to 16 (default: 1)", form="integer")
    square_root: int | None = key("square roots, 1 to 16 (default: 1)", form="integer")
    lut: int | None = key("the most LUT4, as estimated: the accelerator is as fast as they allow", form="integer")
    dsp: int | None = key("the most multipliers of 18 bits, in the same way", form="integer")


@dataclass(frozen=True)
class Accelerator(Section):
    """A type of accelerator; blocks are its instances."""

    name: Text = key("the type's name, which is also the name of the VHDL entity or Verilog module", is_required=True)
    type: Text = key("the accelerator's language, or ROS-SW for software", is_required=True, choices=ACCELERATOR_TYPES)
    sources: tuple[Text, ...] = key(
        "the accelerator's source files, relative to the specification",
        form="texts",
        is_required=True,
        unless=("type", SOFTWARE),
        rule=source_fault,
    )
    standard: int | None = key(
        "the VHDL standard of the sources (default: 93)", form="integer", choices=VHDL_STANDARDS, is_asked=False
    )
    interface: Interface = key("the accelerator's messages", form="section", section=Interface, is_required=True)
    width: int | None = key(
        "width in bits of the accelerator's streams (default: the project's width)", form="integer", choices=WIDTHS
    )
    pins: tuple[Pin, ...] = key("ports that become ports of the system", form="sections", section=Pin)
    parameters: tuple[ParameterSection, ...] = key(
        "numbers that ROS sets at run time: input ports in VHDL and Verilog, attributes in Python",
        form="sections",
        section=ParameterSection,
        is_asked=False,
    )
    numbers: Text | None = key(
        "float32, float64 or fixed(W, F): all floats of an accelerator in Python (default: the types of the fields)",
        rule=numbers_fault,
        is_asked=False,
    )
    resources: Resources | None = key(
        "the operators of an accelerator in Python", form="section", section=Resources, is_asked=False
    )
    latency: int | None = key(
        "the most cycles from a message to the answer: a limit for Python, else a promise for the worst case",
        form="integer",
        is_asked=False,
    )
    interval: int | None = key(
        "the most cycles between two messages, in the same way; without it, each is held until its answer is taken",
        form="integer",
        is_asked=False,
    )
    element: int | None = key(
        "the most cycles for each element of an array in an accelerator in Python", form="integer", is_asked=False
    )

    @property
    def is_software(self) -> bool:
        """Whether the accelerator runs on the host."""
        return self.type == SOFTWARE

    @property
    def is_compiled(self) -> bool:
        """Whether the accelerator's hardware is compiled from a function in Python."""
        return self.type == PYTHON

    @property
    def vhdl_standard(self) -> int:
        """The VHDL standard of the sources."""
        return self.standard or VHDL_93


@dataclass(frozen=True)
class Outgoing(Section):
    """A connection from the block whose section contains it."""

    name: Text = key("the block that receives the message", is_required=True)
    include: tuple[Text, ...] = key(**_INCLUDE)
    exclude: tuple[Text, ...] = key(**_EXCLUDE)


@dataclass(frozen=True)
class Qos(Section):
    """The quality of service of a topic; each key takes the place of the profile's value."""

    profile: Text | None = key("a profile of ROS 2, for the keys that are not given", choices=tuple(PROFILES))
    reliability: Text | None = key(
        "whether lost messages are sent again (default: reliable; the only one in ROS 1)", choices=RELIABILITIES
    )
    durability: Text | None = key(
        "transient_local: late subscribers receive the last messages; in ROS 1, a publisher then latches"
        " (default: volatile)",
        choices=DURABILITIES,
    )
    depth: int | None = key("capacity of the topic's queues, in messages (default: 100)", form="integer")


@dataclass(frozen=True)
class Block(Section):
    """An instance of an accelerator (with a type) or of a converter (with middleware, mode and message)."""

    name: Text = key("the block's name", is_required=True)
    type: Text | None = key("the type of an accelerator; not legal for a converter")
    clock: Text | None = key("clock of an accelerator: one of the project's clocks (default: clk)", only_of=ACCELERATOR)
    middleware: Text | None = key(
        "the middleware of a converter's message", choices=tuple(MIDDLEWARES), only_of=CONVERTER
    )
    mode: Text | None = key(
        "direction of a converter; server answers calls of a service or pursues goals of an action, client calls a"
        " service or sends goals to an action",
        choices=MODES,
        only_of=CONVERTER,
    )
    message: Text | None = key("a converter's message; not legal for a service or an action", only_of=CONVERTER)
    service: Text | None = key(
        "the type of the service of a server or client, such as std_srvs/SetBool", only_of=CONVERTER
    )
    action: Text | None = key(
        "the type of the action of a server or client, such as test_msgs/Fibonacci", only_of=CONVERTER, is_asked=False
    )
    time_limit: Text | None = key(
        "the longest time in which a call of a service is answered, or in which nothing is sent about a goal of an"
        " action by the hardware, or by a client's server, such as 500 ms (default: 5 s)",
        name="timeLimit",
        only_of=CONVERTER,
        is_asked=False,
    )
    accept_limit: Text | None = key(
        "the time after which a server accepts a goal of an action if the hardware has sent nothing (default: 1 s)",
        name="acceptLimit",
        only_of=CONVERTER,
        is_asked=False,
    )
    topic: Text | None = key(
        "the topic of a converter's messages, or the name of its service or action, such as /arm/left or left"
        " (default: the block's name)",
        only_of=CONVERTER,
    )
    qos: Qos | None = key(
        "the quality of service of a converter's topic", form="section", section=Qos, only_of=CONVERTER, is_asked=False
    )
    deliver: Text | None = key(
        "the way of a topic that the system both publishes and subscribes to: within the FPGA, by the host, or both"
        " (default: a publisher delivers to both, a subscriber receives within the FPGA)",
        choices=DELIVERIES,
        only_of=CONVERTER,
        is_asked=False,
    )
    include: tuple[Text, ...] = key(**_INCLUDE, only_of=CONVERTER)
    exclude: tuple[Text, ...] = key(**_EXCLUDE, only_of=CONVERTER)
    max_length: int | None = key(
        "bytes of the longest payload, if the message has no bounds (default: 65536; with a link, w5500 or w5200"
        " 2000; with ethernet the most that is possible)",
        name="maxLength",
        form="integer",
        only_of=CONVERTER,
        is_asked=False,
    )
    buffer: int | None = key(
        "bytes of the longest payload, for a publisher that stores frames", form="integer", only_of=PUBLISHER
    )
    queue: int | None = key(
        "number of frames that are stored before a subscriber (default: none)", form="integer", only_of=SUBSCRIBER
    )
    overflow: Text | None = key(
        "what a subscriber's full queue does: block the host, or drop a frame (default: block); without a queue,"
        " drop_newest drops frames after the watchdog's cycles",
        choices=OVERFLOWS,
        only_of=SUBSCRIBER,
    )
    period: Text | None = key(
        "time between a publisher's messages: cycles, a time such as 10 ms, or a rate such as 100 Hz",
        only_of=PUBLISHER,
    )
    wcet: Text | None = key(
        "longest transfer time of a publisher's frame; optional if the size is limited", only_of=PUBLISHER
    )
    deadline: Text | None = key(
        "time from a publisher's request to the end of the frame (default: the publisher's period)", only_of=PUBLISHER
    )
    outgoing: tuple[Outgoing, ...] = key(
        "connections to the blocks that receive the block's message", form="sections", section=Outgoing
    )
    # The server or client whose messages this converter carries.
    service_block: Block | None = None


@dataclass(frozen=True)
class Specification(Section):
    """The contents of a specification file."""

    project: Project = key("settings of the whole system", form="section", section=Project, is_required=True)
    paths: tuple[Text, ...] = key(
        "folders, bags and cores with message definitions, relative to the file; searched before all others",
        form="texts",
    )
    accelerators: tuple[Accelerator, ...] = key("the types of accelerators", form="sections", section=Accelerator)
    blocks: tuple[Block, ...] = key("instances and connections", form="sections", section=Block, is_required=True)
    # The file is invalid YAML from some line on, so any section may have further items.
    is_cut: bool = False

    @property
    def message_cores(self) -> dict[str, SourceRef | None]:
        """The names of cores among `paths`, with their places."""
        return {str(item): item.source for item in self.paths if is_core(item)}

    @property
    def middlewares(self) -> set[str]:
        """The names of the middlewares that the specification uses, as written there."""
        sides = [side for item in self.accelerators for side in (*item.interface.input, *item.interface.output)]
        words = [*(block.middleware for block in self.blocks), *(side.middleware for side in sides)]
        return {str(word) for word in words if word}


def is_core(path: str) -> bool:
    """Return whether an item of `paths` is the name of a core."""
    return _CORE.fullmatch(path) is not None


@dataclass(frozen=True)
class Draft:
    """The text of a specification that is not yet in its file."""

    path: Path
    text: str


def read_specification(source: Path | Draft, file: str, faults: Diagnostics) -> Specification:
    """Read the specification in a file, which messages call `file`, and note all faults.

    Raise `InputError` if the file cannot be read, is empty, or is not YAML from the start.
    """
    text = parse_yaml(source.text, file, faults) if isinstance(source, Draft) else read_yaml(source, file, faults)
    if text.root is None or is_null(text.root):
        faults.raise_if_any()
        fail(f"{file} is empty; a specification needs the keys 'project' and 'blocks'")
    return replace(read(Specification, text.root, text, faults, "a specification"), is_cut=text.is_cut)
