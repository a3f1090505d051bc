"""What the core beside a specification says of its messages, so that all commands search the places that a build does.

The order is that of a build, too: what the specification itself names under `paths`, what a command is given, what the
core names, a sourced ROS, a distribution.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.message.library import libraries
from fusesoc_firm.request.core_reader import CoreFile, read_core
from fusesoc_firm.request.request import CoreFolders, no_core_folders
from fusesoc_firm.system.system_core import LoadedSystem, load_system, with_paths
from fusesoc_firm.text.diagnostics import Diagnostics, InputError

# The instance of the generator that makes the system.
_INSTANCE = "system"


@dataclass(frozen=True)
class MessageSources:
    """Where the messages of a system come from, beside what its specification names: in order of precedence."""

    paths: tuple[Path, ...] = ()
    distro: str | None = None


def core_of(spec: Path) -> CoreFile | None:
    """The core beside a specification that makes a system of it and can simulate it; None if there is none."""
    # Path.resolve() raises an error of its own for a link that leads in a circle.
    spec = Path(os.path.realpath(spec))
    for path in sorted(spec.parent.glob("*.core")):
        # What is wrong with a core that is not this one's is FuseSoC's to say.
        with suppress(InputError):
            core = read_core(path)
            made = core.parameters(_INSTANCE).get("spec")
            if made and os.path.realpath(path.parent / str(made)) == str(spec):
                return core
    return None


def sources_of(
    spec: Path, paths: Sequence[Path] = (), distro: str | None = None, core_folders: CoreFolders = no_core_folders
) -> MessageSources:
    """What a command is given, then what the core beside a specification says.

    A core with messages that FuseSoC does not know here is left to the build.
    """
    core = core_of(spec)
    parameters = core.parameters(_INSTANCE) if core else {}
    found = [*paths, *(spec.parent / item for item in _words(parameters.get("paths")))]
    with suppress(InputError):
        found += core_folders(dict.fromkeys(_words(parameters.get("messages"))))
    given = parameters.get("distro")
    return MessageSources(tuple(found), distro or (given if isinstance(given, str) else None))


def load_beside(
    spec: Path,
    paths: Sequence[Path] = (),
    distro: str | None = None,
    *,
    needs_sources: bool = True,
    core_folders: CoreFolders = no_core_folders,
) -> LoadedSystem:
    """The system of a specification for a command that is given `paths` and `distro`. Raises `InputError`."""
    sources = sources_of(spec, paths, distro, core_folders)
    known = libraries(sources.paths, os.environ, sources.distro)
    return load_system(spec, known, needs_sources=needs_sources, core_folders=core_folders)


def known_names(spec: Path, own: Sequence[str], sources: MessageSources, core_folders: CoreFolders) -> list[str]:
    """All messages that a specification at `spec` with `own` paths can name, sorted. Raises `InputError`."""
    known = libraries(sources.paths, os.environ, sources.distro)
    found = with_paths(known, dict.fromkeys(own), spec.parent, core_folders, Diagnostics())
    return sorted({str(name) for library in found.values() for name in library.names()})


def _words(value: object) -> list[str]:
    """A list of words; none where it is something else, which the build reports."""
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
