"""The message side of a converter: one port for each leaf of the message."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.frame.model import Frame, FrameField, Path
from fusesoc_firm.text.naming import distinct_identifiers, identifier
from fusesoc_firm.text.reserved import declared_names

_TEMPLATES = ("vhdl/subscriber.vhd", "vhdl/publisher.vhd")
# The port of a field with one of these names has a different name. The templates use the first names without declaring
# them, and declare `store` and `fields_r` with an empty suffix. The last line keeps the names of ports of version 0.1.
_TAKEN = declared_names(*_TEMPLATES) | set(
    """
    rtl firm ieee work std numeric_std std_logic_1164 std_logic std_logic_vector unsigned natural integer resize
    store fields_r to_unsigned rising_edge failure true false
    beyond broken complete ended frame_beats is_told is_waiting
    """.split()
)
# The names of each store if there are several stores.
_NUMBERED = re.compile(r"(store|fields|turns?|used)_\d+(_\w+)?", re.IGNORECASE)


@dataclass(frozen=True)
class FieldPort:
    """A port and its leaf; `width` is in bits, or None for a `std_logic`."""

    name: str
    width: int | None
    field: FrameField

    @property
    def vhdl_type(self) -> str:
        """The port's type in VHDL."""
        return vhdl_type(self.width)

    @property
    def comment(self) -> str:
        """The leaf's ROS name and type, which identify the port's origin: `pose.position.x: float64`."""
        return f"{ros_path(self.field.path)}: {self.field.type.name}"


def field_ports(frame: Frame) -> tuple[FieldPort, ...]:
    """Return the ports of the used leaves in wire order; names do not depend on the selection of fields."""
    fields = [field for field in frame.fields if field.count]
    numbered = (name for field in fields if _NUMBERED.fullmatch(name := identifier(*field.names)))
    names = distinct_identifiers((field.names for field in fields), reserved=[*_TAKEN, *numbered])
    return tuple(
        FieldPort(name, port_width(field), field) for name, field in zip(names, fields, strict=True) if field.is_used
    )


def port_width(field: FrameField) -> int | None:
    """Return the width of a leaf's port in bits, or None for a single bool."""
    is_bit = field.type.bits == 1 and not field.is_array
    return None if is_bit else field.count * field.type.bits


def ros_path(path: Path) -> str:
    """Return a path as written in a definition, with the sizes of fixed arrays: `pose.covariance[36]`."""
    return ".".join(step.name if step.count is None else f"{step.name}[{step.count}]" for step in path)
