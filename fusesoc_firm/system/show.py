"""The derived System as plain data: the content of the dissertation's listings 6.7 and 6.9."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.ports import field_ports
from fusesoc_firm.system.configuration import accelerator_entity
from fusesoc_firm.system.derived import Connection, Converter, DerivedSystem


def derived_description(system: DerivedSystem) -> dict[str, Any]:
    """Converters, accelerators and every connection between two ports, as `block/port`."""
    return {
        "System": {
            "name": system.name,
            "top": system.entity,
            "fpgaPart": system.fpga_part,
            "width": system.width,
            "scheduler": system.scheduler,
        },
        "Converters": {
            "AXIS_to_msg": [
                _converter(item, subscriber_entity(item.frame, item.suffix)) for item in system.subscribers
            ],
            "msg_to_AXIS": [_converter(item, publisher_entity(item.frame, item.suffix)) for item in system.publishers],
        },
        "Accelerators": [
            {
                "name": block.block,
                "entity": accelerator_entity(block.type),
                "type": str(block.type.accelerator.type),
                "sources": [str(source) for source in block.type.accelerator.sources],
            }
            for block in system.accelerators
        ],
        "Connections": list(_connections(system.connections)),
    }


def _converter(converter: Converter, entity: str) -> dict[str, Any]:
    return {
        "nameBD": entity,
        "nameMW": str(converter.frame.message),
        "ROS": int(converter.frame.ros),
        "block": converter.block,
        "id": converter.id,
        "payloadBytes": converter.frame.payload_bytes,
    }


def _connections(connections: Iterable[Connection]) -> Iterator[dict[str, str]]:
    for connection in connections:
        source = connection.source
        for sink, frame in zip(connection.sinks, connection.frames, strict=True):
            ports = [port.name for port in field_ports(frame)]
            for port in [*ports, "segment_valid"]:
                yield {"from": f"{source.block}/{source.prefix}{port}", "to": f"{sink.block}/{sink.prefix}{port}"}
            yield {
                "from": f"{sink.block}/{sink.prefix}msg_ready",
                "to": f"{source.block}/{source.prefix}msg_ready",
            }
