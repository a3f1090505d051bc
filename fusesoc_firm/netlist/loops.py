"""Finds combinational loops in a netlist: bits that depend on themselves without a register in between.

Simulators rarely notice a loop; FPGA tools refuse it. The search is bit-exact for gates that only move bits. An
arithmetic result depends on the operands' bits up to its own, and any other result on all bits of its operands. Every
module is searched once; its parent uses only the dependencies of outputs on inputs. A module without VHDL counts as
registered, unless it is elaborated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from math import gcd
from types import MappingProxyType
from typing import Final

from fusesoc_firm.netlist.model import Instance, Module, Modules, Net
from fusesoc_firm.netlist.verilog import constant

_BITWISE = frozenset(
    {
        *("$and", "$or", "$xor", "$nand", "$nor", "$xnor", "$not", "$utrunc", "$strunc", "$uextend"),
        *("$signal", "$isignal", "$output", "$ioutput", "$port", "$nop", "$resolver"),
    }
)
_SELECTED = frozenset({"$mux2", "$mux4", "$pmux", "$tri"})  # the first input selects
_RIPPLING = frozenset({"$add", "$sub", "$neg", "$umul", "$smul"})
_REGISTERED = frozenset(
    {
        "$dff",
        "$idff",
        "$adff",
        "$iadff",
        "$memory",
        "$memory_init",
        "$mem_rd_sync",
        "$mem_wr_sync",
        "$posedge",
        "$negedge",
    }
)

# A set of bits can have thousands of ports; the search for the shortest loop starts from this many of them.
_CANDIDATES = 32

# For each bit of each output of a module: the module's input bits on which it depends, as the bits of a number.
_Reach = Sequence[Sequence[int]]


def loops(modules: Modules, outside: Modules = MappingProxyType({})) -> list[str]:
    """Return a sentence for each combinational loop: it names instances and their ports, or signals.

    `outside` contains elaborated modules for those that are not defined, by their names; loops within them are not
    reported.
    """
    search = _Search(modules, outside)
    for module in modules.values():
        search.reach(module)
    return list(dict.fromkeys(search.found))


@dataclass(frozen=True)
class Wait:
    """An output of a module that depends on an input without a register in between; `location` is on the way."""

    output: str
    input: str
    location: str


def waits(modules: Modules) -> Iterator[Wait]:
    """Yield the outputs of the top module that wait for a `ready`: a `valid` or a `last` that depends on it.

    Only the first `ready` of each output is named.
    """
    top = next(module for module in modules.values() if module.is_defined)
    bits = _Bits(top, _Search(modules))
    arguments = zip(top.inputs, top.arguments, strict=True)
    ready = {bit: port.name for port, net in arguments if port.name.endswith("ready") for bit in bits.of(net)}
    for port, net in zip(top.outputs, top.results, strict=True):
        if port.name.endswith(("valid", "last")) and (way := bits.way(bits.of(net), ready)):
            gates = filter(None, (bits.driver[bit] for bit in way))
            yield Wait(port.name, ready[way[0]], next((gate.location for gate in gates if gate.location), ""))


class _Search:
    """A search of modules, each once and after the modules that it instantiates."""

    def __init__(self, modules: Modules, outside: Modules = MappingProxyType({})) -> None:
        self.modules: Final = modules
        self._outside: Final = outside
        self.found: Final[list[str]] = []
        self._known: Final[dict[str, _Reach]] = {}

    def reach(self, module: Module) -> _Reach:
        """Search a module, and return on which inputs its outputs depend."""
        if module.name not in self._known:
            bits = _Bits(module, self)
            self._known[module.name] = bits.reach() if module.is_defined else self._reach_outside(module)
            self.found.extend(_sentence(bits, loop) for loop in bits.loops)
        return self._known[module.name]

    def _reach_outside(self, module: Module) -> _Reach:
        """Return the dependencies of a module that is not defined; without a module of equal ports, it has none."""
        other = self._outside.get(module.name)
        if other is None or _sides(other) != _sides(module):
            return [[0] * port.width for port in module.outputs]
        reach = dict(zip((port.name.lower() for port in other.outputs), _Bits(other, self).reach(), strict=True))
        place = {bit: number for number, bit in enumerate(_flat(module))}
        places = [place[bit] for bit in _flat(other)]
        return [
            [sum(1 << places[bit] for bit in _ones(mask)) for mask in reach[port.name.lower()]]
            for port in module.outputs
        ]


@dataclass(frozen=True)
class _Step:
    """A step of a loop: within a gate or an instance, `output` depends on `input`."""

    gate: Instance
    input: int
    output: int


class _Bits:
    """The bits of a module's nets: each has a number, and the bits on which it depends."""

    def __init__(self, module: Module, search: _Search) -> None:
        self.module: Final = module
        self._search: Final = search
        self._first: Final[dict[int, int]] = {}
        self._count = 0
        for net in chain(module.arguments, *(gate.outputs for gate in module.instances)):
            self._first[net.number] = self._count
            self._count += net.width
        self._driver: Final = {net.number: gate for gate in module.instances for net in gate.outputs}
        self.driver: Final[list[Instance | None]] = [None] * self._count
        self.sources: Final[list[Sequence[int]]] = [()] * self._count
        for gate in module.instances:
            for number, net in enumerate(gate.outputs):
                first = self._first[net.number]
                self.driver[first : first + net.width] = [gate] * net.width
                self.sources[first : first + net.width] = self._sources(gate, number, net.width)

    def of(self, net: Net | None) -> Sequence[int]:
        """The bits of a net, lowest first."""
        if net is None or net.number not in self._first:
            return ()
        return range(self._first[net.number], self._first[net.number] + net.width)

    def _sources(self, gate: Instance, output: int, width: int) -> list[Sequence[int]]:
        """The bits on which each bit of an output depends, lowest first."""
        inputs = [self.of(net) for net in gate.inputs]
        if gate.kind in _REGISTERED or constant(gate) is not None:
            return [()] * width
        if not gate.is_gate:
            return self._of_instance(gate, output, inputs)
        if gate.kind in _BITWISE:
            return [[bits[bit] for bits in inputs if bit < len(bits)] for bit in range(width)]
        if gate.kind in _SELECTED:
            return [[*inputs[0], *(bits[bit] for bits in inputs[1:] if bits)] for bit in range(width)]
        if gate.kind in _RIPPLING:
            return [[*chain(*(bits[: bit + 1] for bits in inputs))] for bit in range(width)]
        if gate.kind.startswith("$concat"):
            return [(bit,) for bit in chain(*reversed(inputs))]
        if gate.kind == "$sextend":
            return [inputs[0][min(bit, len(inputs[0]) - 1) :][:1] for bit in range(width)]
        if gate.kind == "$extract":
            return [inputs[0][gate.numbers[0] + bit :][:1] for bit in range(width)]
        if gate.kind.startswith("$dyn_") or gate.kind == "$bmux":
            return self._of_element(gate, inputs, width)
        is_memory = gate.kind == "$mem_rd" and output == 0  # for its next port
        return [(bit,) for bit in inputs[0]] if is_memory else [[*chain(*inputs)]] * width

    def _of_instance(self, gate: Instance, output: int, inputs: Sequence[Sequence[int]]) -> list[Sequence[int]]:
        module = self._search.modules[gate.kind]
        widths = (port.width for port in module.inputs)
        flat = [*chain(*(bits or [-1] * width for bits, width in zip(inputs, widths, strict=True)))]
        reach = self._search.reach(module)[output]
        return [[flat[bit] for bit in _ones(mask) if flat[bit] >= 0] for mask in reach]

    def _of_element(self, gate: Instance, inputs: Sequence[Sequence[int]], width: int) -> list[Sequence[int]]:
        """Read or write an element of a vector: bits keep their places within the elements."""
        if gate.kind == "$bmux":
            return [[*inputs[0][bit::width], *inputs[1]] for bit in range(width)]
        is_read = gate.kind == "$dyn_extract"
        source, (data, index) = inputs[0], ([], inputs[1]) if is_read else inputs[1:3]
        step = self._step(gate.inputs[1 if is_read else 2]) or 1
        offset = gate.numbers[0]
        if is_read:
            return [[*source[(bit + offset) % step :: step], *index] for bit in range(width)]
        always = [*index, *chain(*inputs[3:])]
        return [[*source[bit : bit + 1], *data[(bit - offset) % step :: step], *always] for bit in range(width)]

    def _step(self, net: Net | None) -> int:
        """The number that divides all values of an index."""
        gate = self._driver.get(net.number) if net else None
        if gate is None:
            return 1
        if gate.kind == "$addidx":
            return gcd(*map(self._step, gate.inputs))
        return gate.numbers[0] if gate.kind == "$memidx" else 1

    @cached_property
    def _components(self) -> list[list[int]]:
        """Sets of bits that depend on each other, sources first (Tarjan)."""
        order, lowest, stack, found = [0] * self._count, [0] * self._count, [], []
        number = 0
        for root in range(self._count):
            if order[root]:
                continue
            number += 1
            order[root] = lowest[root] = number
            stack.append(root)
            path = [(root, iter(self.sources[root]))]
            while path:
                bit, sources = path[-1]
                for source in sources:
                    if not order[source]:
                        number += 1
                        order[source] = lowest[source] = number
                        stack.append(source)
                        path.append((source, iter(self.sources[source])))
                        break
                    lowest[bit] = min(lowest[bit], order[source])
                else:
                    path.pop()
                    if path:
                        lowest[path[-1][0]] = min(lowest[path[-1][0]], lowest[bit])
                    if lowest[bit] == order[bit]:
                        place = stack.index(bit) if stack[-1] != bit else len(stack) - 1
                        found.append(stack[place:])
                        del stack[place:]
                        for member in found[-1]:
                            # A finished bit is never the lowest of another.
                            order[member] = self._count + 1
        return found

    def reach(self) -> _Reach:
        """For each bit of each output: the input bits on which it depends."""
        masks = [0] * self._count
        for number, bit in enumerate(chain(*map(self.of, self.module.arguments))):
            masks[bit] = 1 << number
        for component in self._components:
            mask = 0
            for bit in component:
                mask |= masks[bit]
                for source in self.sources[bit]:
                    mask |= masks[source]
            for bit in component:
                masks[bit] = mask
        return [
            [masks[bit] for bit in self.of(net)] or [0] * port.width
            for net, port in zip(self.module.results, self.module.outputs, strict=True)
        ]

    @property
    def loops(self) -> Iterator[list[_Step]]:
        """The shortest loop of each set of bits that depend on themselves, preferably through instances."""
        for component in self._components:
            if len(component) > 1 or component[0] in self.sources[component[0]]:
                inside = set(component)
                ports = [bit for bit in component if (gate := self.driver[bit]) and not gate.is_gate]
                found = (self._loop(bit, inside) for bit in ports[:_CANDIDATES] or component[:1])
                yield min(found, key=lambda loop: (len([*_of_instances(loop)]), len(loop)))

    def _loop(self, start: int, inside: set[int]) -> list[_Step]:
        """The shortest path from a bit back to itself, from each bit to one on which it depends."""
        reader: dict[int, int] = {}
        ahead = deque([start])
        while start not in reader:
            bit = ahead.popleft()
            for source in self.sources[bit]:
                if source in inside and source not in reader:
                    reader[source] = bit
                    ahead.append(source)
        steps: list[_Step] = []
        bit = start
        while not steps or bit != start:
            gate = self.driver[reader[bit]]
            assert gate
            steps.append(_Step(gate, self._index(gate.inputs, bit), self._index(gate.outputs, reader[bit])))
            bit = reader[bit]
        return steps

    def way(self, starts: Sequence[int], ends: Container[int]) -> list[int]:
        """The shortest path from one of the `ends` to a bit of `starts` that depends on it; empty without a path."""
        reader = dict.fromkeys(starts, -1)
        ahead = deque(starts)
        while ahead:
            bit = ahead.popleft()
            if bit in ends:
                found = [bit]
                while (bit := reader[bit]) >= 0:
                    found.append(bit)
                return found
            for source in self.sources[bit]:
                if source not in reader:
                    reader[source] = bit
                    ahead.append(source)
        return []

    def _index(self, nets: Iterable[Net | None], bit: int) -> int:
        return next(number for number, net in enumerate(nets) if bit in self.of(net))

    def ports(self, step: _Step) -> tuple[str, str]:
        """The names of the input and of the output of an instance."""
        module = self._search.modules[step.gate.kind]
        return module.inputs[step.input].name, module.outputs[step.output].name


def _sides(module: Module) -> tuple[set[tuple[str, int]], ...]:
    """The names and widths of a module's inputs and outputs; VHDL does not preserve the case."""
    return tuple({(port.name.lower(), port.width) for port in side} for side in (module.inputs, module.outputs))


def _flat(module: Module) -> list[tuple[str, int]]:
    """The bits of a module's inputs in the order of a mask."""
    return [(port.name.lower(), bit) for port in module.inputs for bit in range(port.width)]


def _ones(mask: int) -> Iterator[int]:
    """The places of the ones in a number."""
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest


def _of_instances(loop: Iterable[_Step]) -> Iterator[_Step]:
    return (step for step in loop if not step.gate.is_gate)


def _entity(name: str) -> str:
    """Return a module's name without the architecture, the library and the generics, which GHDL 6 appends."""
    return name.partition("_B")[0]


def _sentence(bits: _Bits, loop: Sequence[_Step]) -> str:
    """Name the ports between which instances close a loop; first those of a `ready` on which another output depends."""
    entity = _entity(bits.module.name)
    steps = sorted(_of_instances(loop), key=lambda step: not _is_against_the_rule(*bits.ports(step)))
    if not steps:
        signals = dict.fromkeys(step.gate.name for step in loop if step.gate.kind in {"$signal", "$isignal"})
        names = ", ".join(f"'{name}'" for name in signals) or "unnamed signals"
        location = next((step.gate.location for step in loop if step.gate.location), "")
        return f"{location}: error: combinational loop in '{entity}': {names}"
    first, *others = steps
    source, result = bits.ports(first)
    ways = ", ".join(
        f"'{step.gate.name}' (from '{start}' to '{end}')" for step in others for start, end in [bits.ports(step)]
    )
    return (
        f"{first.gate.location}: error: combinational loop in '{entity}': '{result}' of '{first.gate.name}' "
        f"depends on its '{source}', which {f'depends on it through {ways}' if ways else 'is connected to it'}"
    )


def _is_against_the_rule(source: str, result: str) -> bool:
    """Whether something depends on a `ready` that is not a `ready` itself."""
    return source.endswith("ready") and not result.endswith("ready")
