"""Whether answers can be sent while a message is received: its strings and arrays pass once, in their order.

A part of an answer that is passed on, or made by a loop, holds its source back until all that precedes the part in the
answer is sent. So nothing that precedes it may depend on what comes after the source.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, pairwise

from fusesoc_firm.compiler.answers import Answer, Listed, Made, Sent
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.interface import Side
from fusesoc_firm.compiler.paths import Loop
from fusesoc_firm.compiler.values import Stream
from fusesoc_firm.frame.model import names_of
from fusesoc_firm.frame.values import dotted

_ONE = "an answer is sent while the message is received: send one of both"
_BUFFERED = "write 'length: buffered' at the output, and a 'buffer' at the publisher"
_EARLIER = (
    "an answer is sent while the message is received: compute the value from what comes earlier, or omit one of both"
)


def source_of(sent: Sent) -> Stream | None:
    """Return the string or array of the message that a part of an answer passes on, or is made of."""
    if isinstance(sent.value, Listed):
        return None
    return sent.value.loop.stream if isinstance(sent.value, Made) else sent.value


def length_of(sent: Sent) -> Node | None:
    """Return the number of elements of a part of an answer, or None if it is empty."""
    if isinstance(sent.value, Listed):
        return sent.value.length
    source = source_of(sent)
    return source.length if source else None


def is_streamed(answer: Answer) -> bool:
    """Whether the answer is sent while the message is received."""
    return any(map(source_of, answer.parts))


def may_be_dropped(answer: Answer) -> bool:
    """Whether an answer is sent while the message is received, or not at all, in which case its parts are accepted."""
    return is_streamed(answer) and answer.is_conditional


def problems(answers: Sequence[Answer], loops: Sequence[Loop], inputs: Mapping[str, Side]) -> Iterator[tuple[str, str]]:
    """Yield what would wait for ever, or be read twice, each with its remedy; `inputs` are those of the parameters."""
    looped = {loop.number for loop in loops}
    streamed = [answer for answer in answers if is_streamed(answer)]
    taken: set[int] = set()
    for answer in streamed:
        for sent in answer.parts:
            source = source_of(sent)
            if source is None:
                continue
            if source.number in looped and isinstance(sent.value, Stream):
                yield f"'{source.path}' is read by a loop and passed on", "append the elements to a list in the loop"
            if source.number in taken:
                yield f"'{source.path}' is sent twice; its elements pass once", "send it in one place"
            taken.add(source.number)
    if len(streamed) > 1:
        yield "two answers contain arrays or strings of the message", "send them in one answer"
    for answer in answers:
        if answer.side.length == "given":
            yield from _lengths(answer, inputs)
        yield from _waits(answer)


def late(loops: Sequence[Loop], answers: Sequence[Answer]) -> Iterator[tuple[Loop, str]]:
    """Yield each loop that needs a value that follows its array in the message, with the value's name."""
    made = [sent.value for answer in answers for sent in answer.parts if isinstance(sent.value, Made)]
    for loop in loops:
        phase = loop.phase
        needed = [(item.first, phase - 1) for item in loop.carried.values()]
        needed += [(item.next, phase) for item in loop.carried.values() if item.next is not None]
        needed += [(node, phase) for item in made if item.loop is loop for node in chain(*item.fields.values())]
        for node, last in needed:
            if node.phase > last:
                yield loop, _late_name(node, loops)
                break


def _late_name(node: Node, loops: Sequence[Loop]) -> str:
    """Return the name of the field, or of the result of a loop, for which a value waits."""
    while node.operands:
        node = max(node.operands, key=lambda item: item.phase)
    if node.operation == "final":
        carried = chain(*(loop.carried.values() for loop in loops))
        return next(item.name.rpartition("_")[0] for item in carried if item.value.payload == node.payload)
    return re.sub(r"^in\d*_", "", node.payload.port)


def _lengths(answer: Answer, inputs: Mapping[str, Side]) -> Iterator[tuple[str, str]]:
    """Yield why the length of an answer is not that of a message."""
    message = answer.side.frame.message
    same = [name for name, side in inputs.items() if side.frame.message == message and not side.is_fixed]
    if not same:
        yield f"the length of {message} is not known", _BUFFERED
        return
    for sent in answer.parts:
        source = source_of(sent)
        if sent.absent and any(part.path == sent.part.path for part in inputs[same[0]].parts):
            *above, field = sent.absent
            place = f" in '{dotted((*above,))}'" if above else ""
            hint = f'write "{field}": {same[0]}.{dotted(sent.absent)}{place}; if it shall be empty, {_BUFFERED}'
            yield f"the answer has no '{dotted(sent.absent)}', so its length is not that of the message", hint
        elif source is None or source.path != _name(sent):
            yield f"'{_name(sent)}' has another length than in the message", _BUFFERED


def _waits(answer: Answer) -> Iterator[tuple[str, str]]:
    """Yield the parts of an answer that precede what their values wait for."""
    held = [(sent, source) for sent in answer.parts if (source := source_of(sent))]
    for (before, first), (after, second) in pairwise(held):
        if second.number < first.number:
            order = f"'{_name(before)}' precedes '{_name(after)}' in the answer"
            yield f"{order}, but '{first.path}' follows '{second.path}' in the message", _ONE
    for name, segment, node, hint in _needs(answer):
        for sent, source in held:
            if sent.part.segment >= segment and node.phase >= _after(source):
                order = f"{name} precedes '{_name(sent)}' in the answer"
                yield f"{order}, and depends on what follows '{source.path}' in the message", hint
                break
    for before in answer.parts:
        phase = max((node.phase for node in before.listed()), default=0)
        for sent, source in held:
            if sent.part.number > before.part.number and phase >= _after(source):
                order = f"'{_name(before)}' precedes '{_name(sent)}' in the answer"
                yield f"{order}, and depends on what follows '{source.path}' in the message", _EARLIER
                break


def _after(source: Stream) -> int:
    """Return the phase of values that follow from the elements of an array."""
    return source.phase + 1


def _needs(answer: Answer) -> Iterator[tuple[str, int, Node, str]]:
    """Yield the values of an answer: the name, the segment in which the value is sent, and a remedy if it is late."""
    yield "the condition of the answer", 0, answer.condition, _EARLIER
    for leaf in answer.side.leaves:
        for node in answer.fields[leaf.port]:
            yield f"'{dotted(names_of(leaf.path))}'", leaf.segment, node, _EARLIER
    for sent in answer.parts:
        if (length := length_of(sent)) is not None:
            # The sum of all lengths precedes the first field.
            is_first = answer.side.length == "computed"
            segment, hint = (0, _BUFFERED) if is_first else (sent.part.segment, _EARLIER)
            yield f"the length of '{_name(sent)}'", segment, length, hint


def _name(sent: Sent) -> str:
    return dotted(names_of(sent.part.path))
