"""Actions: steps whose results are stored and recalled.

An action's key covers the step's command, the contents of its folder, and the variables of its environment. A stored
record adds the inputs observed elsewhere: programs, libraries and headers of tools. A result is recalled if all of this
is unchanged. Times are not compared.

A result is stored only if the step succeeded, wrote only to its own folder, used no network and read no files besides
its inputs and the machine's tools. Some actions, which the key selects, run a second time: if an output differs byte
for byte, the result is not stored.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from fusesoc_firm.builds.step import environment as variables
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.observed import facts_of, states
from fusesoc_firm.builds.step.places import Places, places_of
from fusesoc_firm.builds.step.results import Record, Results
from fusesoc_firm.builds.step.sandbox import sandboxed
from fusesoc_firm.builds.step.trace import Trace, can_trace, fix_addresses, traced
from fusesoc_firm.builds.step.tree import FILE, PROGRAM, Item, Tree, changed, in_order_of_time, key_of, removed, tree_of
from fusesoc_firm.builds.store.packages import version
from fusesoc_firm.tools.digests import digest_of
from fusesoc_firm.tools.facts import StateOf, hold

TWICE = "FUSESOC_FIRM_ACTIONS_TWICE"
"""The environment variable with the number N, so that one in N actions runs twice; 0 for none."""
# Until 1, a run was not judged by its bench.
_FORMAT = 2
_DEFAULT_TWICE = "32"
# In a stored log, this text replaces the folder's path.
_FOLDER_MARK = b"\0FOLDER\0"


@dataclass(frozen=True)
class Action:
    """A step: its name, the arguments of Python for it, its folder, the content of the folder and the environment.

    `declared` are inputs outside the folder; their contents are observed. With `is_sandboxed`, no other files exist.
    """

    name: str
    arguments: tuple[str, ...]
    folder: Path
    inputs: Tree
    environment: Mapping[str, str]
    declared: tuple[str, ...] = ()
    is_sandboxed: bool = False

    def key(self) -> str:
        """Return the digest of everything that is known before the step runs."""
        return digest_of(self.parts())

    def parts(self) -> dict[str, Any]:
        """Return everything that is known before the step runs."""
        return {
            "format": _FORMAT,
            "arguments": self.arguments,
            "inputs": key_of(self.inputs),
            "environment": variables.key_of(self.environment),
            "machine": platform.machine(),
            "python": sys.version_info[:3],
            "edalize": version("edalize"),
            # A step elsewhere may have found other files.
            **({"sandbox": True} if self.is_sandboxed else {}),
        }

    @property
    def search(self) -> str:
        """The PATH of the step."""
        return self.environment.get("PATH", os.defpath)


@dataclass(frozen=True)
class Done:
    """A step that has run: exit status, duration in seconds, content of the folder, why the result was not stored."""

    status: int
    seconds: float
    tree: Tree = field(repr=False)
    fault: str = ""


def look_up(action: Action, results: Results, contents: Contents, state_of: StateOf | None = None) -> Record | None:
    """Return the stored result of an action, or None if it is missing or no longer valid.

    `state_of` returns the states of facts for several actions with the same PATH, each looked up once.
    """

    def is_valid(record: Record) -> bool:
        is_here = record.place in ("", str(action.folder))
        return is_here and hold(record.facts, state_of or states(contents, action.search))

    key = action.key()
    if (known := results.record(key)) and is_valid(known):
        return known
    if (known := results.remote_record(key)) and is_valid(known):
        with suppress(OSError):
            results.keep_record(key, known)
        return known
    return None


def after(record: Record, inputs: Tree) -> dict[str, Item]:
    """Return the content of a folder after the step with this result."""
    gone = set(record.removed)
    return dict(sorted((path, item) for path, item in {**inputs, **record.outputs}.items() if path not in gone))


def log_of(record: Record, results: Results, folder: Path) -> bytes | None:
    """Return the output of a step, as if it had run in `folder`, or None if it is no longer stored."""
    text = results.content_of(record, record.log)
    return None if text is None else text.replace(_FOLDER_MARK, os.fsencode(folder))


def execute(action: Action, results: Results, contents: Contents, log: Path) -> Done:
    """Run a step in its folder, which contains exactly the inputs; append its output to `log`, and store its result."""
    return _Execution(action, results, contents, log).run()


@dataclass
class _Execution:
    action: Action
    results: Results
    contents: Contents
    log: Path

    def run(self) -> Done:
        action, started, key = self.action, time.monotonic(), self.action.key()
        copy = _copy(action) if _runs_twice(key, action.environment) else None
        begin = self.log.stat().st_size if self.log.exists() else 0
        try:
            status, trace = _run(action, self.log)
            seconds = time.monotonic() - started
            tree = tree_of(action.folder, self.contents)
            if status:
                return Done(status, seconds, tree)
            outside = _places(action).outside(trace) if trace else None
            fault = _fault(action, outside) or (self._difference(copy, tree) if copy else "")
        finally:
            if copy:
                shutil.rmtree(copy, ignore_errors=True)
        if fault or outside is None:
            return Done(0, seconds, tree, fault)
        try:
            record = self._record(tree, begin, seconds, outside)
            self.results.keep_record(key, record)
        except OSError as error:
            return Done(0, seconds, tree, f"the store {self.results.root} cannot be written: {error.strerror}")
        self.results.send(key, record)
        return Done(0, seconds, tree)

    def _record(self, tree: Tree, begin: int, seconds: float, outside: Trace) -> Record:
        """Store the outputs, and return the record of the step. May raise `OSError`."""
        action = self.action
        outputs = changed(action.inputs, tree)
        place = os.fsencode(action.folder)
        is_bound, sizes = False, {}
        for path, item in outputs.items():
            if item.kind in {FILE, PROGRAM}:
                data = (action.folder / path).read_bytes()
                sizes[self.results.keep_content(data)] = len(data)
                is_bound = is_bound or place in data
        with self.log.open("rb") as output:
            output.seek(begin)
            text = output.read().replace(place, _FOLDER_MARK)
        log = self.results.keep_content(text)
        sizes[log] = len(text)
        facts = facts_of(outside, self.contents, action.search)
        ordered = {path: outputs[path] for path in in_order_of_time(action.folder, outputs)}
        gone = removed(action.inputs, tree)
        bound_to = str(action.folder) if is_bound else ""
        return Record(tuple(facts), ordered, tuple(gone), log, seconds, sizes, bound_to)

    def _difference(self, copy: Path, tree: Tree) -> str:
        """Run a step again on a copy of its inputs, in the same folder; return which outputs differ, or nothing."""
        action = self.action
        first = action.folder.with_name(f"{action.folder.name}.first")
        shutil.rmtree(first, ignore_errors=True)
        action.folder.rename(first)
        try:
            copy.rename(action.folder)
            _run(action, Path(os.devnull))
            names = _differing(tree, tree_of(action.folder, self.contents))
        finally:
            shutil.rmtree(action.folder, ignore_errors=True)
            first.rename(action.folder)
        return f"a second run writes other bytes to {', '.join(names)}" if names else ""


def _run(action: Action, log: Path) -> tuple[int, Trace | None]:
    """Run a step; return the exit status and, if it can be observed here, the trace."""
    temporary = _temporary(action)
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    environment = {**variables.of_step(action.environment), "TMPDIR": str(temporary)}
    command = [sys.executable, *action.arguments]

    def within(*further: Path) -> list[str]:
        return sandboxed(_places(action), *further) if action.is_sandboxed else []

    from fusesoc_firm.tools.launcher import note_launched

    fix_addresses()
    try:
        with log.open("ab") as output:
            status, trace = _started(command, action, environment, output, within)
        note_launched(temporary, action.folder)
        return status, trace
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _started(
    command: list[str],
    action: Action,
    environment: Mapping[str, str],
    output: IO[bytes],
    within: Callable[..., list[str]],
) -> tuple[int, Trace | None]:
    if can_trace():
        return traced(command, action.folder, environment, output, within)
    done = subprocess.run(
        [*within(), *command],
        cwd=action.folder,
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        check=False,
    )
    return done.returncode, None


def _fault(action: Action, outside: Trace | None) -> str:
    """Return why the result of a step cannot be stored, or an empty text; `outside` is its use of other places."""
    if outside is None:
        return "its use of files cannot be observed: 'strace' is not installed, or not permitted here"
    return _places(action).fault(outside)


def _differing(one: Tree, other: Tree) -> list[str]:
    """Return the paths whose contents differ, apart from time stamps."""
    return sorted(
        path for path in {*one, *other} if path not in one or path not in other or one[path].key != other[path].key
    )


def _copy(action: Action) -> Path:
    """Return a copy of a step's folder beside it."""
    copy = action.folder.with_name(f"{action.folder.name}.again")
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(action.folder, copy, symlinks=True)
    return copy


def _runs_twice(key: str, environment: Mapping[str, str]) -> bool:
    every = environment.get(TWICE) or _DEFAULT_TWICE
    return every.isdigit() and int(every) > 0 and int(key[:8], 16) % int(every) == 0


def _places(action: Action) -> Places:
    return places_of(action.folder, _temporary(action), action.environment, action.declared)


def _temporary(action: Action) -> Path:
    """Return the folder for temporary files: always the same, since its path may be in an output."""
    return action.folder.with_name(f"{action.folder.name}.tmp")
