"""Write the files that a user names for a command's output, and check them before the work begins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fusesoc_firm.text.diagnostics import fail


def check_output(path: Path, endings: Sequence[str] = ()) -> None:
    """Raise `InputError` if the file cannot be written, or if its name has none of the given `endings`.

    The file's folder must exist, since a missing folder is usually a misspelling.
    """
    if endings and path.suffix not in endings:
        fail(
            f"cannot write {path}: unknown file extension",
            hint=f"legal extensions: {', '.join(endings)}",
        )
    if path.is_dir():
        fail(f"cannot write {path}: the path is a folder")
    check_parent(path)


def shown(path: Path) -> str:
    """Return a path below the current folder relative to that folder, and any other path unchanged."""
    here = Path.cwd().resolve()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def check_parent(path: Path) -> None:
    """Raise `InputError` unless the parent folder exists."""
    if not path.absolute().parent.is_dir():
        fail(f"cannot write {path}: there is no folder {path.parent}")


def make_folder(path: Path) -> None:
    """Create a folder for a command's output, with its parents. May raise `InputError`."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")


def write(path: Path, content: str | bytes) -> None:
    """Write a file for the user, and create any missing parent folders. May raise `InputError`."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
