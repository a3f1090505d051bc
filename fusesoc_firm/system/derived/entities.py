"""The design units of a system; their names must be unique, since a tool keeps only one unit of each name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fusesoc_firm.converter.configuration import publisher_entity, subscriber_entity
from fusesoc_firm.converter.constants import constants_package
from fusesoc_firm.converter.payload_length import length_entity
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.system.derived.cpp_function import kernel_entity
from fusesoc_firm.system.derived.model import AcceleratorType, DerivedSystem
from fusesoc_firm.system.written.specification import Block
from fusesoc_firm.text.diagnostics import Diagnostics
from fusesoc_firm.text.naming import identifier


def check_entities(system: DerivedSystem, blocks: Mapping[str, Block], faults: Diagnostics) -> None:
    """Note every block and accelerator that needs a design unit whose name conflicts with another unit's name."""
    owners = {
        system.entity: "the system",
        f"{system.entity}_tb": "the system's test bench",
        f"{system.entity}_live": "the system's live test bench",
        f"{system.entity}_in_environment": "the system's test bench",
        f"{system.entity}_exchange": "the system's exchange",
        f"{system.entity}_routers": "the routers of the system's exchange",
        f"{system.entity}_rom": "the memory of the system's node",
        f"{system.entity}_network": "the test bench of the system's node",
        f"{system.entity}_node": "the system's node",
        f"{system.entity}_packets": "the packets of the system's node",
        f"{system.entity}_names": "the names of the system's node",
    }
    frames: dict[str, Frame] = {}
    packages: dict[str, MessageName] = {}
    for entity, block, frame in _converters(system):
        if frames.setdefault(entity, frame) != frame:
            message = f"'{block}' and {owners[entity]} need the entity '{entity}' for different messages"
            hint = f"a system can use a message in only one ROS version, here {frames[entity].ros.title}"
            faults.error(message, blocks[block].name.source, hint)
        owners.setdefault(entity, f"converter '{block}'")
        package = constants_package(frame.message)
        if packages.setdefault(package, frame.message) != frame.message:
            message = f"'{block}' and {owners[package]} need the package '{package}' for different messages"
            hint = "a package's name consists of the message's package and name in lower case, joined by '_'"
            faults.error(message, blocks[block].name.source, hint)
        owners.setdefault(package, f"converter '{block}'")
    for frame, suffix in system.computed_lengths.items():
        owners.setdefault(length_entity(frame, suffix), f"the unit that computes the length of {frame.message}")
    for accelerator in system.accelerator_types:
        name = accelerator.accelerator.name
        if accelerator.accelerator.type != "HLS" and identifier(name) != name:
            hint = "legal here: letters, digits and single '_' between them, except VHDL and Verilog keywords"
            faults.error(
                f"'{name}' is not a legal {'module' if accelerator.own.is_component else 'entity'} name",
                name.source,
                hint,
            )
        for entity in _entities(accelerator):
            if owner := owners.get(entity.lower()):
                hint = "the names of a system's entities must differ in more than case"
                faults.error(f"'{name}' and {owner} both need the entity '{entity}'", name.source, hint)
            owners[entity.lower()] = f"accelerator '{name}'"


def _converters(system: DerivedSystem) -> Iterator[tuple[str, str, Frame]]:
    """Yield the entity of each converter, with its block and its frame."""
    for converter in system.subscribers:
        yield subscriber_entity(converter.frame, converter.suffix), converter.block, converter.frame
    for converter in system.publishers:
        yield publisher_entity(converter.frame, converter.suffix), converter.block, converter.frame


def _entities(accelerator: AcceleratorType) -> Iterator[str]:
    yield accelerator.entity
    if accelerator.inner:
        yield accelerator.inner.entity
    if accelerator.accelerator.type == "HLS":
        yield kernel_entity(accelerator)
