"""The cores that FuseSoC knows here: what each consists of, and which of them an edit touches.

What a core consists of is read for all its targets and flags together, so nothing that some build uses is left out.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from fusesoc_firm.text.diagnostics import fail
from fusesoc_firm.text.render import render
from fusesoc_firm.text.yaml_text import yaml_data

GRAPH_TEMPLATE = "dot/cores.dot"

# A part of a core that depends on a flag: `target_sim ? (x)`.
_CONDITION = re.compile(r"!?\w+\s*\?\s*\(([^()]*)\)")
_RELATIONS = "<>=~^ "


@dataclass(frozen=True)
class Instance:
    """A generated core that a core asks for: its full name, and the call of its generator."""

    vlnv: str
    generator: str
    files_root: Path
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class ProjectCore:
    """A core: its name, its files with its description first, what it depends on, what it has generated.

    `names` are those by which others can depend on it, and `depends` names of that kind: vendor, library and name.
    """

    vlnv: str
    names: frozenset[str]
    files: tuple[Path, ...]
    depends: frozenset[str]
    instances: tuple[Instance, ...]


def project_cores() -> list[ProjectCore]:
    """Every core in FuseSoC's libraries, as `fusesoc` finds them in the current folder, sorted by name."""
    from fusesoc.config import Config
    from fusesoc.fusesoc import Fusesoc

    found = Fusesoc(Config()).get_cores()
    return [_core(name, Path(found[name].core_file)) for name in sorted(found)]


def dependencies(core: str) -> tuple[ProjectCore, list[ProjectCore]]:
    """A core, and all others that one of its targets depends on, sorted by name.

    Raises `InputError` if there is no such core, or if something that it depends on is missing.
    """
    manager, top = _found(core)
    needed: dict[str, Path] = {}
    for target in top.get_data({}).targets:
        needed |= {str(item.name): Path(item.core_file) for item in _solved(manager, top, target)}
    needed.pop(str(top.name), None)
    return _core(str(top.name), Path(top.core_file)), [_core(name, needed[name]) for name in sorted(needed)]


def affected(cores: Iterable[ProjectCore], touches: Callable[[ProjectCore], str | None]) -> dict[str, str]:
    """The cores that are touched themselves or depend on such a core, each with the reason, in the order of `cores`.

    `touches` says what of a core itself is touched, or None.
    """
    cores = list(cores)
    reasons = {core.vlnv: reason for core in cores if (reason := touches(core))}
    new = set(reasons)
    while new:
        by_name = {name: core.vlnv for core in cores if core.vlnv in new for name in core.names}
        new = set()
        for core in cores:
            if core.vlnv not in reasons and (through := sorted(core.depends & by_name.keys())):
                reasons[core.vlnv] = f"by {by_name[through[0]]}"
                new.add(core.vlnv)
    return {core.vlnv: reasons[core.vlnv] for core in cores if core.vlnv in reasons}


def changed_files(revision: str, folder: Path) -> list[Path]:
    """The files of the repository around `folder` that differ from a revision, new and removed ones too, absolute.

    Raises `InputError` if there is no repository or no such revision.
    """
    root = Path(_git(folder, "rev-parse", "--show-toplevel").rstrip("\n"))
    # As a commit: what begins with a dash is no option then.
    commit = _git(folder, "rev-parse", "--verify", "--end-of-options", f"{revision}^{{commit}}").strip()
    listed = _git(root, "diff", "--name-only", "--no-renames", "-z", commit)
    listed += _git(root, "ls-files", "--others", "--exclude-standard", "-z")
    return sorted({root / name for name in listed.split("\0") if name})


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        fail("this needs the program 'git'", hint="Debian and Ubuntu: apt install git")
    if done.returncode:
        fail(f"git {arguments[0]}: {done.stderr.strip()}")
    return done.stdout


def core_graph(core: str, target: str, inputs_of: Callable[[Instance], list[str]]) -> str:
    """What a target of a core depends on, in Graphviz's language: cores, what is generated for them, and of what.

    Raises `InputError` if there is no such core or target, or if something that it depends on is missing.
    """
    manager, top = _found(core)
    flags = _flags(top, target)
    solved = _solved(manager, top, target)
    names = {name: str(item.name) for item in solved for name in _names(item.core_file)}
    edges: list[tuple[str, str]] = []
    generated: dict[str, str] = {}
    sources: dict[str, None] = {}
    for item in solved:
        own = {**flags, "is_toplevel": item is solved[-1]}
        needed = [names.get(_short(str(depend)), "") for depend in item.get_depends(own)]
        edges += [(str(item.name), name) for name in needed if name]
        for call in item.get_ttptttg(own):
            made = Instance(
                _instance_name(str(item.name), call["name"]), call["generator"], Path(item.files_root), call["config"]
            )
            generated[made.vlnv] = made.generator
            edges.append((str(item.name), made.vlnv))
            for source in inputs_of(made):
                sources[source] = None
                edges.append((made.vlnv, source))
    return render(
        GRAPH_TEMPLATE,
        {
            "cores": [{"name": str(item.name)} for item in solved],
            "generated": [{"name": name, "generator": generator} for name, generator in generated.items()],
            "sources": [{"name": name} for name in sources],
            "edges": [{"from": start, "to": end} for start, end in edges],
        },
    )


def _found(core: str) -> tuple[Any, Any]:
    """FuseSoC's manager of cores, and the core of this name."""
    from fusesoc.config import Config
    from fusesoc.coremanager import DependencyError
    from fusesoc.fusesoc import Fusesoc
    from fusesoc.vlnv import Vlnv

    manager = Fusesoc(Config()).cm
    try:
        return manager, manager.get_core(Vlnv(core))
    except (DependencyError, SyntaxError):
        fail(f"'{core}' is no core that FuseSoC knows here", hint="fusesoc core list")


def _flags(top: Any, target: str) -> dict[str, Any]:
    try:
        return {**top.get_flags(target), "target": target}
    except RuntimeError as error:
        fail(str(error))


def _solved(manager: Any, top: Any, target: str) -> list[Any]:
    """All cores of a target, those that others depend on first, the core itself last."""
    from fusesoc.coremanager import DependencyError

    try:
        return list(manager.get_depends(top.name, {**_flags(top, target), "is_toplevel": True}))
    except DependencyError as error:
        fail(f"{top.name} depends on what FuseSoC does not know here: {error}")


def _core(vlnv: str, path: Path) -> ProjectCore:
    data = _data(path)
    filesets = [item for item in _mapping(data, "filesets").values() if isinstance(item, dict)]
    files = [file for fileset in filesets for item in fileset.get("files") or () for file in _words(_file(item))]
    files += [str(item["command"]) for item in _mapping(data, "generators").values() if "command" in item]
    depends = {_short(word) for fileset in filesets for item in fileset.get("depend") or () for word in _words(item)}
    return ProjectCore(
        vlnv,
        frozenset(_names(path)),
        (path.resolve(), *((path.parent / file).resolve() for file in dict.fromkeys(files))),
        frozenset(depends),
        tuple(_instances(vlnv, path, data)),
    )


def _instances(vlnv: str, path: Path, data: Mapping[str, Any]) -> Iterator[Instance]:
    """Each instance, and again with the parameters that a target changes."""
    known = _mapping(data, "generate")
    calls: list[tuple[str, dict[str, Any]]] = [(name, {}) for name in known]
    for target in _mapping(data, "targets").values():
        for item in target.get("generate") or ():
            calls += item.items() if isinstance(item, dict) else ()
    for name, changed in calls:
        section = known.get(name) or {}
        parameters = {**(section.get("parameters") or {}), **changed}
        yield Instance(_instance_name(vlnv, name), str(section.get("generator")), path.parent, parameters)


def _instance_name(vlnv: str, instance: str) -> str:
    vendor, library, name, version = vlnv.split(":")
    return f"{vendor}:{library}:{name}-{instance}:{version}"


def _names(path: Path | str) -> list[str]:
    """The names that a core has or stands for."""
    data = _data(Path(path))
    return [_short(str(name)) for name in (data.get("name", ""), *(data.get("virtual") or ()))]


def _data(path: Path) -> dict[str, Any]:
    try:
        data = yaml_data(path.read_text(encoding="utf-8").removeprefix("CAPI=2:"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        fail(f"cannot read {path}: {error}")
    return data if isinstance(data, dict) else {}


def _mapping(data: Mapping[str, Any], section: str) -> dict[str, Any]:
    return {name: item or {} for name, item in (data.get(section) or {}).items()}


def _file(item: object) -> str:
    """The name of a file, with or without attributes."""
    return str(next(iter(item)) if isinstance(item, dict) else item)


def _words(item: object) -> list[str]:
    """What a condition gives when it holds, or the words themselves."""
    text, count = str(item), 1
    while count:
        text, count = _CONDITION.subn(r"\1", text)
    return text.split()


def _short(vlnv: str) -> str:
    """Vendor, library and name of a core, whatever its version."""
    parts = vlnv.strip(_RELATIONS).split(":")
    return ":".join(parts[:3])
