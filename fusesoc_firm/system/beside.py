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
from typing import Any

import yaml

from fusesoc_firm.message.library import libraries
from fusesoc_firm.request.request import CoreFolders, no_core_folders
from fusesoc_firm.system.system_core import LoadedSystem, load_system, with_paths
from fusesoc_firm.text.diagnostics import Diagnostics, InputError
from fusesoc_firm.text.yaml_text import yaml_data


@dataclass(frozen=True)
class MessageSources:
    """Where the messages of a system come from, beside what its specification names: in order of precedence."""

    paths: tuple[Path, ...] = ()
    distro: str | None = None


def core_of(spec: Path) -> Path | None:
    """The core beside a specification that makes a system of it and can simulate it; None if there is none."""
    # Path.resolve() raises an error of its own for a link that leads in a circle.
    spec = Path(os.path.realpath(spec))
    return next((path for path in sorted(spec.parent.glob("*.core")) if _makes(path, spec)), None)


def core_content(core: Path) -> Any:
    """A core's description; empty if it does not make a system."""
    try:
        content = yaml_data(core.read_text(encoding="utf-8").replace("CAPI=2:", "", 1))
        return content if isinstance(content["generate"]["system"]["parameters"], dict) else {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError):
        return {}


def sources_of(
    spec: Path, paths: Sequence[Path] = (), distro: str | None = None, core_folders: CoreFolders = no_core_folders
) -> MessageSources:
    """What a command is given, then what the core beside a specification says.

    A core with messages that FuseSoC does not know here is left to the build.
    """
    core = core_of(spec)
    parameters = core_content(core)["generate"]["system"]["parameters"] if core else {}
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


def _makes(core: Path, spec: Path) -> bool:
    """Whether a core makes a system of the specification."""
    parameters = core_content(core).get("generate", {}).get("system", {}).get("parameters", {})
    return bool(parameters.get("spec")) and os.path.realpath(core.parent / str(parameters["spec"])) == str(spec)


def _words(value: object) -> list[str]:
    """A list of words; none where it is something else, which the build reports."""
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
