"""Run many builds in parallel after generating their cores in advance: the work of `firm build`.

The modules that plan, generate and run builds are imported where they are used, since builds that are recalled need
none of them.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fusesoc_firm.builds.setup.outcome import Build, Limits, Outcome, ignore
from fusesoc_firm.builds.setup.process import Run, run_all, save_time
from fusesoc_firm.builds.setup.recall import Recall, note_call, observed, unobserved
from fusesoc_firm.builds.setup.steps import Steps, report_of, run_unstored
from fusesoc_firm.text.diagnostics import InputError
from fusesoc_firm.tools import own_code
from fusesoc_firm.tools.launcher import launcher_of_steps
from fusesoc_firm.tools.library_path import library_root

if TYPE_CHECKING:
    from fusesoc_firm.builds.setup.plan import Plan
    from fusesoc_firm.builds.setup.pool import Pool

_LAUNCHER = "EDALIZE_LAUNCHER"


@dataclass(frozen=True)
class How:
    """The options of builds: the folders, the last step, the number of parallel builds (0: one per core), a cluster.

    After a failure, `is_failing_fast` skips the other builds. With `steps`, builds run as actions, and the other
    options for the folders and the last step are ignored.
    """

    is_clean: bool = False
    is_setup_only: bool = False
    is_build_only: bool = False
    is_locked: bool = False
    jobs: int = 0
    cluster: str = ""
    is_failing_fast: bool = False
    limits: Limits = field(default_factory=Limits)
    steps: Steps | None = None


@dataclass(frozen=True)
class Listener:
    """The callbacks for waiting builds, the progress of generation, and each started try of a build.

    `recall_or_build` calls `plan` with all builds before the first one.
    """

    tell: Callable[[str], None]
    progress: Callable[[str], None]
    begin: Callable[[Build, int], None] = ignore
    plan: Callable[[Sequence[Build]], None] = lambda _: None


def build(plan: Plan, how: How, listener: Listener) -> Generator[Outcome, None, None]:
    """Yield the outcome of each build as it finishes. On exit, end all started processes.

    May raise `InputError`, also for differences from a core's lock file.
    """
    waiting = dict.fromkeys(plan.builds)
    with closing(_build(plan, how, listener)) as outcomes:
        for outcome in outcomes:
            del waiting[outcome.build]
            yield outcome
            if how.is_failing_fast and not outcome.is_good:
                break
    for rest in waiting:
        yield Outcome(rest, False, 0, is_skipped=True)


def _build(plan: Plan, how: How, listener: Listener) -> Generator[Outcome, None, None]:
    _set_launcher(how)
    plan, faults = plan.sound()
    for item, error in faults.items():
        yield _refused(item, error)
    if how.is_locked:
        from fusesoc_firm.builds.project import check_locked

        for core in dict.fromkeys(build.core for build in plan.builds):
            check_locked(core, plan.options)
    options = ["--setup"] * how.is_setup_only + ["--clean"] * how.is_clean
    if how.cluster:
        yield from _build_on_cluster(plan, how, listener, options)
        return
    options += ["--setup", "--build"] * how.is_build_only
    words = (*options, *plan.options.options())
    # Each simulation is judged as in `firm test`.
    judged = partial(run_unstored, flags=plan.options.use_flags())
    run = how.steps or (run_all if how.is_setup_only or how.is_build_only else judged)
    yield from _pool(plan, how, listener, words, run).run(plan)


def _refused(build: Build, error: InputError) -> Outcome:
    """Return the outcome of a build that cannot be set up; its log contains the faults."""
    report_of(build).unlink(missing_ok=True)
    build.log.parent.mkdir(parents=True, exist_ok=True)
    build.log.write_text(f"{error}\n", encoding="utf-8")
    return Outcome(build, False, 0, tuple(str(error).splitlines()))


def _build_on_cluster(plan: Plan, how: How, listener: Listener, options: list[str]) -> Generator[Outcome, None, None]:
    from fusesoc_firm.builds.setup.apart import Prepare, build_apart, can_build_apart
    from fusesoc_firm.builds.setup.cluster import build_on
    from fusesoc_firm.tools.workers import cluster_workers

    if not how.is_setup_only and can_build_apart():
        flags = tuple(plan.options.use_flags().items())
        names = ("build",) if how.is_build_only else ("build", "run")
        with cluster_workers(how.cluster) as workers:
            # Only the steps are limited and repeated.
            pool = _pool(plan, replace(how, limits=Limits()), listener, tuple(plan.options.options()), Prepare(flags))
            yield from build_apart(workers, pool, plan, names, how.limits)
        return
    words = [*options, *["--build-only"] * how.is_build_only, "--build-root", str(plan.build_root)]
    words += [f"--timeout={how.limits.seconds:g}"] * bool(how.limits.seconds)
    words += [f"--retries={how.limits.retries}", *plan.options.command_line()]
    with cluster_workers(how.cluster) as workers:
        yield from build_on(workers, plan, words)


def _pool(plan: Plan, how: How, listener: Listener, words: tuple[str, ...], run_build: Run) -> Pool:
    """Generate the cores of all builds, and return a pool that runs the builds."""
    from fusesoc_firm.builds.setup.pool import Pool

    jobs = how.jobs or len(os.sched_getaffinity(0))
    plan.fetch()
    # Each call with a lock file checks this file.
    if not how.is_locked and _generators_run_here() and (calls := plan.generator_calls()):
        from fusesoc_firm.builds.call.batch import prepare

        with closing(prepare(calls, jobs)) as steps:
            for number, _ in enumerate(steps, start=1):
                listener.progress(f"generated {number} of {len(calls)}")
        own_code.keep_state()
        save_time(_answer)
    return Pool(words, jobs, listener.tell, how.limits, listener.begin, run_build)


def recall_or_build(
    recall: Recall, make: Callable[[], Plan], how: How, listener: Listener
) -> Generator[Outcome, None, None]:
    """Yield the outcome of each build as it finishes: recalled if possible, else built.

    `make` makes the plan of the command whose notes `recall` reads. `how.steps` are the steps. Raise `InputError` as
    `make` and `build` do.
    """
    assert how.steps
    _set_launcher(how)
    recall.build_root.mkdir(parents=True, exist_ok=True)
    done: set[Build] = set()
    known = None
    if not how.is_locked and not how.steps.is_rerun and (known := recall.builds()):
        builds, scan = known
        listener.plan(builds)
        steps = replace(how.steps, recall=recall, scan=scan)
        for item in builds:
            if (seconds := steps.recalled(item)) is not None:
                done.add(item)
                yield Outcome(item, True, seconds)
        recall.contents.save()
        if len(done) == len(builds):
            return
    with observed() as found:
        plan = make()
    # A recalled plan would not repeat FuseSoC's warnings.
    found.is_whole = found.is_whole and not plan.fusesoc.parse_errors
    steps = replace(how.steps, recall=recall, scan=recall.keep_builds(plan.builds, found))
    if not known:
        listener.plan(plan.builds)
    rest = tuple(item for item in plan.builds if item not in done)
    yield from build(replace(plan, builds=rest), replace(how, steps=steps), listener)


def _set_launcher(how: How) -> None:
    """Let this package start the programs of builds, unless another launcher is set.

    Makefiles find programs of Python packages, such as cocotb-config, although the environment is not active.
    """
    of_build = shlex.join([sys.executable, "-m", "fusesoc_firm.cli", "tool"])
    os.environ.setdefault(_LAUNCHER, launcher_of_steps() if how.steps else of_build)
    search, beside = os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)
    if beside not in search.split(os.pathsep):
        os.environ["PATH"] = f"{search}{os.pathsep}{beside}"


def _generators_run_here() -> bool:
    """Return whether generators run in the same Python as this process."""
    chosen = os.environ.get("FUSESOC_FIRM_PYTHON")
    return not chosen or Path(chosen).absolute() == Path(sys.executable).absolute()


def _answer(line: Sequence[str], start: Callable[[], None]) -> None:
    """Answer a call from the store, or start the generator in the command line."""
    from fusesoc_firm.builds.call.answer import answer_from_store, noted_facts
    from fusesoc_firm.builds.call.generators import GENERATORS

    *_, script, path = line
    commands = {library_root() / "generators" / f"{name}_generator.py": name for name in GENERATORS}
    name = next((name for known, name in commands.items() if known.resolve() == Path(script).resolve()), None)
    if name is None:
        start()
        return
    # The generator's note contains its inputs, also the versions of programs.
    with unobserved():
        if not answer_from_store(name, Path(path)):
            start()
    note_call(noted_facts(name, Path(path)))
