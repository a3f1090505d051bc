"""Write files atomically: no reader, on this machine or on another that shares the folder, sees a partial file.

Every hit loads this module, so it imports as little as possible.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress

TEMPORARY = ".new-"
"""The prefix of the names of incomplete files."""


def write_whole(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a temporary file next to the target, then rename it. May raise `OSError`."""
    folder = os.path.dirname(os.fspath(path))
    os.makedirs(folder or ".", exist_ok=True)
    # This name is unique across machines, unlike a process id.
    temporary = os.path.join(folder, f"{TEMPORARY}{os.urandom(8).hex()}")
    try:
        with open(temporary, "xb") as file:
            file.write(data)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def write_if_changed(path: str | os.PathLike[str], content: str | bytes) -> bool:
    """Write a file as with `write_whole`, unless its content is unchanged; return whether it was written.

    An unchanged file keeps its modification time, so that later steps are not repeated. May raise `OSError`.
    """
    data = content.encode() if isinstance(content, str) else content
    if read_file(path) == data:
        return False
    write_whole(path, data)
    return True


def read_file(path: str | os.PathLike[str]) -> bytes | None:
    """Return the content of a regular file, or None if the file is missing or unreadable; do not wait for pipes."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                return None
            with open(handle, "rb", closefd=False) as file:
                return file.read()
        finally:
            os.close(handle)
    except OSError:
        return None


def is_file(path: str | os.PathLike[str]) -> bool:
    """Return whether a regular file exists; an impossible path, such as one that is too long, results in False."""
    return os.path.isfile(path)


def read_regular(path: str | os.PathLike[str], most: int) -> bytes:
    """Return the content of a regular file of at most `most` bytes.

    Raise `OSError`, with the reason, for other kinds of file: opening a FIFO would wait for a writer, and a device may
    never end.
    """
    with open(path, "rb", opener=_open_at_once) as file:
        mode = os.fstat(file.fileno()).st_mode
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "it is not a regular file", os.fspath(path))
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"it is larger than {most} bytes", os.fspath(path))
    return data


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
