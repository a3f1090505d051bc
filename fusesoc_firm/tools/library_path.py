"""The paths of this package's FuseSoC libraries: one with reusable cores and generators, one with demo systems.

In a wheel, the folders contain the files; in a checkout, they contain relative links to `cores`, `generators` and
`specs`. In both cases they contain nothing else, because FuseSoC loads every `.core` file below a library's folder. A
project that adds one of these libraries therefore never finds the remains of a build or a virtual environment in the
checkout. The adjacent `FUSESOC_IGNORE` excludes the folders from all other libraries, such as the library of a project
whose folder contains a virtual environment.
"""

from __future__ import annotations

import os
from pathlib import Path

LINK = Path(".firm", "library")
"""The link in a project that leads to the library of the installation in use; `fusesoc.conf` names it."""

_PACKAGE = Path(__file__).resolve().parents[1]


def library_root() -> Path:
    """Return the absolute path of the folder for `fusesoc library add firm FOLDER`."""
    return _PACKAGE / "library"


def demos_root() -> Path:
    """Return the absolute path of the demo systems' folder, for `fusesoc library add firm_demos FOLDER`."""
    return _PACKAGE / "demos"


def docs_root() -> Path:
    """Return the absolute path of the documentation's folder."""
    return _PACKAGE / "docs"


def link_library(project: Path) -> None:
    """Let a project's link lead to this installation's library, since its path differs on each machine.

    A copy of the library in place of the link is kept. May raise `OSError`.
    """
    link = project / LINK
    if link.is_symlink() and link.readlink() == library_root():
        return
    if link.exists() and not link.is_symlink():
        return
    link.parent.mkdir(exist_ok=True)
    # The link's cores are those of their own library, not of the project's.
    (link.parent / "FUSESOC_IGNORE").touch()
    # A process that reads the library meanwhile finds the former link or the new one.
    made = link.with_name(f"{link.name}-{os.getpid()}")
    made.symlink_to(library_root())
    made.replace(link)
