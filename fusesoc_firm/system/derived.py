"""The derived System: every converter, accelerator, id and connection, with nothing left to decide.

It is what `analysis` makes of a specification and what all templates, and `firm system show`, are filled from.
"""

from __future__ import annotations

from dataclasses import dataclass

from fusesoc_firm.frame.model import Frame
from fusesoc_firm.message.model import MessageName, RosVersion
from fusesoc_firm.system.specification import Accelerator


@dataclass(frozen=True)
class Converter:
    """An instance of a converter; `id` counts subscribers and publishers apart, from 0, in the order of the blocks.

    The fields that are used in `frame` are its ports. One without all of them has an entity with a `suffix`.
    """

    block: str
    frame: Frame
    id: int
    suffix: str = ""


@dataclass(frozen=True)
class MessageSide:
    """A message at an accelerator: its ports begin with `prefix` (`in_`, `out1_`)."""

    prefix: str
    frame: Frame

    @property
    def kind(self) -> tuple[MessageName, RosVersion]:
        """What connects two sides: the message, whichever fields of it they use."""
        return self.frame.message, self.frame.ros


@dataclass(frozen=True)
class AcceleratorType:
    """An accelerator with its messages resolved."""

    accelerator: Accelerator
    inputs: tuple[MessageSide, ...]
    outputs: tuple[MessageSide, ...]


@dataclass(frozen=True)
class AcceleratorBlock:
    """An instance of an accelerator."""

    block: str
    type: AcceleratorType


@dataclass(frozen=True)
class End:
    """One end of a connection: a block, and the prefix of the message there (empty at a converter)."""

    block: str
    prefix: str = ""


@dataclass(frozen=True)
class Connection:
    """A message's way from where it arises to all who take it, in the order of the specification.

    `frames` is the message for each sink: the fields that are used in it go there from here.
    """

    source: End
    sinks: tuple[End, ...]
    frames: tuple[Frame, ...]


@dataclass(frozen=True)
class DerivedSystem:
    """The whole system; `name` is an identifier, `width` the streams' bits."""

    name: str
    fpga_part: str
    width: int
    scheduler: str
    subscribers: tuple[Converter, ...]
    publishers: tuple[Converter, ...]
    accelerators: tuple[AcceleratorBlock, ...]
    connections: tuple[Connection, ...]

    @property
    def entity(self) -> str:
        """The top level's name."""
        return f"{self.name}_system"

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Every frame of a converter, once."""
        return tuple(dict.fromkeys(converter.frame for converter in (*self.subscribers, *self.publishers)))

    @property
    def accelerator_types(self) -> tuple[AcceleratorType, ...]:
        """Every type that has an instance, once."""
        return tuple(dict.fromkeys(block.type for block in self.accelerators))
