"""A project's cores and their calls of our generators: effects of edits, lock files and message folders."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from fusesoc_firm.builds.call.answer import Basis, load, obtain
from fusesoc_firm.builds.call.calls import make_request
from fusesoc_firm.builds.call.generators import GENERATORS, MESSAGES
from fusesoc_firm.builds.call.lock_file import Lock, check_lock, lock_of, lock_path, lock_text, read_lock
from fusesoc_firm.builds.inputs import digest_of_core, first_changed, inputs_of_foreign_call
from fusesoc_firm.builds.setup.cores import (
    ProjectCore,
    affected,
    changed_files,
    core_graph,
    dependencies,
    former_names,
    project_cores,
    target_calls,
)
from fusesoc_firm.builds.setup.outcome import configuration_file
from fusesoc_firm.builds.setup.query import Answer
from fusesoc_firm.builds.setup.run_options import RunOptions
from fusesoc_firm.core.core_reader import core_name
from fusesoc_firm.core.request import GeneratorCall, LoadedRequest, Request
from fusesoc_firm.text.diagnostics import InputError, SourceRef, fail
from fusesoc_firm.text.outputs import shown, write
from fusesoc_firm.tools.own_code import PACKAGE, names
from fusesoc_firm.tools.reads import Input

_NO_OPTIONS = RunOptions()


def graph(core: str, target: str) -> str:
    """Return the dependencies of a core's target in Graphviz's language. May raise `InputError`."""

    def sources(call: GeneratorCall) -> list[str]:
        request = _request(call)
        return [] if request is None else [*map(_place, _input_files(request))]

    return core_graph(core, target, sources)


def _place(path: Path) -> str:
    """Return a path relative to the current folder or to the folder of our package, the same on every machine.

    Other paths lead out of the current folder. Such paths distinguish files with equal names in two cores.
    """
    for root in (Path.cwd().resolve(), PACKAGE.parent):
        if path.is_relative_to(root):
            return str(path.relative_to(root))
    return os.path.relpath(path)


def affected_since(revision: str) -> dict[str, str]:
    """Return the cores that edits since a revision affect, each with the reason. May raise `InputError`."""
    here = Path.cwd()
    changed = [*dict.fromkeys(path.resolve() for path in changed_files(revision, here))]
    cores = project_cores()
    if libraries := [path for path in changed if path in _library_files(changed)]:
        return {core.vlnv: shown(libraries[0]) for core in cores}
    return affected(cores, partial(_touched, changed), former_names(revision, here, cores))


def _library_files(changed: Iterable[Path]) -> set[Path]:
    """Return the changed files that determine which cores FuseSoC finds."""
    conf = configuration_file().resolve()
    return {path for path in changed if path == conf or path.name == "FUSESOC_IGNORE"}


def generated_files(core: str, target: str, options: RunOptions = _NO_OPTIONS) -> Answer:
    """Return the files of the cores that our generators write for a target. May raise `InputError`.

    Missing files are generated into the store. The files of other generators are unknown and shown as `-`.
    """
    rows, edges = [], []
    for requesting, call in target_calls(core, target, options):
        names = _generated_names(call)
        rows += [(call.vlnv, call.generator, name) for name in names or ["-"]]
        edges += [(requesting, call.vlnv), *((call.vlnv, name) for name in names)]
    return Answer(("core", "generator", "file"), tuple(rows), tuple(edges))


def check_locked(core: str, options: RunOptions = _NO_OPTIONS) -> Path:
    """Compare the named core with its lock file, and return the file's path.

    The mappings and flags of `options` apply. Raise `InputError` with every difference, or if the lock file is missing.
    """
    found, depends = dependencies(core, options)
    path = lock_path(found)
    locked = read_lock(path)
    check_lock(locked, _used(found, depends))
    return path


def write_lock(core: str, options: RunOptions = _NO_OPTIONS) -> Path:
    """Write the named core's lock file, and return the file's path. May raise `InputError`."""
    found, depends = dependencies(core, options)
    path = lock_path(found)
    generated = (call.vlnv for item in (found, *depends) for call in item.calls)
    write(path, lock_text(_used(found, depends), (found.vlnv, *generated)))
    return path


def message_folders(named: Mapping[str, SourceRef | None]) -> tuple[Path, ...]:
    """Return the original folders of message cores, since no run of FuseSoC has copied them."""
    found: list[Path] = []
    cores = {name: core for core in (project_cores() if named else ()) for name in core.names}
    for name, source in named.items():
        core = cores.get(core_name(name))
        requests = [_request(call) for call in core.calls if call.generator == MESSAGES] if core else []
        if not requests:
            fail(f"no known core '{name}' provides messages", source)
        found += [folder for request in requests if request for folder in request.definition_folders()]
    return tuple(found)


def _used(core: ProjectCore, depends: Sequence[ProjectCore]) -> Lock:
    """Return the definitions, cores and tools that a core uses now."""
    generated = [*_requests(core)]
    digests: dict[str, str] = {}
    for item in depends:
        own: list[LoadedRequest] = []
        # Only part of a dependency may be used here. If another part cannot be generated, FuseSoC's run reports the
        # fault.
        with suppress(InputError):
            own = [*_requests(item)]
        foreign = [path for call in item.calls if not _is_ours(call) for path in inputs_of_foreign_call(call)]
        digests[item.vlnv] = digest_of_core(
            item, (*item.files, *foreign, *(part for made in own for part in made.inputs))
        )
        generated += own
    return lock_of(generated, digests)


def _requests(core: ProjectCore) -> Iterator[LoadedRequest]:
    """Yield the derived requests of a core's generator calls."""
    for call in core.calls:
        if call.generator != MESSAGES and (request := _request(call)):
            yield GENERATORS[request.command].load(request)


def _generated_names(call: GeneratorCall) -> list[str]:
    if (request := _request(call)) is None:
        return []
    generator, basis = GENERATORS[request.command], Basis("")
    return [*obtain(load(request, generator, basis), generator, basis)[1].files]


def _touched(changed: Collection[Path], core: ProjectCore) -> str | None:
    """Return the name of a changed file that touches a core itself, or None."""
    found = first_changed(changed, core.files)
    # The inputs of generated cores are examined last, since finding them takes longer.
    for call in core.calls if changed and not found else ():
        found = found or first_changed(changed, _inputs_of(call))
    return shown(found) if found else None


def _inputs_of(call: GeneratorCall) -> list[Input]:
    """Return all inputs of a generated core, including our own files."""
    if not _is_ours(call):
        return [*inputs_of_foreign_call(call)]
    try:
        request = _request(call)
        assert request is not None
        found = GENERATORS[request.command].load(request).inputs
    except InputError:
        # The core cannot be generated; any change next to it, or in our own files, may be the cause.
        return [Path(call.files_root).resolve(), PACKAGE]
    return [*found, *(PACKAGE / name for name in names())]


def _is_ours(call: GeneratorCall) -> bool:
    return call.generator in GENERATORS


def _request(call: GeneratorCall) -> Request | None:
    """Return the request that FuseSoC would make, or None if the generator is not ours."""
    if not _is_ours(call):
        return None
    return make_request(call, GENERATORS[call.generator].parameters, message_folders)


def _input_files(request: Request) -> list[Path]:
    """Return the files that a request depends on, including files of which only a part is used."""
    inputs = GENERATORS[request.command].load(request).inputs
    found = (item if isinstance(item, Path) else item.path for item in inputs)
    return [*dict.fromkeys(path.resolve() for path in found)]
