"""The languages in which a system's node can be generated, each with its writer.

A writer imports its modules only when called, since the command line lists the languages in every help text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fusesoc_firm.core.request import CoreFolders
    from fusesoc_firm.message.middleware import Middleware
    from fusesoc_firm.system.system_core import LoadedSystem


@dataclass(frozen=True)
class Place:
    """The folder of the node, the specification, and the folders in which the node searches for messages."""

    folder: Path
    specification: Path
    paths: Sequence[Path]
    core_folders: CoreFolders


def _cpp(loaded: LoadedSystem, ros: Middleware | None, _: Place) -> Mapping[str, str]:
    from fusesoc_firm.node.package.cpp_package import cpp_package

    return cpp_package(loaded, ros)


def _python(loaded: LoadedSystem, ros: Middleware | None, place: Place) -> Mapping[str, str]:
    from fusesoc_firm.node.package.python_node import python_node
    from fusesoc_firm.system.message_sources import sources_of

    # The node may run where FuseSoC is not installed.
    own = place.core_folders(loaded.specification.message_cores)
    sources = sources_of(place.specification, [*own, *place.paths], core_folders=place.core_folders)
    return python_node(loaded, ros, place.specification, place.folder, sources.paths)


LANGUAGES: Mapping[str, Callable[[LoadedSystem, Middleware | None, Place], Mapping[str, str]]] = {
    "cpp": _cpp,
    "python": _python,
}
"""For each language's name, a function that returns a node's files by path, for one version of ROS or for any."""
