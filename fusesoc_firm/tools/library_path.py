"""The paths of this package's FuseSoC libraries: one of reusable cores and generators, one of demo systems.

In a wheel the folders hold the files; in a checkout they contain relative links to `cores`, `generators` and `specs`.
In both cases they hold nothing else, because FuseSoC takes every `.core` file below a library's folder: a project that
adds one of these libraries never finds the remains of a build or a virtual environment in the checkout. The adjacent
`FUSESOC_IGNORE` keeps the folders out of all other libraries, such as the library of a project whose folder contains a
virtual environment.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def library_root() -> Path:
    """Return the folder for `fusesoc library add firm FOLDER`, absolute."""
    return _PACKAGE / "library"


def demos_root() -> Path:
    """Return the folder of the demo systems, for `fusesoc library add firm_demos FOLDER`, absolute."""
    return _PACKAGE / "demos"


def docs_root() -> Path:
    """Return the folder of the documentation, absolute."""
    return _PACKAGE / "docs"
