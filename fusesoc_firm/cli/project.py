"""`firm graph`, `firm affected` and `firm lock`: how the cores of a project hang together, and what they use."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fusesoc_firm.cli.common import add_picture, command
from fusesoc_firm.text.diagnostics import InputError, SourceRef, fail

if TYPE_CHECKING:
    from fusesoc_firm.building.cores import Instance, ProjectCore
    from fusesoc_firm.plugin.lock import Lock
    from fusesoc_firm.request.request import LoadedRequest, Request


def add_project(commands: Any) -> None:
    """Declare the commands."""
    graph = command(
        commands,
        "graph",
        "draw what a core depends on: cores, what is generated for them, and of which files",
        "firm graph robot:sys:quat2euler --target sim -o quat2euler.svg",
        _draw_cores,
    )
    graph.add_argument("core", metavar="CORE", help="its name as FuseSoC has it")
    graph.add_argument("--target", default="default", metavar="NAME", help="the target meant (default: default)")
    add_picture(graph)
    affected = command(
        commands,
        "affected",
        "list the cores that an edit touches, each with the reason",
        "firm affected --since main",
        _list_affected,
    )
    affected.add_argument("--since", default="HEAD", metavar="REV", help="the revision before it (default: HEAD)")
    lock = command(
        commands,
        "lock",
        "write which message definitions, cores and tools a core uses, into a file beside it",
        "firm lock robot:sys:quat2euler",
        _lock,
    )
    lock.add_argument("core", metavar="CORE", help="its name as FuseSoC has it")
    lock.add_argument(
        "--locked", action="store_true", help="write nothing; refuse what differs from the file, and say what does"
    )


def _draw_cores(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.building.cores import core_graph
    from fusesoc_firm.tools.pictures import check_picture, draw

    def sources(instance: Instance) -> list[str]:
        request = _request(instance)
        # Told from here, files of one name in two cores are two.
        return [] if request is None else [*map(shown, _input_files(request))]

    check_picture(arguments.output, arguments.format)
    draw(core_graph(arguments.core, arguments.target, sources), arguments.output, arguments.format)


def _list_affected(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.building.cores import affected, changed_files, project_cores

    changed = dict.fromkeys(path.resolve() for path in changed_files(arguments.since, Path.cwd()))
    found = affected(project_cores(), _touched(changed))
    width = max(map(len, found), default=0)
    for name, reason in found.items():
        print(f"{name:{width}}  {reason}")


def check_locked(core: str) -> Path:
    """Raise `InputError` with everything in which a core, by its name, differs from its lock file, which is returned.

    Where that file is missing, there is nothing to hold the core to, which is a fault, too.
    """
    from fusesoc_firm.building.cores import dependencies
    from fusesoc_firm.plugin.lock import check_lock, lock_path, read_lock

    found, depends = dependencies(core)
    path = lock_path(found)
    locked = read_lock(path)
    check_lock(locked, _used(found, depends))
    return path


def _lock(arguments: argparse.Namespace) -> None:
    from fusesoc_firm.building.cores import dependencies
    from fusesoc_firm.plugin.lock import lock_path, lock_text
    from fusesoc_firm.text.outputs import write

    if arguments.locked:
        print(f"{shown(check_locked(arguments.core))}: nothing differs")
        return
    core, depends = dependencies(arguments.core)
    write(lock_path(core), lock_text(_used(core, depends)))
    print(shown(lock_path(core)))


def _used(core: ProjectCore, depends: Sequence[ProjectCore]) -> Lock:
    """What a core uses now."""
    from fusesoc_firm.plugin.lock import lock_of

    calls = {core.vlnv: [*_calls(core)]}
    for item in depends:
        # Of another one only part may be used here. Where that cannot be made, FuseSoC's run says so.
        with suppress(InputError):
            calls[item.vlnv] = [*_calls(item)]
    return lock_of(core, depends, calls)


def _calls(core: ProjectCore) -> Iterator[tuple[Request, LoadedRequest]]:
    from fusesoc_firm.plugin.generators import GENERATORS, MESSAGES

    for instance in core.instances:
        if instance.generator != MESSAGES and (request := _request(instance)):
            yield request, GENERATORS[request.command].load(request)


def _touched(changed: Collection[Path]) -> Callable[[ProjectCore], str | None]:
    """What tells by which of the changed files a core itself is touched."""

    def touched(core: ProjectCore) -> str | None:
        found = _first(changed, core.files)
        # What is behind a generated core takes longer to tell.
        for instance in core.instances if changed and not found else ():
            found = found or _first(changed, _files_behind(instance, changed))
        return shown(found) if found else None

    return touched


def _first(changed: Collection[Path], files: Collection[Path]) -> Path | None:
    return next((path for path in changed if path in files), None)


def _files_behind(instance: Instance, changed: Collection[Path]) -> set[Path]:
    """All that a generated core is made of, our own files too."""
    from fusesoc_firm.store.own_code import PACKAGE, names

    try:
        request = _request(instance)
        if request is None:
            return set()
        files = set(_input_files(request))
    except InputError:
        # It cannot be made: whatever changed beside it, or in our own files, may be why.
        roots = (instance.files_root.resolve(), PACKAGE)
        return {path for path in changed if any(path.is_relative_to(root) for root in roots)}
    return files | {PACKAGE / name for name in names()}


def _request(instance: Instance) -> Request | None:
    """The request that FuseSoC would make; None for a generator that is not ours."""
    from fusesoc_firm.plugin.generators import GENERATORS
    from fusesoc_firm.request.calls import make_request
    from fusesoc_firm.request.request import GeneratorCall

    if instance.generator not in GENERATORS:
        return None
    call = GeneratorCall(instance.generator, instance.vlnv, str(instance.files_root), instance.parameters)
    return make_request(call, GENERATORS[instance.generator].parameters, message_folders)


def message_folders(names: Mapping[str, SourceRef | None]) -> tuple[Path, ...]:
    """The folders of cores that carry messages, where these lie: there is no run that copies them."""
    from fusesoc_firm.building.cores import project_cores
    from fusesoc_firm.plugin.generators import MESSAGES
    from fusesoc_firm.request.message_core import folders

    found: list[Path] = []
    cores = {name: core for core in project_cores() for name in core.names}
    for name, source in names.items():
        core = cores.get(":".join(name.split(":")[:3]))
        requests = [_request(item) for item in core.instances if item.generator == MESSAGES] if core else []
        if not requests:
            fail(f"'{name}' is no core with messages that FuseSoC knows here", source)
        found += [folder for request in requests if request for folder in folders(request)]
    return tuple(found)


def _input_files(request: Request) -> list[Path]:
    """The files that a request depends on, be it in part."""
    from fusesoc_firm.plugin.generators import GENERATORS

    inputs = GENERATORS[request.command].load(request).inputs
    found = (item if isinstance(item, Path) else item.path for item in inputs)
    return [*dict.fromkeys(path.resolve() for path in found)]


def shown(path: Path) -> str:
    """A path as short as it can be told here."""
    here = Path.cwd().resolve()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
