"""The cores in FuseSoC's libraries: the parts of each core, and the cores that an edit affects.

A core is read for all targets and flags together, so that the result includes everything that any build uses.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from fusesoc_firm.builds.setup.folder_lock import FolderLock
from fusesoc_firm.builds.setup.libraries import core_fault, core_hint, open_libraries, unsolved
from fusesoc_firm.builds.setup.run_options import RunOptions
from fusesoc_firm.builds.setup.scripts import script_files
from fusesoc_firm.core.core_reader import CoreFile, read_core
from fusesoc_firm.core.request import GeneratorCall
from fusesoc_firm.text.diagnostics import InputError, fail
from fusesoc_firm.text.outputs import shown
from fusesoc_firm.text.render import render
from fusesoc_firm.text.yaml_text import yaml_data

GRAPH_TEMPLATE = "dot/cores.dot"
_NO_OPTIONS = RunOptions()


@dataclass(frozen=True)
class ProjectCore:
    """A core: the name, the files with the `.core` file first, the dependencies, and the generator calls.

    `names` are the names by which other cores can depend on this core; each consists of vendor, library and name.
    `files` may be folders, or missing. `needs` are the dependencies as written, such as `>=acme:m:one:1.0`. `fetched`
    is the folder with the sources of a provider, or None. `replaced` are the names of which the core takes the place
    if a user selects a mapping.
    """

    vlnv: str
    names: frozenset[str]
    files: tuple[Path, ...]
    needs: tuple[str, ...]
    calls: tuple[GeneratorCall, ...]
    fetched: Path | None = None
    replaced: tuple[str, ...] = ()

    @property
    def depends(self) -> frozenset[str]:
        """The names of the dependencies, without relations and versions."""
        return frozenset(map(short, self.needs))


def project_cores() -> list[ProjectCore]:
    """Return all cores that `fusesoc` finds from the current folder, sorted by name."""
    found = open_libraries().get_cores()
    mapped = _mapped(found.values())
    return [_core(found[name], mapped) for name in sorted(found)]


def _mapped(cores: Iterable[Any]) -> dict[str, list[str]]:
    """Return the names that cores replace by each name, if a user selects the mappings of these cores."""
    replaced: dict[str, list[str]] = {}
    for core in cores:
        for name, other in core.mapping.items():
            replaced.setdefault(short(other), []).append(short(name))
    return replaced


def dependencies(core: str, options: RunOptions) -> tuple[ProjectCore, list[ProjectCore]]:
    """Return a core and all cores that any of its targets depends on, sorted by name.

    The mappings and flags of `options` apply. Sources of providers are fetched. Raise `InputError` if the core or one
    of its dependencies is missing.
    """
    fusesoc, top = _found(core, options)
    needed: dict[str, Any] = {}
    for target in top.get_data({}).targets:
        needed |= {str(item.name): item for item, _ in solved(fusesoc, top, target, options.use_flags())}
    needed.pop(str(top.name), None)
    for item in needed.values():
        fetch(item)
    return _core(top, {}), [_core(needed[name], {}) for name in sorted(needed)]


def fetch(core: Any) -> None:
    """Download the sources of a core with a provider, unless they are here; FuseSoC cannot do this in parallel."""
    if not core.provider or core.cache_status() == "downloaded":
        return
    lock = FolderLock(Path(f"{core.files_root}.lock"))
    if owner := lock.acquire():
        fail(f"{core.name} is being downloaded by {owner}", hint="run the command again after the download")
    try:
        core.setup()
    finally:
        lock.release()


def affected(
    cores: Iterable[ProjectCore], touches: Callable[[ProjectCore], str | None], gone: Mapping[str, str]
) -> dict[str, str]:
    """Return the names of the cores that are touched or depend on a touched core, each with the reason.

    The result is in the order of `cores`. `touches` returns the touched part of a core, or None. `gone` are names that
    no core has any longer, each with the file that had it.
    """
    cores = list(cores)
    reasons = {
        core.vlnv: reason
        for core in cores
        if (reason := touches(core) or next((gone[name] for name in sorted(core.depends & gone.keys())), None))
    }
    new = set(reasons)
    while new:
        by_name = {name: core.vlnv for core in cores if core.vlnv in new for name in (*core.names, *core.replaced)}
        new = set()
        for core in cores:
            if core.vlnv not in reasons and (through := sorted(core.depends & by_name.keys())):
                reasons[core.vlnv] = f"by {by_name[through[0]]}"
                new.add(core.vlnv)
    return {core.vlnv: reasons[core.vlnv] for core in cores if core.vlnv in reasons}


def changed_files(revision: str, folder: Path) -> list[Path]:
    """Return the absolute paths of the files that differ from a revision, including new and removed files.

    The files are those in the repository that contains `folder`. Raise `InputError` if the repository or the revision
    is missing.
    """
    root = Path(_git(folder, "rev-parse", "--show-toplevel").rstrip("\n"))
    # The revision is resolved to a commit, so that a leading dash is not read as an option.
    commit = _git(folder, "rev-parse", "--verify", "--end-of-options", f"{revision}^{{commit}}").strip()
    listed = _git(root, "diff", "--name-only", "--no-renames", "-z", commit)
    listed += _git(root, "ls-files", "--others", "--exclude-standard", "-z")
    return sorted({root / name for name in listed.split("\0") if name})


def former_names(revision: str, folder: Path, cores: Iterable[ProjectCore]) -> dict[str, str]:
    """Return the names that cores had at a revision, and no longer have, each with the path of its `.core` file."""
    names = {core.files[0]: core.names for core in cores}
    found: dict[str, str] = {}
    root = Path(_git(folder, "rev-parse", "--show-toplevel").rstrip("\n"))
    for path in changed_files(revision, folder):
        name = str(path.relative_to(root))
        if path.suffix == ".core" and _git(root, "ls-tree", "--name-only", revision, "--", name):
            former = _names_in(_git(root, "show", f"{revision}:{name}"))
            found |= dict.fromkeys(former - names.get(path.resolve(), frozenset()), shown(path.resolve()))
    return found


def _names_in(text: str) -> frozenset[str]:
    try:
        data = yaml_data(text)
    except yaml.YAMLError:
        return frozenset()
    return frozenset(_names(data) if isinstance(data, dict) else ())


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        fail("the program 'git' is not installed", hint="on Debian and Ubuntu: apt install git")
    if done.returncode:
        fail(f"git {arguments[0]}: {done.stderr.strip()}")
    return done.stdout


def core_graph(core: str, target: str, inputs_of: Callable[[GeneratorCall], list[str]]) -> str:
    """Return the dependencies of a core's target in Graphviz's language: cores, generated cores and inputs.

    Raise `InputError` if the core, the target or a dependency is missing.
    """
    fusesoc, top = _found(core)
    cores = solved(fusesoc, top, target)
    names = {name: str(item.name) for item, _ in cores for name in _names(read_core(Path(item.core_file)).data)}
    edges: list[tuple[str, str]] = []
    generated: dict[str, str] = {}
    sources: dict[str, None] = {}
    for item, flags in cores:
        needed = [names.get(short(str(depend)), "") for depend in item.get_depends(flags)]
        edges += [(str(item.name), name) for name in needed if name]
        for made in calls_of(item, flags):
            generated[made.vlnv] = made.generator
            edges.append((str(item.name), made.vlnv))
            for source in inputs_of(made):
                sources[source] = None
                edges.append((made.vlnv, source))
    return render(
        GRAPH_TEMPLATE,
        {
            "cores": [{"name": str(item.name)} for item, _ in cores],
            "generated": [{"name": name, "generator": generator} for name, generator in generated.items()],
            "sources": [{"name": name} for name in sources],
            "edges": [{"from": start, "to": end} for start, end in edges],
        },
    )


def target_calls(core: str, target: str, options: RunOptions) -> list[tuple[str, GeneratorCall]]:
    """Return the generator calls of a core's target, each with the requesting core. May raise `InputError`."""
    fusesoc, top = _found(core, options)
    cores = solved(fusesoc, top, target, options.use_flags())
    return [(str(item.name), call) for item, flags in cores for call in calls_of(item, flags)]


def solved(
    fusesoc: Any, top: Any, target: str, further: Mapping[str, Any] = MappingProxyType({})
) -> list[tuple[Any, Mapping[str, Any]]]:
    """Return all cores of a target with their flags, each after its dependencies, so that the core itself is last.

    `further` flags are added to those of the target.

    Raise `InputError` if the target or a dependency is missing.
    """
    from fusesoc.coremanager import DependencyError

    try:
        flags = {**top.get_flags(target), "target": target, **further}
        cores = fusesoc.cm.get_depends(top.name, {**flags, "is_toplevel": True})
    except DependencyError as error:
        if faults := unsolved(fusesoc, top, flags):
            raise InputError(faults) from error
        fail(f"FuseSoC cannot resolve the dependencies of {top.name}", hint=" ".join(error.msg.split()))
    except RuntimeError as error:
        fail(str(error))
    return [(core, {**flags, "is_toplevel": core.name == top.name}) for core in cores]


def _found(core: str, options: RunOptions = _NO_OPTIONS) -> tuple[Any, Any]:
    """Return a FuseSoC instance to which the mappings apply, and the core with this name. May raise `InputError`."""
    from fusesoc.coremanager import DependencyError

    fusesoc = open_libraries()
    options.apply(fusesoc)
    try:
        return fusesoc, fusesoc.get_core(core)
    except (DependencyError, SyntaxError):
        fail(f"unknown core '{core}'", hint=core_hint(fusesoc, core))


def calls_of(core: Any, flags: Mapping[str, Any]) -> Iterator[GeneratorCall]:
    """Yield the generator calls that a FuseSoC core makes with these flags. May raise `InputError`."""
    try:
        calls = core.get_ttptttg(dict(flags))
    except SyntaxError as error:
        raise InputError([core_fault(core, error)]) from error
    for call in calls:
        yield _call(str(core.name), call["name"], call["generator"], core.files_root, call["config"])


def _core(found: Any, mapped: Mapping[str, Sequence[str]]) -> ProjectCore:
    """Return the parts of a FuseSoC core; `mapped` are the names that mappings replace by each name."""
    vlnv, core = str(found.name), read_core(Path(found.core_file))
    filesets = core.section("filesets").values()
    needs = [word for fileset in filesets for item in _listed(fileset, "depend") for word in _words(item)]
    names = _names(core.data)
    fetched = Path(found.files_root).resolve() if found.provider else None
    roots = [core.path.parent, *([fetched] if fetched else ())]
    files = [(root / file).resolve() for file in dict.fromkeys(_files(core)) for root in roots]
    scripts = [
        file.resolve()
        for item in core.section("generators").values()
        for root in roots
        for file in script_files(root / str(item.get("command", "")))
    ]
    return ProjectCore(
        vlnv,
        frozenset(names),
        tuple(dict.fromkeys((core.path.resolve(), *files, *scripts, *([fetched] if fetched else ())))),
        tuple(dict.fromkeys(needs)),
        tuple(_calls(vlnv, core, Path(found.files_root))),
        fetched,
        tuple(other for name in names for other in mapped.get(name, ())),
    )


def _files(core: CoreFile) -> Iterator[str]:
    """Yield a core's files and folders: in filesets, patches, and values of parameters of the type `file`."""
    for fileset in core.section("filesets").values():
        for item in _listed(fileset, "files"):
            yield from _words(_file(item))
    provider = core.data.get("provider")
    yield from map(str, _listed(provider, "patches") if isinstance(provider, dict) else ())
    kinds = core.section("parameters")
    values = {name: str(item.get("default") or "") for name, item in kinds.items()}
    given = [f"{name}={value}" for name, value in values.items()]
    for target in core.section("targets").values():
        given += [word for item in _listed(target, "parameters") for word in _words(item)]
    for name, _, value in (word.partition("=") for word in given):
        if value and kinds.get(name, {}).get("datatype", "file") == "file":
            yield value


def _calls(vlnv: str, core: CoreFile, folder: Path) -> Iterator[GeneratorCall]:
    """Yield the call of each generator instance, and another call for each target that changes its parameters."""
    known = core.section("generate")
    changes: list[tuple[str, dict[str, Any]]] = [(name, {}) for name in known]
    for target in core.section("targets").values():
        for item in _listed(target, "generate"):
            changes += item.items() if isinstance(item, dict) else ()
    for name, changed in changes:
        generator = str(known.get(name, {}).get("generator"))
        yield _call(vlnv, name, generator, folder, {**core.parameters(name), **(changed or {})})


def _call(vlnv: str, instance: str, generator: str, folder: Path | str, parameters: Mapping[str, Any]) -> GeneratorCall:
    vendor, library, name, version = vlnv.split(":")
    return GeneratorCall(
        generator, f"{vendor}:{library}:{name}-{instance}:{version}", str(Path(folder).absolute()), parameters
    )


def _names(data: Mapping[str, Any]) -> list[str]:
    """Return a core's own name and the virtual names that it provides under any flags."""
    virtual = (word for item in data.get("virtual") or () for word in _words(item))
    return [short(str(name)) for name in (data.get("name", ""), *virtual)]


def _listed(section: Mapping[str, Any], key: str) -> list[Any]:
    """Return the list under a key of a section, including additions to an inherited list."""
    return [item for name in (key, f"{key}_append") for item in section.get(name) or ()]


def _file(item: object) -> str:
    """Return the name in a file's entry, which may have attributes."""
    return str(next(iter(item)) if isinstance(item, dict) else item)


def _words(item: object) -> list[str]:
    """Return the words of a text under all flags, such as x for `target_sim ? (x)`; rejected text is unchanged."""
    from fusesoc.capi2.exprs import parse

    def words(tree: Iterable[Any]) -> Iterator[str]:
        for part in tree:
            yield from part.split() if isinstance(part, str) else words(part[2])

    try:
        return [*words(parse(str(item)))]
    except ValueError:
        return [str(item)]


def short(name: str) -> str:
    """Return a core's vendor, library and name, without the version; a name that FuseSoC rejects is unchanged."""
    from fusesoc.vlnv import Vlnv

    try:
        core = Vlnv(name)
    except SyntaxError:
        return name
    return f"{core.vendor}:{core.library}:{core.name}"
