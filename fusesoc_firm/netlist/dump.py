"""Read a netlist in the form of `ghdl --synth --out=dump`: every gate with its kind, its parameters and its nets.

GHDL derives its VHDL and Verilog netlists from this form. The Verilog netlist lacks much information; the dump lacks
only the generics of components without an entity.
"""

from __future__ import annotations

import re

from fusesoc_firm.netlist.model import Instance, Module, Modules, Net, NetlistError, Port

# A name consists of parts separated by dots: a VHDL name (possibly an extended identifier), a GHDL name, or a number.
_PART = re.compile(r"\\(\\(?:[^\\]|\\\\)*\\|[^\\.\s{\[:;]+)|\$(\w+)|%(\d+)")
_NET = re.compile(r"(\S.*?)\{n(\d+)w(\d+)\}")
_DRIVER = re.compile(r".* <- (?:.*\{n(\d+)w(\d+)\})?")
_PORT = re.compile(r"(input|output) (.*?)(?:\[(?:(\d+):0|(\?))\])?;")
_INSTANCE = re.compile(r"instance (.*?)\{i\d+\}: (.*)")
# The instances' inputs already determine the readers of each net.
_NOT_NEEDED = "connect "
# All values have quotation marks.
_ATTRIBUTE = re.compile(r'attribute (\S+) of .* := "(.*)";')
_MODULE = re.compile(r"module \{m\d+\} (.*)")
_LOCATION = re.compile(r"# (.*:\d+:\d+)")


def read(text: str) -> Modules:
    """Return the modules of a netlist by name, in GHDL's order and without GHDL's gates."""
    reader = _Reader()
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith(_NOT_NEEDED):
            continue
        try:
            reader.line(line)
        except (ValueError, IndexError) as error:
            raise NetlistError(f"cannot parse line {number} of GHDL's netlist: {line}") from error
    return {name: module for name, module in reader.modules.items() if not name.startswith("$")}


class _Reader:
    """The modules in the lines read so far; a line belongs to the nearest line above with less indentation."""

    def __init__(self) -> None:
        self.modules: dict[str, Module] = {}
        self._stack: list[Module] = []
        self._instance: Instance | None = None
        self._module: Module | None = None
        self._location = ""
        self._attributes: dict[str, str] = {}

    def line(self, line: str) -> None:
        """Read the next line."""
        text = line.lstrip()
        depth = (len(line) - len(text)) // 2
        word = text.partition(" ")[0]
        if word == "module":
            self._begin_module(depth, text)
        elif word == "instance":
            self._begin_instance(self._stack[depth - 1], text)
        elif word in {"#", "attribute"}:
            self._note(text)
        elif word == "parameter":
            self._stack[-1].parameters.append(_name(text.split()[1].rstrip(":")))
        elif word == "parameters" and self._instance:
            self._instance.parameters = text.split()[1:]
        elif word in {"input", "output"} and " <- " not in text:
            self._port(text)
        elif word == "input":
            number, width = _matched(_DRIVER, text).groups()
            self._connect(Net(int(number), int(width)) if number else None)
        elif word == "outputs":
            self._drive(
                [Net(int(number), int(width), _name(name)) for name, number, width in _NET.findall(text, len(word))]
            )
        elif text:
            raise ValueError(text)

    def _note(self, text: str) -> None:
        """Note the place of the next instance, or an attribute of it."""
        if text.startswith("#"):
            self._location = _matched(_LOCATION, text)[1]
        else:
            name, value = _matched(_ATTRIBUTE, text).groups()
            self._attributes[name] = value

    def _begin_module(self, depth: int, text: str) -> None:
        name = _matched(_MODULE, text)[1]
        # The dollar sign distinguishes a gate from a user's module.
        module = Module(name if name.startswith("$") else _name(name))
        self._stack = [*self._stack[:depth], module]
        self.modules[module.name] = module

    def _port(self, text: str) -> None:
        direction, name, high, is_empty = _matched(_PORT, text).groups()
        module = self._stack[-1]
        port = Port(_name(name), 0 if is_empty else int(high or 0) + 1)
        (module.inputs if direction == "input" else module.outputs).append(port)

    def _begin_instance(self, module: Module, text: str) -> None:
        name, kind = _matched(_INSTANCE, text).groups()
        kind = kind if kind.startswith("$") else _name(kind)
        instance = Instance(_name(name), kind, self._location, attributes=self._attributes)
        self._location, self._attributes = "", {}
        self._instance = instance
        self._module = None
        if instance.kind == module.name:
            # Inside a module, the module's outputs are inputs.
            module.is_defined = True
            self._module = module
        else:
            module.instances.append(instance)

    def _connect(self, net: Net | None) -> None:
        if self._module:
            self._module.results = [*self._module.results, net]
        elif self._instance:
            self._instance.inputs.append(net)

    def _drive(self, nets: list[Net]) -> None:
        if self._module:
            self._module.arguments = nets
        elif self._instance:
            self._instance.outputs = nets


def _matched(pattern: re.Pattern[str], text: str) -> re.Match[str]:
    if not (found := pattern.fullmatch(text)):
        raise ValueError(text)
    return found


def _name(text: str) -> str:
    r"""Return a name as in GHDL's netlists: `\sum.%3` becomes `sum_n3`; extended identifiers lose their backslashes."""
    parts = [_plain(user) if user else own or f"n{number}" for user, own, number in _PART.findall(text)]
    if not parts:
        raise ValueError(text)
    return "_".join(parts)


def _plain(identifier: str) -> str:
    return identifier[1:-1].replace("\\\\", "\\") if identifier.startswith("\\") else identifier
