"""Run a node from its options to its exit status, for `firm live` and for generated nodes."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType

from fusesoc_firm.node.engine.carrier import CarrierError, RosCarrier, RosOptions
from fusesoc_firm.node.engine.hardware_parameters import HardwareParameters
from fusesoc_firm.node.engine.log import Level, Log
from fusesoc_firm.node.engine.queues import Overflow
from fusesoc_firm.node.engine.software import node_software
from fusesoc_firm.node.engine.trace import Trace
from fusesoc_firm.node.interface.description import NodeDescription
from fusesoc_firm.node.interface.options import ROS_ARGUMENTS
from fusesoc_firm.node.interface.parameters import parameters_of
from fusesoc_firm.node.interface.services import NodeService
from fusesoc_firm.node.node import Node, NodeSettings, OpenTransport
from fusesoc_firm.node.reopening import checked, status_registers
from fusesoc_firm.node.status.status_socket import StatusServer, served_names
from fusesoc_firm.node.transport.transport import TransportError
from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.written.specification import RELIABLE
from fusesoc_firm.text.diagnostics import InputError, fail


@dataclass(frozen=True)
class RunOptions:
    """The options with which a node starts; `versions` are the versions of ROS to which the node's topics belong.

    `status` is the address of the status' registers, if it is given.
    """

    versions: tuple[int, ...]
    ros: RosOptions
    settings: NodeSettings
    trace: Path | None = None
    status: str = ""


def run_options(
    arguments: argparse.Namespace, rest: Sequence[str], description: NodeDescription, ros: int | None = None
) -> RunOptions:
    """Return the options from a command line, restricted to the version `ros` if it is given.

    May raise `InputError`.
    """
    if ros is not None and ros not in description.versions:
        known = " and ".join(map(str, description.versions))
        hint = "the hardware supports one ROS version; select the version with 'middleware' in blocks and interfaces"
        fail(f"system '{description.name}' has no ROS {ros} topics, only topics of ROS {known}", hint=hint)
    versions = description.versions if ros is None else (ros,)
    if arguments.ros_args and 2 not in versions:
        fail(
            f"'{ROS_ARGUMENTS}' is for ROS 2, but the topics use ROS 1",
            hint=f"for ROS 1, write NAME:=VALUE without '{ROS_ARGUMENTS}'",
        )
    if arguments.lifecycle and 2 not in versions:
        hint = "nodes of ROS 1 have no lifecycle states; omit --lifecycle"
        fail("'--lifecycle' is for ROS 2, but the topics use ROS 1", hint=hint)
    passed = [*rest, *([ROS_ARGUMENTS, *arguments.ros_args] if arguments.ros_args else ())]
    name = arguments.name or description.name
    parameters = _hardware_parameters(description, versions, name, passed)
    return RunOptions(
        versions,
        RosOptions(
            name,
            tuple(passed),
            arguments.queue,
            None if arguments.qos is None else arguments.qos == RELIABLE,
            arguments.trace is not None,
            arguments.ros_python,
            arguments.lifecycle,
            dict(parameters.values),
        ),
        NodeSettings(
            arguments.queue,
            Overflow(arguments.overflow),
            drain=arguments.drain,
            restarts=arguments.restart,
            parameters=parameters,
        ),
        arguments.trace,
        arguments.status,
    )


def _hardware_parameters(
    description: NodeDescription, versions: Sequence[int], name: str, arguments: Sequence[str]
) -> HardwareParameters:
    """Return the parameters of the hardware with the values that ROS has for them. May raise `InputError`."""
    known = {item.name for item in description.parameters}
    values = parameters_of(versions, name, arguments, _say, known) if known else {}
    return HardwareParameters(description.parameters, values)


def run_node(
    description: NodeDescription,
    open_transport: OpenTransport,
    options: RunOptions,
    loaded: LoadedSystem | None = None,
    address: str = "",
) -> None:
    """Run the node until Ctrl-C, SIGTERM or ROS stops it; a second Ctrl-C ends it immediately.

    `loaded` is the system, if it has software. `address` is that of the transport, if it has one. Raise `InputError` if
    ROS or the hardware fails, or if received messages could not be processed in time.
    """
    log = Log(_say)
    try:
        with ExitStack() as stack:
            software = (
                stack.enter_context(node_software(loaded, lambda error: log.warn(str(error)))) if loaded else None
            )
            trace = (
                stack.enter_context(closing(Trace(options.trace, description, report=log.warn)))
                if options.trace
                else None
            )
            registers = status_registers(description, options.status, address)
            settings = replace(options.settings, report=log.warn, registers=registers)
            node = Node(
                description,
                checked(open_transport, description, registers, settings.parameters),
                settings,
                software,
                trace,
            )
            # Published messages are sent before the node prints its statistics.
            stack.callback(lambda: _say(node.statistics.text()))
            stack.callback(node.close)
            if node.has_status:
                names = served_names(description.name, address)
                stack.enter_context(StatusServer(names, node.access_status, log.warn, description.parameters))
            carriers = {}
            for ros in options.versions:
                carriers[ros] = stack.enter_context(closing(RosCarrier(ros, description, options.ros)))
                log.connect(carriers[ros].log)
                log.info(_topics(carriers[ros], description))
            # While the carriers are open.
            stack.push(partial(_log_end, log, node))
            with _stopped_by_signals(node):
                if not node.run(carriers):
                    fail("some received messages were not processed")
    except (TransportError, CarrierError) as error:
        fail(str(error))


def _log_end(log: Log, node: Node, _: object, error: BaseException | None, __: object) -> None:
    """Put the counts, and the error that ends the node, into ROS's log; both are printed later."""
    log.pass_on(Level.INFO, node.statistics.text())
    if isinstance(error, TransportError | CarrierError | InputError):
        log.pass_on(Level.ERROR, str(error))


def _topics(carrier: RosCarrier, description: NodeDescription) -> str:
    """Return a text for the user that lists a running node's topics."""
    taken, given, called = carrier.subscribers.items(), carrier.publishers.items(), carrier.services.items()
    known = description.subscribers, description.publishers, description.services
    lines = [
        *(f"  {name} -> {known[0][number].block}" for number, name in taken if number < len(known[0])),
        *(f"  {known[1][number].block} -> {name}" for number, name in given if number < len(known[1])),
        *(_service(name, known[2][number]) for number, name in called if number < len(known[2])),
        *_actions(carrier, description),
    ]
    return "\n".join([f"{description.name} is a node of {carrier.title}", *lines])


def _actions(carrier: RosCarrier, description: NodeDescription) -> Iterator[str]:
    """Yield a line for each action; the name of one of its topics or services begins with its name."""
    topic, service = len(description.subscribers), len(description.services)
    for action in description.actions:
        name = carrier.services.get(service) if action.services else carrier.subscribers.get(topic)
        topic, service = topic + len(action.subscribers), service + len(action.services)
        if name:
            for ending in ("/goal", "/status", "/_action/send_goal"):
                name = name.removesuffix(ending)
            yield f"  action {name} -> {action.block}" if action.is_server else f"  {action.block} -> action {name}"


def _service(name: str, service: NodeService) -> str:
    return f"  service {name} -> {service.block}" if service.is_server else f"  {service.block} -> service {name}"


@contextmanager
def _stopped_by_signals(node: Node) -> Iterator[None]:
    """Stop the node at the first Ctrl-C or SIGTERM within this context."""
    known = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def stop(_: int, __: FrameType | None) -> None:
        for number, handler in known.items():
            signal.signal(number, handler)
        node.stop()

    for number in known:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in known.items():
            signal.signal(number, handler)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
