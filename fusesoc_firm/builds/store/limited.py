"""A folder of cached files with a size limit: the least recently used files are removed first."""

from __future__ import annotations

import os
import re
import stat
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fusesoc_firm.builds.store import shared_files
from fusesoc_firm.text.diagnostics import fail

_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
# Shrinking leaves a margin, so that the limit is not exceeded again immediately.
_KEPT_OF_LIMIT = 0.8


@dataclass(frozen=True)
class StoredFile:
    """A file in the folder: its name, its size in bytes, and the time of last use in seconds since the epoch."""

    name: str
    size: int
    used: float


@dataclass(frozen=True)
class LimitedFolder(ABC):
    """Cached files of at most about `limit` bytes in the folder `root`, which is created by the first write."""

    root: Path
    limit: int

    def size(self) -> int:
        """Return the number of bytes that count against the limit."""
        return sum(file.size for file in self._files())

    def shrink(self, limit: int) -> int:
        """Remove the least recently used files until at most `limit` bytes remain; return the number of removed bytes.

        May raise `OSError`.
        """
        total = removed = 0
        for file in self._files():
            total += file.size
            if total > limit:
                removed += shared_files.remove(self._root, file.name)
        return removed

    def shrink_if_needed(self) -> None:
        """Remove the least recently used files if the limit is exceeded. May raise `OSError`."""
        if self.size() > self.limit:
            self.shrink(int(self.limit * _KEPT_OF_LIMIT))

    def remove_damaged(self) -> list[Path]:
        """Remove damaged files and files that cannot belong here; return their paths. May raise `OSError`."""
        damaged = []
        for name, status in self._listed():
            # If the file is missing, another process has removed it.
            if not self._is_whole(name, status) and shared_files.state(self._root, name) is not None:
                shared_files.remove(self._root, name)
                damaged.append(self.root / name)
        return damaged

    def _files(self) -> list[StoredFile]:
        """Return the files that count against the limit, the most recently used first."""
        found = [
            StoredFile(name, status.st_size, status.st_mtime)
            for name, status in self._listed()
            if self._counts(name) and stat.S_ISREG(status.st_mode)
        ]
        return sorted(found, key=lambda file: (-file.used, file.name))

    @abstractmethod
    def _listed(self) -> list[tuple[str, os.stat_result]]:
        """Return the name and the status of each file."""

    def _counts(self, _: str) -> bool:
        """Return whether the file with this name counts against the limit."""
        return True

    @abstractmethod
    def _is_whole(self, name: str, status: os.stat_result) -> bool:
        """Return whether a file belongs here and is undamaged."""

    @property
    def _root(self) -> str:
        return str(self.root)


def limit_of(environment: Mapping[str, str], variable: str, default: str, examples: str) -> int:
    """Return the limit in bytes that an environment variable sets. Raise `InputError` if its value is not a size."""
    text = environment.get(variable) or default
    if (size := parse_size(text)) is None:
        fail(f"{variable} is '{text}', which is not a size", hint=f"legal: a number of bytes, such as {examples}")
    return size


def parse_size(text: str) -> int | None:
    """Return the number of bytes in a text such as `5G` (K, M, G, T: powers of 1024), or None if it is invalid."""
    found = re.fullmatch(r"(\d+)([KMGT]?)", text.strip().upper())
    return int(found[1]) * _UNITS[found[2]] if found else None
