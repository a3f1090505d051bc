"""The template and configuration of a Frame's converters, of fixed or variable size.

The modules for variable size are imported only if needed, so that edits to these modules do not invalidate cached
converters of fixed size.
"""

from __future__ import annotations

from typing import NamedTuple

from fusesoc_firm.converter.configuration import (
    PUBLISHER_TEMPLATE,
    SUBSCRIBER_TEMPLATE,
    check_width,
    publisher_configuration,
    publisher_entity,
    subscriber_configuration,
    subscriber_entity,
)
from fusesoc_firm.converter.pipeline import NONE
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.text.render import Context


class ConverterSource(NamedTuple):
    """A template and its configuration, which together define a converter's text."""

    template: str
    configuration: Context


def subscriber_source(frame: Frame, width: int, entity: str = "", pipeline: str = NONE) -> ConverterSource:
    """Return the source of a subscriber; `entity` is by default `subscriber_entity`. May raise `InputError`.

    `pipeline` is one of `PIPELINES`; it does not affect subscribers of fixed size.
    """
    check_width(width)
    if frame.is_fixed_size:
        return ConverterSource(SUBSCRIBER_TEMPLATE, subscriber_configuration(frame, width, entity))
    from fusesoc_firm.converter.variable_subscriber import (
        VARIABLE_SUBSCRIBER_TEMPLATE,
        variable_subscriber_configuration,
    )

    configuration = variable_subscriber_configuration(frame, width, entity or subscriber_entity(frame), pipeline)
    return ConverterSource(VARIABLE_SUBSCRIBER_TEMPLATE, configuration)


def publisher_source(frame: Frame, width: int, entity: str = "") -> ConverterSource:
    """Return the source of a publisher; `entity` is by default `publisher_entity`. May raise `InputError`."""
    check_width(width)
    if frame.is_fixed_size:
        return ConverterSource(PUBLISHER_TEMPLATE, publisher_configuration(frame, width, entity))
    from fusesoc_firm.converter.variable_publisher import (
        VARIABLE_PUBLISHER_TEMPLATE,
        variable_publisher_configuration,
    )

    configuration = variable_publisher_configuration(frame, width, entity or publisher_entity(frame))
    return ConverterSource(VARIABLE_PUBLISHER_TEMPLATE, configuration)
