"""The quality of service of a topic: the specification's `qos`."""

from __future__ import annotations

from fusesoc_firm.message.middleware import MIDDLEWARES
from fusesoc_firm.system.derived.model import Quality
from fusesoc_firm.system.written.specification import (
    BEST_EFFORT,
    PROFILES,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
    Block,
    Qos,
)
from fusesoc_firm.text.diagnostics import Diagnostics

_MOST_MESSAGES = 100_000
_RELIABLE_ONLY = 1


def quality_of(block: Block) -> Quality:
    """Return the quality of service of a converter's topic."""
    if block.qos is None:
        return Quality()
    reliability, durability, depth = _values(block.qos)
    return Quality(reliability == RELIABLE, durability == TRANSIENT_LOCAL, depth)


def check_quality(block: Block, faults: Diagnostics) -> None:
    """Note the faults in a converter's `qos`."""
    qos = block.qos
    if qos is None:
        return
    reliability, _, depth = _values(qos)
    if not 1 <= depth <= _MOST_MESSAGES:
        faults.error(
            f"'{block.name}' cannot have 'depth: {depth}'", qos.place("depth"), f"legal here: 1 to {_MOST_MESSAGES}"
        )
    is_first = block.middleware is not None and MIDDLEWARES[block.middleware].number == _RELIABLE_ONLY
    if is_first and reliability == BEST_EFFORT:
        key = "reliability" if qos.reliability else "profile"
        faults.error(
            f"'{block.name}' cannot be {BEST_EFFORT}, since its topic belongs to ROS 1",
            qos.place(key),
            f"legal here: {RELIABLE}; ROS 1 sends by TCP",
        )


def _values(qos: Qos) -> tuple[str, str, int]:
    """Return reliability, durability and depth, from the section, its profile, or the defaults."""
    known = PROFILES[qos.profile] if qos.profile else (RELIABLE, VOLATILE, Quality().depth)
    reliability, durability, depth = known
    return (
        str(qos.reliability or reliability),
        str(qos.durability or durability),
        depth if qos.depth is None else qos.depth,
    )
