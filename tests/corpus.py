"""Real message definitions, which are not part of this project: folders `ros1` and `ros2`, named by CORPUS."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# As in the Makefile.
_USUAL = Path(__file__).resolve().parents[1] / ".." / "shared" / "corpus"


def definitions(ros: str, package: str) -> Path:
    """The folder of `ros1` or `ros2`; the test is skipped where it does not have this package."""
    folder = Path(os.environ.get("CORPUS") or _USUAL).resolve() / ros
    if not (folder / package).is_dir():
        pytest.skip(f"no {package} in {folder}; CORPUS names another place")
    return folder
