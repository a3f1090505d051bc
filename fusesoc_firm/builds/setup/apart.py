"""Run the steps of builds on machines without a shared folder; inputs and outputs travel through the remote store.

FuseSoC sets each build up on this machine. The content of its folder is written to the remote store as a record like
that of a step, and a machine of the cluster writes it to a folder with the same path, runs the steps as actions, and
returns the record of what they changed. A machine therefore needs the tools and this package, but not the project.

    python -m fusesoc_firm.builds.setup.apart     runs the task on the standard input on such a machine
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.folder_lock import FolderLock
from fusesoc_firm.builds.setup.outcome import Build, Limits, Outcome
from fusesoc_firm.builds.setup.plan import Plan
from fusesoc_firm.builds.setup.pool import SHOWN_LINES, Pool
from fusesoc_firm.builds.setup.process import set_up
from fusesoc_firm.builds.setup.steps import Step, StepsRun, backend_of, write_report
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.results import Record, Results, default_results
from fusesoc_firm.builds.step.tree import FILE, PROGRAM, Tree, changed, in_order_of_time, removed, tree_of
from fusesoc_firm.text.files import write_whole
from fusesoc_firm.tools.digests import digest_of
from fusesoc_firm.tools.launcher import launcher_of_steps, starts_everything
from fusesoc_firm.tools.workers import Workers, is_task_wanted

# The environment variables that the steps receive from this machine. Paths of programs differ between machines.
_PREFIXES = ("EDALIZE_", "FUSESOC_FIRM_ACTIONS_TWICE", "FUSESOC_FIRM_REMOTE")
_LAUNCHER = "EDALIZE_LAUNCHER"
_POLL_SECONDS = 0.2
_LOCK_SECONDS = 1.0


@dataclass(frozen=True)
class Task:
    """A build whose inputs are the record `inputs` in the remote store, the names of its steps, and its limits."""

    core: str
    target: str
    folder: str
    backend: tuple[str, str]
    steps: tuple[str, ...]
    inputs: str
    environment: Mapping[str, str] = field(repr=False)
    limits: Limits

    @property
    def build(self) -> Build:
        """The build."""
        return Build(self.core, self.target, Path(self.folder))


@dataclass(frozen=True)
class Answer:
    """The result of a task: its steps, the record of its outputs, the number of tries, and the last lines of output."""

    is_good: bool
    seconds: float
    steps: tuple[Step, ...] = ()
    outputs: str = ""
    lines: tuple[str, ...] = ()
    tries: int = 1


@dataclass(frozen=True)
class Prepare:
    """The preparation of a build in a separate process: setup, and transfer of the inputs to the remote store."""

    flags: tuple[tuple[str, bool | str], ...] = ()

    def __call__(self, fusesoc: Any, build: Build, options: tuple[str, ...]) -> None:
        """Set a build up and send its inputs; exit with status 1 after a failure."""
        set_up(fusesoc, build, options)
        results = default_results()
        key = send(build.work_root, {}, results, results.contents())
        if not key:
            sys.exit("error: the build's inputs cannot be written to the remote store")
        write_whole(_note(build), json.dumps([key, backend_of(fusesoc, build, dict(self.flags))]).encode())


def can_build_apart() -> bool:
    """Return whether there is a remote store that this user may write, so that machines need not share a folder."""
    remote = default_results().remote
    return remote is not None and remote.is_writable


def build_apart(workers: Workers, pool: Pool, plan: Plan, steps: tuple[str, ...], limits: Limits) -> Iterator[Outcome]:
    """Prepare the builds with `pool`, and run their steps on the workers; yield each outcome when it is ready."""
    failed: list[Outcome] = []
    environment = {name: value for name, value in os.environ.items() if name.startswith(_PREFIXES)}
    if starts_everything():
        environment.pop(_LAUNCHER, None)

    def tasks() -> Iterator[Task]:
        for outcome in pool.run(plan):
            if outcome.is_good:
                build = outcome.build
                key, backend = json.loads(_note(build).read_bytes())
                _note(build).unlink()
                root = str(build.work_root)
                yield Task(build.core, build.target, root, tuple(backend), steps, key, environment, limits)
            else:
                failed.append(outcome)

    results = default_results()
    for task, answer in workers.run(run_task, tasks()):
        yield _received(task.build, answer, results)
    yield from failed


def send(folder: Path, before: Tree, results: Results, contents: Contents, log: bytes = b"") -> str:
    """Write a folder's changes since `before` to the remote store; return the record's key, or "" after a failure."""
    tree = tree_of(folder, contents)
    outputs = changed(before, tree)
    data = [(folder / path).read_bytes() for path, item in outputs.items() if item.kind in (FILE, PROGRAM)]
    sizes = {results.keep_content(content): len(content) for content in (*data, log)}
    ordered = {path: outputs[path] for path in in_order_of_time(folder, outputs)}
    name = results.keep_content(log)
    record = Record((), ordered, tuple(removed(before, tree)), name, 0, sizes)
    key = digest_of(
        [str(folder), [[path, *item.key, item.digest] for path, item in ordered.items()], record.removed, name]
    )
    return key if results.send(key, record) else ""


def receive(key: str, folder: Path, results: Results) -> bytes | None:
    """Write a record of the remote store to a folder; return its log, or None if something is missing."""
    record = results.remote_record(key)
    if record is None or not results.restore(folder, record):
        return None
    for path in record.removed:
        # An empty folder may remain.
        with suppress(OSError):
            (folder / path).unlink()
    return results.content_of(record, record.log)


def run_task(task: Task) -> Answer:
    """Run a task in a separate process on this machine; end it at the time limit or if the task is cancelled."""
    answer = Answer(False, 0)
    for number in range(1, task.limits.retries + 2):
        answer = _tried(task, number)
        if answer.is_good or not is_task_wanted():
            break
    return answer


def _tried(task: Task, number: int) -> Answer:
    started = time.monotonic()
    ours = {_LAUNCHER: launcher_of_steps()}
    with subprocess.Popen(
        [sys.executable, "-m", __name__],
        env={**os.environ, **ours, **task.environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as running:
        given: str | None = json.dumps(asdict(task))
        while True:
            seconds = time.monotonic() - started
            try:
                text, _ = running.communicate(given, timeout=_POLL_SECONDS)
                break
            except subprocess.TimeoutExpired:
                given = None
            if 0 < task.limits.seconds < seconds:
                _end(running)
                return Answer(
                    False, seconds, (), "", (f"ended at the time limit of {task.limits.seconds:g} s",), number
                )
            if not is_task_wanted():
                _end(running)
                return Answer(False, seconds)
    seconds = time.monotonic() - started
    try:
        is_good, outputs, steps, lines = json.loads(text)
    except ValueError:
        return Answer(False, seconds, (), "", tuple(text.splitlines()[-SHOWN_LINES:]), number)
    return Answer(is_good, seconds, tuple(Step(**step) for step in steps), outputs, tuple(lines), number)


def _end(running: subprocess.Popen[str]) -> None:
    import signal

    os.killpg(running.pid, signal.SIGKILL)
    running.wait()


def _received(build: Build, answer: Answer, results: Results) -> Outcome:
    """Write the outputs of a build and its log to this machine's folder; return the outcome."""
    lines, is_good = answer.lines, answer.is_good
    if answer.outputs:
        log = receive(answer.outputs, build.work_root, results)
        if log is None:
            is_good, lines = False, (*lines, "the outputs are missing in the remote store")
        with build.log.open("ab") as file:
            file.write(log or b"")
    write_report(build, answer.steps)
    return Outcome(build, is_good, answer.seconds, () if is_good else lines, answer.tries)


def main() -> None:
    """Run the task on the standard input in its folder; print the answer."""
    data = json.load(sys.stdin)
    task = Task(**{**data, "limits": Limits(), "backend": tuple(data["backend"]), "steps": tuple(data["steps"])})
    build, results = task.build, default_results()
    lock = FolderLock(build.lock)
    while lock.acquire():
        time.sleep(_LOCK_SECONDS)
    try:
        answer = _run(task, results)
    finally:
        lock.release()
    print(json.dumps(answer))


def _run(task: Task, results: Results) -> list[object]:
    build, contents = task.build, results.contents()

    def write_inputs() -> None:
        shutil.rmtree(build.work_root, ignore_errors=True)
        build.work_root.mkdir()
        if receive(task.inputs, build.work_root, results) is None:
            sys.exit("error: the build's inputs are missing in the remote store, or cannot be read")

    write_inputs()
    before = tree_of(build.work_root, contents)
    run = StepsRun(build, task.backend, results, contents, write_inputs)
    with _log(build) as read:
        is_good = run.all(task.steps, is_rerun=False, has_outputs=True)
        sys.stdout.flush()
        log = read()
    contents.save()
    results.shrink_if_needed()
    outputs = send(build.work_root, before, results, contents, log)
    lines = [] if is_good else log.decode(errors="replace").splitlines()[-SHOWN_LINES:]
    if not outputs:
        is_good, lines = False, [*lines, "the outputs cannot be written to the remote store"]
    return [is_good, outputs, [asdict(step) for step in run.steps], lines]


@contextmanager
def _log(build: Build) -> Iterator[Callable[[], bytes]]:
    """Redirect all output to the build's log within this context, and yield a function that returns it.

    At the end, the log is restored: on a machine that shares the folder, it belongs to the machine of the command.
    """
    with build.log.open("ab+") as file:
        begin, kept = file.seek(0, os.SEEK_END), os.dup(1)
        os.dup2(file.fileno(), 1)
        try:
            yield lambda: (file.seek(begin), file.read())[1]
        finally:
            os.dup2(kept, 1)
            os.close(kept)
            file.truncate(begin)


def _note(build: Build) -> Path:
    return build.work_root.with_name(f"{build.work_root.name}.sent")


if __name__ == "__main__":
    main()
