"""Functions of Python, `math` and NumPy that a compiled function may call with numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from fusesoc_firm.compiler.arithmetic import Arithmetic, RefusalError
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.kinds import FLOAT, INT, KINDS

_ANY = 100


@dataclass(frozen=True)
class Call:
    """A function of numbers: the fewest and most arguments, and the operation."""

    fewest: int
    most: int
    make: Callable[[Arithmetic, list[Node]], Node]


def _folded(step: Callable[[Arithmetic, Node, Node], Node]) -> Callable[[Arithmetic, list[Node]], Node]:
    """Return an operation on several numbers, applied from the left."""

    def run(arithmetic: Arithmetic, values: list[Node]) -> Node:
        result = values[0]
        for item in values[1:]:
            result = step(arithmetic, result, item)
        return result

    return run


def _round(arithmetic: Arithmetic, values: list[Node]) -> Node:
    return arithmetic.rounded(values[0])


def _float(arithmetic: Arithmetic, values: list[Node]) -> Node:
    return arithmetic.real_to(values[0], FLOAT)


def _one(name: str) -> Call:
    return Call(1, 1, lambda arithmetic, values: getattr(arithmetic, name)(values[0]))


def _of_numpy(name: str) -> Call:
    return Call(1, 1, lambda arithmetic, values: getattr(arithmetic, name)(arithmetic.of_numpy(values[0])))


def _typed(name: str) -> Call:
    kind = KINDS[name]
    if kind.is_float:
        return Call(1, 1, lambda arithmetic, values: arithmetic.real_to(values[0], kind))
    return Call(1, 1, lambda arithmetic, values: arithmetic.to(values[0], kind))


def _magnitude(arithmetic: Arithmetic, values: list[Node]) -> Node:
    value = values[0]
    return arithmetic.absolute(value if value.kind.format else arithmetic.real(value))


_SHARED = {
    "sqrt": _one("square_root"),
    "fabs": Call(1, 1, _magnitude),
    "isnan": _one("is_nan"),
    "isinf": _one("is_infinite"),
    "isfinite": _one("is_finite"),
    "copysign": Call(2, 2, lambda arithmetic, values: arithmetic.copied_sign(*values)),
}
CALLS: Mapping[str, Call] = MappingProxyType(
    {
        "abs": _one("absolute"),
        "min": Call(2, _ANY, _folded(Arithmetic.smallest)),
        "max": Call(2, _ANY, _folded(Arithmetic.largest)),
        "round": Call(1, 1, _round),
        "int": Call(1, 1, lambda arithmetic, values: arithmetic.to(arithmetic.truncated(values[0]), INT)),
        "float": Call(1, 1, _float),
        "bool": _one("truth"),
        "math.floor": _one("floor"),
        "math.ceil": _one("ceiling"),
        "math.trunc": _one("truncated"),
        "math.atan2": Call(2, 2, lambda arithmetic, values: arithmetic.function("atan2", *values)),
        "math.fma": Call(3, 3, lambda arithmetic, values: arithmetic.function("multiply_add", *values)),
        "math.exp": Call(1, 1, lambda arithmetic, values: arithmetic.function("exp", *values)),
        "math.log": Call(1, 1, lambda arithmetic, values: arithmetic.function("log", *values)),
        "math.sin": _one("sine"),
        "math.cos": _one("cosine"),
        "math.tan": _one("tangent"),
        "math.atan": _one("angle"),
        "math.asin": _one("arc_sine"),
        "math.acos": _one("arc_cosine"),
        "math.hypot": Call(1, _ANY, lambda arithmetic, values: arithmetic.length(values)),
        "numpy.sin": _of_numpy("sine"),
        "numpy.cos": _of_numpy("cosine"),
        "numpy.tan": _of_numpy("tangent"),
        "numpy.exp": Call(1, 1, lambda arithmetic, values: arithmetic.function("exp", arithmetic.of_numpy(values[0]))),
        "numpy.log": Call(1, 1, lambda arithmetic, values: arithmetic.function("log", arithmetic.of_numpy(values[0]))),
        "numpy.abs": _one("absolute"),
        "numpy.absolute": _one("absolute"),
        **{f"math.{name}": call for name, call in _SHARED.items()},
        **{f"numpy.{name}": call for name, call in _SHARED.items()},
        **{f"numpy.{name}": _typed(name) for name in KINDS if name != "bool"},
        "numpy.bool_": _one("truth"),
    }
)
CONSTANTS: Mapping[str, float] = MappingProxyType(
    {
        **{f"math.{name}": getattr(math, name) for name in ("pi", "e", "tau", "inf", "nan")},
        **{f"numpy.{name}": getattr(math, name) for name in ("pi", "e", "inf", "nan")},
    }
)
MODULES = ("math", "numpy")
"""The modules whose functions and constants hardware knows."""


def called(name: str, arithmetic: Arithmetic, values: list[Node]) -> Node:
    """Return the result of a function; may raise `RefusalError`."""
    call = CALLS[name]
    if not call.fewest <= len(values) <= call.most:
        wanted = str(call.fewest) if call.fewest == call.most else f"{call.fewest} or more"
        raise RefusalError(f"'{name}' takes {wanted} numbers in hardware, not {len(values)}")
    return arithmetic.own(call.make(arithmetic, values))
