"""The content of a work folder: each file, link and folder by its path.

Two kinds of content do not affect a step's result, so they are left out of a file's `identity`: the time stamps that a
tool writes into its own files, and FuseSoC's notes about where cores come from.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.builds.step.contents import Contents

FILE, PROGRAM, LINK, FOLDER = "file", "program", "link", "folder"
# FuseSoC's generators work in these folders; what a build uses is exported to `src`.
_PRIVATE = ("generator_cache", "generated")
# Our launcher's notes of paths, and records of steps.
_NOTES = (".firm_noted",)
# GHDL writes the time of analysis into a library, and Verilator the times of its inputs. Yosys, nextpnr and the reports
# of cocotb, VUnit and pytest contain durations.
_STAMPS: dict[str, re.Pattern[bytes]] = {
    ".cf": re.compile(rb'"\d{14}\.\d{3}"'),
    # The origins of cores, which no flow uses.
    ".eda.yml": re.compile(rb"^(?:cores|dependencies):\n(?:[ -].*\n)*", re.MULTILINE),
    "yosys.log": re.compile(rb"^(?:End of script\.|Time spent:|ABC: Total runtime|ABC: elapse:).*$", re.MULTILINE),
    "next.log": re.compile(rb"\b\d+\.\d\d(?:s\b| +\d+\.\d\d\|)"),
    "results.xml": re.compile(rb'\b(?:time|timestamp|ratio_time)="[^"]*"|<property name="sim_time_ratio"[^>]*>'),
    "__verFiles.dat": re.compile(rb"(?<=[CST] ) *\d+ +\d+ +\d+ +\d+ +\d+ +\d+"),
}


@dataclass(frozen=True)
class Item:
    """A file, an executable file (`program`), a link or a folder; a link's `digest` is the path to which it leads.

    `identity` is the digest without time stamps.
    """

    kind: str
    digest: str = ""
    identity: str = ""

    @property
    def key(self) -> list[str]:
        """The part that determines the result of a step that reads the item."""
        return [self.kind, self.identity or self.digest]


Tree = Mapping[str, Item]
"""The items of a folder by their relative paths."""


def tree_of(folder: Path, contents: Contents, *, is_exported: bool = True) -> dict[str, Item]:
    """Return the content of a folder, sorted by path.

    If `is_exported` is set, folders in which FuseSoC's generators work are left out.
    """
    left_out = (*_NOTES, *(_PRIVATE if is_exported else ()))
    found: dict[str, Item] = {}
    _add(str(folder), "", contents, left_out, found)
    return dict(sorted(found.items()))


def changed(before: Tree, after: Tree) -> dict[str, Item]:
    """Return the items of `after` that are new or differ."""
    return {path: item for path, item in after.items() if before.get(path) != item}


def removed(before: Tree, after: Tree) -> list[str]:
    """Return the paths that only `before` contains."""
    return [path for path in before if path not in after]


def key_of(tree: Tree) -> dict[str, list[str]]:
    """Return a tree as plain data for a key."""
    return {path: item.key for path, item in tree.items()}


def in_order_of_time(folder: Path, paths: Iterable[str]) -> list[str]:
    """Return paths, the oldest first, so that `make` considers files restored in this order up to date."""
    return sorted(paths, key=lambda path: (os.lstat(folder / path).st_mtime_ns, path))


def _add(folder: str, above: str, contents: Contents, left_out: tuple[str, ...], found: dict[str, Item]) -> None:
    with os.scandir(folder) as entries:
        for entry in entries:
            path = f"{above}{entry.name}"
            if not above and entry.name in left_out:
                continue
            if entry.is_symlink():
                found[path] = Item(LINK, os.readlink(entry.path))
            elif entry.is_dir():
                found[path] = Item(FOLDER)
                _add(entry.path, f"{path}/", contents, (), found)
            elif digest := contents.digest(entry.path):
                is_program = bool(entry.stat().st_mode & stat.S_IXUSR)
                found[path] = Item(PROGRAM if is_program else FILE, digest, _identity(entry.path))


def _identity(path: str) -> str:
    """Return the digest of a file without its time stamps, or an empty text if files of this name contain none."""
    pattern = next((pattern for ending, pattern in _STAMPS.items() if path.endswith(ending)), None)
    if pattern is None:
        return ""
    return hashlib.sha256(pattern.sub(b"", Path(path).read_bytes())).hexdigest()
