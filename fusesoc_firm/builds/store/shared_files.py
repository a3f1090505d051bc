"""Access files in a folder that other people may write to, such as a team's store.

Nothing below the root is trusted: a name may be a link, a pipe, a device or a folder. Every folder is opened relative
to its parent without following links, files are opened without waiting, and only regular files are accepted. The user
chooses the root itself, which may be a link. All names are relative to the root.

New files and folders in a group-writable folder belong to the folder's group, which may write to them regardless of the
umask, as in a shared Git repository.

This module imports as little of Python's standard library as possible.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from fusesoc_firm.text.files import TEMPORARY

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import BinaryIO

_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
# Opening a pipe must not wait for the other end, and a terminal must not become the controlling terminal.
_FILE = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_RIGHTS = 0o666
# The number of times that other processes may remove a folder while a file is being written to it.
_TRIES = 100


def read(root: str, name: str, most: int) -> bytes | None:
    """Return the content of a readable regular file of at most `most` bytes, or None for any other file."""
    try:
        with opened(root, name) as file:
            size = os.fstat(file.fileno()).st_size
            if size > most:
                return None
            # Our files are complete when they appear, so a file that is still growing is not ours.
            content = file.read(size + 1)
            return content if len(content) == size else None
    except OSError:
        return None


@contextmanager
def opened(root: str, name: str) -> Iterator[BinaryIO]:
    """Provide a regular file to be read. Raise `OSError` for any other path."""
    with _opened(root, os.path.dirname(name)) as folder:
        handle = os.open(os.path.basename(name), os.O_RDONLY | _FILE, dir_fd=folder)
    with open(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file")
        yield file


def write_whole(root: str, name: str, data: bytes) -> None:
    """Write a temporary file next to the target, then rename it; create missing folders. May raise `OSError`."""
    for _ in range(_TRIES - 1):
        # Another process may remove the folder, or files in the folder.
        with suppress(FileNotFoundError):
            return _write(root, name, data)
    return _write(root, name, data)


@contextmanager
def writing(root: str, name: str) -> Iterator[BinaryIO]:
    """Provide a temporary file next to the target, which it replaces at the end unless an error is raised.

    Create missing folders. May raise `OSError`.
    """
    # This name is unique across machines, unlike a process id.
    temporary = f"{TEMPORARY}{os.urandom(8).hex()}"
    with _opened(root, os.path.dirname(name), is_made=True) as folder:
        try:
            handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _FILE, _RIGHTS, dir_fd=folder)
            with open(handle, "wb") as file:
                _share(handle, folder)
                yield file
            os.replace(temporary, os.path.basename(name), src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary, dir_fd=folder)
            raise


def open_lock(root: str, name: str) -> int:
    """Open a file to be locked and return its handle; create a missing file, and keep the content of an existing one.

    May raise `OSError`, also if the path is not a regular file.
    """
    for _ in range(_TRIES - 1):
        with suppress(FileNotFoundError):
            return _open_lock(root, name)
    return _open_lock(root, name)


def state(root: str, name: str) -> os.stat_result | None:
    """Return the status of a path without following links, or None if the path is missing or inaccessible."""
    try:
        with _opened(root, os.path.dirname(name)) as folder:
            return os.stat(os.path.basename(name), dir_fd=folder, follow_symlinks=False)
    except OSError:
        return None


def listed(root: str, name: str) -> list[tuple[str, os.stat_result]]:
    """Return the entries of all subfolders, and any other files in place of subfolders, each with its status."""
    found = []
    for inner, status in _entries(root, name) if _is_folder(root, name) else [(name, state(root, name))]:
        if status is not None:
            found += _entries(root, inner) if stat.S_ISDIR(status.st_mode) else [(inner, status)]
    return found


def mark_used(root: str, name: str) -> None:
    """Set the times of a file, or of a link itself, to the current time. May raise `OSError`."""
    with _opened(root, os.path.dirname(name)) as folder:
        os.utime(os.path.basename(name), dir_fd=folder, follow_symlinks=False)


def remove(root: str, name: str) -> int:
    """Remove a file, or a folder with its contents; return the number of bytes removed. May raise `OSError`."""
    try:
        with _opened(root, os.path.dirname(name)) as folder:
            return _remove(os.path.basename(name), folder)
    except FileNotFoundError:
        # Another process has already removed the file.
        return 0


def _write(root: str, name: str, data: bytes) -> None:
    with writing(root, name) as file:
        file.write(data)


def _open_lock(root: str, name: str) -> int:
    with _opened(root, os.path.dirname(name), is_made=True) as folder:
        handle = os.open(os.path.basename(name), os.O_RDWR | os.O_CREAT | _FILE, _RIGHTS, dir_fd=folder)
        if stat.S_ISREG(os.fstat(handle).st_mode):
            _share(handle, folder)
            return handle
        os.close(handle)
    raise OSError(errno.EINVAL, "Not a regular file")


def _remove(name: str, above: int) -> int:
    removed = 0
    # Other processes may remove the same file at the same time.
    with suppress(FileNotFoundError):
        status = os.stat(name, dir_fd=above, follow_symlinks=False)
        if not stat.S_ISDIR(status.st_mode):
            os.unlink(name, dir_fd=above)
            return status.st_size
        try:
            for _, folders, files, handle in os.fwalk(name, topdown=False, dir_fd=above):
                removed += sum(_remove(inner, handle) for inner in files)
                for inner in folders:
                    _remove_folder(inner, handle)
        except RecursionError:
            raise OSError(errno.ENAMETOOLONG, "Folders within folders are too many") from None
        _remove_folder(name, above)
    return removed


def _remove_folder(name: str, above: int) -> None:
    """Remove an empty folder or a link; keep a folder that another process has written to."""
    try:
        os.rmdir(name, dir_fd=above)
    except NotADirectoryError:
        os.unlink(name, dir_fd=above)
    except OSError:
        return


def _is_folder(root: str, name: str) -> bool:
    status = state(root, name)
    return status is not None and stat.S_ISDIR(status.st_mode)


def _entries(root: str, name: str) -> list[tuple[str, os.stat_result]]:
    found = []
    with suppress(OSError), _opened(root, name) as folder:
        for inner in sorted(os.listdir(folder)):
            # Another process may remove the folder between the two steps.
            with suppress(OSError):
                found.append((f"{name}/{inner}", os.stat(inner, dir_fd=folder, follow_symlinks=False)))
    return found


@contextmanager
def _opened(root: str, name: str, *, is_made: bool = False) -> Iterator[int]:
    """Open a folder within this context and yield its handle; with `is_made`, create missing folders."""
    if is_made:
        os.makedirs(root, exist_ok=True)
    handle = os.open(root, _FOLDER)
    try:
        for part in filter(None, name.split("/")):
            if is_made:
                _make_folder(part, handle)
            inner = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=handle)
            os.close(handle)
            handle = inner
        yield handle
    finally:
        os.close(handle)


def _make_folder(name: str, above: int) -> None:
    with suppress(FileExistsError):
        os.mkdir(name, dir_fd=above)
        handle = os.open(name, _FOLDER | os.O_NOFOLLOW, dir_fd=above)
        try:
            _share(handle, above)
        finally:
            os.close(handle)


def _share(handle: int, above: int) -> None:
    """Set a new file's group and group rights to those of its folder, if the group may write to the folder."""
    folder, made = os.fstat(above), os.fstat(handle)
    if not folder.st_mode & stat.S_IWGRP:
        return
    is_folder = stat.S_ISDIR(made.st_mode)
    rights = stat.S_IRGRP | stat.S_IWGRP | (stat.S_IXGRP | stat.S_ISGID if is_folder else 0)
    # The calls fail if the user is not in the group, or if another user created the file.
    with suppress(PermissionError):
        if made.st_gid != folder.st_gid:
            os.fchown(handle, -1, folder.st_gid)
        os.fchmod(handle, stat.S_IMODE(made.st_mode) | rights)
