"""The text of a generated Python module: its functions, and the objects that they refer to by short names.

The codec generates one function to read and one to write for each type of message (`decoder_source`,
`encoder_source`). No text of users becomes part of a module except names of fields, which are quoted.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from fusesoc_firm.frame.model import FrameField, Path
from fusesoc_firm.message.wire import WireType


class UnusualError(Exception):
    """A value or a payload that a generated function does not accept; a slower check tells the reason."""


class Module:
    """A module under construction; `add` and `constant` return the names of its functions and objects."""

    def __init__(self) -> None:
        self._functions: list[str] = []
        self._objects: dict[str, Any] = {"UnusualError": UnusualError}
        self._names: dict[Any, str] = {}
        self._count = 0

    def name(self, letter: str) -> str:
        """Return an unused name that begins with `letter`."""
        self._count += 1
        return f"{letter}{self._count}"

    def constant(self, key: Any, value: Any) -> str:
        """Return the name of an object; equal keys share a name."""
        if key not in self._names:
            self._names[key] = self.name("k")
            self._objects[self._names[key]] = value
        return self._names[key]

    def shared(self, function: Callable[..., Any]) -> str:
        """Return the name of a function outside of the module."""
        self._objects[function.__name__] = function
        return function.__name__

    def type(self, type_: WireType) -> str:
        """Return the name of the NumPy type of a wire type."""
        return self.constant(("type", type_.code), array_type(type_))

    def packer(self, form: str) -> str:
        """Return the name of the function that packs values in a `struct` format."""
        return self.constant(("pack", form), struct.Struct(f"<{form}").pack)

    def packers(self, form: str, zeros: range) -> str:
        """Return the name of a tuple of functions like `packer`, with each of these numbers of zeros in front."""
        made = tuple(struct.Struct(f"<{count}x{form}").pack for count in zeros)
        return self.constant(("packs", form, zeros), made)

    def unpacker(self, form: str) -> str:
        """Return the name of the function that unpacks values in a `struct` format at an offset."""
        return self.constant(("unpack", form), struct.Struct(f"<{form}").unpack_from)

    def add(self, name: str, parameters: str, lines: list[str]) -> None:
        """Add a function."""
        self._functions += [f"def {name}({parameters}):", *(f"    {line}" for line in lines)]

    def compiled(self, name: str) -> Any:
        """Return the function with this name."""
        exec(compile("\n".join(self._functions), "<codec>", "exec"), self._objects)
        return self._objects[name]


def array_type(type_: WireType) -> np.dtype[Any]:
    """Return the NumPy type of a wire type."""
    return np.dtype(f"<{type_.code}")


def indented(lines: list[str]) -> list[str]:
    """Return the lines of a block."""
    return [f"    {line}" for line in lines]


def is_plain(leaf: FrameField) -> bool:
    """Return whether a leaf with elements is an array of numbers that is not within an array of messages."""
    return leaf.path[-1].count is not None and all(step.count is None for step in leaf.path[:-1])


def is_in_block(leaf: FrameField) -> bool:
    """Return whether a leaf is within a block: an array of messages in a `Fixed`."""
    return any(step.count is not None for step in leaf.path[:-1])


def block_of(path: Path) -> Path:
    """Return the path of the block around a leaf."""
    first = next(place for place, step in enumerate(path) if step.count is not None)
    return path[: first + 1]


def block_code(type_: WireType) -> str:
    """Return the `struct` code of an element of a block, in which numbers with 32 bits are handled as words.

    Conversion to Python's double would lose the bits of a signalling NaN.
    """
    return "I" if type_.code == "f" else type_.code
