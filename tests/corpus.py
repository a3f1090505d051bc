"""Real message definitions, which are not part of this project: folders `ros1` and `ros2`, named by CORPUS."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def definitions(ros: str, package: str) -> Path:
    """The folder of `ros1` or `ros2`; the test is skipped where it does not have this package."""
    if not (place := os.environ.get("CORPUS")):
        pytest.skip("CORPUS does not name a folder of message definitions")
    folder = Path(place).resolve() / ros
    if not (folder / package).is_dir():
        pytest.skip(f"no {package} in {folder}, which CORPUS names")
    return folder
