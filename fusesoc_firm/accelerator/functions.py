"""The functions of accelerators in software, and the messages in transit between the functions.

A function is called when all its messages have arrived. Each block of a type has a separate function with a separate
state. A message contains only the fields that its connection carries. A function's result is converted as by a
middleware.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fusesoc_firm.accelerator.hardware_numbers import plain, silent, typed
from fusesoc_firm.accelerator.message import with_attributes
from fusesoc_firm.accelerator.user_code import Numbers, UserFunction, load_compiled, load_function
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_answer
from fusesoc_firm.frame.model import Frame
from fusesoc_firm.frame.select import used_part
from fusesoc_firm.system.derived.model import (
    AcceleratorBlock,
    AcceleratorType,
    DerivedSystem,
    End,
    MessageSide,
    Software,
)
from fusesoc_firm.system.derived.python_function import function_name, parameter_names, prototype
from fusesoc_firm.system.written.specification import Accelerator
from fusesoc_firm.text.diagnostics import fail

Message = dict[str, Any]
# The messages that may pass merges and queues because of one message from the host.
_MOST_PASSED = 100_000


@contextmanager
def importable_sources(accelerators: Sequence[Accelerator], folder: Path) -> Iterator[None]:
    """Let sources in `folder` import each other. Raise `InputError` if a source imports an unlisted file."""
    listed = {(folder / source).resolve(): item for item in accelerators for source in item.sources}
    owners = {path.parent: item for path, item in reversed(listed.items())}
    paths, known, writes = [*sys.path], {*sys.modules}, sys.dont_write_bytecode
    # The folders are last on the path, so that the user's files do not hide modules of Python's standard library.
    sys.path += map(str, owners)
    # Write no __pycache__ beside the user's files.
    sys.dont_write_bytecode = True
    try:
        yield
        for _, file, place in _imported(known, owners):
            if file not in listed:
                message = f"software imports {file.relative_to(place)}, which is not one of the sources"
                fail(message, owners[place].sources[0].source, "list all files of the accelerator in 'sources'")
    finally:
        sys.path[:], sys.dont_write_bytecode = paths, writes
        for name, _, _ in [*_imported(known, owners)]:
            del sys.modules[name]


def _imported(known: Collection[str], folders: Iterable[Path]) -> Iterator[tuple[str, Path, Path]]:
    """Yield each module that is not `known` and is from one of the folders, with its file and its folder."""
    for name in sorted(sys.modules.keys() - known):
        file = Path(getattr(sys.modules[name], "__file__", None) or "").resolve()
        first = name.partition(".")[0]
        for folder in folders:
            if file == folder / f"{first}.py" or file.is_relative_to(folder / first):
                yield name, file, folder


@dataclass(frozen=True)
class _Way:
    """The destination of a message, with the fields that the connection carries."""

    sink: End
    frame: Frame


@dataclass
class Functions:
    """The blocks with source files, in the order of the data flow, and the messages that wait at each end.

    Messages from several blocks to one end are combined in order: the first messages together, then the second, and so
    on.
    """

    blocks: list[AcceleratorBlock]
    functions: dict[str, UserFunction]
    ways: dict[End, list[_Way]] = field(default_factory=dict)
    waiting: dict[End, dict[End, deque[Message]]] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, software: Software, folder: Path, outside: Mapping[End, str] = MappingProxyType({})) -> Functions:
        """Load all functions. May raise `InputError`, also for a fault within a file.

        Messages to a block without sources are dropped, unless `outside` contains a name for the block.
        """
        here = {block.block: block for block in software.blocks if block.type.accelerator.sources}
        elsewhere = {block.block for block in software.blocks} - here.keys()
        graph: dict[str, list[str]] = {name: [] for name in here}
        for connection in software.connections:
            for sink in connection.sinks:
                if sink.block in here and connection.source.block in here:
                    graph[sink.block].append(connection.source.block)
        made = cls(
            [here[name] for name in TopologicalSorter(graph).static_order()],
            {name: _load(block, folder) for name, block in here.items()},
        )
        for connection in software.connections:
            for end, frame in zip(connection.sinks, connection.frames, strict=True):
                sink = End(outside[end]) if end in outside else end
                if sink.block not in elsewhere:
                    made.ways.setdefault(connection.source, []).append(_Way(sink, frame))
                    made.waiting.setdefault(sink, {})[connection.source] = deque()
        return made

    def take(self, source: End, message: Message) -> list[tuple[str, Message]]:
        """Process a message from `source`; return the resulting messages to other blocks, each with its destination.

        If the method raises `InputError`, only the messages of the failed call are lost; `run` returns the other
        messages.
        """
        self._send(source, message)
        return self.run()

    def run(self) -> list[tuple[str, Message]]:
        """Call each function whose messages have all arrived; return messages like `take`. May raise `InputError`."""
        for block in self.blocks:
            ends = [End(block.block, side.prefix) for side in block.type.inputs]
            while all(map(self._is_there, ends)):
                answers = self._answers(block, [self._next(end) for end in ends])
                for side, answer in zip(block.type.outputs, answers, strict=True):
                    if answer is not None:
                        self._send(End(block.block, side.prefix), answer)
        return [*self._leaving()]

    def _send(self, source: End, message: Message) -> None:
        for way in self.ways.get(source, ()):
            self.waiting[way.sink][source].append(used_part(message, way.frame))

    def _leaving(self) -> Iterator[tuple[str, Message]]:
        for end in self.waiting:
            while end.block not in self.functions and self._is_there(end):
                yield end.block, self._next(end)

    def _is_there(self, end: End) -> bool:
        return all(self.waiting[end].values())

    def _next(self, end: End) -> Message:
        """Return the next message at an end, combined from its parts."""
        message: Message = {}
        for queue in self.waiting[end].values():
            message = _joined(message, queue.popleft())
        return message

    def _answers(self, block: AcceleratorBlock, messages: Sequence[Message]) -> list[Message | None]:
        """Call a function with its messages; return a message or None for each output."""
        number = self.calls[block.block] = self.calls.get(block.block, -1) + 1
        when = f"message {number} to '{block.block}'"
        function, outputs = self.functions[block.block], block.type.outputs
        with function.guarded(when, messages), silent():
            answer: object = function.call(*_arguments(block, messages))
        answers = [answer] if len(outputs) == 1 else [None] * len(outputs) if answer is None else answer
        if not isinstance(answers, list | tuple) or len(answers) != len(outputs):
            function.fail(f"for {when}, {function.what} returned {answer!r}", _expected(outputs))
        if block.type.accelerator.is_compiled:
            answers = [plain(side.frame, value) for side, value in zip(outputs, answers, strict=True)]
        return [_answer(function, when, side, value) for side, value in zip(outputs, answers, strict=True)]


def _arguments(block: AcceleratorBlock, messages: Sequence[Message]) -> list[Any]:
    """Return copies of messages as the block's function takes them."""
    if not block.type.accelerator.is_compiled:
        return [with_attributes(message) for message in messages]
    numbers = str(block.type.accelerator.numbers or "")
    sides = block.type.inputs
    return [typed(side.frame, message, numbers) for side, message in zip(sides, messages, strict=True)]


def compiled_model(system: DerivedSystem, folder: Path) -> UserFunction | None:
    """Return the model of a system whose accelerators in hardware are all compiled from Python, else None.

    The functions answer for the hardware: the model is called as that of a simulation.
    """
    if not system.is_compiled:
        return None
    hardware = Software(blocks=system.accelerators, connections=system.connections)
    functions = Functions.of(hardware, folder)

    outputs = {item.block: [End(item.block, side.prefix) for side in item.outputs] for item in system.junctions}

    def respond(subscriber: str, message: Message) -> list[tuple[str, Message]]:
        answers = []
        left = deque(functions.take(End(subscriber), message))
        passed = 0
        while left:
            name, answer = left.popleft()
            passed += name in outputs
            if passed > _MOST_PASSED:
                fail(f"the messages that a message to '{subscriber}' causes circulate through '{name}' without an end")
            if name in outputs:
                left.extend(taken for output in outputs[name] for taken in functions.take(output, answer))
            else:
                answers.append((name, answer))
        return answers

    first = system.accelerators[0].type.own.accelerator.sources[0]
    return UserFunction(folder / first, "the accelerator", respond)


def numbers_of(type_: AcceleratorType, numbers: str = "") -> Numbers:
    """Return the numbers of a compiled function, with the parameters' defaults; the floats may have another type."""
    parameters = [(item.name, item.type.name, item.default) for item in type_.parameters]
    return Numbers(numbers or str(type_.accelerator.numbers or ""), parameters)


def _load(block: AcceleratorBlock, folder: Path) -> UserFunction:
    name = function_name(block.type)
    path = folder / block.type.accelerator.sources[0]
    parameters = ", ".join(parameter_names(block.type))
    hint = f"expected: {prototype(block.type)}"
    if block.type.accelerator.is_compiled:
        return load_compiled(path, name, f"'{name}'", (parameters, hint), numbers_of(block.type))
    return load_function(path, name, f"'{name}'", parameters, hint)


def _answer(function: UserFunction, when: str, side: MessageSide, value: object) -> Message | None:
    """Return a function's result as converted by the middleware, or None without a result."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        message = f"for {when}, {function.what} returned {value!r}, which is not a mapping of fields"
        function.fail(message, _expected([side]))
    try:
        return decode(side.frame, encode_answer(side.frame, value))
    except CodecError as error:
        fault = f"for {when}, {function.what} returned an invalid message: {error}"
        function.fail(fault, error.hint, error.field)


def _expected(outputs: Sequence[MessageSide]) -> str:
    messages = ", ".join(str(side.frame.message) for side in outputs)
    match len(outputs):
        case 0:
            return "the accelerator has no output, so the function must return nothing"
        case 1:
            return f"the function must return {messages} as a mapping, or None to send nothing"
    return f"the function must return a tuple of {messages}, each as a mapping, or None to send nothing"


def _joined(one: Any, other: Any) -> Any:
    """Return the combination of two parts of a message; elements of arrays may also be in parts."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        both = {name: _joined(one[name], other[name]) for name in one.keys() & other.keys()}
        return {**one, **other, **both}
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [_joined(*pair) for pair in zip(one, other, strict=True)]
    return other
