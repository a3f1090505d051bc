"""The models of the cores for arithmetic, which are files of these cores."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType

from tests.hdl.ghdl import CORES


def load_model(core: str) -> ModuleType:
    """Load `model.py` of a core in cores/acc."""
    specification = importlib.util.spec_from_file_location(f"firm_{core}_model", CORES / "acc" / core / "model.py")
    assert specification
    assert specification.loader
    module = importlib.util.module_from_spec(specification)
    # Its dataclass looks for the module by name.
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module
