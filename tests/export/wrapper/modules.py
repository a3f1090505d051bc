"""The modules that `firm wrap` writes, as Python imports them."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any


def load(path: Path) -> Any:
    """The class in a module, whose name is that of the module in capitals."""
    spec = spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, "".join(word.capitalize() for word in path.stem.split("_")))
