"""Run a build as actions: FuseSoC's setup, then Edalize's build and run, each answered from the store if possible.

The setup always runs in an empty folder, so that a step sees only its inputs, but no outputs of earlier builds, such as
old units in a GHDL library. Outputs of a recalled step are written to the folder only if a later step runs or the
caller wants them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.folder_lock import FolderLock
from fusesoc_firm.builds.setup.outcome import Build
from fusesoc_firm.builds.setup.process import run_all, set_up
from fusesoc_firm.builds.setup.reasons import reasons, remember
from fusesoc_firm.builds.setup.recall import Recall, observed
from fusesoc_firm.builds.step.action import Action, after, execute, log_of, look_up
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.results import Record, Results, default_results
from fusesoc_firm.builds.step.tree import Tree, tree_of
from fusesoc_firm.text.files import write_whole

CACHED, RAN, FAILED = "cached", "ran", "failed"
_EDAM = ".eda.yml"
_RERUN = "--rerun"
_NOT_STORED = "the last run failed, or its result is not stored"
_NOT_EXPORTED = "with --no-export, its inputs are not in the folder of the build"
_BACKEND = ("-m", "fusesoc_firm.builds.step.backend")


@dataclass(frozen=True)
class Step:
    """A step of a build: name, `cached`, `ran` or `failed`, duration in seconds, and why the result is not stored.

    The duration of a cached step is that of the stored run. `reasons` explain why the step was not cached.
    """

    name: str
    state: str
    seconds: float
    fault: str = ""
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True)
class Steps:
    """The options of a build that runs as actions: the steps after the setup, and whether their outputs are wanted.

    With `is_rerun`, steps run although their results are stored. `scan` is the state of FuseSoC's libraries for the
    notes of `recall`, and `flags` are the user's flags. With `is_sandboxed`, steps see only their inputs and tools.
    """

    names: tuple[str, ...]
    has_outputs: bool = True
    is_rerun: bool = False
    recall: Recall | None = None
    scan: str = ""
    flags: tuple[tuple[str, bool | str], ...] = ()
    is_sandboxed: bool = False

    def __call__(self, fusesoc: Any, build: Build, options: tuple[str, ...]) -> None:
        """Set a build up and run its steps; write the report, and exit with status 1 if a step fails."""
        report_of(build).unlink(missing_ok=True)
        if fusesoc.config.no_export:
            # The sources are not in the build's folder, so no step could be cached; the command line refuses a sandbox.
            run_unstored(fusesoc, build, options, dict(self.flags), is_build_only="run" not in self.names)
            write_report(build, [Step(name, RAN, 0, _NOT_EXPORTED) for name in self.names])
            return
        results = default_results()
        contents = results.contents()
        with observed() as found:
            set_up(fusesoc, build, options)
        run = StepsRun(
            build,
            backend_of(fusesoc, build, dict(self.flags)),
            results,
            contents,
            partial(set_up, fusesoc, build, options),
            is_sandboxed=self.is_sandboxed,
        )
        if self.recall:
            tree = tree_of(build.work_root, contents)
            self.recall.keep_setup(build, self.scan, found, run.backend, tree)
        is_good = run.all(self.names, is_rerun=self.is_rerun, has_outputs=self.has_outputs)
        contents.save()
        results.shrink_if_needed()
        write_report(build, run.steps)
        if not is_good:
            sys.exit(1)

    def recalled(self, build: Build) -> float | None:
        """Answer a whole build without a setup; return the seconds, or None if the build must run.

        The log and the report are those of the stored steps. If outputs are wanted, they must be in the folder.
        """
        if self.recall is None or self.is_rerun:
            return None
        started, results, contents = time.monotonic(), self.recall.results, self.recall.contents
        if (known := self.recall.setup(build, self.scan)) is None:
            return None
        backend, tree = known
        act = partial(action_of, build, backend, is_sandboxed=self.is_sandboxed)
        look = partial(look_up, results=results, contents=contents, state_of=self.recall.state_of)
        found = recorded(self.names, act, tree, look)
        logs = [log for _, record in found if (log := log_of(record, results, build.work_root)) is not None]
        if len(logs) < len(self.names) or (self.has_outputs and not _is_in_place(build, tree, found, contents)):
            return None
        lock = FolderLock(build.lock)
        if lock.acquire():
            return None
        try:
            build.log.write_bytes(b"".join(logs))
            for action, record in found:
                remember(action, record.facts, results)
            write_report(build, [Step(action.name, CACHED, record.seconds) for action, record in found])
        finally:
            lock.release()
        return time.monotonic() - started


def _is_in_place(build: Build, tree: Tree, found: list[tuple[Action, Record]], contents: Contents) -> bool:
    """Return whether a build's folder contains exactly its inputs and the outputs of its steps."""
    expected = dict(tree)
    for _, record in found:
        expected = after(record, expected)
    return build.work_root.is_dir() and tree_of(build.work_root, contents) == expected


def run_unstored(
    fusesoc: Any, build: Build, options: tuple[str, ...], flags: Mapping[str, Any], *, is_build_only: bool = False
) -> None:
    """Run a build without the store: its setup and build with FuseSoC, its run as a step; exit after a failure."""
    run_all(fusesoc, build, ("--setup", "--build", *options))
    if not is_build_only:
        edam = f"{fusesoc.get_core(build.core).name.sanitized_name}{_EDAM}"
        command = [sys.executable, *_BACKEND, "run", *backend_of(fusesoc, build, flags), edam]
        if status := subprocess.run(command, cwd=build.work_root, check=False).returncode:
            sys.exit(status)


def write_report(build: Build, steps: Sequence[Step]) -> None:
    """Write the steps of a build to the file that `steps_of` reads."""
    write_whole(report_of(build), json.dumps([asdict(step) for step in steps]).encode())


def report_of(build: Build) -> Path:
    """Return the file with the steps of a build."""
    return build.work_root.with_name(f"{build.work_root.name}.steps")


def steps_of(build: Build) -> tuple[Step, ...]:
    """Return the steps that a build ran or recalled, or nothing if the build ended before its first step."""
    try:
        return tuple(Step(**item) for item in json.loads(report_of(build).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return ()


def action_of(build: Build, backend: tuple[str, str], step: str, inputs: Tree, *, is_sandboxed: bool = False) -> Action:
    """Return the action of a build's step; `backend` is `flow` or `tool` with its name in Edalize."""
    edam = next(path for path in inputs if path.endswith(_EDAM) and "/" not in path)
    arguments = (*_BACKEND, step, *backend, edam)
    return Action(step, arguments, build.work_root, inputs, os.environ, is_sandboxed=is_sandboxed)


def recorded(
    names: tuple[str, ...], act: Callable[[str, Tree], Action], inputs: Tree, look: Callable[[Action], Record | None]
) -> list[tuple[Action, Record]]:
    """Return the stored results of a build's first steps, up to the first step without one."""
    found: list[tuple[Action, Record]] = []
    tree = inputs
    for name in names:
        action = act(name, tree)
        record = look(action)
        if record is None:
            break
        found.append((action, record))
        tree = after(record, tree)
    return found


@dataclass
class StepsRun:
    """The steps of one build, whose folder `set_up` fills with the inputs again; `steps` are the completed ones."""

    build: Build
    backend: tuple[str, str]
    results: Results
    contents: Contents
    set_up: Callable[[], None]
    is_sandboxed: bool = False
    steps: list[Step] = field(default_factory=list)

    def all(self, names: tuple[str, ...], *, is_rerun: bool, has_outputs: bool) -> bool:
        """Recall the first steps, and run the others; return whether all succeeded."""
        inputs = tree_of(self.build.work_root, self.contents)
        look = partial(look_up, results=self.results, contents=self.contents)
        known = [] if is_rerun else recorded(names, self._action, inputs, look)
        if (has_outputs or len(known) < len(names)) and not self._restored(known):
            # A stored output is missing; the folder may already contain other outputs.
            self.set_up()
            known = []
        tree = inputs
        for action, record in known:
            remember(action, record.facts, self.results)
            self._show(record)
            self.steps.append(Step(action.name, CACHED, record.seconds))
            tree = after(record, tree)
        return all(self._runs(name, is_rerun=is_rerun) for name in names[len(known) :])

    def _runs(self, name: str, *, is_rerun: bool) -> bool:
        """Run a step; return whether it succeeded."""
        action = self._action(name, tree_of(self.build.work_root, self.contents))
        why = [_RERUN] if is_rerun else reasons(action, self.results, self.contents) or [_NOT_STORED]
        action = replace(action, declared=_files_of_parameters(self.build.work_root / action.arguments[-1]))
        done = execute(action, self.results, self.contents, self.build.log)
        record = self.results.record(action.key())
        remember(action, record.facts if record else (), self.results)
        self.steps.append(Step(name, FAILED if done.status else RAN, done.seconds, done.fault, tuple(why)))
        if done.fault:
            print(f"{self.build}: the step '{name}' is not cached: {done.fault}", flush=True)
        return done.status == 0

    def _action(self, name: str, tree: Tree) -> Action:
        return action_of(self.build, self.backend, name, tree, is_sandboxed=self.is_sandboxed)

    def _restored(self, known: list[tuple[Action, Record]]) -> bool:
        """Write the outputs of recalled steps to the folder; return False if one is no longer stored."""
        for action, record in known:
            if log_of(record, self.results, action.folder) is None:
                return False
            if not self.results.restore(action.folder, record):
                return False
            for path in record.removed:
                with suppress(OSError):
                    (action.folder / path).unlink()
        return True

    def _show(self, record: Record) -> None:
        text = log_of(record, self.results, self.build.work_root) or b""
        print(text.decode(errors="backslashreplace"), end="", flush=True)


def _files_of_parameters(edam: Path) -> tuple[str, ...]:
    """Return the files that are values of a core's parameters of the type `file`, such as a processor's firmware."""
    text = edam.read_text(encoding="utf-8")
    if "datatype: file" not in text:
        return ()
    from fusesoc_firm.text.yaml_text import yaml_data

    parameters = yaml_data(text)["parameters"].values()
    return tuple(str(item["default"]) for item in parameters if item["datatype"] == "file" and item.get("default"))


def backend_of(fusesoc: Any, build: Build, further: Mapping[str, Any]) -> tuple[str, str]:
    """Return `flow` or `tool`, and the name of the build's flow or tool in Edalize."""
    core = fusesoc.get_core(build.core)
    flags: Mapping[str, Any] = {**core.get_flags(build.target), "target": build.target, **further}
    flow = core.get_flow(flags)
    return ("flow", str(flow)) if flow else ("tool", str(flags["tool"]))
