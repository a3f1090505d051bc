"""The message sources in the core next to a specification, so that commands and builds search the same places.

Their order is also the same: the specification's `paths`, the command's arguments, the core's paths, a sourced ROS, a
distribution.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.core.core_reader import CoreFile, pair_of, read_core
from fusesoc_firm.core.request import CoreFolders, no_core_folders
from fusesoc_firm.message.library import MessageLibrary, libraries
from fusesoc_firm.message.middleware import Middleware
from fusesoc_firm.system.system_core import LoadedSystem, load_system, with_paths
from fusesoc_firm.system.written.specification import Draft
from fusesoc_firm.text.diagnostics import Diagnostics, InputError, fail, nearest
from fusesoc_firm.text.yaml_text import read_yaml

# The generator instance that generates the system.
_INSTANCE = "system"
# The keys of a specification at its top level.
_KEYS = ("project", "blocks")


@dataclass(frozen=True)
class MessageSources:
    """The sources of a system's messages in order of precedence, without the specification's own sources."""

    paths: tuple[Path, ...] = ()
    distro: str | None = None


def core_of(spec: Path) -> CoreFile | None:
    """Return the core file in a specification's folder that generates the system, or None if it is missing."""
    # Path.resolve() raises a different error for a cyclic link.
    spec = Path(os.path.realpath(spec))
    for path in sorted(spec.parent.glob("*.core")):
        # FuseSoC reports faults in unrelated cores.
        with suppress(InputError):
            core = read_core(path)
            made = core.parameters(_INSTANCE).get("spec")
            if made and os.path.realpath(path.parent / str(made)) == str(spec):
                return core
    return None


def cores_in(folder: Path, instance: str = _INSTANCE) -> list[Path]:
    """Return the core files in a folder that have a generator instance with this name. May raise `InputError`."""
    return [path for path in sorted(folder.glob("*.core")) if instance in read_core(path).section("generate")]


def specs_in(folder: Path) -> list[Path]:
    """Return the specifications of the cores in a folder, or else the YAML files with the keys of a specification.

    May raise `InputError`.
    """
    if found := dict.fromkeys(spec for core in cores_in(folder) if (spec := spec_of(core))):
        return [*found]
    return _specs_alone(folder)


def _specs_alone(folder: Path) -> list[Path]:
    """Return the YAML files in a folder with the keys of a specification."""
    alone = []
    for path in sorted(folder.glob("*.yaml")):
        # Faults in unrelated files are not of interest.
        with suppress(InputError):
            root = read_yaml(path).root
            alone += [path] if all(pair_of(root, key) for key in _KEYS) else []
    return alone


def check_specs_of(folder: Path) -> None:
    """Raise `InputError` for the first core file in a folder that names a missing specification."""
    for path in sorted(folder.glob("*.core")):
        spec, core = spec_of(path), read_core(path)
        item = core.item("generate", _INSTANCE, "parameters", "spec")
        if spec and item and not spec.is_file():
            near = [*sorted(spec.parent.glob(f"*/{spec.name}")), *_specs_alone(spec.parent)]
            hint = nearest(spec.name, [str(item.relative_to(spec.parent)) for item in near])
            fail(f"there is no specification {spec}", core.source(item[1]), hint)


def spec_of(core: Path) -> Path | None:
    """Return the specification of the system that a core file generates, or None. May raise `InputError`."""
    made = read_core(core).parameters(_INSTANCE).get("spec")
    return core.parent / str(made) if made else None


def sources_of(
    spec: Path, paths: Sequence[Path] = (), distro: str | None = None, core_folders: CoreFolders = no_core_folders
) -> MessageSources:
    """Return the command's arguments, followed by the message sources of the core next to a specification.

    Unknown message cores are ignored here, because the build reports them.
    """
    core = core_of(spec)
    parameters = core.parameters(_INSTANCE) if core else {}
    found = [*paths, *(spec.parent / item for item in _words(parameters.get("paths")))]
    with suppress(InputError):
        found += core_folders(dict.fromkeys(_words(parameters.get("messages"))))
    given = parameters.get("distro")
    return MessageSources(tuple(found), distro or (given if isinstance(given, str) else None))


def load_beside(
    spec: Path | Draft,
    paths: Sequence[Path] = (),
    distro: str | None = None,
    *,
    needs_sources: bool = True,
    core_folders: CoreFolders = no_core_folders,
) -> LoadedSystem:
    """Return the system of a specification; `paths` and `distro` are a command's arguments. May raise `InputError`."""
    path = spec.path if isinstance(spec, Draft) else spec
    known = libraries_beside(path, paths, distro, core_folders=core_folders)
    return load_system(spec, known, needs_sources=needs_sources, core_folders=core_folders)


def libraries_beside(
    spec: Path, paths: Sequence[Path] = (), distro: str | None = None, *, core_folders: CoreFolders = no_core_folders
) -> Mapping[Middleware, MessageLibrary]:
    """Return the messages available to a specification; the arguments are those of `load_beside`."""
    sources = sources_of(spec, paths, distro, core_folders)
    return libraries(sources.paths, os.environ, sources.distro)


def known_names(spec: Path, own: Sequence[str], sources: MessageSources, core_folders: CoreFolders) -> list[str]:
    """Return the sorted names of all messages available to a specification with `own` paths; may raise `InputError`."""
    known = libraries(sources.paths, os.environ, sources.distro)
    found = with_paths(known, dict.fromkeys(own), spec.parent, core_folders, Diagnostics())
    return sorted({str(name) for library in found.values() for name in library.names()})


def _words(value: object) -> list[str]:
    """Return the texts in a list; for any other value, which the build reports, return an empty list."""
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
