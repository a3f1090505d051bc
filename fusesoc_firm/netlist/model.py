"""A netlist as plain data: modules, their instances of gates and of other modules, and the nets between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


class NetlistError(Exception):
    """A netlist that is not what the VHDL says; the text is what to tell the user."""


class LostMemoryError(NetlistError):
    """What GHDL made wrong, or crashed at, as it looked for memories."""


@dataclass(frozen=True)
class Net:
    """A net by its number, how many bits it has, and its name, which others may have, too."""

    number: int
    width: int
    name: str = field(default="", compare=False)


@dataclass(frozen=True)
class Port:
    """A port of a module; `width` is in bits."""

    name: str
    width: int


@dataclass
class Instance:
    """A gate (`kind` begins with `$`) or an instance of a module.

    An input is None if nothing drives it. `location` is `file:line:column` of the VHDL, or empty.
    """

    name: str
    kind: str
    location: str = ""
    parameters: Sequence[str] = ()
    inputs: list[Net | None] = field(default_factory=list)
    outputs: Sequence[Net] = ()

    def error(self, message: str) -> NetlistError:
        """An error at this instance's place in the VHDL."""
        return NetlistError(f"{self.location or self.name}: error: {message}")

    @property
    def numbers(self) -> list[int]:
        """The parameters of a gate, without their names."""
        return [int(text.rpartition("=")[2]) for text in self.parameters]

    def input(self, index: int) -> Net:
        """The net at an input. Raises `NetlistError` if nothing drives it."""
        net = self.inputs[index]
        if net is None:
            raise self.error(f"nothing drives an input of '{self.name}'")
        return net


@dataclass
class Module:
    """A module; one without `is_defined` is a component whose inside is elsewhere.

    `results` are the nets of its outputs, `arguments` those of its inputs.
    """

    name: str
    parameters: list[str] = field(default_factory=list)
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    is_defined: bool = False
    results: Sequence[Net | None] = ()
    arguments: Sequence[Net] = ()


Modules = Mapping[str, Module]
