"""The error of narrower numbers: the answers of a function to the same messages, against those with float64."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fusesoc_firm.accelerator.functions import Functions, Message, numbers_of
from fusesoc_firm.accelerator.hardware_numbers import plain, silent, typed
from fusesoc_firm.accelerator.user_code import UserFunction, load_compiled
from fusesoc_firm.frame.codec import CodecError, decode
from fusesoc_firm.frame.defaults import encode_answer
from fusesoc_firm.runs.simulation.stimuli import Stimulus
from fusesoc_firm.system.derived.model import AcceleratorBlock, AcceleratorType, DerivedSystem, End, Software
from fusesoc_firm.system.derived.python_function import function_name, parameter_names, prototype

Call = Sequence[Message]
"""The messages of one call of the function."""
Answers = Sequence[Message | None]
"""The messages of its answers, one for each output."""
WIDEST = "float64"
"""The numbers with which the others are compared."""


@dataclass(frozen=True)
class Largest:
    """The largest error, the field of the answer with it, and the number of the call, from 0."""

    error: float = 0.0
    field: str = ""
    call: int = 0

    def data(self) -> dict[str, Any]:
        """Return the error as plain data."""
        return {"error": self.error, "field": self.field or None, "call": self.call if self.field else None}


@dataclass(frozen=True)
class Accuracy:
    """The largest errors in all calls, and the number of answers that only one type of numbers sends.

    A relative error is that of a value other than zero. The difference of a finite and an infinite number, or of a
    number and NaN, is infinite.
    """

    calls: int
    absolute: Largest
    relative: Largest
    missing: int

    def data(self) -> dict[str, Any]:
        """Return the errors as plain data."""
        found = {"absolute": self.absolute.data(), "relative": self.relative.data()}
        return {"calls": self.calls, **found, "answersOfOne": self.missing}


def accuracy(type_: AcceleratorType, folder: Path, blocks: Sequence[Sequence[Call]], numbers: str) -> Accuracy:
    """Return the errors of numbers against float64 in the calls of all blocks, each with states of its own.

    Raise `InputError` for a fault within the function.
    """
    wanted, found = ([*_answers_of(type_, folder, blocks, name)] for name in (WIDEST, numbers))
    return _compared([*zip(wanted, found, strict=True)])


def _answers_of(
    type_: AcceleratorType, folder: Path, blocks: Sequence[Sequence[Call]], numbers: str
) -> Iterator[Answers]:
    for calls in blocks:
        yield from _answers(type_, folder, calls, numbers)


def _compared(pairs: Sequence[tuple[Answers, Answers]]) -> Accuracy:
    absolute, relative, missing = Largest(), Largest(), 0
    for call, (wanted, found) in enumerate(pairs):
        missing += sum((one is None) != (other is None) for one, other in zip(wanted, found, strict=True))
        for name, one, other in _numbers_of(wanted, found):
            error = _difference(one, other)
            absolute = max(absolute, Largest(error, name, call), key=lambda item: item.error)
            if one and math.isfinite(one):
                relative = max(relative, Largest(error / abs(one), name, call), key=lambda item: item.error)
    return Accuracy(len(pairs), absolute, relative, missing)


def _difference(one: float, other: float) -> float:
    if one == other or (math.isnan(one) and math.isnan(other)):
        return 0.0
    return abs(one - other) if math.isfinite(one) and math.isfinite(other) else math.inf


def _numbers_of(wanted: Answers, found: Answers) -> Iterator[tuple[str, float, float]]:
    """Yield the name and both values of each number in answers that both send."""
    for one, other in zip(wanted, found, strict=True):
        if one is not None and other is not None:
            yield from _values(one, other, "")


def _values(one: Any, other: Any, name: str) -> Iterator[tuple[str, float, float]]:
    if isinstance(one, Mapping):
        for key, value in one.items():
            yield from _values(value, other[key], f"{name}.{key}" if name else key)
    elif isinstance(one, list):
        for number, pair in enumerate(zip(one, other, strict=False)):
            yield from _values(*pair, f"{name}[{number}]")
    elif isinstance(one, int | float):
        yield name, one, other


def _answers(type_: AcceleratorType, folder: Path, calls: Sequence[Call], numbers: str) -> Iterator[Answers]:
    """Yield the answers to all calls, as they are sent."""
    path, what = folder / type_.accelerator.sources[0], f"'{function_name(type_)}'"
    names = ", ".join(parameter_names(type_))
    form = (names, f"expected: {prototype(type_)}")
    function = load_compiled(path, function_name(type_), what, form, numbers_of(type_, numbers))
    for number, call in enumerate(calls):
        when = f"message {number}, with numbers: {numbers}"
        with silent():
            given = [typed(side.frame, message, numbers) for side, message in zip(type_.inputs, call, strict=True)]
            with function.guarded(when, given):
                answer = function.call(*given)
        answers = [answer] if len(type_.outputs) == 1 or answer is None else [*answer]
        answers += [None] * (len(type_.outputs) - len(answers))
        yield [_sent(function, when, side, value) for side, value in zip(type_.outputs, answers, strict=True)]


def _sent(function: UserFunction, when: str, side: Any, value: Any) -> Message | None:
    if value is None:
        return None
    try:
        return decode(side.frame, encode_answer(side.frame, plain(side.frame, value)))
    except CodecError as error:
        function.fail(f"for {when}, {function.what} returned an invalid message: {error}", error.hint, error.field)


def calls_of(
    system: DerivedSystem, type_: AcceleratorType, folder: Path, stimuli: Sequence[Stimulus]
) -> list[list[Call]]:
    """Return the calls of each block of an accelerator, if a system gets these stimuli.

    Other accelerators in Python answer on the way; those in other languages let nothing pass.
    """
    blocks = [item for item in system.accelerators if item.type.own == type_]
    ends = {End(item.block, side.prefix): f"{item.block} {side.prefix}" for item in blocks for side in type_.inputs}
    functions = Functions.of(_hardware(system, blocks), folder, ends)
    waiting: dict[str, list[Message]] = {name: [] for name in ends.values()}
    for item in stimuli:
        for name, message in functions.take(End(item.subscriber.block), item.message):
            if name in waiting:
                waiting[name].append(message)
    return [_together([waiting[f"{item.block} {side.prefix}"] for side in type_.inputs]) for item in blocks]


def _together(inputs: Sequence[Sequence[Message]]) -> list[Call]:
    return [*zip(*inputs, strict=False)]


def _hardware(system: DerivedSystem, blocks: Sequence[AcceleratorBlock]) -> Software:
    """Return the accelerators as functions; those of the explored type, and those in other languages, have none."""
    found = [
        item
        if item.type.own.accelerator.is_compiled and item not in blocks
        else replace(item, type=replace(item.type, accelerator=replace(item.type.accelerator, sources=())))
        for item in system.accelerators
    ]
    return Software(blocks=tuple(found), connections=system.connections)
