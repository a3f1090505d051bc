"""The models of functions that no library computes to the last bit: those of `robot:acc:firm_float`."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from types import ModuleType
from typing import Any

from fusesoc_firm.compiler.kinds import Kind
from fusesoc_firm.tools.library_path import library_root

_MODULE = "_firm_float_model"


@cache
def _model() -> ModuleType:
    path = library_root() / "cores" / "acc" / "float" / "model.py"
    spec = importlib.util.spec_from_file_location(_MODULE, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look up their module.
    sys.modules[_MODULE] = module
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = writes
    return module


def modelled(name: str, kind: Kind, *values: Any) -> float:
    """Return the result of a function as the hardware for a kind of numbers computes it."""
    model = _model()
    size = model.FLOAT32 if kind.bits == 32 else model.FLOAT64
    result: float = getattr(model, name)(*map(float, values), size)
    return result
