"""Functions of Python, `math` and NumPy that a compiled function may call with numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from fusesoc_firm.compiler.arithmetic import Arithmetic, RefusalError
from fusesoc_firm.compiler.graph import Node
from fusesoc_firm.compiler.kinds import FLOAT, INT, KINDS, Kind

_ANY = 100
_Operation = Callable[..., Node]


@dataclass(frozen=True)
class Call:
    """A function of numbers: the operation, which takes an `Arithmetic` first, and the fewest and most numbers.

    The result of a choice is one of the numbers.
    """

    make: _Operation
    fewest: int = 1
    most: int = 1
    is_choice: bool = False


def _folded(step: Callable[[Arithmetic, Node, Node], Node]) -> Call:
    """Return a function of several numbers, to which the operation is applied from the left."""

    def run(arithmetic: Arithmetic, result: Node, *others: Node) -> Node:
        for item in others:
            result = step(arithmetic, result, item)
        return result

    return Call(run, 2, _ANY, is_choice=True)


def _modelled(name: str) -> _Operation:
    return lambda arithmetic, *values: arithmetic.function(name, *values)


def _of_numpy(make: _Operation) -> Call:
    return Call(lambda arithmetic, value: make(arithmetic, arithmetic.of_numpy(value)))


def _typed(kind: Kind) -> Call:
    convert = Arithmetic.real_to if kind.is_float else Arithmetic.to
    return Call(lambda arithmetic, value: convert(arithmetic, value, kind))


def _int(arithmetic: Arithmetic, value: Node) -> Node:
    return arithmetic.to(arithmetic.truncated(value), INT)


def _magnitude(arithmetic: Arithmetic, value: Node) -> Node:
    return arithmetic.absolute(value if value.kind.format else arithmetic.real(value))


_SHARED = {
    "sqrt": Call(Arithmetic.square_root),
    "fabs": Call(_magnitude),
    "isnan": Call(Arithmetic.is_nan),
    "isinf": Call(Arithmetic.is_infinite),
    "isfinite": Call(Arithmetic.is_finite),
    "copysign": Call(Arithmetic.copied_sign, 2, 2),
}
# Those that compute with a float64 for a number of Python in NumPy, and with Python's float in `math`.
_BY_MODEL: Mapping[str, _Operation] = {
    "sin": Arithmetic.sine,
    "cos": Arithmetic.cosine,
    "tan": Arithmetic.tangent,
    "exp": _modelled("exp"),
    "log": _modelled("log"),
}
CALLS: Mapping[str, Call] = MappingProxyType(
    {
        "abs": Call(Arithmetic.absolute),
        "min": _folded(Arithmetic.smallest),
        "max": _folded(Arithmetic.largest),
        "round": Call(Arithmetic.rounded),
        "int": Call(_int),
        "float": _typed(FLOAT),
        "bool": Call(Arithmetic.truth),
        "math.floor": Call(Arithmetic.floor),
        "math.ceil": Call(Arithmetic.ceiling),
        "math.trunc": Call(Arithmetic.truncated),
        "math.atan2": Call(_modelled("atan2"), 2, 2),
        "math.fma": Call(_modelled("multiply_add"), 3, 3),
        "math.atan": Call(Arithmetic.angle),
        "math.asin": Call(Arithmetic.arc_sine),
        "math.acos": Call(Arithmetic.arc_cosine),
        "math.hypot": Call(Arithmetic.length, 1, _ANY),
        "numpy.abs": Call(Arithmetic.absolute),
        "numpy.absolute": Call(Arithmetic.absolute),
        **{f"math.{name}": call for name, call in _SHARED.items()},
        **{f"numpy.{name}": call for name, call in _SHARED.items()},
        **{f"math.{name}": Call(make) for name, make in _BY_MODEL.items()},
        **{f"numpy.{name}": _of_numpy(make) for name, make in _BY_MODEL.items()},
        **{f"numpy.{name}": _typed(kind) for name, kind in KINDS.items() if name != "bool"},
        "numpy.bool_": Call(Arithmetic.truth),
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

    def make(*numbers: Node) -> Node:
        return arithmetic.own(call.make(arithmetic, *numbers))

    return make(*values) if call.is_choice else arithmetic.each(make, *values)
