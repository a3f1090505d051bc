"""Where the FuseSoC library lies that this package brings along: its reusable cores, generators and example systems.

In a wheel `library/` holds the files; in a checkout it holds relative links to `cores`, `generators` and `specs`.
Either way it holds nothing else: FuseSoC takes every `.core` below a library's folder, and a project that adds this
one never finds what a build or a virtual environment left in the checkout.
"""

from __future__ import annotations

from pathlib import Path


def library_root() -> Path:
    """The folder for `fusesoc library add firm FOLDER`, absolute."""
    return Path(__file__).resolve().parent / "library"


def docs_root() -> Path:
    """The folder of the documentation, absolute; in a wheel as in a checkout."""
    return Path(__file__).resolve().parent / "docs"
