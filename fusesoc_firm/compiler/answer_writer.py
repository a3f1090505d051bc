"""The answers of a program and the strings and arrays of its messages, for the template `python_accelerator.vhd`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from fusesoc_firm.compiler.answers import Answer, Listed, Made
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.interface import Elements, Part, Side
from fusesoc_firm.compiler.kinds import BOOL
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.schedule import TRANSPARENT
from fusesoc_firm.compiler.signals import Signals, own_signal
from fusesoc_firm.compiler.streaming import is_streamed, length_of, may_be_dropped
from fusesoc_firm.compiler.values import Stream
from fusesoc_firm.converter.message_ports import MessagePort
from fusesoc_firm.text.render import Context


@dataclass
class AnswerWriter:
    """The text of the answers and of the messages' parts; each method returns a part of the configuration."""

    signals: Signals

    def __post_init__(self) -> None:
        self.schedule = self.signals.schedule
        self.program = self.signals.program
        self.bases = self.schedule.bases
        # The phase after the last one.
        self.end = len(self.schedule.steps)

    def answer(self, number: int, answer: Answer) -> Context:
        """Return an answer."""
        side = answer.side
        condition = self._at_end(answer.condition)
        return {
            "prefix": side.prefix,
            "number": number,
            "is_fixed": side.is_fixed,
            "has_parts": not side.is_fixed,
            "condition": condition,
            "segments_name": own_signal("segments", answer),
            "segments_high": side.segments - 1,
            "drops": [self._drop(answer)] if may_be_dropped(answer) else [],
            "is_conditional": answer.is_conditional,
            "segments": [self._answer_segment(answer, segment) for segment in range(side.segments)],
            "wires": [{"to": to, "from": text} for to, text in self._wires(answer)],
            "made": [
                self._made(sent.part, sent.value)
                for sent in answer.parts
                if isinstance(sent.part, Part) and isinstance(sent.value, Made)
            ],
            "listed": [
                self._listed(number, answer, sent.part, sent.value)
                for sent in answer.parts
                if isinstance(sent.value, Listed)
            ],
        }

    def _drop(self, answer: Answer) -> Context:
        conditions = ["is_open", *self._valid(answer.condition), f"not {self._at_end(answer.condition)}"]
        return {"name": own_signal("dropped", answer), "value": " and ".join(dict.fromkeys(conditions))}

    def _at_end(self, node: Node) -> str:
        """Return the expression of a value after the last step."""
        return self.signals.value(node, self.end, 0)

    def _wires(self, answer: Answer) -> Iterator[tuple[str, str]]:
        """Yield the ports of an answer that one expression drives, each with the expression."""
        for leaf in answer.side.leaves:
            yield leaf.port, self.signals.field(answer.fields[leaf.port], self.end, 0)
        if answer.side.length == "given":
            source = next(side for side in self.program.inputs if side.frame.message == answer.side.frame.message)
            yield f"{answer.side.prefix}payload_length", f"{source.prefix}payload_length"
        for sent in answer.parts:
            if sent.part.length:
                yield sent.part.length, _length_text(length_of(sent))
            if isinstance(sent.value, Stream):
                drop = f" or {own_signal('dropped', answer)}" if may_be_dropped(answer) else ""
                yield from _passed(sent.value.part, sent.part, drop, has_others=len(self.program.inputs) > 1)
            elif sent.value is None:
                yield from _empty(sent.part.ports)
            elif isinstance(sent.value, Listed):
                yield from _listed_message(sent.part, sent.value) if isinstance(sent.part, Elements) else ()
            elif isinstance(sent.part, Elements):
                yield from self._made_message(sent.part, sent.value)

    def _made_message(self, part: Elements, made: Made) -> Iterator[tuple[str, str]]:
        """Yield the ports of an element that a loop makes."""
        phase, last = made.loop.phase, self.schedule.end(made.loop.phase)
        for port, values in made.fields.items():
            yield port, self.signals.field(values, phase, last)
        yield from _empty(part.inner)
        yield from _handshake(part, *self._leaves_loop(made.loop))

    def _leaves_loop(self, loop: Loop) -> tuple[str, str]:
        """Return the conditions that an element leaves a loop, and that it is the last one."""
        phase, element = loop.phase, loop.stream.part.element
        if phase in self.schedule.depths:
            depth = self.schedule.depths[phase]
            return f"{self.signals['token', phase]}({depth})", f"{self.signals['last', phase]}({depth})"
        return f"{element}_valid and at_step_r({self.bases[phase + 1] - 1})", f"{element}_last"

    def _answer_segment(self, answer: Answer, segment: int) -> Context:
        conditions = dict.fromkeys(self._is_sent(answer))
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

    def _is_sent(self, answer: Answer) -> Iterator[str]:
        """Yield the conditions that an answer is sent, unless it always is."""
        if answer.is_conditional:
            yield from (*self._valid(answer.condition), self._at_end(answer.condition))

    def _valid(self, node: Node | None) -> Iterator[str]:
        """Yield the conditions that a value is valid, for a message that is open."""
        if node is None or node.operation in ("constant", "state"):
            return
        if node.operation == "input":
            if node.phase:
                yield self.signals.segment(node.phase // 2)
            return
        if node.operation in TRANSPARENT:
            for item in node.operands:
                yield from self._valid(item)
            return
        after = node.phase if node.operation == "final" else node.phase + 1
        yield f"to_bit_of(step_r >= {self.bases[after]})"

    def _made(self, part: Part, made: Made) -> Context:
        """Return the array of numbers that a loop makes."""
        phase = made.loop.phase
        ((node,),) = made.fields.values()
        valid, ends = self._leaves_loop(made.loop)
        return {
            "stream": part.stream,
            "element": part.element,
            "bits": part.bits,
            "lanes": part.bits // 8,
            "value": self.signals.quiet(node, phase, self.schedule.end(phase)),
            "valid": valid,
            "last": ends,
        }

    def _listed(self, number: int, answer: Answer, part: Part | Elements, listed: Listed) -> Context:
        """Return the array or text that consists of listed elements."""
        elements = listed.elements
        # The first port of an element, and the first element, are in the lowest bits.
        words = [
            " & ".join(self.signals.field(nodes, self.end, 0) for nodes in reversed(item.values())) for item in elements
        ]
        conditions = ["is_open", f"not sent_r({number})", f"not sent_{part.element}_r"]
        if not is_streamed(answer):
            conditions.append("done")
        for node in listed.nodes():
            conditions += self._valid(node)
        conditions += self._is_sent(answer)
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
        phase = loop.phase
        if phase in self.schedule.depths:
            flow, all_ = self.signals["flow", phase], self.signals["all", phase]
            return f"{flow} and at_step_r({self.bases[phase]}) and not {all_}"
        return f"advance and at_step_r({self.bases[phase + 1] - 1})"

    def input(self, side: Side, part: Part | Elements) -> Context:
        """Return a string or an array of a message that is received."""
        loop = next((item for item in self.program.loops if item.number == part.number), None)
        passed = any(
            isinstance(sent.value, Stream) and sent.value.number == part.number
            for answer in self.program.answers
            for sent in answer.parts
        )
        accepted = [port.name for port in part.ports if port.is_reverse and not passed]
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
    yield from _handshake(part, f"valid_{part.element}", f"ends_{part.element}")


def _handshake(part: Elements, valid: str, last: str) -> Iterator[tuple[str, str]]:
    """Yield the ports of an element that tell that it is valid, and the last one."""
    own = {"valid": valid, "last": last, "segment_valid": f"(others => {valid})"}
    names = {item.name for item in part.ports}
    yield from ((name, text) for signal, text in own.items() if (name := f"{part.element}_{signal}") in names)


def _passed(
    source: Part | Elements, part: Part | Elements, dropped: str, *, has_others: bool
) -> Iterator[tuple[str, str]]:
    """Yield the connections of a part that is passed on; it waits until the other messages are there, if any."""
    for taken, given in zip(source.ports, part.ports, strict=True):
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
