"""FuseSoC's libraries, in which a core that FuseSoC cannot use is reported with its file, and ignored.

FuseSoC ignores the files that violate its schema. Other faults in a file would end the commands for all cores: a
version that the solver rejects, a virtual name that is not a name, an alias that contains itself.
"""

from __future__ import annotations

import operator
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fusesoc_firm.builds.setup.outcome import configuration, configuration_file
from fusesoc_firm.core.core_reader import core_name, read_core
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError, SourceRef, closest
from fusesoc_firm.text.outputs import shown
from fusesoc_firm.tools.library_path import LINK, link_library

_RELATIONS = {"==": operator.eq, ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt}
_LIBRARY = re.compile(r"\[library\.(.+)\]")
_ITEM = re.compile(r"\s*([\w-]+)\s*[=:]\s*(.*\S)")
_OWN_PLACE = "write the path that 'firm path' prints"
_QUOTED = re.compile(r"'([^']+)'")
ALL_CORES = "'fusesoc core list' lists all cores"
# The sections of a core whose items a target names.
_SECTIONS = ("filesets", "generate", "parameters", "hooks", "scripts", "vpi")


def open_libraries(config: Any = None) -> Any:
    """Return a FuseSoC instance with the libraries of a configuration; the default is that of the current folder."""
    from fusesoc.fusesoc import Fusesoc

    _prepare()
    config = configuration() if config is None else config
    _link_library(config)
    check_locations()
    return Fusesoc(config)


def has_library(fusesoc: Any, folder: Path) -> bool:
    """Return whether a folder is one of the libraries of a FuseSoC instance."""
    return folder.resolve() in {Path(library.location).resolve() for library in fusesoc.get_libraries()}


def check_locations() -> None:
    """Raise `InputError` if a library in the current folder's `fusesoc.conf` is in a folder that does not exist.

    FuseSoC would report only that dependencies conflict. The user's own configuration may list deleted projects.
    """
    path = configuration_file()
    faults, section = Diagnostics(), ""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
    found: dict[tuple[str, str], tuple[str, SourceRef]] = {}
    for number, line in enumerate(lines, start=1):
        if head := _LIBRARY.fullmatch(line.strip()):
            section = head[1]
        elif line.lstrip().startswith("["):
            section = ""
        elif section and (item := _ITEM.match(line)):
            found[section, item[1]] = item[2], SourceRef(str(path), number, item.start(2) + 1, line, len(item[2]))
    for (name, key), (place, source) in found.items():
        is_fetched = (name, "sync-uri") in found
        if key == "location" and not is_fetched and not (path.parent / place).is_dir():
            hint = _OWN_PLACE if name == "firm" or place.endswith("fusesoc_firm/library") else "correct the path"
            faults.error(f"library '{name}' is in {place}, which does not exist on this machine", source, hint)
    faults.raise_if_any()


def main() -> None:
    """Run the command `fusesoc` with the arguments of this process."""
    from fusesoc.main import main as run

    _prepare()
    sys.exit(run())


def _link_library(config: Any) -> None:
    """Renew a project's link to our library, which leads nowhere in a copy from another machine."""
    places = [Path(library.location) for library in config.libraries]
    for place in places:
        if place.parts[-len(LINK.parts) :] == LINK.parts:
            # A link that is missing and cannot be written is reported with its place in fusesoc.conf.
            with suppress(OSError):
                link_library(place.parents[len(LINK.parts) - 1])


@cache
def _prepare() -> None:
    """Extend FuseSoC's cores and generator calls in this process, for which FuseSoC has no other way."""
    from fusesoc import coremanager, edalizer

    from fusesoc_firm.builds.setup.fusesoc_parts import LockedCall, SoundCore

    coremanager.Core = edalizer.Core = SoundCore
    edalizer.Ttptttg = LockedCall


def newest(depend: str, providers: Iterable[str]) -> str | None:
    """Return the newest of the cores that satisfies a dependency, such as `>=acme:m:one:1.0`, or None.

    `providers` are full names of cores with the name of the dependency, or of cores that provide this virtual name.
    Raise `SyntaxError` for an invalid dependency.
    """
    from fusesoc.vlnv import Vlnv

    from fusesoc_firm.builds.setup.fusesoc_parts import check_relation, version

    check_relation(depend)
    wanted = Vlnv(depend)

    def fits(name: Any) -> bool:
        # FuseSoC does not compare the versions of virtual names.
        return name.vln_str() != wanted.vln_str() or all(
            _RELATIONS[simple.relation](version(name), version(simple)) for simple in wanted.simpleVLNVs()
        )

    fitting = [name for name in map(Vlnv, providers) if fits(name)]
    return str(max(fitting, key=version)) if fitting else None


def cores_here(fusesoc: Any) -> list[str]:
    """Return the names of the cores whose files are below the current folder, sorted."""
    here, cores = Path.cwd().resolve(), fusesoc.get_cores()
    return sorted(name for name in cores if Path(cores[name].core_file).resolve().is_relative_to(here))


def core_hint(fusesoc: Any, core: str) -> str:
    """Return a hint for an unknown core: why its file is ignored, the nearest name, or the cores of this folder."""
    short = {name.split(":")[2]: core_name(name) for name in fusesoc.get_cores()}
    near = closest(core.split(":")[2] if core.count(":") > 1 else core, short)
    here = ", ".join(map(core_name, cores_here(fusesoc)))
    meant = f"did you mean '{short[near]}'? " if near else f"cores here: {here}; " if here else ""
    return ignored(fusesoc, core) or meant + ALL_CORES


def ignored(fusesoc: Any, core: str) -> str:
    """Return why the file with a core of this name is ignored, or an empty text."""
    for path, message in fusesoc.parse_errors:
        try:
            text = Path(path).read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue
        if core in text:
            return f"{shown(Path(path))} is ignored: {' '.join(message.split())}"
    return ""


@dataclass(frozen=True)
class _Chain:
    """A core, and the cores through which another one needs it, from that one on."""

    core: Any
    names: tuple[str, ...]


def unsolved(fusesoc: Any, top: Any, flags: Mapping[str, Any]) -> list[Diagnostic]:
    """Return the reasons why FuseSoC finds no cores for the dependencies of a core.

    These are dependencies that no core satisfies, and cores with invalid filesets, or else cores that cannot be used
    together.
    """
    faults = Diagnostics()
    cores = fusesoc.get_cores()
    providers: dict[str, list[str]] = {}
    for vlnv, core in cores.items():
        for name in _names(core, flags):
            providers.setdefault(name, []).append(vlnv)
    chains = {str(top.name): _Chain(top, (str(top.name),))}
    waiting = [*chains.values()]
    while waiting:
        chain = waiting.pop(0)
        for depend in _depends(fusesoc, chain.core, {**flags, "is_toplevel": chain.core is top}, faults):
            known = providers.get(depend.vln_str(), [])
            if (found := newest(depend.depstr(), known)) is None:
                source, hint = core_place(chain.core, _bare(depend)), _hint(fusesoc, depend, known)
                through = f"needed by {' -> '.join(chain.names)}"
                faults.error(_unsatisfied(depend, known), source, f"{through}; {hint}" if hint else through)
            elif found not in chains:
                chains[found] = _Chain(cores[found], (*chain.names, found))
                waiting.append(chains[found])
    return faults.found or [*_clashes([chain.core for chain in chains.values()], flags)]


def _names(core: Any, flags: Mapping[str, Any]) -> list[str]:
    return [name.vln_str() for name in (core.name, *core.get_virtuals(flags))]


def _depends(fusesoc: Any, core: Any, flags: Mapping[str, Any], faults: Diagnostics) -> Iterator[Any]:
    try:
        depends = core.get_depends(flags)
    except SyntaxError as error:
        fault = core_fault(core, error)
        faults.error(fault.message, fault.source)
        return
    for depend in depends:
        fusesoc.cm.db._mapping_apply(depend)  # noqa: SLF001 - the only place that knows the mappings in use
        yield depend


def _bare(depend: Any) -> str:
    """Return the name of a dependency, in which vendor and library may be missing."""
    return str(depend.vln_str().lstrip(":"))


def _unsatisfied(depend: Any, known: Sequence[str]) -> str:
    name = _bare(depend)
    return f"no known version of core '{name}' satisfies '{depend.depstr()}'" if known else f"unknown core '{name}'"


def _hint(fusesoc: Any, depend: Any, known: Sequence[str]) -> str:
    if known:
        return f"known versions: {', '.join(name.rpartition(':')[2] for name in known)}"
    near = closest(_bare(depend), [core_name(name) for name in fusesoc.get_cores()])
    return ignored(fusesoc, _bare(depend)) or (f"did you mean '{near}'?" if near else "")


def _clashes(cores: Iterable[Any], flags: Mapping[str, Any]) -> Iterator[Diagnostic]:
    """Yield a fault for each name that several cores have, of which FuseSoC permits only one."""
    by_name: dict[str, list[str]] = {}
    for core in cores:
        for name in _names(core, flags):
            by_name.setdefault(name, []).append(str(core.name))
    for name, found in by_name.items():
        if len(found) > 1:
            yield Diagnostic(f"{' and '.join(found)} are needed together, but only one core can be '{name}'")


def check_files(core: Any, flags: Mapping[str, Any]) -> None:
    """Raise `InputError` if a file of a core would be copied out of the build folder."""
    try:
        core.get_files(dict(flags))
    except SyntaxError as error:
        raise InputError([core_fault(core, error)]) from error


def core_fault(core: Any, error: SyntaxError) -> Diagnostic:
    """Return FuseSoC's fault about the content of a core as a fault at the place of the first name in its message."""
    message = str(error.msg).removeprefix(f"{core.name} : ")
    named = _QUOTED.search(message)
    word = named[1] if named else ""
    return Diagnostic(message, core_place(core, word), _nearest_item(core, word))


def _nearest_item(core: Any, word: str) -> str:
    """Return a hint for an unknown name in the file of a core: the nearest of the names that the file defines."""
    try:
        file = read_core(Path(core.core_file))
    except InputError:
        return ""
    near = closest(word, [name for section in _SECTIONS for name in file.section(section)])
    return f"did you mean '{near}'?" if near and near != word else ""


def core_place(core: Any, word: str) -> SourceRef | None:
    """Return the place of the first text with a word in the file of a core, or None if it cannot be read."""
    path = Path(core.core_file)
    try:
        source = read_core(path).place_of(word)
    except InputError:
        return None
    return SourceRef(shown(path), source.line, source.column, source.text, source.width)
