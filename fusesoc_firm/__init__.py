"""FPGAs for robots: message converters (FIRM) and whole systems (FAR) as FuseSoC cores.

`codec` and `System` are for scripts and notebooks (docs/how-to/use-python.md). They are imported on first use, since
every command imports this module.
"""

from __future__ import annotations

__version__ = "0.2.0"

TYPE_CHECKING = False
if TYPE_CHECKING:
    from fusesoc_firm.api.codec import Codec, codec
    from fusesoc_firm.api.system import Answer, SimulationError, System
    from fusesoc_firm.frame.values import CodecError
    from fusesoc_firm.text.diagnostics import InputError

_MODULES = {
    "Answer": "api.system",
    "Codec": "api.codec",
    "CodecError": "frame.values",
    "InputError": "text.diagnostics",
    "SimulationError": "api.system",
    "System": "api.system",
    "codec": "api.codec",
}

__all__ = ["Answer", "Codec", "CodecError", "InputError", "SimulationError", "System", "codec"]


def __getattr__(name: str) -> object:
    """Import one of the names above."""
    if name not in _MODULES:
        raise AttributeError(f"module 'fusesoc_firm' has no attribute '{name}'")
    from importlib import import_module

    value: object = getattr(import_module(f"fusesoc_firm.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
