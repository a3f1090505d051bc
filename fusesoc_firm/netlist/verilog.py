"""Write a netlist as Verilog 2001: a wire for each net, and a statement with the exact function of each gate.

The result does not depend on Verilog's rules for the width and sign of expressions: operands are as wide as results,
and signs are explicit. Combinational logic uses continuous assignments instead of `always @*`, which some simulators do
not run until an input changes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Final

from fusesoc_firm.netlist.model import Instance, LostMemoryError, Module, Modules, Net, NetlistError, Port
from fusesoc_firm.text.naming import VERILOG_KEYWORDS

_WORD = 32
_LEVELS = "01zx"  # indexed by the bit of GHDL's value plus twice the bit of GHDL's mask for levels other than 0 and 1

_UNARY = {"$not": "~{0}", "$neg": "-{0}", "$red_and": "&{0}", "$red_or": "|{0}", "$red_xor": "^{0}"}
_BINARY = {
    "$and": "{0} & {1}",
    "$or": "{0} | {1}",
    "$xor": "{0} ^ {1}",
    "$nand": "~({0} & {1})",
    "$nor": "~({0} | {1})",
    "$xnor": "~({0} ^ {1})",
    "$add": "{0} + {1}",
    "$sub": "{0} - {1}",
    "$umul": "{0} * {1}",
    "$smul": "{0} * {1}",
    "$udiv": "{0} / {1}",
    "$umod": "{0} % {1}",
    "$sdiv": "$signed({0}) / $signed({1})",
    "$srem": "$signed({0}) % $signed({1})",
    "$umin": "{0} < {1} ? {0} : {1}",
    "$umax": "{0} > {1} ? {0} : {1}",
    "$smin": "$signed({0}) < $signed({1}) ? {0} : {1}",
    "$smax": "$signed({0}) > $signed({1}) ? {0} : {1}",
    "$lsl": "{0} << {1}",
    "$lsr": "{0} >> {1}",
    "$asr": "$signed({0}) >>> {1}",
    "$eq": "{0} == {1}",
    "$ne": "{0} != {1}",
    "$ult": "{0} < {1}",
    "$ule": "{0} <= {1}",
    "$ugt": "{0} > {1}",
    "$uge": "{0} >= {1}",
    "$slt": "$signed({0}) < $signed({1})",
    "$sle": "$signed({0}) <= $signed({1})",
    "$sgt": "$signed({0}) > $signed({1})",
    "$sge": "$signed({0}) >= $signed({1})",
}
_OTHER = {
    "$mux2": "{0} ? {2} : {1}",
    "$mux4": "{0}[1] ? ({0}[0] ? {4} : {3}) : ({0}[0] ? {2} : {1})",
    "$tri": "{0} ? {1} : {{{width}{{1'bz}}}}",
}
_EXPRESSIONS: Mapping[str, str] = {**_UNARY, **_BINARY, **_OTHER}
_WIRES = frozenset({"$signal", "$isignal", "$output", "$ioutput", "$port", "$nop", "$enable"})
_SIGNALS = frozenset({"$signal", "$isignal"})  # their nets have the same names, without a suffix
_EDGES = {"$posedge": "posedge", "$negedge": "negedge"}
_MEMORIES = frozenset({"$memory", "$memory_init"})
# The attributes with which VHDL tells synthesis how to build a memory; their values are texts.
_OF_MEMORIES = frozenset({"ram_style", "ramstyle", "syn_ramstyle", "rw_addr_collision"})
_MEMORY_PORTS = frozenset({"$mem_rd", "$mem_rd_sync", "$mem_wr_sync"})
_REGISTERS = frozenset({"$dff", "$idff", "$adff", "$iadff"})
# These gates serve formal verification and are not hardware.
_IGNORED = frozenset({"$assume", "$cover"})

# The generics of a component, in Verilog, indexed by the enclosing module and the instance's name.
Generics = Mapping[tuple[str, str], Mapping[str, str]]


def write(modules: Modules, generics: Generics) -> dict[str, str]:
    """Return the Verilog of each defined module, by its name, instances before what contains them.

    Raise `NetlistError` for gates without a hardware equivalent.
    """
    defined = [module for module in modules.values() if module.is_defined]
    return {module.name: _Writer(module, modules, generics).text() for module in reversed(defined)}


def identifier(name: str) -> str:
    """Return a Verilog identifier, escaped unless the name is a simple identifier."""
    name = "".join(letter if "!" <= letter <= "~" else "_" for letter in name)
    is_simple = name.isidentifier() and name not in VERILOG_KEYWORDS
    return name if is_simple else f"\\{name} "


def literal(bits: str) -> str:
    """Return a Verilog literal for the levels 0, 1, x and z in `bits`, the highest bit first."""
    if len(bits) > 1 and set(bits) <= {"0", "1"}:
        return f"{len(bits)}'h{int(bits, 2):x}"
    return f"{len(bits)}'b{bits}"


def declaration(width: int) -> str:
    """Return the range in a declaration, followed by a blank, or an empty string for one bit."""
    return f"[{width - 1}:0] " if width > 1 else ""


def memory_attributes(memory: Instance) -> str:
    """Return the attributes in front of a memory's declaration, followed by a blank, or an empty string."""
    known = [f'{name} = "{value}"' for name, value in memory.attributes.items() if name in _OF_MEMORIES]
    return f"(* {', '.join(known)} *) " if known else ""


def constant(gate: Instance) -> str | None:
    """Return the levels of a constant, the highest bit first, or None if the gate is not a constant."""
    width = gate.outputs[0].width if gate.outputs else 0
    match gate.kind:
        case "$const_UB32" | "$const_0":
            words, levels = [*gate.numbers, 0][:1], [0]
        case "$const_1":
            words, levels = [1], [0]
        case "$const_SB32":
            value = gate.numbers[0]
            return _digits(value - (value >> _WORD - 1 << _WORD), width)
        case "$const_UL32":
            words, levels = gate.numbers[:1], gate.numbers[1:]
        case "$const_X":
            return "x" * width
        case "$const_Z":
            return "z" * width
        case "$const_bit":
            words, levels = gate.numbers, []
        case "$const_log":
            words, levels = gate.numbers[::2], gate.numbers[1::2]
        case _:
            return None
    value, other = (sum(word << _WORD * index for index, word in enumerate(half)) for half in (words, levels))
    if not other:
        return _digits(value, width)
    return "".join(
        _LEVELS[2 * int(level) + int(bit)]
        for bit, level in zip(_digits(value, width), _digits(other, width), strict=True)
    )


def _digits(value: int, width: int) -> str:
    return format(value & (1 << width) - 1, f"0{width}b") if width else ""


def _assignment(target: str, value: str) -> str:
    return f"  assign {target} = {value};"


def _either(condition: str, value: str, other: str) -> str:
    return f"{condition} ? {value} : {other}"


def _function(name: str, width: int, inputs: Mapping[str, Net], statements: Iterable[str]) -> Iterator[str]:
    """Yield the declaration of a function with a `width`-bit result."""
    yield f"  function {declaration(width)}{name};"
    yield from (f"    input {declaration(net.width)}{item};" for item, net in inputs.items())
    yield from (f"    {statement}" for statement in statements)
    yield "  endfunction"


def _insertion(function: str, place: str, width: int) -> Iterator[str]:
    """Yield statements that insert `data` (`width` bits) into `source` at a position."""
    yield "begin"
    yield f"  {function} = source;"
    yield f"  {function}[{place} +: {width}] = data;"
    yield "end"


def _choice(function: str, width: int, count: int) -> Iterator[str]:
    """Yield statements that choose the value whose bit in the `selector` is set, or `value0` if no bit is set."""
    yield "case (selector)"
    for bit in range(count - 1):
        yield f"  {literal(_digits(1 << bit, width))}: {function} = value{bit + 1};"
    yield f"  default: {function} = value0;"
    yield "endcase"


class _Writer:
    """A writer for one module."""

    def __init__(self, module: Module, modules: Modules, generics: Generics) -> None:
        self.module: Final = module
        self.modules: Final = modules
        self.generics: Final = generics
        self.driver: dict[int, Instance] = {net.number: gate for gate in module.instances for net in gate.outputs}
        self.readers: dict[int, list[Instance]] = defaultdict(list)
        for gate in module.instances:
            for net in gate.inputs:
                if net:
                    self.readers[net.number].append(gate)
        self.constants: dict[int, str] = {}
        for gate in module.instances:
            if (bits := constant(gate)) is not None:
                self.constants[gate.outputs[0].number] = bits
        self._taken = {port.name for port in (*module.inputs, *module.outputs)}
        self.names: dict[int, str] = {
            net.number: identifier(port.name) for net, port in zip(module.arguments, module.inputs, strict=True)
        }
        self.labels: dict[int, str] = {}  # of instances and memories
        self._name_all()

    def _name_all(self) -> None:
        """Name all nets and instances as GHDL does; append a number to a name that is already in use."""
        for gate in self.module.instances:
            if gate.kind in _MEMORIES or not gate.is_gate:
                self.labels[id(gate)] = self._distinct(gate.name)
            for net in gate.outputs:
                self.names[net.number] = self._distinct(gate.name if gate.kind in _SIGNALS else net.name)

    def _distinct(self, name: str) -> str:
        found, number = name, 1
        while found in self._taken:
            number += 1
            found = f"{name}_{number}"
        self._taken.add(found)
        return identifier(found)

    # The module

    def text(self) -> str:
        """Return the module's Verilog."""
        declarations = list(chain.from_iterable(map(self._declarations, self.module.instances)))
        statements = list(chain.from_iterable(map(self._located, self.module.instances)))
        lines = [f"module {identifier(self.module.name)}", *self._ports(), *declarations, *self._outputs(), *statements]
        return "\n".join([*lines, "endmodule", ""])

    def _ports(self) -> Iterator[str]:
        inouts = self._inouts()
        ports = [("input  ", port) for port in self.module.inputs]
        ports += [("inout  " if port.name in inouts else "output ", port) for port in self.module.outputs]
        for number, (direction, port) in enumerate(ports):
            begin, end = "   " if number else "  (", ");" if number == len(ports) - 1 else ","
            yield f"{begin}{direction}{declaration(self._port_width(port))}{identifier(port.name)}{end}"
        if not ports:
            yield "  ;"

    def _port_width(self, port: Port) -> int:
        if not port.width:
            raise NetlistError(f"error: the port '{port.name}' of '{self.module.name}' has no bits")
        return port.width

    def _inouts(self) -> dict[str, Net]:
        return {
            port.name: net
            for port, net in zip(self.module.outputs, self.module.results, strict=True)
            if net and (gate := self.driver.get(net.number)) and gate.kind in {"$inout", "$iinout"}
        }

    def _outputs(self) -> Iterator[str]:
        for port, net in zip(self.module.outputs, self.module.results, strict=True):
            if net is None:
                raise NetlistError(f"error: nothing drives the port '{port.name}' of '{self.module.name}'")
            yield _assignment(identifier(port.name), self.value(net))

    def _declarations(self, gate: Instance) -> Iterator[str]:
        if gate.kind in _EDGES or (gate.outputs and gate.outputs[0].number in self.constants):
            return
        if gate.kind in _MEMORIES:
            yield from self._memory_declaration(gate)
            return
        is_register = gate.kind in _REGISTERS or gate.kind == "$mem_rd_sync"
        for net in gate.outputs[1:] if gate.kind in _MEMORY_PORTS else gate.outputs:
            if net.width:
                yield f"  {'reg' if is_register else 'wire'} {declaration(net.width)}{self.names[net.number]};"

    def _located(self, gate: Instance) -> Iterator[str]:
        """Yield a gate's statements, below a comment with the gate's place in the VHDL."""
        statements = list(self._statements(gate))
        if statements and gate.location:
            yield f"  // {gate.location}"
        yield from statements

    # Nets

    def value(self, net: Net) -> str:
        """Return a net's name, or its value if it is constant."""
        if net.number in self.constants:
            return literal(self.constants[net.number])
        gate = self.driver.get(net.number)
        if gate and gate.kind in _EDGES:
            raise LostMemoryError(str(gate.error("the edge of a clock is used as a value")))
        return self.names[net.number]

    def part(self, net: Net, low: int, width: int) -> str:
        """Return a slice of a net."""
        if net.number in self.constants:
            bits = self.constants[net.number]
            return literal(bits[len(bits) - low - width : len(bits) - low])
        name = self.value(net)
        if width == net.width:
            return name
        return f"{name}[{low}]" if width == 1 else f"{name}[{low + width - 1}:{low}]"

    def extended(self, net: Net, width: int) -> str:
        """Return a net, extended with zeros to `width` bits."""
        if net.number in self.constants:
            return literal(self.constants[net.number].zfill(width))
        value = self.value(net)
        return f"{{{literal('0' * (width - net.width))}, {value}}}" if width > net.width else value

    # Gates

    def _statements(self, gate: Instance) -> Iterator[str]:
        if gate.outputs and gate.outputs[0].number in self.constants:
            return
        if gate.kind in _IGNORED or gate.kind in _EDGES or gate.kind in _MEMORY_PORTS:
            return
        if not gate.is_gate:
            yield from self._module_instance(gate)
        elif gate.kind in _MEMORIES:
            yield from self._memory(gate)
        elif gate.kind in _REGISTERS:
            yield from self._register(gate)
        elif gate.outputs and not gate.outputs[0].width:
            return
        elif gate.kind in _EXPRESSIONS:
            yield from self._assign(gate, self._expression(gate))
        elif gate.kind in _WIRES:
            yield from self._assign(gate, self._driven(gate))
        elif (special := self._special.get(gate.kind)) is not None:
            yield from special(self, gate)
        else:
            raise gate.error(f"GHDL translates this to '{gate.kind[1:]}', which has no counterpart in Verilog")

    def _assign(self, gate: Instance, expression: str) -> Iterator[str]:
        yield _assignment(self.names[gate.outputs[0].number], expression)

    def _expression(self, gate: Instance) -> str:
        nets = [gate.input(index) for index in range(len(gate.inputs))]
        if gate.kind == "$mux4" and nets[0].number in self.constants:
            return self.value(nets[1 + int(self.constants[nets[0].number], 2)])
        return _EXPRESSIONS[gate.kind].format(*map(self.value, nets), width=gate.outputs[0].width)

    def _driven(self, gate: Instance) -> str:
        """Return the assignment to a signal; a signal without a driver keeps its initial value."""
        has_first = gate.kind in {"$isignal", "$ioutput"}
        return self.value(gate.input(1 if has_first and gate.inputs[0] is None else 0))

    def _absolute(self, gate: Instance) -> Iterator[str]:
        net = gate.input(0)
        value = self.value(net)
        yield from self._assign(gate, _either(self.part(net, net.width - 1, 1), f"-{value}", value))

    def _modulus(self, gate: Instance) -> Iterator[str]:
        """Yield the statements for the remainder with the sign of the divisor."""
        left, right = gate.input(0), gate.input(1)
        a, b = (f"$signed({self.value(net)})" for net in (left, right))
        signs = " != ".join(self.part(net, net.width - 1, 1) for net in (left, right))
        yield from self._assign(gate, f"{a} % {b} != 0 && {signs} ? {a} % {b} + {b} : {a} % {b}")

    def _rotation(self, gate: Instance) -> Iterator[str]:
        net, width = gate.input(0), gate.outputs[0].width
        value, places = self.value(net), gate.input(1)
        size = max(places.width, width.bit_length())
        count = f"({self.extended(places, size)} % {size}'d{width})"
        twice = f"{{{value}, {value}}}"
        yield from self._assign(
            gate, f"{twice} >> {count}" if gate.kind == "$ror" else f"({twice} << {count}) >> {width}"
        )

    def _concatenation(self, gate: Instance) -> Iterator[str]:
        nets = [gate.input(index) for index in range(len(gate.inputs))]
        yield from self._assign(gate, f"{{{', '.join(self.value(net) for net in nets if net.width)}}}")

    def _truncation(self, gate: Instance) -> Iterator[str]:
        yield from self._assign(gate, self.part(gate.input(0), 0, gate.outputs[0].width))

    def _extension(self, gate: Instance) -> Iterator[str]:
        net, width = gate.input(0), gate.outputs[0].width
        if gate.kind == "$uextend" or not net.width:
            yield from self._assign(gate, self.extended(net, width) if net.width else literal("0" * width))
        elif bits := self.constants.get(net.number):
            yield from self._assign(gate, literal(bits.rjust(width, bits[0])))
        else:
            sign = self.part(net, net.width - 1, 1)
            yield from self._assign(gate, f"{{{{{width - net.width}{{{sign}}}}}, {self.value(net)}}}")

    def _extraction(self, gate: Instance) -> Iterator[str]:
        yield from self._assign(gate, self.part(gate.input(0), gate.numbers[0], gate.outputs[0].width))

    def _scaled_index(self, gate: Instance) -> Iterator[str]:
        net, width, step = gate.input(0), gate.outputs[0].width, gate.numbers[0]
        index = self.extended(net, width) if net.width < width else self.part(net, 0, width)
        yield from self._assign(gate, index if step == 1 else f"{index} * {width}'d{step % (1 << width)}")

    def _sum_of_indices(self, gate: Instance) -> Iterator[str]:
        width = gate.outputs[0].width
        yield from self._assign(gate, " + ".join(self.extended(gate.input(index), width) for index in (0, 1)))

    def _dynamic_extraction(self, gate: Instance) -> Iterator[str]:
        yield from self._part(gate, self._place(gate, gate.input(1)))

    def _element(self, gate: Instance) -> Iterator[str]:
        yield from self._part(gate, f"{self.value(gate.input(1))} * {gate.outputs[0].width}")

    def _part(self, gate: Instance, place: str) -> Iterator[str]:
        """Assign the bits of the first input from `place` on."""
        source, width = gate.input(0), gate.outputs[0].width
        if source.width == width:
            yield from self._assign(gate, self.value(source))
            return
        name = self.value(source)
        if source.number in self.constants:
            name = self._distinct(f"{gate.name}_source")
            yield f"  wire {declaration(source.width)}{name} = {self.value(source)};"
        yield from self._assign(gate, f"{name}[{place} +: {width}]")

    def _dynamic_insertion(self, gate: Instance) -> Iterator[str]:
        source, data, index = (gate.input(number) for number in range(3))
        width = gate.outputs[0].width
        changed = self.value(data)
        if width != data.width:
            name = self._distinct(f"{gate.name}_insert")
            place = self._place(gate, index, "place")
            inputs = {"source": source, "data": data, "place": index}
            yield from _function(name, width, inputs, _insertion(name, place, data.width))
            changed = self._call(name, inputs.values())
        if gate.kind == "$dyn_insert_en":
            changed = _either(self.value(gate.input(3)), changed, self.value(source))
        yield from self._assign(gate, changed)

    def _place(self, gate: Instance, index: Net, name: str = "") -> str:
        """Return the sum of an index and the gate's offset, which is wide enough not to overflow."""
        offset = gate.numbers[0]
        width = max(index.width, offset.bit_length()) + 1
        value = f"{{{literal('0' * (width - index.width))}, {name or self.value(index)}}}"
        return f"{value} + {width}'d{offset}" if offset else name or self.value(index)

    def _selection(self, gate: Instance) -> Iterator[str]:
        """Yield the statements for a multiplexer with a selector bit for each value except the first."""
        width, selector = gate.outputs[0].width, gate.input(0)
        nets = [gate.input(index) for index in range(1, len(gate.inputs))]
        name = self._distinct(f"{gate.name}_select")
        inputs = {"selector": selector, **{f"value{number}": net for number, net in enumerate(nets)}}
        yield from _function(name, width, inputs, _choice(name, selector.width, len(nets)))
        yield from self._assign(gate, self._call(name, inputs.values()))

    def _call(self, function: str, nets: Iterable[Net]) -> str:
        return f"{function}({', '.join(map(self.value, nets))})"

    def _bidirectional(self, gate: Instance) -> Iterator[str]:
        read, port = gate.outputs
        name = next(name for name, net in self._inouts().items() if net.number == port.number)
        if gate.inputs[0]:
            yield _assignment(self.names[port.number], self.value(gate.input(0)))
        else:
            yield _assignment(self.names[port.number], f"{{{port.width}{{1'bz}}}}")
        yield _assignment(self.names[read.number], identifier(name))

    def _resolution(self, gate: Instance) -> Iterator[str]:
        for index in (0, 1):
            yield from self._assign(gate, self.value(gate.input(index)))

    def _assertion(self, gate: Instance) -> Iterator[str]:
        yield "  always @*"
        yield f"    if (!{self.value(gate.input(0))})"
        yield f'      $fatal(1, "assertion failure {gate.name}");'

    _special: Final[Mapping[str, Callable[[_Writer, Instance], Iterator[str]]]] = {
        "$abs": _absolute,
        "$smod": _modulus,
        "$rol": _rotation,
        "$ror": _rotation,
        **dict.fromkeys(("$concat2", "$concat3", "$concat4", "$concatn"), _concatenation),
        **dict.fromkeys(("$utrunc", "$strunc"), _truncation),
        **dict.fromkeys(("$uextend", "$sextend"), _extension),
        "$extract": _extraction,
        "$memidx": _scaled_index,
        "$addidx": _sum_of_indices,
        "$dyn_extract": _dynamic_extraction,
        "$bmux": _element,
        **dict.fromkeys(("$dyn_insert", "$dyn_insert_en"), _dynamic_insertion),
        "$pmux": _selection,
        **dict.fromkeys(("$inout", "$iinout"), _bidirectional),
        "$resolver": _resolution,
        **dict.fromkeys(("$assert", "$assert_cover"), _assertion),
    }

    # Registers and memories

    def _edge(self, gate: Instance, index: int) -> str:
        net = gate.input(index)
        clock = self.driver.get(net.number)
        if clock is None or clock.kind not in _EDGES:
            raise gate.error("a register has no clock")
        return f"{_EDGES[clock.kind]} {self.value(clock.input(0))}"

    def _register(self, gate: Instance) -> Iterator[str]:
        name = self.names[gate.outputs[0].number]
        assignment = f"{name} <= {self.value(gate.input(1))};"
        if "a" in gate.kind:
            yield from self._with_reset(gate, name, assignment)
        else:
            yield from (f"  always @({self._edge(gate, 0)})", f"    {assignment}")
        if "i" in gate.kind:
            first = self._first_value(gate, gate.input(len(gate.inputs) - 1))
            if set(first) != {"x"}:
                yield f"  initial {name} = {literal(first)};"

    def _with_reset(self, gate: Instance, name: str, assignment: str) -> Iterator[str]:
        reset = self.value(gate.input(2))
        yield f"  always @({self._edge(gate, 0)} or posedge {reset})"
        yield f"    if ({reset})"
        yield f"      {name} <= {self.value(gate.input(3))};"
        yield "    else"
        yield f"      {assignment}"

    def _first_value(self, gate: Instance, net: Net) -> str:
        """Return the levels of a net's initial value, which may come from a signal."""
        if net.number in self.constants:
            return self.constants[net.number]
        source = self.driver.get(net.number)
        if source and source.kind in _SIGNALS:
            return self._first_value(gate, source.input(1 if source.kind == "$isignal" else 0))
        if source and source.kind == "$extract":
            bits = self._first_value(gate, source.input(0))
            end = len(bits) - source.numbers[0]
            return bits[end - net.width : end]
        raise gate.error("the initial value is not constant")

    def _memory_ports(self, memory: Instance) -> list[Instance]:
        """Return a memory's ports in the order in which they operate."""
        found: list[Instance] = []
        port = memory
        while (port := self._next_port(port)) is not memory:
            found.append(port)
        return found

    def _next_port(self, port: Instance) -> Instance:
        net = port.outputs[0].number
        for reader in self.readers[net]:
            if reader.inputs[0] and reader.inputs[0].number == net:
                return reader
        raise port.error("GHDL did not connect the ports of a memory")

    def _memory_size(self, memory: Instance) -> tuple[int, int]:
        """Return the number of bits per word and the number of words."""
        port = self._memory_ports(memory)[0]
        width = port.input(4).width if port.kind == "$mem_wr_sync" else port.outputs[1].width
        return width, memory.outputs[0].width // width

    def _memory_declaration(self, memory: Instance) -> Iterator[str]:
        width, depth = self._memory_size(memory)
        yield f"  {memory_attributes(memory)}reg {declaration(width)}{self.labels[id(memory)]} [0:{depth - 1}];"

    def _memory(self, memory: Instance) -> Iterator[str]:
        name = self.labels[id(memory)]
        ports = self._memory_ports(memory)
        if memory.kind == "$memory_init":
            yield from self._contents(memory)
        clocked: dict[str, list[Instance]] = defaultdict(list)
        for number, port in enumerate(ports):
            if port.kind == "$mem_rd":
                yield _assignment(self.names[port.outputs[1].number], self._word(name, port, ports[:number]))
            else:
                clocked[self._edge(port, 2)].append(port)
        for edge, group in clocked.items():
            yield from self._clocked(name, edge, group)

    def _clocked(self, name: str, edge: str, ports: Sequence[Instance]) -> Iterator[str]:
        """Yield the `always` block for the ports of a memory that operate at the same edge."""
        yield f"  always @({edge}) begin"
        for number, port in enumerate(ports):
            is_always = self.constants.get(port.input(3).number) == "1"
            condition = "" if is_always else f"if ({self.value(port.input(3))}) "
            yield f"    {condition}{self._action(name, port, ports[:number])}"
        yield "  end"

    def _action(self, name: str, port: Instance, before: Sequence[Instance]) -> str:
        """Return the statement that a port executes at its clock edge."""
        if port.kind == "$mem_wr_sync":
            return f"{name}[{self.value(port.input(1))}] <= {self.value(port.input(4))};"
        return f"{self.names[port.outputs[1].number]} <= {self._word(name, port, before)};"

    def _word(self, name: str, port: Instance, before: Sequence[Instance]) -> str:
        """Return the word at a port's address, including data that earlier ports write at the same edge."""
        address = self.value(port.input(1))
        word = f"{name}[{address}]"
        for other in before:
            if other.kind == "$mem_wr_sync":
                is_written = f"{self.value(other.input(3))} && {self.value(other.input(1))} == {address}"
                word = _either(is_written, self.value(other.input(4)), word)
        return word

    def _contents(self, memory: Instance) -> Iterator[str]:
        name = self.labels[id(memory)]
        width, depth = self._memory_size(memory)
        bits = self._first_value(memory, memory.input(1))
        if set(bits) == {"x"}:
            return
        yield "  initial begin"
        for word in range(depth):
            end = len(bits) - word * width
            yield f"    {name}[{word}] = {literal(bits[end - width : end])};"
        yield "  end"

    # Instances of modules

    def _module_instance(self, gate: Instance) -> Iterator[str]:
        module = self.modules[gate.kind]
        values = self.generics.get((self.module.name, gate.name), {}) if module.parameters else {}
        parameters = ", ".join(f".{identifier(name)}({values[name]})" for name in module.parameters)
        given = f"#({parameters}) " if parameters else ""
        yield f"  {identifier(module.name)} {given}{self.labels[id(gate)]} ("
        yield ",\n".join(f"    .{identifier(port)}({value})" for port, value in self._connections(gate, module))
        yield "  );"

    def _connections(self, gate: Instance, module: Module) -> Iterator[tuple[str, str]]:
        """Yield each port of an instance, with the connected net."""
        for index, port in enumerate(module.inputs):
            yield port.name, self.value(gate.input(index))
        for port, net in zip(module.outputs, gate.outputs, strict=True):
            yield port.name, self.names[net.number] if self._is_read(net) else ""

    def _is_read(self, net: Net) -> bool:
        return net.number in self.readers or net in self.module.results
