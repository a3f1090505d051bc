"""The names of a program's signals, and the expressions of its values in VHDL."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field

from fusesoc_firm.compiler.answers import Answer
from fusesoc_firm.compiler.binding import Binding, Register
from fusesoc_firm.compiler.graph import LEAVES, Node
from fusesoc_firm.compiler.kinds import BOOL, INT, bits_of
from fusesoc_firm.compiler.operators import is_operator
from fusesoc_firm.compiler.paths import Carried
from fusesoc_firm.compiler.schedule import TRANSPARENT
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.text.naming import KEYWORDS, VHDL_PREDEFINED, distinct_identifiers

# The signals of the template.
_SIGNALS = """
    step_r at_step_r advance holds is_open is_checked accepted done sent_r
    firm rtl work ieee run_steps run_operations send_answers clk rst_n
""".split()
# The signals of a list whose elements have the name '*'.
_OF_LIST = ("words_*", "word_*", "index_*_r", "ends_*", "valid_*", "ready_*", "sent_*_r")
OF_PIPELINE = ("flow", "enters", "token", "last", "all", "ends")
"""The signals of a pipeline.

No output stalls it, an element enters, is in each stage, and is the last one; the last one has entered, and leaves.
"""
_INTEGER_OPERATORS = {"add": "+", "subtract": "-"}


@dataclass
class Signals:
    """The signals of a bound program, and the constants that its expressions need, by their bits.

    The name of a signal is that of its key: the node, register or unit, ('carried', payload of the node),
    ('delayed', node, stage of a pipeline), or one of a pipeline with its phase. An expression is that of a value in a
    step of a phase.
    """

    binding: Binding
    constants: dict[tuple[int, int], str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.schedule = self.binding.schedule
        self.program = self.schedule.program
        self.combinational = [node for node in self.program.needed() if _is_combinational(node)]
        wanted = [*self._wanted()]
        names = distinct_identifiers([_words(name) for _, name in wanted], [*self._reserved()])
        self._names = {key: name for (key, _), name in zip(wanted, names, strict=True)}

    def __getitem__(self, key: Hashable) -> str:
        """Return the name of a signal."""
        return self._names[key]

    # Names.

    def _wanted(self) -> Iterator[tuple[Hashable, str]]:
        """Yield the key of each signal, with the name that readers would choose."""
        for state in self.program.states:
            yield state.value, f"{state.path.split('.', 1)[-1]}_state_r"
        for item in self._carried():
            yield ("carried", item.value.payload), f"{item.name}_r"
        for register in self.binding.registers:
            yield register, f"{self._register_name(register)}_r"
        for node in self.combinational:
            yield node, _node_name(node)
        for unit in self.schedule.units:
            yield unit, f"{unit.operator.operation}_{unit.operator.operand}_{unit.number}"
        for node, stage in self.binding.delays():
            yield ("delayed", node, stage), f"{self._delayed_name(node)}_{stage}_r"
        for phase in self.schedule.depths:
            yield from (((name, phase), f"{name}_{phase // 2}") for name in OF_PIPELINE)

    def _reserved(self) -> Iterator[str]:
        """Yield the names that the template, VHDL and the ports have."""
        yield from (*_SIGNALS, *KEYWORDS, *VHDL_PREDEFINED)
        yield from (item.port for item in self.program.settings)
        answers = self.program.answers
        yield from (own_signal(name, answer) for answer in answers for name in ("dropped", "segments"))
        for side in (*self.program.inputs, *(answer.side for answer in answers)):
            yield from (leaf.port for leaf in side.leaves)
            for part in side.parts:
                yield part.element
                yield from (name.replace("*", part.element) for name in _OF_LIST)

    def _carried(self) -> Iterator[Carried]:
        for loop in self.program.loops:
            yield from loop.carried.values()

    def _register_name(self, register: Register) -> str:
        first = register.values[0]
        issue = self.schedule.issues.get(first.number)
        if len(register.values) == 1 or issue is None:
            return _node_name(first)
        return f"{issue.unit.operator.operation}_value"

    def _delayed_name(self, node: Node) -> str:
        """Return the name of a value that a pipeline hands on."""
        if node.operation == "input":
            return str(node.payload.port)
        if node.operation == "carried":
            return next(item.name for item in self._carried() if item.value is node)
        return _node_name(node)

    # Expressions.

    def value(self, node: Node, phase: int, step: int) -> str:
        """Return the expression of a value in a step of a phase."""
        if phase in self.schedule.depths and (key := ("delayed", node, step)) in self._names:
            return self._names[key]
        match node.operation:
            case "constant":
                return self._constant(node)
            case "input":
                return str(node.payload)
            case "state":
                return self._names[node]
            case "carried" | "final":
                return self._names["carried", node.payload]
        if node.operation in TRANSPARENT:
            return self._transparent(node, phase, step)
        time = self.schedule.times[node.number]
        if (time.phase, time.step) != (phase, step):
            return self._names[self.binding.by_node[node.number]]
        if is_operator(node):
            return f"{self._names[self.schedule.issues[node.number].unit]}_result"
        return self._names[node]

    def fitted(self, node: Node, bits: int, phase: int, step: int) -> str:
        """Return the expression of a value with a number of bits: integers of Python have those of their ranges."""
        if node.kind != INT or node.bits == bits:
            return self.value(node, phase, step)
        if node.is_constant:
            return self._constant(node, bits)
        return f"std_logic_vector({number_text(node, self.value(node, phase, step), bits)})"

    def _constant(self, node: Node, bits: int = 0) -> str:
        if node.kind == BOOL:
            return "'1'" if node.payload else "'0'"
        width = bits or node.bits
        key = (width, bits_of(node.kind, node.payload, width))
        return self.constants.setdefault(key, f"constant_{len(self.constants)}")

    def _transparent(self, node: Node, phase: int, step: int) -> str:
        given = [self.value(item, phase, step) for item in node.operands]
        match node.operation:
            case "negate":
                return f"negated({given[0]})"
            case "absolute":
                return f"magnitude({given[0]})"
            case "sine" | "cosine" | "quotient" | "remainder":
                # A pair is a signal; its first number is in the lowest bits.
                low = node.bits if node.operation in ("cosine", "remainder") else 0
                return f"{given[0]}({low + node.bits - 1} downto {low})"
            case "copy_sign":
                return f"with_sign_of({given[0]}, {given[1]}, {node.kind.exponent_bits})"
            case "invert" if node.kind == BOOL:
                return f"(not {given[0]})"
            case "invert":
                return _vector(f"not {number_text(node.operands[0], given[0], node.bits)}")
            case "wrap":
                return _vector(number_text(node.operands[0], given[0], node.bits))
            case "shift_left":
                return _vector(f"shift_left({number_text(node.operands[0], given[0], node.bits)}, {node.payload})")
            case "shift_right":
                # The bits above the result's are shifted into it.
                wide = node.operands[0].bits
                shifted = f"shift_right({number_text(node.operands[0], given[0], wide)}, {node.payload})"
                return _vector(f"fitted({shifted}, {node.bits})" if wide != node.bits else shifted)
        return given[0]

    def combinational_value(self, node: Node) -> str:
        """Return the expression of an operation from its operands in the step in which it is evaluated."""
        time = self.schedule.times[node.number]
        given = [self.value(item, time.phase, time.step) for item in node.operands]
        match node.operation:
            case "choose":
                pair = [self.fitted(item, node.bits, time.phase, time.step) for item in node.operands[1:]]
                return f"chosen({given[0]}, {pair[0]}, {pair[1]})"
            case "and" | "or" | "xor" if node.kind == BOOL:
                return f"{given[0]} {node.operation} {given[1]}"
            case "less" | "at_most" | "equal":
                return self._comparison(node, given)
            case "saturate":
                units = node.operands[0]
                return _vector(f"saturated({number_text(units, given[0], units.bits)}, {node.bits})")
        one, other = (number_text(item, text, node.bits) for item, text in zip(node.operands, given, strict=True))
        if node.operation == "multiply":
            return _vector(f"fitted({one} * {other}, {node.bits})")
        return _vector(f"{one} {_INTEGER_OPERATORS.get(node.operation, node.operation)} {other}")

    def _comparison(self, node: Node, given: Sequence[str]) -> str:
        one = node.operands[0]
        if one.kind.is_float:
            return f"is_{node.operation}({given[0]}, {given[1]}, {one.kind.exponent_bits})"
        # With a bit for the sign, all integers are compared as signed ones.
        bits = max(item.bits + (not item.is_signed) for item in node.operands)
        pair = [number_text(item, text, bits) for item, text in zip(node.operands, given, strict=True)]
        return f"to_bit_of({pair[0]} {'<' if node.operation == 'less' else '='} {pair[1]})"

    def segment(self, number: int) -> str:
        """Return the condition that the fields of a segment are valid; no field may follow the last array."""
        conditions = ["is_open"]
        conditions += [
            f"{side.prefix}segment_valid({number})"
            for side in self.program.inputs
            if not side.is_fixed and 0 < number < side.segments
        ]
        return " and ".join(conditions)

    def quiet(self, node: Node, phase: int, step: int) -> str:
        """Return the expression of a value; the only NaN of hardware takes the place of each NaN."""
        text = self.value(node, phase, step)
        return f"quiet({text}, {node.kind.exponent_bits})" if node.kind.is_float and _may_be_odd(node) else text

    def field(self, values: Sequence[Node], phase: int, step: int) -> str:
        """Return the expression of a field: that of its elements, of which the first one is in the lowest bits."""
        texts = [self.quiet(node, phase, step) for node in values]
        if len(texts) == 1 and values[0].kind != BOOL:
            return texts[0]
        return " & ".join(reversed(texts))


def own_signal(name: str, answer: Answer) -> str:
    """Return the name of a signal of an answer, which never equals that of a port."""
    return f"{name}_{answer.side.prefix.strip('_')}"


def value_type(node: Node) -> str:
    """Return the type of a signal for a value."""
    return vhdl_type(None if node.kind == BOOL else node.bits)


def number_text(node: Node, text: str, bits: int) -> str:
    """Return an integer as a number of a width; its sign decides how it is extended."""
    if node.kind == BOOL:
        text, bits_here, is_signed = f"from_bit({text})", 2, True
    else:
        bits_here, is_signed = node.bits, node.is_signed
    made = f"{'signed' if is_signed else 'unsigned'}({text})"
    made = made if bits_here == bits else f"fitted({made}, {bits})"
    return made if is_signed else f"signed({made})"


def _is_combinational(node: Node) -> bool:
    return node.operation not in LEAVES and node.operation not in TRANSPARENT and not is_operator(node)


def _node_name(node: Node) -> str:
    return node.name or f"{node.operation}_{node.number}"


def _words(name: str) -> tuple[str, ...]:
    return ("".join(char if char.isalnum() else "_" for char in name).strip("_") or "value",)


def _vector(number: str) -> str:
    return f"std_logic_vector({number})"


def _may_be_odd(node: Node) -> bool:
    """Whether a NaN may have other bits than the quiet NaN: that of a message, or with a changed sign."""
    if node.operation in ("negate", "copy_sign", "absolute", "input"):
        return True
    if node.operation == "choose":
        return any(_may_be_odd(item) for item in node.operands[1:])
    # A state or carried value may come from one of these.
    return node.operation in ("state", "carried", "final", "rename")
