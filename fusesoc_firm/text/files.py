"""Write files atomically: no reader, on this machine or on another that shares the folder, sees a partial file.

Every hit loads this module, so it imports as little as possible.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress

TEMPORARY = ".new-"
"""The prefix of the names of incomplete files."""
# Of Linux: relative paths begin in the current folder; the two files are exchanged.
_HERE, _RENAME_EXCHANGE = -100, 2
# The system, or the file system, cannot exchange two files.
_NO_EXCHANGE = (errno.ENOSYS, errno.EINVAL)


def write_whole(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a temporary file next to the target, then rename it; an existing file keeps its mode and owner.

    May raise `OSError`.
    """
    with _temporary(path, data) as temporary:
        os.replace(temporary, path)


def replace_content(path: str | os.PathLike[str], expected: bytes, data: bytes) -> bool:
    """Write an existing file like `write_whole`, but only if its content is still `expected`; return whether it was.

    A file that another program writes or replaces meanwhile is not lost, where the system can exchange two names. May
    raise `OSError`.
    """
    with _temporary(path, data) as temporary:
        own = os.stat(temporary).st_ino
        try:
            _exchange(temporary, path)
        except OSError as error:
            if error.errno not in _NO_EXCHANGE or read_file(path) != expected:
                raise
            os.replace(temporary, path)
            return True
        if read_file(temporary) == expected:
            return True
        _exchange(temporary, path)
        while os.stat(temporary).st_ino != own:
            # The file has been replaced again, so what was put back is older than what is now the temporary file.
            _exchange(temporary, path)
        return False


@contextmanager
def _temporary(path: str | os.PathLike[str], data: bytes) -> Iterator[str]:
    """Provide a file with `data` next to `path`, with the mode and owner of an existing file there, and delete it."""
    folder = os.path.dirname(os.fspath(path))
    os.makedirs(folder or ".", exist_ok=True)
    # This name is unique across machines, unlike a process id.
    temporary = os.path.join(folder, f"{TEMPORARY}{os.urandom(8).hex()}")
    former = None
    with suppress(OSError):
        former = os.stat(path)
    mode = stat.S_IMODE(former.st_mode) if former else 0o666
    try:
        with open(temporary, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            if former:
                with suppress(OSError):
                    # Only root can give a file away; without the group, others keep at most what they had.
                    os.chown(temporary, former.st_uid, former.st_gid)
                os.chmod(temporary, mode)
            file.write(data)
        yield temporary
    finally:
        with suppress(OSError):
            os.unlink(temporary)


def _exchange(one: str, other: str | os.PathLike[str]) -> None:
    """Exchange two files in one step. May raise `OSError`."""
    import ctypes

    exchange = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if exchange is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    if exchange(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _RENAME_EXCHANGE):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), os.fspath(other))


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
