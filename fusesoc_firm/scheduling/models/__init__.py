"""Cycle-exact models of the schedulers in cores/sched; the function and file of a model have its policy's name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from fusesoc_firm.scheduling.models.base import Generics, Scheduler
from fusesoc_firm.scheduling.models.combined import Combined
from fusesoc_firm.scheduling.policies import POLICIES

__all__ = ["Combined", "Generics", "Scheduler", "make_model"]


def make_model(policy: str, generics: Generics) -> Scheduler:
    """Return the model of a policy just after reset; raise `ValueError` for generics that the entity rejects."""
    module = import_module(f"{__name__}.{POLICIES[policy].model_file}")
    make: Callable[[Generics], Scheduler] = getattr(module, policy)
    return make(generics)
