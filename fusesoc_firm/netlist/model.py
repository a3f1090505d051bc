"""A netlist as plain data: modules, the instances of gates and modules in each module, and nets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain


class NetlistError(Exception):
    """An error because the netlist would not match the VHDL; the text is the message to the user."""


class LostMemoryError(NetlistError):
    """An error because GHDL produced a wrong netlist, or crashed, while inferring memories."""


class GrownTableError(NetlistError):
    """An error because GHDL crashed when one of its tables grew (`padding`)."""


@dataclass(frozen=True)
class Net:
    """A net: its number, its width in bits, and its name, which need not be unique."""

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

    An undriven input is None. `location` is the place in the VHDL as `file:line:column`, or empty. `attributes` are
    those of the signal that became this gate, as text.
    """

    name: str
    kind: str
    location: str = ""
    parameters: Sequence[str] = ()
    inputs: list[Net | None] = field(default_factory=list)
    outputs: Sequence[Net] = ()
    attributes: Mapping[str, str] = field(default_factory=dict)

    def error(self, message: str) -> NetlistError:
        """Return an error with this instance's place in the VHDL."""
        return NetlistError(f"{self.location or self.name}: error: {message}")

    @property
    def is_gate(self) -> bool:
        """True for a gate, False for an instance of a module."""
        return self.kind.startswith("$")

    @property
    def numbers(self) -> list[int]:
        """The values of a gate's parameters."""
        return [int(text.rpartition("=")[2]) for text in self.parameters]

    def input(self, index: int) -> Net:
        """Return the net at an input. Raise `NetlistError` if nothing drives it."""
        net = self.inputs[index]
        if net is None:
            raise self.error(f"nothing drives an input of '{self.name}'")
        return net


@dataclass
class Module:
    """A module; if `is_defined` is false, the module is a component that is defined outside the netlist.

    `results` are the nets at the module's outputs, and `arguments` are the nets at its inputs.
    """

    name: str
    parameters: list[str] = field(default_factory=list)
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    is_defined: bool = False
    results: Sequence[Net | None] = ()
    arguments: Sequence[Net] = ()

    def first_unused(self) -> int:
        """Return the first unused net number."""
        driven = (net.number for instance in self.instances for net in instance.outputs)
        return 1 + max(chain(driven, (net.number for net in self.arguments)), default=0)


Modules = Mapping[str, Module]
