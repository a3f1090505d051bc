"""Specification -> derived System.

The steps are the messages of all blocks (`resolution`), the data flow between them (`connections`, `partition`), the
converters at its ends, and everything that follows from these. After a step, faults end the derivation if the next step
could only report their consequences.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import Names, names_in_use, select, with_names_in_use
from fusesoc_firm.system.derived.actions import actions_of
from fusesoc_firm.system.derived.clocks import clocks_of
from fusesoc_firm.system.derived.entities import check_entities
from fusesoc_firm.system.derived.exchange import exchange_of
from fusesoc_firm.system.derived.held import check_held
from fusesoc_firm.system.derived.inner_topics import Met, meet
from fusesoc_firm.system.derived.lateness import with_lateness_buffers
from fusesoc_firm.system.derived.length import publisher_buffers, with_lengths
from fusesoc_firm.system.derived.link import link_of
from fusesoc_firm.system.derived.longest import with_longest_payloads, with_longest_sent
from fusesoc_firm.system.derived.model import Action, Connection, Converter, DerivedSystem, End, Service
from fusesoc_firm.system.derived.network import network_of
from fusesoc_firm.system.derived.parameters import check_number
from fusesoc_firm.system.derived.partition import Parting, Parts, message_names
from fusesoc_firm.system.derived.quality import quality_of
from fusesoc_firm.system.derived.queue import queue_of
from fusesoc_firm.system.derived.resolution import Libraries, Resolved, resolve
from fusesoc_firm.system.derived.services import services_of
from fusesoc_firm.system.derived.status import has_time_stamps, status_of
from fusesoc_firm.system.derived.streams import check_streams
from fusesoc_firm.system.derived.timing import clock_frequency, scheduling_of
from fusesoc_firm.system.derived.topics import check_topics
from fusesoc_firm.system.derived.tree import tree_of
from fusesoc_firm.system.derived.watchdog import watchdog_of
from fusesoc_firm.system.written.specification import PUBLISHER, SUBSCRIBER, Project, Specification
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import identifier


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
    resolved = resolve(specification, folder, libraries, faults, needs_sources=needs_sources)
    project = specification.project
    clock = clock_frequency(project, faults)
    clocks = clocks_of(specification, clock, faults)
    flow = _data_flow(resolved, project, faults)
    faults.raise_if_any()
    parts = flow.parts
    parts.check(resolved.blocks, project.id_bytes, faults)
    subscribers, publishers = _converters(flow, project, faults)
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
        accelerators=resolved.instances(is_software=False),
        connections=flow.connections,
        clock=clock,
        clocks=clocks,
        software=parts.software,
        names=flow.names,
        link=link,
        status=status_of(project, link, len(subscribers), len(publishers), faults),
        has_time_stamps=has_time_stamps(project, faults),
        tree=tree,
        pipeline=None if project.pipeline is None else str(project.pipeline),
        network=network,
        watchdog=watchdog_of(project, scheduling, publishers, faults),
        services=flow.services,
        actions=flow.actions,
        junctions=flow.met.junctions,
        inner_topics=flow.met.topics,
        exchange=exchange_of(project, flow.met.junctions, flow.connections, flow.met.topics, faults),
    )
    check_entities(system, parts.blocks, faults)
    check_held(system, parts.blocks, faults)
    check_number(system, project, faults)
    faults.raise_if_any()
    return with_lateness_buffers(system, project, faults)


def source_files(specification: Specification, folder: Path) -> list[Path]:
    """Return the source files of all accelerators, in the order of the specification."""
    return [folder / source for accelerator in specification.accelerators for source in accelerator.sources]


@dataclass(frozen=True)
class _Flow:
    """The data flow of a system: its hardware and software, and the connections in hardware with their lengths.

    `names` are the names of message sides outside their accelerators. `met` contains the merges and queues, and the
    topics within the system.
    """

    names: Mapping[End, str]
    parts: Parts
    connections: tuple[Connection, ...]
    services: tuple[Service, ...]
    actions: tuple[Action, ...]
    met: Met


def _data_flow(resolved: Resolved, project: Project, faults: Diagnostics) -> _Flow:
    """Connect the blocks, and partition them into hardware and software."""
    blocks, inputs, outputs = resolved.blocks, resolved.inputs, resolved.outputs
    names = message_names(blocks, inputs, outputs)
    uses = tuple(resolved.topic_uses(names))
    check_topics(uses, faults)
    wiring = resolved.wiring(faults)
    before = Met(blocks, inputs, outputs, wiring.connect())
    software = resolved.instances(is_software=True)
    met = meet(before, uses, wiring, project, faults)
    parts = Parting(met.blocks, software, met.inputs, met.outputs, met.connections, names).parts()
    services = services_of(blocks, parts, faults)
    actions = actions_of(blocks, parts, faults)
    connections = with_lengths(parts.connections, parts.outputs, parts.blocks, faults)
    check_streams(connections, met.merges, parts.blocks, faults)
    return _Flow(names, parts, connections, services, actions, met)


def _converters(
    flow: _Flow, project: Project, faults: Diagnostics
) -> tuple[tuple[Converter, ...], tuple[Converter, ...]]:
    """Return the subscribers and the publishers, with their queues, buffers and longest payloads.

    Raise `InputError` if the buffers have faults, since payloads then have no known length.
    """
    parts = flow.parts
    buffers = publisher_buffers(flow.connections, parts.of_mode(PUBLISHER), flow.met.merges, faults)
    faults.raise_if_any()
    publishers = tuple(
        replace(item, buffer=buffers.get(item.block, 0)) for item in _of_mode(PUBLISHER, parts, flow.connections)
    )
    subscribers = with_longest_payloads(_of_mode(SUBSCRIBER, parts, flow.connections), project, parts.blocks, faults)
    subscribers = tuple(
        replace(item, queue=queue_of(parts.blocks[item.block], item, project, faults)) for item in subscribers
    )
    return subscribers, with_longest_sent(publishers, subscribers, project, parts.blocks, faults)


def _of_mode(mode: str, parts: Parts, connections: Iterable[Connection]) -> tuple[Converter, ...]:
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
