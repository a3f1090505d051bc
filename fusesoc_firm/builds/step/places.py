"""The places that a step may use: its own folder, the machine's tools, and the caches that these tools keep."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.builds.step.trace import Trace
from fusesoc_firm.tools.digests import texts_folder
from fusesoc_firm.tools.own_code import PACKAGE

# The state of the machine, which is not recorded.
_MACHINE = ("/dev", "/etc", "/proc", "/run", "/sys")
_TOOLS = ("/bin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store", "/opt", "/sbin", "/usr")
# Devices without a state; a write to /proc changes only the process itself.
_WRITABLE = ("/dev/full", "/dev/null", "/dev/pts", "/dev/tty", "/dev/zero", "/proc")
_BYTE_CODE = "/__pycache__"
# Parts of this package that a step runs. Other parts are only read to describe a build in its manifest.
_PARTS = tuple("builds/step cocotb converter frame message netlist system text tools".split())


class _Below:
    """The paths of these folders and of everything in them."""

    def __init__(self, folders: tuple[str, ...]) -> None:
        self._folders = folders
        self._beginnings = tuple(f"{folder}/" for folder in folders)

    def __contains__(self, path: str) -> bool:
        return path in self._folders or path.startswith(self._beginnings)


_OF_PACKAGE = _Below((str(PACKAGE),))
_OURS = _Below(tuple(f"{PACKAGE}/{part}" for part in _PARTS))


@dataclass(frozen=True)
class Places:
    """The folder of a step, the folder for its temporary files, the places of tools and of their caches, and HOME.

    `histories` are the beginnings of the paths of histories that tools keep of typed commands.
    """

    folder: str
    temporary: str
    tools: tuple[str, ...]
    caches: tuple[str, ...] = ()
    declared: frozenset[str] = field(default_factory=frozenset)
    home: str = ""
    histories: tuple[str, ...] = ()

    def outside(self, trace: Trace) -> Trace:
        """Return the recorded part of a step's accesses outside its folder."""
        apart = _Below((self.folder, self.temporary, *self.caches, *_MACHINE))

        def kept(paths: Iterable[str]) -> set[str]:
            return {
                path
                for path in paths
                if path not in apart
                and not path.startswith(self.histories)
                and (path not in _OF_PACKAGE or path in _OURS)
            }

        return Trace(
            kept(trace.programs) | kept(_interpreters(trace.programs)),
            kept(trace.read),
            # The names in a folder above the step's own are not an input.
            {path for path in kept(trace.listed) if self.folder not in _Below((path,))},
            kept(trace.asked),
            {path for path in trace.written if not self._may_be_written(path)},
            trace.network,
        )

    def fault(self, outside: Trace) -> str:
        """Return why a step with this use of places outside its folder is not cached, or an empty text."""
        if outside.written:
            return f"it writes {min(outside.written)}, outside its folder"
        if outside.network:
            return "it uses the network"
        undeclared = [path for path in outside.read | outside.programs if not self._is_known(path)]
        return f"it reads {min(undeclared)}, which is not an input of its core" if undeclared else ""

    def _is_known(self, path: str) -> bool:
        tools = _Below(self.tools)
        return path in self.declared or path in tools or os.path.realpath(path) in tools

    def _may_be_written(self, path: str) -> bool:
        is_byte_code = _BYTE_CODE in path and self._is_known(path)
        is_legal = path in _Below((self.folder, self.temporary, *self.caches, *_WRITABLE))
        is_above = any(history.startswith(path + os.sep) for history in self.histories)
        return is_legal or is_byte_code or is_above or path.startswith(self.histories)


def places_of(folder: Path, temporary: Path, environment: Mapping[str, str], declared: Iterable[str] = ()) -> Places:
    """Return the places of a step with this environment; `declared` are input files outside its folder."""
    home = environment.get("HOME", os.path.expanduser("~"))
    states = environment.get("XDG_STATE_HOME") or os.path.join(home, ".local", "state")
    caches = environment.get("XDG_CACHE_HOME") or os.path.join(home, ".cache")
    return Places(
        os.path.abspath(folder),
        os.path.abspath(temporary),
        tuple(dict.fromkeys((*_TOOLS, *_of_python(), *_of_path(environment.get("PATH", os.defpath), home)))),
        (
            environment.get("CCACHE_DIR") or os.path.join(caches, "ccache"),
            os.path.join(home, ".ccache"),
            os.path.join(caches, "YoWASP"),
            texts_folder(environment),
        ),
        frozenset(map(os.path.realpath, declared)),
        home,
        # Yosys keeps a history even without typed commands; it writes a temporary file and renames it. The second one
        # is that of Yosys 0.52 (Debian 13), which also creates the folder.
        (os.path.join(home, ".yosys_history"), os.path.join(states, "yosys", "history")),
    )


def _of_python() -> tuple[str, ...]:
    """Return the folders of this Python, its packages, this package and its parts in Edalize's name space."""
    return (sys.prefix, sys.base_prefix, str(PACKAGE), *_beside_package(), *_packages())


def _beside_package() -> tuple[str, ...]:
    """Return the parts of this package in Edalize's name space, and a checkout's description of the package."""
    return tuple(str(PACKAGE.parent / name) for name in ("edalize", f"{PACKAGE.name}.egg-info"))


def _packages() -> tuple[str, ...]:
    return tuple(path for path in sys.path if os.path.basename(path) in ("site-packages", "dist-packages"))


def _of_path(search: str, home: str) -> tuple[str, ...]:
    """Return the installations whose programs are on the path: the parent of a folder `bin`, else the folder itself."""
    found = []
    for folder in filter(os.path.isabs, search.split(os.pathsep)):
        above, name = os.path.split(os.path.normpath(folder))
        is_whole = name in ("bin", "sbin") and above not in ("/", os.path.normpath(home))
        found.append(above if is_whole else os.path.normpath(folder))
    return tuple(found)


def _interpreters(programs: Iterable[str]) -> set[str]:
    """Return the interpreters of scripts, which the kernel starts."""
    found = set()
    for path in programs:
        try:
            with open(path, "rb") as file:
                line = file.readline(256)
        except OSError:
            continue
        if line.startswith(b"#!") and (words := line[2:].split()):
            found.add(os.fsdecode(words[0]))
    return found
