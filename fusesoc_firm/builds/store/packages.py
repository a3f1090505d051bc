"""The versions of installed packages."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path


@cache
def version(package: str) -> str:
    """Return the version of an installed package, from the name of its folder if possible.

    Python's module for the metadata of packages takes longer to load than most recalled builds. Raise
    `PackageNotFoundError` if the package is not installed.
    """
    wanted = _plain(package)
    for folder in sys.path:
        try:
            names = [path.name for path in Path(folder).iterdir()]
        except OSError:
            continue
        for name in names:
            found, _, number = name.removesuffix(".dist-info").partition("-")
            if name.endswith(".dist-info") and number and _plain(found) == wanted:
                return number
    from importlib import metadata

    return metadata.version(package)


def _plain(package: str) -> str:
    return package.lower().replace("-", "_").replace(".", "_")
