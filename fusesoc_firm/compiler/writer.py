"""From a bound schedule to the configuration of the template `python_accelerator.vhd`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

from fusesoc_firm.compiler.answers import Answer, Listed, Made, Sent
from fusesoc_firm.compiler.binding import Binding, Register
from fusesoc_firm.compiler.graph import LEAVES, Node, Place
from fusesoc_firm.compiler.interface import Elements, Part, Side
from fusesoc_firm.compiler.kinds import BOOL, INT, bits_of
from fusesoc_firm.compiler.operators import Operator, is_operator
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.schedule import TRANSPARENT, Issue, Unit
from fusesoc_firm.compiler.selection import selected
from fusesoc_firm.compiler.streaming import is_streamed, length_of
from fusesoc_firm.compiler.values import Stream
from fusesoc_firm.converter.message_ports import MessagePort
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.text.naming import KEYWORDS, VHDL_PREDEFINED, distinct_identifiers
from fusesoc_firm.text.render import Context

TEMPLATE = "vhdl/python_accelerator.vhd"

# The signals of the template.
_SIGNALS = """
    step_r at_step_r advance holds is_open is_checked accepted done sent_r
    firm rtl work ieee run_steps run_operations send_answers clk rst_n
""".split()
# The signals of a list whose elements have the name '*'.
_OF_LIST = ("words_*", "word_*", "index_*_r", "ends_*", "valid_*", "ready_*", "sent_*_r")
# The signals of a pipeline: no output stalls it, an element enters, is in each stage, and is the last one; the last one
# has entered, and leaves.
_OF_PIPELINE = ("flow", "enters", "token", "last", "all", "ends")
_INTEGER_OPERATORS = {"add": "+", "subtract": "-"}
_LONGEST_COMMENT = 90


@dataclass
class Writer:
    """The text of a program; each method returns a part of the template's configuration."""

    binding: Binding
    _names: dict[Any, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.schedule = self.binding.schedule
        self.program = self.schedule.program
        self.bases = self.schedule.bases
        self.last = self.bases[-1]
        self.nodes = self.program.needed()
        self.streams = [(side, part) for side in self.program.inputs for part in side.parts]
        self._constants: dict[tuple[int, int], str] = {}
        self._name_all()

    # Names.

    def _name_all(self) -> None:
        wanted: list[tuple[Any, str]] = []
        for state in self.program.states:
            wanted.append((("leaf", state.value.number), f"{state.path.split('.', 1)[-1]}_state_r"))
        for loop in self.program.loops:
            for item in loop.carried.values():
                wanted.append((("carried", loop.number, item.value.payload), f"{item.name}_r"))
        for register in self.binding.registers:
            wanted.append((id(register), f"{self._register_name(register)}_r"))
        for node in self.nodes:
            if self._has_signal(node):
                wanted.append((node.number, node.name or f"{node.operation}_{node.number}"))
        for unit in self.schedule.units:
            wanted.append((unit, f"{unit.operator.operation}_{unit.operator.operand}_{unit.number}"))
        for node, stage in self.binding.delays():
            wanted.append((("delayed", node.number, stage), f"{self._value_name(node)}_{stage}_r"))
        for phase in self.schedule.depths:
            wanted += [((name, phase), f"{name}_{phase // 2}") for name in _OF_PIPELINE]
        ports = [leaf.port for answer in self.program.answers for leaf in answer.side.leaves]
        ports += [leaf.port for side in self.program.inputs for leaf in side.leaves]
        answers = [_own_signal(name, answer) for answer in self.program.answers for name in ("dropped", "segments")]
        sides = [*self.program.inputs, *(answer.side for answer in self.program.answers)]
        elements = [part.element for side in sides for part in side.parts]
        elements += [name.replace("*", element) for element in elements for name in _OF_LIST]
        reserved = [*_SIGNALS, *KEYWORDS, *VHDL_PREDEFINED, *ports, *answers, *elements]
        names = distinct_identifiers([_words(name) for _, name in wanted], reserved)
        self._names = {key: name for (key, _), name in zip(wanted, names, strict=True)}

    def _register_name(self, register: Register) -> str:
        first = register.values[0]
        issue = self.schedule.issues.get(first.number)
        if len(register.values) == 1 or issue is None:
            return first.name or f"{first.operation}_{first.number}"
        return f"{issue.unit.operator.operation}_value"

    def _value_name(self, node: Node) -> str:
        """Return the name of a value that a pipeline hands on."""
        if node.operation == "input":
            return str(node.payload.port)
        if node.operation == "carried":
            carried = chain(*(loop.carried.values() for loop in self.program.loops))
            return next(item.name for item in carried if item.value is node)
        return node.name or f"{node.operation}_{node.number}"

    def _has_signal(self, node: Node) -> bool:
        return node.operation not in LEAVES and node.operation not in TRANSPARENT and not is_operator(node)

    # Expressions.

    def value(self, node: Node, phase: int, step: int) -> str:
        """Return the expression of a value in a step of a phase."""
        if phase in self.schedule.depths and (key := ("delayed", node.number, step)) in self._names:
            return self._names[key]
        match node.operation:
            case "constant":
                return self._constant(node)
            case "input":
                return str(node.payload)
            case "state":
                return self._names["leaf", node.number]
            case "carried":
                return self._names["carried", node.payload[0], node.payload]
            case "final":
                return self._names["carried", *node.payload]
        if node.operation in TRANSPARENT:
            return self._transparent(node, phase, step)
        time = self.schedule.times[node.number]
        if (time.phase, time.step) != (phase, step):
            return self._names[id(self.binding.by_node[node.number])]
        if is_operator(node):
            return f"{self._names[self.schedule.issues[node.number].unit]}_result"
        return self._names[node.number]

    def fitted(self, node: Node, bits: int, phase: int, step: int) -> str:
        """Return the expression of a value with a number of bits: integers of Python have those of their ranges."""
        if node.kind != INT or node.bits == bits:
            return self.value(node, phase, step)
        if node.is_constant:
            return self._constant(node, bits)
        return f"std_logic_vector({_number(node, self.value(node, phase, step), bits)})"

    def _constant(self, node: Node, bits: int = 0) -> str:
        if node.kind == BOOL:
            return "'1'" if node.payload else "'0'"
        width = bits or node.bits
        key = (width, bits_of(node.kind, node.payload, width))
        return self._constants.setdefault(key, f"constant_{len(self._constants)}")

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
                return _vector(f"not {_number(node.operands[0], given[0], node.bits)}")
            case "wrap":
                return _vector(_number(node.operands[0], given[0], node.bits))
            case "shift_left":
                return _vector(f"shift_left({_number(node.operands[0], given[0], node.bits)}, {node.payload})")
            case "shift_right":
                # The bits above the result's are shifted into it.
                wide = node.operands[0].bits
                shifted = f"shift_right({_number(node.operands[0], given[0], wide)}, {node.payload})"
                return _vector(f"fitted({shifted}, {node.bits})" if wide != node.bits else shifted)
        return given[0]

    def _combinational(self, node: Node) -> str:
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
                return _vector(f"saturated({_number(node.operands[0], given[0], node.operands[0].bits)}, {node.bits})")
        one, other = (_number(item, text, node.bits) for item, text in zip(node.operands, given, strict=True))
        if node.operation == "multiply":
            return _vector(f"fitted({one} * {other}, {node.bits})")
        return _vector(f"{one} {_INTEGER_OPERATORS.get(node.operation, node.operation)} {other}")

    def _comparison(self, node: Node, given: Sequence[str]) -> str:
        one = node.operands[0]
        if one.kind.is_float:
            return f"is_{node.operation}({given[0]}, {given[1]}, {one.kind.exponent_bits})"
        # With a bit for the sign, all integers are compared as signed ones.
        bits = max(item.bits + (not item.is_signed) for item in node.operands)
        pair = [_number(item, text, bits) for item, text in zip(node.operands, given, strict=True)]
        return f"to_bit_of({pair[0]} {'<' if node.operation == 'less' else '='} {pair[1]})"

    # The parts of the template.

    def configuration(self, entity: str, ports: Sequence[Context], width: int) -> Context:
        """Return the configuration of the entity with these ports."""
        loads = self._loads()
        signals = [
            {
                "name": self._names[node.number],
                "type": _type(node.bits, node.kind == BOOL),
                "value": self._combinational(node),
            }
            for node in self.nodes
            if self._has_signal(node)
        ]
        answers = [self._answer(number, answer) for number, answer in enumerate(self.program.answers)]
        inputs = [self._input(side, part) for side, part in self.streams]
        states = [self._state(state) for state in self.program.states]
        made = {
            "entity": entity,
            "source": self.program.source.name.rpartition("/")[2],
            "function": self.program.name,
            "width": width,
            "ports": [*ports],
            "last": self.last,
            "has_streams": bool(self.streams) or any(answer.side.parts for answer in self.program.answers),
            "open": " and ".join(self._open_conditions()),
            "checked": " and ".join(f"{side.prefix}msg_valid" for side in self.program.inputs),
            "readies": [f"{side.prefix}msg_ready" for side in self.program.inputs],
            "answer_count": len(answers),
            "finished": " and ".join(
                f"(sent_r({item['number']}) or not {item['condition']})"
                if item["is_conditional"]
                else f"sent_r({item['number']})"
                for item in answers
            ),
            "holds": [
                {"step": step, "condition": " and ".join(conditions)}
                for step, conditions in sorted(self._waits().items())
            ],
            "jumps": self._jumps(),
            "pipelines": [
                self._pipeline(loop) for loop in self.program.loops if 2 * loop.number + 1 in self.schedule.depths
            ],
            "units": [self._unit(unit) for unit in self.schedule.units],
            "combinational": signals,
            "loads": loads,
            "registers": self._registers(),
            "states": states,
            "answers": answers,
            "inputs": inputs,
        }
        # The constants are known when all expressions are written.
        made["constants"] = self._written_constants()
        return made

    def _open_conditions(self) -> Iterator[str]:
        for side in self.program.inputs:
            yield f"{side.prefix}msg_valid" if side.is_fixed else f"{side.prefix}segment_valid(0)"

    def _written_constants(self) -> list[Context]:
        """Return the constants, in pieces of at most 32 bits: GHDL 2 loses zeros of longer ones."""
        return [
            {
                "name": name,
                "bits": bits,
                "pieces": [
                    {
                        "high": min(low + 31, bits - 1),
                        "low": low,
                        "value": f"{code >> low & (1 << min(32, bits - low)) - 1:0{min(32, bits - low)}b}",
                    }
                    for low in range(0, bits, 32)
                ],
            }
            for (bits, code), name in self._constants.items()
        ]

    def _registers(self) -> list[Context]:
        found = [
            {"name": self._names[id(register)], "type": _type(register.bits, register.values[0].kind == BOOL)}
            for register in self.binding.registers
        ]
        for loop in self.program.loops:
            found += [
                {
                    "name": self._names["carried", loop.number, item.value.payload],
                    "type": _type(item.value.bits, item.value.kind == BOOL),
                }
                for item in loop.carried.values()
            ]
        for unit in self.schedule.units:
            ports = self._operand_names(unit)
            found += [{"name": name, "type": vhdl_type(unit.operator.operand)} for name in ports]
        for node, stage in self.binding.delays():
            name = self._names["delayed", node.number, stage]
            found.append({"name": name, "type": _type(node.bits, node.kind == BOOL)})
        return found

    def _operand_names(self, unit: Unit) -> list[str]:
        base = self._names[unit]
        return [f"{base}_{port.removeprefix('in_')}_r" for port in unit.operator.inputs]

    def _unit(self, unit: Unit) -> Context:
        operator, base = unit.operator, self._names[unit]
        issues = sorted((item for item in self.schedule.issues.values() if item.unit == unit), key=self._step)
        flow = " and ".join(self._names["flow", phase] for phase in self._pipelines_of(unit))
        return {
            "name": base,
            "entity": operator.entity,
            "generics": [{"name": name, "value": value} for name, value in operator.generics],
            "operands": [
                {"port": port, "signal": signal, "values": values}
                for port, signal, values in zip(
                    operator.inputs, self._operand_names(unit), self._selected(issues), strict=True
                )
            ],
            "operations": [{"step": self._step(item), "place": _described(item.node.place)} for item in issues],
            "outputs": _outputs(operator, f"{base}_result"),
            "result": f"{base}_result",
            "type": vhdl_type(operator.width),
            "has_wait": operator.has_wait,
            "is_pipeline": not operator.has_wait,
            "taken": self._results_taken(unit, issues),
            "flow": flow or "'1'",
            "stalled": [{"flow": flow}] if flow else [],
            "starts": " or ".join(f"at_step_r({self._step(item)})" for item in issues),
            "loads": " or ".join(map(self._load, issues)),
        }

    def _pipelines_of(self, unit: Unit) -> list[int]:
        """Return the pipelines that a unit is part of."""
        phases = {item.node.phase for item in self.schedule.issues.values() if item.unit == unit}
        return sorted(phases & self.schedule.depths.keys())

    def _pipeline(self, loop: Loop) -> Context:
        """Return the stages of a loop that takes an element in each cycle."""
        phase = 2 * loop.number + 1
        step, depth = self.bases[phase], self.schedule.depths[phase]
        names = {name: self._names[name, phase] for name in _OF_PIPELINE}
        held = [f"{names['token']}({depth}) and not {ready}" for ready in self._readies(loop)]
        lines: list[tuple[str, str, Node | None]] = []
        for node, stage in self.binding.delays():
            if node.phase == phase:
                lines.append((self._names["delayed", node.number, stage], self.value(node, phase, stage - 1), None))
        carried = []
        for value in loop.carried.values():
            if value.next is not None and value.next is not value.value:
                stage = self.schedule.carried[value.value.number]
                text = self.fitted(value.next, value.value.bits, phase, stage)
                token = f"{names['token']}({stage})" if stage else names["enters"]
                name = self._names["carried", loop.number, value.value.payload]
                carried.append({"name": name, "value": text, "token": token})
        element = loop.stream.part.element
        return {**names, "step": step, "depth": depth, "element": element, "stalls": " or ".join(held) or "'0'",
                "path": loop.stream.path, "lines": _commented(lines), "carried": carried}  # fmt: skip

    def _readies(self, loop: Loop) -> Iterator[str]:
        """Yield the conditions that the elements that a loop makes are taken."""
        for answer, sent in self._sent_of(loop):
            ready = f"{sent.part.element}_ready"
            yield f"({ready} or {_dropped(answer)})" if _may_be_dropped(answer) else ready

    def _waits(self) -> dict[int, list[str]]:
        """Return the conditions that each step waits for."""
        found: dict[int, list[str]] = {}
        for phase, count in enumerate(self.schedule.steps):
            if count and phase % 2 == 0 and (phase == 0 or self.streams):
                found.setdefault(self.bases[phase], []).append(self._segment(phase // 2))
        for loop in self.program.loops:
            phase = 2 * loop.number + 1
            if phase in self.schedule.depths:
                found.setdefault(self.bases[phase], []).append(self._names["ends", phase])
                continue
            found.setdefault(self.bases[phase], []).append(f"{loop.stream.part.element}_valid")
            for condition in self._readies(loop):
                found.setdefault(self.bases[phase + 1] - 1, []).append(condition)
        for item in self.schedule.issues.values():
            if item.unit.operator.has_wait:
                step = self.bases[item.node.phase] + item.ready
                found.setdefault(step, []).append(f"{self._names[item.unit]}_valid")
        found.setdefault(self.last, []).append("accepted")
        return found

    def _segment(self, number: int) -> str:
        """Return the condition that the fields of a segment are valid; no field may follow the last array."""
        conditions = ["is_open"]
        conditions += [
            f"{side.prefix}segment_valid({number})"
            for side in self.program.inputs
            if not side.is_fixed and 0 < number < side.segments
        ]
        return " and ".join(conditions)

    def _jumps(self) -> list[Context]:
        """Return the steps that are not followed by the next one: those around loops."""
        found = []
        for loop in self.program.loops:
            part, phase = loop.stream.part, 2 * loop.number + 1
            first, after = self.bases[phase], self.bases[phase + 1]
            if part.length:
                found.append({"step": first - 1, "condition": f"unsigned({part.length}) = 0", "target": after})
            if phase not in self.schedule.depths:
                found.append({"step": after - 1, "condition": f"{part.element}_last = '0'", "target": first})
        return found

    def _sent_of(self, loop: Loop) -> list[tuple[Answer, Sent]]:
        return [
            (answer, sent)
            for answer in self.program.answers
            for sent in answer.parts
            if isinstance(sent.value, Made) and sent.value.loop is loop
        ]

    def _loads(self) -> list[Context]:
        """Return the registers that each step loads, with the lines of the source."""
        found: dict[int, list[tuple[str, str, Node | None]]] = {}

        def load(phase: int, step: int, target: str, node: Node, bits: int) -> None:
            text = self.fitted(node, bits, phase, step)
            found.setdefault(self.bases[phase] + step, []).append((target, text, node))

        for number, register in self.binding.by_node.items():
            node = self.program.graph.nodes[number]
            time = self.schedule.times[number]
            load(time.phase, time.step, self._names[id(register)], node, register.bits)
        for loop in self.program.loops:
            phase = 2 * loop.number + 1
            for carried in loop.carried.values():
                target = self._names["carried", loop.number, carried.value.payload]
                load(phase - 1, self.schedule.steps[phase - 1] - 1, target, carried.first, carried.value.bits)
                assert carried.next is not None
                if carried.next is not carried.value and phase not in self.schedule.depths:
                    load(phase, self.schedule.steps[phase] - 1, target, carried.next, carried.value.bits)
        held = self._waits()
        return [
            {"step": step, "is_held": step in held, "lines": _commented(lines)} for step, lines in sorted(found.items())
        ]

    def _results_taken(self, unit: Unit, issues: Sequence[Issue]) -> str:
        """Return the condition that the result of a unit is taken: at the end of the step that waits for it.

        A step that waits for nothing else ends with the result.
        """
        waits, valid = self._waits(), f"{self._names[unit]}_valid"
        steps = sorted(self.bases[item.node.phase] + item.ready for item in issues)
        return " or ".join(
            f"at_step_r({step})" if waits.get(step) == [valid] else f"(at_step_r({step}) and advance)" for step in steps
        )

    def _selected(self, issues: Sequence[Issue]) -> list[list[Context]]:
        """Return the values of each operand of a unit, each with the condition that selects it."""
        return [
            [
                {
                    "value": text,
                    "condition": " or ".join(f"at_step_r({self._step(item)})" for item in chosen),
                    "is_choice": len(sources) > 1,
                }
                for text, chosen in sources.items()
            ]
            for sources in selected(issues, self._operand)
        ]

    def _load(self, issue: Issue) -> str:
        """Return the condition that a unit takes operands: at the end of a step, in which it may hold a result."""
        step = self._step(issue)
        conditions = [] if issue.node.phase in self.schedule.depths else self._waits().get(step, [])
        return f"({' and '.join([f'at_step_r({step})', *conditions])})" if conditions else f"at_step_r({step})"

    def _step(self, issue: Issue) -> int:
        """Return the step of an operation, counted from the begin of the program; a pipeline is one step."""
        phase = issue.node.phase
        return self.bases[phase] + (0 if phase in self.schedule.depths else issue.start)

    def _operand(self, issue: Issue, operand: Node) -> str:
        """Return an operand of a unit; an integer has the unit's width."""
        text = self.value(operand, issue.node.phase, issue.start)
        if operand.kind.is_float:
            return text
        return f"std_logic_vector({_number(operand, text, issue.unit.operator.operand)})"

    def _state(self, state: Any) -> Context:
        end = len(self.schedule.steps)
        return {
            "name": self._names["leaf", state.value.number],
            "type": _type(state.value.bits, state.value.kind == BOOL),
            "first": self.fitted(state.first, state.value.bits, end, 0),
            "next": self.fitted(state.next, state.value.bits, end, 0),
            "path": state.path,
        }

    # Answers.

    def _answer(self, number: int, answer: Answer) -> Context:
        side = answer.side
        condition = self._at_end(answer.condition)
        return {
            "prefix": side.prefix,
            "number": number,
            "is_fixed": side.is_fixed,
            "has_parts": not side.is_fixed,
            "condition": condition,
            "segments_name": _own_signal("segments", answer),
            "segments_high": side.segments - 1,
            "drops": [self._drop(answer)] if _may_be_dropped(answer) else [],
            "is_conditional": _is_conditional(answer),
            "segments": [self._answer_segment(answer, segment) for segment in range(side.segments)],
            "wires": [{"to": to, "from": text} for to, text in self._wires(answer)],
            "made": [
                self._made(sent.part, sent.value)
                for sent in answer.parts
                if isinstance(sent.part, Part) and isinstance(sent.value, Made)
            ],
            "listed": [
                self._listed(answer, number, sent.part, sent) for sent in answer.parts if isinstance(sent.value, Listed)
            ],
        }

    def _drop(self, answer: Answer) -> Context:
        conditions = ["is_open", *self._valid(answer.condition), f"not {self._at_end(answer.condition)}"]
        return {"name": _dropped(answer), "value": " and ".join(dict.fromkeys(conditions))}

    def _at_end(self, node: Node) -> str:
        """Return the expression of a value after the last step."""
        return self.value(node, len(self.schedule.steps), 0)

    def _wires(self, answer: Answer) -> Iterator[tuple[str, str]]:
        """Yield the ports of an answer that one expression drives, each with the expression."""
        end = len(self.schedule.steps)
        for leaf in answer.side.leaves:
            yield leaf.port, self._field(answer.fields[leaf.port], end, 0)
        if answer.side.length == "given":
            source = next(side for side in self.program.inputs if side.frame.message == answer.side.frame.message)
            yield f"{answer.side.prefix}payload_length", f"{source.prefix}payload_length"
        for sent in answer.parts:
            if sent.part.length:
                yield sent.part.length, _length_text(length_of(sent))
            if isinstance(sent.value, Stream):
                dropped = f" or {_dropped(answer)}" if _may_be_dropped(answer) else ""
                yield from _passed(sent.value.part, sent.part, dropped, has_others=len(self.program.inputs) > 1)
            elif sent.value is None:
                yield from _empty(_ports_of(sent.part))
            elif isinstance(sent.value, Listed):
                yield from _listed_message(sent.part, sent.value) if isinstance(sent.part, Elements) else ()
            elif isinstance(sent.part, Elements):
                yield from self._made_message(sent.part, sent.value)

    def _made_message(self, part: Elements, made: Made) -> Iterator[tuple[str, str]]:
        """Yield the ports of an element that a loop makes."""
        phase, last = 2 * made.loop.number + 1, self.schedule.end(2 * made.loop.number + 1)
        for port, values in made.fields.items():
            yield port, self._field(values, phase, last)
        yield from _empty(part.inner)
        valid, ends = self._leaves_loop(made.loop)
        own = {"valid": valid, "last": ends, "segment_valid": f"(others => {valid})"}
        names = {item.name for item in part.ports}
        yield from ((name, text) for signal, text in own.items() if (name := f"{part.element}_{signal}") in names)

    def _leaves_loop(self, loop: Loop) -> tuple[str, str]:
        """Return the conditions that an element leaves a loop, and that it is the last one."""
        phase, element = 2 * loop.number + 1, loop.stream.part.element
        if phase in self.schedule.depths:
            depth = self.schedule.depths[phase]
            return f"{self._names['token', phase]}({depth})", f"{self._names['last', phase]}({depth})"
        return f"{element}_valid and at_step_r({self.bases[phase + 1] - 1})", f"{element}_last"

    def _field(self, values: Sequence[Node], phase: int, step: int) -> str:
        texts = [self._quiet(node, self.value(node, phase, step)) for node in values]
        if len(texts) == 1 and values[0].kind != BOOL:
            return texts[0]
        # Element 0 is in the lowest bits.
        return " & ".join(reversed(texts))

    def _quiet(self, node: Node, text: str) -> str:
        """Return a float with the only NaN of hardware."""
        return f"quiet({text}, {node.kind.exponent_bits})" if node.kind.is_float and _may_be_odd(node) else text

    def _answer_segment(self, answer: Answer, segment: int) -> Context:
        conditions: dict[str, None] = {}
        if _is_conditional(answer):
            conditions |= dict.fromkeys([*self._valid(answer.condition), self._at_end(answer.condition)])
        if not is_streamed(answer):
            # Otherwise, an answer that waits for another one might be sent first, and both would wait.
            return {"number": segment, "conditions": ["done", *conditions]}
        for leaf in answer.side.leaves:
            if leaf.segment == segment:
                for node in answer.fields[leaf.port]:
                    conditions |= dict.fromkeys(self._valid(node))
        for sent in answer.parts:
            if sent.part.segment == segment or (segment == 0 and answer.side.length == "computed"):
                conditions |= dict.fromkeys(self._valid(length_of(sent)))
        return {"number": segment, "conditions": [*conditions]}

    def _valid(self, node: Node | None) -> Iterator[str]:
        """Yield the conditions that a value is valid, for a message that is open."""
        if node is None or node.operation in ("constant", "state"):
            return
        if node.operation == "input":
            if node.phase:
                yield self._segment(node.phase // 2)
            return
        if node.operation in TRANSPARENT:
            for item in node.operands:
                yield from self._valid(item)
            return
        after = node.phase if node.operation == "final" else node.phase + 1
        yield f"to_bit_of(step_r >= {self.bases[after]})"

    def _made(self, part: Part, made: Made) -> Context:
        """Return the array of numbers that a loop makes."""
        phase = 2 * made.loop.number + 1
        ((node,),) = made.fields.values()
        valid, ends = self._leaves_loop(made.loop)
        return {
            "stream": part.stream,
            "element": part.element,
            "bits": part.bits,
            "lanes": part.bits // 8,
            "value": self._quiet(node, self.value(node, phase, self.schedule.end(phase))),
            "valid": valid,
            "last": ends,
        }

    def _listed(self, answer: Answer, number: int, part: Part | Elements, sent: Sent) -> Context:
        """Return the array or text that consists of listed elements."""
        assert isinstance(sent.value, Listed)
        end, elements = len(self.schedule.steps), sent.value.elements
        # The first port of an element, and the first element, are in the lowest bits.
        words = [" & ".join(self._field(nodes, end, 0) for nodes in reversed(item.values())) for item in elements]
        conditions = ["is_open", f"not sent_r({number})", f"not sent_{part.element}_r"]
        if not is_streamed(answer):
            conditions.append("done")
        for node in sent.listed():
            conditions += self._valid(node)
        if _is_conditional(answer):
            conditions += [*self._valid(answer.condition), self._at_end(answer.condition)]
        return {
            "element": part.element,
            "count": len(elements),
            "last": len(elements) - 1,
            "bits": _word_bits(elements[0]),
            "all_bits": len(elements) * _word_bits(elements[0]),
            "words": " & ".join(f"({word})" if " & " in word else word for word in reversed(words)),
            "conditions": [*dict.fromkeys(conditions)],
            "index_bits": max(1, (len(elements) - 1).bit_length()),
            "stream": [_stream(part)] if isinstance(part, Part) else [],
            "ready": f"{part.element}_ready" if isinstance(part, Elements) else "",
        }

    def _taken(self, loop: Loop) -> str:
        """Return the condition that an element of the message is taken."""
        phase = 2 * loop.number + 1
        if phase in self.schedule.depths:
            flow, all_ = self._names["flow", phase], self._names["all", phase]
            return f"{flow} and at_step_r({self.bases[phase]}) and not {all_}"
        return f"advance and at_step_r({self.bases[phase + 1] - 1})"

    def _input(self, side: Side, part: Part | Elements) -> Context:
        loop = next((item for item in self.program.loops if item.number == part.number), None)
        passed = any(
            isinstance(sent.value, Stream) and sent.value.number == part.number
            for answer in self.program.answers
            for sent in answer.parts
        )
        accepted = [port.name for port in _ports_of(part) if port.is_reverse and not passed]
        ready = f"{part.element}_ready"
        if loop:
            accepted = [name for name in accepted if isinstance(part, Elements) and name != ready]
        numbers = None
        if loop and isinstance(part, Part):
            # A part of an element is kept until the other messages are there, and dropped if its own one is withdrawn.
            is_open = f"{side.prefix}segment_valid(0)"
            numbers = {"element": part.element, "stream": part.stream, "bits": part.bits, "open": is_open}
        return {
            "ready": ready,
            "accepted": accepted,
            "taken": self._taken(loop) if loop else "",
            "numbers": numbers,
        }


def _described(place: Place | None) -> str:
    return f", line {place.line}: {place.text[:_LONGEST_COMMENT]}" if place else ""


def _stream(part: Part) -> Context:
    return {"name": part.stream, "element": part.element, "bits": part.bits, "keep": "1" * (part.bits // 8)}


def _word_bits(element: Mapping[str, Sequence[Node]]) -> int:
    return sum(node.bits for nodes in element.values() for node in nodes)


def _listed_message(part: Elements, listed: Listed) -> Iterator[tuple[str, str]]:
    """Yield the ports of an element of a list."""
    low = 0
    for port, nodes in listed.elements[0].items():
        bits = sum(node.bits for node in nodes)
        is_bit = len(nodes) == 1 and nodes[0].kind == BOOL
        yield port, f"word_{part.element}({low})" if is_bit else f"word_{part.element}({low + bits - 1} downto {low})"
        low += bits
    yield from _empty(part.inner)
    valid = f"valid_{part.element}"
    own = {"valid": valid, "last": f"ends_{part.element}", "segment_valid": f"(others => {valid})"}
    names = {item.name for item in part.ports}
    yield from ((name, text) for signal, text in own.items() if (name := f"{part.element}_{signal}") in names)


def _is_conditional(answer: Answer) -> bool:
    return not answer.condition.is_constant or not answer.condition.payload


def _ports_of(part: Part | Elements) -> Sequence[MessagePort]:
    """Return the ports of a string or an array, except for its length."""
    if isinstance(part, Elements):
        return part.ports
    forward = {"tdata": 8, "tkeep": 1, "tvalid": None, "tlast": None}
    ports = [MessagePort(f"{part.stream}_{signal}", width) for signal, width in forward.items()]
    return [*ports, MessagePort(f"{part.stream}_tready", None, is_reverse=True)]


def _may_be_dropped(answer: Answer) -> bool:
    """Whether an answer is sent while the message is received, or not at all, in which case its parts are accepted."""
    return is_streamed(answer) and _is_conditional(answer)


def _dropped(answer: Answer) -> str:
    return _own_signal("dropped", answer)


def _own_signal(name: str, answer: Answer) -> str:
    """Return the name of a signal of an answer, which never equals that of a port."""
    return f"{name}_{answer.side.prefix.strip('_')}"


def _passed(
    source: Part | Elements, part: Part | Elements, dropped: str, *, has_others: bool
) -> Iterator[tuple[str, str]]:
    """Yield the connections of a part that is passed on; it waits until the other messages are there, if any."""
    for taken, given in zip(_ports_of(source), _ports_of(part), strict=True):
        to, text = (taken.name, f"{given.name}{dropped}") if taken.is_reverse else (given.name, taken.name)
        is_level = taken.width is None and to.endswith(("valid", "ready"))
        yield to, f"({text}) and is_open" if has_others and is_level else text


def _empty(ports: Iterable[MessagePort]) -> Iterator[tuple[str, str]]:
    """Yield the values of the ports of an empty part."""
    for port in ports:
        if not port.is_reverse:
            yield port.name, "'0'" if port.width is None else "(others => '0')"


def _length_text(node: Node | None) -> str:
    if node is None:
        return "(others => '0')"
    return f"std_logic_vector(to_unsigned({node.payload}, 32))" if node.is_constant else str(node.payload.port)


def _may_be_odd(node: Node) -> bool:
    """Whether a NaN may have other bits than the quiet NaN: that of a message, or with a changed sign."""
    if node.operation in ("negate", "copy_sign", "absolute", "input"):
        return True
    if node.operation == "choose":
        return any(_may_be_odd(item) for item in node.operands[1:])
    # A state or carried value may come from one of these.
    return node.operation in ("state", "carried", "final", "rename")


def _commented(lines: Sequence[tuple[str, str, Node | None]]) -> list[Context]:
    """Return the lines of a step in the order of the source; a comment names each new line of it."""
    found: list[Context] = []
    before = None
    for target, text, node in sorted(
        lines, key=lambda item: (item[2].place.line if item[2] and item[2].place else 0, item[0])
    ):
        place = node.place if node else None
        comment = (
            f"line {place.line}: {place.text[:_LONGEST_COMMENT]}"
            if place and place is not before and place.text
            else ""
        )
        if place and before and place.line == before.line:
            comment = ""
        found.append({"comment": comment, "target": target, "value": text})
        before = place
    return found


def _outputs(operator: Operator, result: str) -> list[Context]:
    """Return the ports of a result, each with its part of the signal."""
    if len(operator.outputs) == 1:
        return [{"port": operator.outputs[0], "signal": result}]
    width = operator.width // len(operator.outputs)
    return [
        {"port": port, "signal": f"{result}({width * (place + 1) - 1} downto {width * place})"}
        for place, port in enumerate(operator.outputs)
    ]


def _words(name: str) -> tuple[str, ...]:
    return ("".join(char if char.isalnum() else "_" for char in name).strip("_") or "value",)


def _type(bits: int, is_bit: bool) -> str:
    return vhdl_type(None if is_bit else bits)


def _vector(number: str) -> str:
    return f"std_logic_vector({number})"


def _number(node: Node, text: str, bits: int) -> str:
    """Return an integer as a number of a width; its sign decides how it is extended."""
    if node.kind == BOOL:
        text, bits_here, is_signed = f"from_bit({text})", 2, True
    else:
        bits_here, is_signed = node.bits, node.is_signed
    made = f"{'signed' if is_signed else 'unsigned'}({text})"
    made = made if bits_here == bits else f"fitted({made}, {bits})"
    return made if is_signed else f"signed({made})"
