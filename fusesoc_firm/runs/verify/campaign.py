"""A campaign: select messages, verify each layout once, and collect the results."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fusesoc_firm.frame.layout import frame_of
from fusesoc_firm.message.library import MessageLibrary
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.message.model import MessageName
from fusesoc_firm.message.parser import parse_full_name
from fusesoc_firm.message.signature import signature
from fusesoc_firm.runs.verify.complexity import Statistics, statistics
from fusesoc_firm.runs.verify.task import Result, Task, Verdict, verify
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.tools.workers import Workers


@dataclass(frozen=True)
class Settings:
    """The settings of a verification."""

    width: int = 8
    stimuli: int = 3
    seed: int = 1
    keeps_files: bool = False


@dataclass(frozen=True)
class Entry:
    """A message and its result.

    `same_as` is the verified message with the same layout, if this message itself was not verified; `statistics` is
    None and `signature` is empty for an illegal definition.
    """

    name: MessageName
    ros: Middleware
    result: Result
    statistics: Statistics | None = None
    same_as: MessageName | None = None
    signature: str = ""


def select(library: MessageLibrary, patterns: Sequence[str], faults: Diagnostics) -> list[MessageName]:
    """Return the sorted messages that names or patterns (with `*` and `?`) select; without patterns, all messages.

    The name of a service or an action selects all its messages. A name or pattern without a match is a fault, and so
    are all faults in the definitions of a named message.
    """
    if not patterns:
        return library.names()
    found: set[MessageName] = set()
    for pattern in patterns:
        try:
            names = list(_matching(library, pattern)) if set(pattern) & set("*?[") else _named(library, pattern)
        except InputError as error:
            faults.take(error, None)
            continue
        if not names:
            faults.error(f"no message matches '{pattern}'", hint="'firm message list' lists all messages")
        found |= set(names)
    return sorted(found)


def _matching(library: MessageLibrary, pattern: str) -> Iterator[MessageName]:
    yield from (name for name in library.names() if fnmatch.fnmatchcase(str(name), pattern))
    for interface in library.interfaces():
        if fnmatch.fnmatchcase(str(interface), pattern):
            yield from interface.messages


def _named(library: MessageLibrary, full_name: str) -> Sequence[MessageName]:
    kind, name = parse_full_name(full_name)
    interface = library.interface(name, kind)
    names = interface.messages if interface else (name,)
    library.joint_closure(names)
    return names


def run(library: MessageLibrary, names: Iterable[MessageName], settings: Settings, workers: Workers) -> Iterator[Entry]:
    """Verify messages; yield each entry when it is ready. Raise `InputError` if no message can be verified here."""
    tasks = _Tasks(library, settings)
    for task, result in workers.run(verify, tasks.of(names)):
        yield from tasks.finished
        tasks.finished.clear()
        yield from tasks.entries(task, result)
    yield from tasks.finished


@dataclass
class _Tasks:
    """The tasks of a campaign: all messages with the same layout share the task of the first one."""

    library: MessageLibrary
    settings: Settings
    finished: list[Entry] = field(default_factory=list)
    """The entries without a task: rejected definitions, and messages whose layout was already verified."""
    _first: dict[Any, MessageName] = field(default_factory=dict)
    _waiting: dict[MessageName, list[MessageName]] = field(default_factory=dict)
    _results: dict[MessageName, Result] = field(default_factory=dict)
    _statistics: dict[MessageName, Statistics] = field(default_factory=dict)
    _signatures: dict[MessageName, str] = field(default_factory=dict)

    def of(self, names: Iterable[MessageName]) -> Iterator[Task]:
        for name in names:
            try:
                definitions = self.library.closure(name)
            except InputError as error:
                refused = Result(Verdict.REFUSED, _first_fault(error))
                self.finished.append(Entry(name, self.library.ros, refused))
                continue
            self._statistics[name] = statistics(name, definitions)
            self._signatures[name] = signature(name, definitions)
            first = self._first.setdefault(frame_of(name, definitions).nodes, name)
            if first == name:
                yield Task(name, definitions, **vars(self.settings))
            elif first in self._results:
                self.finished.append(self._copy(name, first))
            else:
                self._waiting.setdefault(first, []).append(name)

    def entries(self, task: Task, result: Result) -> Iterator[Entry]:
        """Yield the entries of a task's message and of all messages that share the task."""
        self._results[task.name] = result
        yield self._entry(task.name, result)
        for name in self._waiting.pop(task.name, ()):
            yield self._copy(name, task.name)

    def _copy(self, name: MessageName, first: MessageName) -> Entry:
        result = self._results[first]
        copied = replace(result, seconds=0.0, files={})
        return self._entry(name, copied, first)

    def _entry(self, name: MessageName, result: Result, same_as: MessageName | None = None) -> Entry:
        return Entry(name, self.library.ros, result, self._statistics[name], same_as, self._signatures[name])


def _first_fault(error: InputError) -> str:
    fault = error.diagnostics[0]
    return f"line {fault.source.line}: {fault.message}" if fault.source else fault.message
