"""The models of the operators of `robot:acc:firm_float` and `firm_fixed`, which no library computes to the last bit."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from fusesoc_firm.tools.library_path import library_root

_CORES = ("float", "fixed")


def model_files() -> list[Path]:
    """Return the paths of the models."""
    return [_path(core) for core in _CORES]


def _path(core: str) -> Path:
    return library_root() / "cores" / "acc" / core / "model.py"


@cache
def core_model(core: str) -> ModuleType:
    """Return the module of a core's model."""
    name = f"_firm_{core}_model"
    spec = importlib.util.spec_from_file_location(name, _path(core))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look up their module.
    sys.modules[name] = module
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = writes
    return module


def modelled(name: str, bits: int, *values: Any) -> float:
    """Return the result of a function as the hardware for floats of 32 or 64 bits computes it."""
    model = core_model("float")
    size = model.FLOAT32 if bits == 32 else model.FLOAT64
    result: float = getattr(model, name)(*map(float, values), size)
    return result
