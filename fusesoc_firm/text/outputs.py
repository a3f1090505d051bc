"""Files that a user names for what a command writes: checked before the work begins, and written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.text.diagnostics import fail


def check_output(path: Path, endings: Sequence[str] = ()) -> None:
    """Raise `InputError` if a file cannot be written there, or if its name has none of `endings`, where there are any.

    Its folder must exist: one that does not is more often misspelled than meant.
    """
    if endings and path.suffix not in endings:
        fail(
            f"cannot write {path}: its ending does not name a format",
            hint=f"legal endings: {', '.join(endings)}",
        )
    if path.is_dir():
        fail(f"cannot write {path}: it is a folder")
    check_parent(path)


def shown(path: Path) -> str:
    """A path as short as it can be told here."""
    here = Path.cwd().resolve()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def check_parent(path: Path) -> None:
    """Raise `InputError` unless the folder is there that something is to be written into."""
    if not path.absolute().parent.is_dir():
        fail(f"cannot write {path}: there is no folder {path.parent}")


def make_folder(path: Path) -> None:
    """Make a folder that a command is to fill, with those above it. Raises `InputError`."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")


def write(path: Path, content: str | bytes) -> None:
    """Write a file of the user, with the folders above it. Raises `InputError`."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
