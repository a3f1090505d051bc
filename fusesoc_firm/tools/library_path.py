"""The paths of this package's FuseSoC libraries: one with reusable cores and generators, one with demo systems.

In a wheel, the folders contain the files; in a checkout, they contain relative links to `cores`, `generators` and
`specs`. In both cases they contain nothing else, because FuseSoC loads every `.core` file below a library's folder. A
project that adds one of these libraries therefore never finds the remains of a build or a virtual environment in the
checkout. The adjacent `FUSESOC_IGNORE` excludes the folders from all other libraries, such as the library of a project
whose folder contains a virtual environment.
"""

from __future__ import annotations

from pathlib import Path

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
