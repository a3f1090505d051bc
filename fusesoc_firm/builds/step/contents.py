"""The SHA-256 of files, without reading a file again while its size, times and inode are unchanged.

The digests are kept between runs, since a build reads the same hundreds of tool and header files each time. A file that
changed shortly before it was read is not remembered: file times are too coarse to show a second edit.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fusesoc_firm.text.files import read_file, write_whole

# File times are too coarse to distinguish two edits within this period.
_NEW_NANOSECONDS = 2 * 10**9
_MOST_REMEMBERED = 50_000
_STATUS_PARTS = 5


@dataclass
class Contents:
    """The digests of files; `path` is the file that keeps them between runs, or None."""

    path: Path | None = None
    _known: dict[str, list[object]] | None = None
    _new: dict[str, list[object]] = field(default_factory=dict)

    def digest(self, path: str) -> str | None:
        """Return the SHA-256 of a regular file in hexadecimal digits, or None for anything else."""
        try:
            status = os.stat(path)
        except (OSError, ValueError):
            return None
        if not stat.S_ISREG(status.st_mode):
            return None
        mark = [status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns]
        known = self._new.get(path) or self._loaded().get(path)
        if known and known[1:] == mark:
            return str(known[0])
        content = read_file(path)
        if content is None:
            return None
        found = hashlib.sha256(content).hexdigest()
        if max(status.st_mtime_ns, status.st_ctime_ns) < time.time_ns() - _NEW_NANOSECONDS:
            self._new[path] = [found, *mark]
        return found

    def save(self) -> None:
        """Keep the new digests for later runs, if there is a file for them and it can be written."""
        if self.path is None or not self._new:
            return
        # Another process may have added digests since this process read the file.
        self._known = None
        merged = [*(self._loaded() | self._new).items()][-_MOST_REMEMBERED:]
        with suppress(OSError):
            write_whole(self.path, json.dumps(dict(merged)).encode())
        self._known, self._new = dict(merged), {}

    def _loaded(self) -> dict[str, list[object]]:
        if self._known is None:
            data = read_file(self.path) if self.path else None
            self._known = _checked(data) if data else {}
        return self._known


def _checked(data: bytes) -> dict[str, list[object]]:
    """Return the digests in a file's content; a damaged file counts as empty."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    if not isinstance(found, dict):
        return {}
    return {path: known for path, known in found.items() if isinstance(known, list) and len(known) == 1 + _STATUS_PARTS}
