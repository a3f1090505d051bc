"""Messages -> generated VHDL files: packages of constants, and converters of fixed or variable size.

The modules for variable size are imported only if needed, so that edits to these modules do not invalidate cached
converters of fixed size.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from fusesoc_firm.converter.configuration import (
    PUBLISHER_TEMPLATE,
    SUBSCRIBER_TEMPLATE,
    check_width,
    publisher_configuration,
    publisher_entity,
    subscriber_configuration,
    subscriber_entity,
)
from fusesoc_firm.converter.constants import CONSTANTS_TEMPLATE, constants_configuration, constants_package
from fusesoc_firm.converter.pipeline import NONE
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.middleware import Definitions
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.text.render import Context, render


@dataclass(frozen=True)
class Artifact:
    """A generated file: name, template and data."""

    path: str
    template: str
    configuration: Context

    @cached_property
    def text(self) -> str:
        """The text of the file."""
        return render(self.template, self.configuration)


def constants_sources(messages: Sequence[tuple[MessageName, Definitions]], prefix: str = "") -> Iterator[Artifact]:
    """Yield the package of each message; the definitions include nested messages."""
    counts = Counter(name for name, _ in messages)
    for name, definitions in messages:
        package = constants_package(name, definitions[name].ros if counts[name] > 1 else None, prefix)
        yield Artifact(f"{package}.vhd", CONSTANTS_TEMPLATE, constants_configuration(name, definitions, package))


def subscriber_source(frame: Frame, width: int, entity: str = "", pipeline: str = NONE) -> Artifact:
    """Return the source of a subscriber; `entity` is by default `subscriber_entity`. May raise `InputError`.

    `pipeline` is one of `PIPELINES`; it does not affect subscribers of fixed size.
    """
    check_width(width)
    entity = entity or subscriber_entity(frame)
    if frame.is_fixed_size:
        return Artifact(f"{entity}.vhd", SUBSCRIBER_TEMPLATE, subscriber_configuration(frame, width, entity))
    from fusesoc_firm.converter.variable_subscriber import (
        VARIABLE_SUBSCRIBER_TEMPLATE,
        variable_subscriber_configuration,
    )

    configuration = variable_subscriber_configuration(frame, width, entity, pipeline)
    return Artifact(f"{entity}.vhd", VARIABLE_SUBSCRIBER_TEMPLATE, configuration)


def publisher_source(frame: Frame, width: int, entity: str = "") -> Artifact:
    """Return the source of a publisher; `entity` is by default `publisher_entity`. May raise `InputError`."""
    check_width(width)
    entity = entity or publisher_entity(frame)
    if frame.is_fixed_size:
        return Artifact(f"{entity}.vhd", PUBLISHER_TEMPLATE, publisher_configuration(frame, width, entity))
    from fusesoc_firm.converter.variable_publisher import (
        VARIABLE_PUBLISHER_TEMPLATE,
        variable_publisher_configuration,
    )

    configuration = variable_publisher_configuration(frame, width, entity)
    return Artifact(f"{entity}.vhd", VARIABLE_PUBLISHER_TEMPLATE, configuration)
