"""The system from the node's view: its topics, and the topics' converters in the hardware.

A payload is a message as serialised by the middleware, so the node needs only a table of names and ids, and where each
message ends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

from fusesoc_firm.accelerator.software import sent_elsewhere, taken_elsewhere, way_to
from fusesoc_firm.frame.content import Content, content_of
from fusesoc_firm.message import ROS1, ROS2
from fusesoc_firm.message.wire import INTEGER_AND_FLOAT
from fusesoc_firm.node.interface.action_types import NodeAction, node_action
from fusesoc_firm.node.interface.services import NodeService, node_service
from fusesoc_firm.node.interface.topics import NodeTopic, node_topic
from fusesoc_firm.system.derived.model import BlockParameter, Converter, Parameter, StatusAccess, Topic
from fusesoc_firm.system.system_core import LoadedSystem, identity
from fusesoc_firm.text.diagnostics import fail


@dataclass(frozen=True)
class Crossing:
    """A converter with an id but without a topic: of software on this host, of a service or of an action."""

    block: str
    id: int


@dataclass(frozen=True)
class NodeDescription:
    """A system from its node's view.

    The node takes messages from the topics of `subscribers` and publishes messages on the topics of `publishers`.
    Software on this host, and the ends of `services` and `actions`, send to the hardware through `entering` and receive
    from the hardware through `leaving`. For each publisher in hardware, `sources` lists the ids of the subscribers
    whose messages cause the publisher's messages. `contents` tells the end of the messages that each subscriber in
    hardware takes, by block. `longest_payload` is the size in bytes of the longest payload from
    any publisher, or None without a bound. `clock_hz` is None if the specification has no clock. `digest` is that of
    the hardware's identity, or empty if the hardware has no status. With `has_status_registers`, the status is a port
    for AXI4-Lite; otherwise frames read it. `parameters` are those of the accelerators.
    """

    name: str
    width: int
    subscribers: tuple[NodeTopic, ...]
    publishers: tuple[NodeTopic, ...]
    sources: tuple[tuple[int, ...], ...]
    entering: tuple[Crossing, ...] = ()
    leaving: tuple[Crossing, ...] = ()
    contents: Mapping[str, Content] = field(default_factory=dict)
    longest_payload: int | None = None
    clock_hz: float | None = None
    digest: str = ""
    services: tuple[NodeService, ...] = ()
    actions: tuple[NodeAction, ...] = ()
    has_status_registers: bool = False
    parameters: tuple[BlockParameter, ...] = ()

    @property
    def taken_topics(self) -> tuple[NodeTopic, ...]:
        """All topics that the node subscribes to, in the order of their numbers; those of actions are last."""
        return (*self.subscribers, *(topic for action in self.actions for topic in action.subscribers))

    @property
    def given_topics(self) -> tuple[NodeTopic, ...]:
        """All topics that the node publishes, in the order of their numbers; those of actions are last."""
        return (*self.publishers, *(topic for action in self.actions for topic in action.publishers))

    @property
    def all_services(self) -> tuple[NodeService, ...]:
        """All services of the node, in the order of their numbers; those of actions are last."""
        return (*self.services, *(service for action in self.actions for service in action.services))

    @property
    def has_status_frames(self) -> bool:
        """Whether frames read the status of the hardware."""
        return bool(self.digest) and not self.has_status_registers

    @property
    def inputs(self) -> tuple[NodeTopic | Crossing, ...]:
        """All inputs of the hardware or of software: topics first, in the order of their numbers."""
        return (*self.subscribers, *self.entering)

    @property
    def outputs(self) -> tuple[NodeTopic | Crossing, ...]:
        """All outputs of the hardware or of software: topics first, in the order of their numbers."""
        return (*self.publishers, *self.leaving)

    @property
    def versions(self) -> tuple[int, ...]:
        """The versions of ROS to which the topics, services and actions belong."""
        topics = (*self.taken_topics, *self.given_topics)
        return tuple(sorted({topic.ros for topic in topics} | {item.ros for item in self.all_services}))


def describe(loaded: LoadedSystem) -> NodeDescription:
    """Describe the node of a system.

    Raise `InputError` for a middleware other than ROS, for ids of two bytes, and for a system that is a node itself.
    """
    if loaded.system.network:
        fail(
            f"'{loaded.system.name}' is a node itself, and needs none on a host",
            loaded.specification.project.interconnect.source,
            "'firm live' runs its simulated board; omit --transport",
        )
    if loaded.system.id_bytes > 1:
        fail(
            f"nodes do not support 'idBytes: {loaded.system.id_bytes}'", hint="such a system is simulated with firm sim"
        )
    system, software = loaded.system, loaded.system.software
    here = {block.block for block in software.blocks if block.type.accelerator.sources}
    subscribers, entering = _parted(system.subscribers, here)
    publishers, leaving = _parted(system.publishers, here)
    taken = (*subscribers, *software.subscribers, *sent_elsewhere(system))
    given = (*publishers, *software.publishers, *taken_elsewhere(system))
    lengths = [item.frame.payload_bytes if item.frame.is_fixed_size else None for item in system.publishers]
    ids = {item.block: item.id for item in system.subscribers}
    return NodeDescription(
        system.name,
        system.width,
        tuple(_topic(item, loaded) for item in _once(taken)),
        tuple(_topic(item, loaded) for item in _once(given)),
        tuple(
            tuple(sorted(ids[block] for block in way_to(item.block, system) if block in ids))
            for item in system.publishers
        ),
        entering,
        leaving,
        {str(item.block): content_of(item.frame) for item in system.subscribers},
        max(length for length in lengths if length is not None) if None not in lengths else None,
        None if system.clock is None else float(system.clock),
        identity(loaded).digest if system.status else "",
        tuple(node_service(item, loaded) for item in system.services),
        tuple(node_action(item, loaded) for item in system.actions),
        has_status_registers=system.status is StatusAccess.AXI_LITE,
        parameters=system.parameters,
    )


def hardware_parameters(
    *parameters: tuple[str, str, str, float, float, float],
) -> tuple[BlockParameter, ...]:
    """Return the parameters of a system from block, name, type, default, and the least and the most value of each."""
    made = ((block, Parameter(name, INTEGER_AND_FLOAT[type_], *values)) for block, name, type_, *values in parameters)
    return tuple(BlockParameter(number, *each) for number, each in enumerate(made))


def converter_names(description: NodeDescription) -> tuple[dict[int, str], dict[int, str]]:
    """Return the names of the subscribers and of the publishers by id."""
    return (
        {item.id: item.block for item in description.inputs if item.id is not None},
        {item.id: item.block for item in description.outputs if item.id is not None},
    )


def channel_names(description: NodeDescription) -> list[str]:
    """Return the names of the channels of the hardware's status: the subscribers by id, then the publishers by id."""
    return [name for names in converter_names(description) for _, name in sorted(names.items())]


def _parted(converters: Iterable[Converter], here: Collection[str]) -> tuple[list[Converter], tuple[Crossing, ...]]:
    """Split converters into those with topics and those without."""
    topics: list[Converter] = []
    crossings: list[Crossing] = []
    for item in converters:
        if item.service or (item.software and item.software.block in here):
            crossings.append(Crossing(item.block, item.id))
        else:
            topics.append(item)
    return topics, tuple(crossings)


def _once(topics: Iterable[Topic]) -> list[Topic]:
    """Return one topic for each block, with the block's converter if there is one."""
    found: dict[str, Topic] = {}
    for topic in topics:
        found.setdefault(topic.block, topic)
    return [*found.values()]


def _topic(topic: Topic, loaded: LoadedSystem) -> NodeTopic:
    frame = topic.frame
    if frame.ros not in (ROS1, ROS2):
        fail(
            f"'{topic.block}' uses {frame.ros.title}, which nodes do not support",
            hint="nodes support only ROS 1 and ROS 2",
        )
    return replace(
        node_topic(topic.block, topic.ros_name, frame.message, loaded.libraries[frame.ros]),
        id=topic.id if isinstance(topic, Converter) else None,
        is_reliable=topic.quality.is_reliable,
        is_transient_local=topic.quality.is_transient_local,
        depth=topic.quality.depth,
    )
