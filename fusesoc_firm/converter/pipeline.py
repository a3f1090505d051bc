"""The register stages of subscribers of variable size: the values of the key and parameter `pipeline`."""

from __future__ import annotations

from fusesoc_firm.frame.model import Fixed, Frame, all_nodes

# No additional registers; register slices on paths to other blocks; these slices, and fields stored a cycle later.
NONE, BORDERS, FULL = PIPELINES = ("none", "borders", "full")
# With more bytes of fields, the registers' enables are the critical paths of a subscriber (ECP5).
_MANY_BYTES = 256


def pipeline_of(frame: Frame, given: str | None = None, least: str = NONE) -> str:
    """Return the stages of a frame's subscriber: `given` or, by default, the stages that its timing needs.

    The default is `full` for more than 256 bytes of fields, otherwise `least`.
    """
    if given is not None:
        return given
    return FULL if _field_bytes(frame) > _MANY_BYTES else least


def _field_bytes(frame: Frame) -> int:
    """Return the bytes of all used fields except strings and arrays of variable size."""
    return sum(
        leaf.held * leaf.type.size
        for node in all_nodes(frame.nodes)
        if isinstance(node, Fixed)
        for leaf in node.fields
        if leaf.is_used
    )
