"""Derived System -> template configuration: the names that all files of an HLS accelerator share."""

from __future__ import annotations

from pathlib import PurePosixPath

from fusesoc_firm.system.derived.cpp_function import function_name, kernel_entity, library_name
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.text.render import Context


def named(accelerator: AcceleratorType) -> Context:
    """Return the names of the wrapper, the function, its kernel, its file and its library."""
    return {
        "entity": accelerator.entity,
        "function": function_name(accelerator),
        "kernel": kernel_entity(accelerator),
        "source": str(PurePosixPath(accelerator.accelerator.sources[0]).name),
        "library": library_name(accelerator),
    }
