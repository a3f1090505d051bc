"""From a bound schedule to the configuration of the template `python_accelerator.vhd`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fusesoc_firm.compiler.answer_writer import AnswerWriter
from fusesoc_firm.compiler.answers import Answer, Made, Sent
from fusesoc_firm.compiler.binding import Binding
from fusesoc_firm.compiler.graph import Node, Place
from fusesoc_firm.compiler.operators import Operator
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.program import State
from fusesoc_firm.compiler.schedule import Issue, Unit
from fusesoc_firm.compiler.selection import selected
from fusesoc_firm.compiler.signals import OF_PIPELINE, Signals, number_text, own_signal, value_type
from fusesoc_firm.compiler.streaming import may_be_dropped
from fusesoc_firm.converter.vhdl import vhdl_type
from fusesoc_firm.text.render import Context

TEMPLATE = "vhdl/python_accelerator.vhd"

_LONGEST_COMMENT = 90
# An assignment: its target, the expression, and the line of the source.
_Line = tuple[str, str, Place | None]


@dataclass
class Writer:
    """The text of a program; each method returns a part of the template's configuration."""

    binding: Binding

    def __post_init__(self) -> None:
        self.signals = Signals(self.binding)
        self.schedule = self.binding.schedule
        self.program = self.schedule.program
        self.bases = self.schedule.bases
        self.streams = [(side, part) for side in self.program.inputs for part in side.parts]
        self.waits = self._waits()

    def configuration(self, entity: str, ports: Sequence[Context], width: int) -> Context:
        """Return the configuration of the entity with these ports."""
        answer_writer = AnswerWriter(self.signals)
        # The constants are numbered in the order in which expressions are written.
        loads = self._loads()
        combinational = [self._combinational(node) for node in self.signals.combinational]
        answers = [answer_writer.answer(number, answer) for number, answer in enumerate(self.program.answers)]
        inputs = [answer_writer.input(side, part) for side, part in self.streams]
        states = [self._state(state) for state in self.program.states]
        made = {
            "entity": entity,
            "source": self.program.source.name.rpartition("/")[2],
            "function": self.program.name,
            "width": width,
            "ports": [*ports],
            "last": self.bases[-1],
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
                {"step": step, "condition": " and ".join(conditions)} for step, conditions in sorted(self.waits.items())
            ],
            "jumps": self._jumps(),
            "pipelines": [self._pipeline(loop) for loop in self.program.loops if loop.phase in self.schedule.depths],
            "units": [self._unit(unit) for unit in self.schedule.units],
            "combinational": combinational,
            "loads": loads,
            "registers": self._registers(),
            "states": states,
            "answers": answers,
            "inputs": inputs,
        }
        # The constants are known when all expressions are written.
        made["constants"] = self._constants()
        return made

    def _open_conditions(self) -> Iterator[str]:
        for side in self.program.inputs:
            yield f"{side.prefix}msg_valid" if side.is_fixed else f"{side.prefix}segment_valid(0)"

    def _constants(self) -> list[Context]:
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
            for (bits, code), name in self.signals.constants.items()
        ]

    def _combinational(self, node: Node) -> Context:
        return {
            "name": self.signals[node],
            "type": value_type(node),
            "value": self.signals.combinational_value(node),
        }

    def _registers(self) -> list[Context]:
        found = [(self.signals[register], value_type(register.values[0])) for register in self.binding.registers]
        for loop in self.program.loops:
            for item in loop.carried.values():
                found.append((self.signals["carried", item.value.payload], value_type(item.value)))
        for unit in self.schedule.units:
            found += [(name, vhdl_type(unit.operator.operand)) for name in self._operand_names(unit)]
        for node, stage in self.binding.delays():
            found.append((self.signals["delayed", node, stage], value_type(node)))
        return [{"name": name, "type": type_} for name, type_ in found]

    def _operand_names(self, unit: Unit) -> list[str]:
        base = self.signals[unit]
        return [f"{base}_{port.removeprefix('in_')}_r" for port in unit.operator.inputs]

    def _unit(self, unit: Unit) -> Context:
        operator, base = unit.operator, self.signals[unit]
        issues = sorted((item for item in self.schedule.issues.values() if item.unit == unit), key=self._step)
        flow = " and ".join(self.signals["flow", phase] for phase in self._pipelines_of(unit))
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
        phase = loop.phase
        step, depth = self.bases[phase], self.schedule.depths[phase]
        names = {name: self.signals[name, phase] for name in OF_PIPELINE}
        held = [f"{names['token']}({depth}) and not {ready}" for ready in self._readies(loop)]
        lines: list[_Line] = [
            (self.signals["delayed", node, stage], self.signals.value(node, phase, stage - 1), None)
            for node, stage in self.binding.delays()
            if node.phase == phase
        ]
        carried = []
        for value in loop.carried.values():
            if value.next is not None and value.next is not value.value:
                stage = self.schedule.carried[value.value.number]
                text = self.signals.fitted(value.next, value.value.bits, phase, stage)
                token = f"{names['token']}({stage})" if stage else names["enters"]
                name = self.signals["carried", value.value.payload]
                carried.append({"name": name, "value": text, "token": token})
        element = loop.stream.part.element
        return {**names, "step": step, "depth": depth, "element": element, "stalls": " or ".join(held) or "'0'",
                "path": loop.stream.path, "lines": _commented(lines), "carried": carried}  # fmt: skip

    def _readies(self, loop: Loop) -> Iterator[str]:
        """Yield the conditions that the elements that a loop makes are taken."""
        for answer, sent in self._sent_of(loop):
            ready = f"{sent.part.element}_ready"
            yield f"({ready} or {own_signal('dropped', answer)})" if may_be_dropped(answer) else ready

    def _waits(self) -> dict[int, list[str]]:
        """Return the conditions that each step waits for."""
        found: dict[int, list[str]] = {}
        for phase, count in enumerate(self.schedule.steps):
            if count and phase % 2 == 0 and (phase == 0 or self.streams):
                found.setdefault(self.bases[phase], []).append(self.signals.segment(phase // 2))
        for loop in self.program.loops:
            phase = loop.phase
            if phase in self.schedule.depths:
                found.setdefault(self.bases[phase], []).append(self.signals["ends", phase])
                continue
            found.setdefault(self.bases[phase], []).append(f"{loop.stream.part.element}_valid")
            for condition in self._readies(loop):
                found.setdefault(self.bases[phase + 1] - 1, []).append(condition)
        for item in self.schedule.issues.values():
            if item.unit.operator.has_wait:
                step = self.bases[item.node.phase] + item.ready
                found.setdefault(step, []).append(f"{self.signals[item.unit]}_valid")
        found.setdefault(self.bases[-1], []).append("accepted")
        return found

    def _jumps(self) -> list[Context]:
        """Return the steps that are not followed by the next one: those around loops."""
        found = []
        for loop in self.program.loops:
            part, phase = loop.stream.part, loop.phase
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
        found: dict[int, list[_Line]] = {}

        def load(phase: int, step: int, target: str, node: Node, bits: int) -> None:
            text = self.signals.fitted(node, bits, phase, step)
            found.setdefault(self.bases[phase] + step, []).append((target, text, node.place))

        for number, register in self.binding.by_node.items():
            node = self.program.graph.nodes[number]
            time = self.schedule.times[number]
            load(time.phase, time.step, self.signals[register], node, register.bits)
        for loop in self.program.loops:
            phase = loop.phase
            for carried in loop.carried.values():
                target = self.signals["carried", carried.value.payload]
                load(phase - 1, self.schedule.steps[phase - 1] - 1, target, carried.first, carried.value.bits)
                assert carried.next is not None
                if carried.next is not carried.value and phase not in self.schedule.depths:
                    load(phase, self.schedule.steps[phase] - 1, target, carried.next, carried.value.bits)
        return [
            {"step": step, "is_held": step in self.waits, "lines": _commented(lines)}
            for step, lines in sorted(found.items())
        ]

    def _results_taken(self, unit: Unit, issues: Sequence[Issue]) -> str:
        """Return the condition that the result of a unit is taken: at the end of the step that waits for it.

        A step that waits for nothing else ends with the result.
        """
        valid = f"{self.signals[unit]}_valid"
        steps = sorted(self.bases[item.node.phase] + item.ready for item in issues)
        return " or ".join(
            f"at_step_r({step})" if self.waits.get(step) == [valid] else f"(at_step_r({step}) and advance)"
            for step in steps
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
        conditions = [] if issue.node.phase in self.schedule.depths else self.waits.get(step, [])
        return f"({' and '.join([f'at_step_r({step})', *conditions])})" if conditions else f"at_step_r({step})"

    def _step(self, issue: Issue) -> int:
        """Return the step of an operation, counted from the begin of the program; a pipeline is one step."""
        phase = issue.node.phase
        return self.bases[phase] + (0 if phase in self.schedule.depths else issue.start)

    def _operand(self, issue: Issue, operand: Node) -> str:
        """Return an operand of a unit; an integer has the unit's width."""
        text = self.signals.value(operand, issue.node.phase, issue.start)
        if operand.kind.is_float:
            return text
        return f"std_logic_vector({number_text(operand, text, issue.unit.operator.operand)})"

    def _state(self, state: State) -> Context:
        end = len(self.schedule.steps)
        return {
            "name": self.signals[state.value],
            "type": value_type(state.value),
            "first": self.signals.fitted(state.first, state.value.bits, end, 0),
            "next": self.signals.fitted(state.next, state.value.bits, end, 0),
            "path": state.path,
        }


def _described(place: Place | None) -> str:
    return f", line {place.line}: {place.text[:_LONGEST_COMMENT]}" if place else ""


def _commented(lines: Sequence[_Line]) -> list[Context]:
    """Return the lines of a step in the order of the source; a comment names each new line of it."""
    found: list[Context] = []
    before = 0
    for target, text, place in sorted(lines, key=lambda item: (item[2].line if item[2] else 0, item[0])):
        is_new = place and place.text and place.line != before
        comment = f"line {place.line}: {place.text[:_LONGEST_COMMENT]}" if place and is_new else ""
        found.append({"comment": comment, "target": target, "value": text})
        before = place.line if place else 0
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
