"""Run a Python function with the numbers of hardware, so that the function is the model of its compiled accelerator.

Fields are NumPy's numbers of the message's types. Where Python, `math` or NumPy would raise an exception, or compute a
number that hardware does not compute, a function of this module takes the place: powers are products, the square root
of a negative number is NaN, and a conversion of NaN to an integer is 0.
"""

from __future__ import annotations

import ast
import copy
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from fusesoc_firm.accelerator.message import Message
from fusesoc_firm.compiler.fixed import FixedNumber, Format, format_of
from fusesoc_firm.compiler.functions import CALLS, CONSTANTS
from fusesoc_firm.compiler.kinds import INTEGERS, floor_number, number_of, whole_number
from fusesoc_firm.compiler.models import modelled
from fusesoc_firm.frame.model import Data, DataKind, Fixed, Frame, FrameField, all_nodes

_OPERATORS = {
    ast.Pow: "_firm_power",
    ast.Div: "_firm_quotient",
    ast.FloorDiv: "_firm_floor_quotient",
    ast.Mod: "_firm_remainder",
}
_ENCODINGS = {DataKind.STRING: "utf-8", DataKind.WSTRING: "utf-16-le"}
_IMPORTS = (ast.Import, ast.ImportFrom)


def typed(frame: Frame, message: Mapping[str, Any], numbers: str = "") -> Message:
    """Return a message with numbers of NumPy; floats have the type `numbers`, if it is given."""
    types = {part.names: _type(part, numbers) for part in _numbers(frame)}
    for node in all_nodes(frame.nodes):
        if isinstance(node, Data) and node.kind in _ENCODINGS:
            types[node.names] = partial(_Text.of, _ENCODINGS[node.kind])
    made: Message = _typed(message, (), types)
    return made


class _Text(str):
    """A text whose length is that of hardware: the number of its bytes, or of its UTF-16 units."""

    __slots__ = ("units",)
    units: int

    @classmethod
    def of(cls, encoding: str, text: str) -> _Text:
        """Return a text of a message."""
        made = cls(text)
        made.units = len(text.encode(encoding, "surrogatepass")) // len("a".encode(encoding))
        return made

    def __len__(self) -> int:
        return self.units


def _numbers(frame: Frame) -> Iterator[FrameField | Data]:
    for node in all_nodes(frame.nodes):
        if isinstance(node, Fixed):
            yield from node.fields
        elif isinstance(node, Data) and node.kind is DataKind.ARRAY:
            yield node


def _wire(part: FrameField | Data) -> Any:
    """Return the wire type of a field, or of an array's elements."""
    return part.element if isinstance(part, Data) else part.type


def _type(part: FrameField | Data, numbers: str) -> Callable[[Any], Any]:
    wire = _wire(part)
    if wire.name == "bool":
        # An array of variable size has bytes.
        return np.uint8 if isinstance(part, Data) else bool
    return _number_type(wire.name, numbers)


def _number_type(name: str, numbers: str) -> Callable[[Any], Any]:
    is_float = name.startswith("float")
    if is_float and (format_ := format_of(numbers)):
        return format_.number
    made: Callable[[Any], Any] = getattr(np, numbers if numbers and is_float else name)
    return made


def typed_number(name: str, value: float, numbers: str = "") -> Any:
    """Return a number of the type with this name; floats have the type `numbers`, if it is given."""
    return bool(value) if name == "bool" else _number_type(name, numbers)(value)


def _typed(value: Any, path: tuple[str, ...], types: Mapping[tuple[str, ...], Callable[[Any], Any]]) -> Any:
    if isinstance(value, Mapping):
        return Message({name: _typed(item, (*path, name), types) for name, item in value.items()})
    if isinstance(value, list | bytes | bytearray):
        return [_typed(item, path, types) for item in value]
    return types[path](value) if path in types else value


def plain(frame: Frame, answer: Any) -> Any:
    """Return an answer with Python's numbers: integers wrap in their field, and each NaN is the positive quiet NaN."""
    bits = {part.names: _wire(part) for part in _numbers(frame)}
    return _plain(answer, (), bits)


def _plain(value: Any, path: tuple[str, ...], types: Mapping[tuple[str, ...], Any]) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item, (*path, str(name)), types) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, path, types) for item in value]
    wire = types.get(path)
    if isinstance(value, _Text):
        return str(value)
    if isinstance(value, float | np.floating | FixedNumber):
        number = float(value)
        return math.nan if math.isnan(number) else number
    if isinstance(value, bool | np.bool_):
        return bool(value) if wire is None or wire.name == "bool" else int(value)
    if isinstance(value, int | np.integer) and wire is not None and wire.code in "bBhHiIqQ":
        whole = int(value) % (1 << wire.bits)
        return whole - (1 << wire.bits) if wire.code.islower() and whole >> (wire.bits - 1) else whole
    return value


@contextmanager
def silent() -> Iterator[None]:
    """Let NumPy compute infinities, NaN and integers that wrap without a warning."""
    with np.errstate(all="ignore"):
        yield


def prepared(module: ast.Module, numbers: str = "") -> ast.Module:
    """Return a source in which powers, quotients and remainders are calls of functions of this module.

    After each import, the module gets the functions of hardware. Fixed-point numbers take the place of floats.
    """
    made: ast.Module = _Replaced(format_of(numbers) is not None).visit(module)
    adopting = ast.Expr(ast.Call(ast.Name("_firm_adopt", ast.Load()), [], []))
    for place in reversed([place for place, item in enumerate(made.body) if isinstance(item, _IMPORTS)]):
        made.body.insert(place + 1, ast.copy_location(copy.deepcopy(adopting), made.body[place]))
    return ast.fix_missing_locations(made)


@dataclass
class _Replaced(ast.NodeTransformer):
    is_fixed: bool

    def visit_Dict(self, node: ast.Dict) -> ast.AST:
        self.generic_visit(node)
        return ast.copy_location(ast.Call(ast.Name("dict", ast.Load()), [node], []), node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if not self.is_fixed or not isinstance(node.value, float):
            return node
        return ast.copy_location(ast.Call(ast.Name("_firm_number", ast.Load()), [node], []), node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        return _called(node, node.op, node.left, node.right) or node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        self.generic_visit(node)
        before = copy.deepcopy(node.target)
        before.ctx = ast.Load()
        call = _called(node, node.op, before, node.value)
        return ast.copy_location(ast.Assign([node.target], call), node) if call else node


def _called(node: ast.AST, kind: ast.operator, left: ast.expr, right: ast.expr) -> ast.expr | None:
    """Return the call that takes the place of an operator, or None for other operators."""
    name = _OPERATORS.get(type(kind))
    return ast.copy_location(ast.Call(ast.Name(name, ast.Load()), [left, right], []), node) if name else None


def quotient(one: Any, other: Any) -> Any:
    """Return a quotient; that by zero is infinite or NaN also for numbers of Python."""
    try:
        return one / other
    except ZeroDivisionError:
        return float(np.float64(one) / np.float64(other))


def floor_quotient(one: Any, other: Any) -> Any:
    """Return `one // other`; by zero, it is 0 also for integers of Python."""
    return one * 0 if _is_python_zero(other) else one // other


def remainder(one: Any, other: Any) -> Any:
    """Return `one % other`; by zero, it is 0 also for integers of Python."""
    return one * 0 if _is_python_zero(other) else one % other


def _is_python_zero(value: Any) -> bool:
    return type(value) is int and not value


def power(base: Any, exponent: Any) -> Any:
    """Return a power as hardware computes it: products from the left, the square root, or the inverse of a power."""
    if isinstance(exponent, FixedNumber):
        # As for the product with such a number.
        base, exponent = exponent.format.number(base), float(exponent)
    if exponent == 0.5:
        return _through(square_root, base.format, base) if isinstance(base, FixedNumber) else square_root(base)
    if exponent != int(exponent):
        return base**exponent
    if exponent < 0:
        return (
            np.divide(1.0, power(base, -int(exponent)))
            if isinstance(base, np.generic)
            else 1.0 / power(base, -exponent)
        )
    result = base * 1 if isinstance(exponent, int) else base * 1.0
    first = result
    for _ in range(int(exponent) - 1):
        result = result * first
    return result if exponent else first * 0 + 1


def square_root(value: Any) -> Any:
    """Return the square root in the value's type: float32, or float64."""
    return _real(np.sqrt, value)


def _real(function: Callable[..., Any], *values: Any) -> Any:
    """Return the result of a function of NumPy in the type that `math` would have for float64, or in float32."""
    if all(isinstance(value, np.float32) for value in values):
        return function(*values)
    made = function(*(np.float64(value) for value in values))
    return made if any(isinstance(value, np.float64) for value in values) else made.item()


def _hypotenuse(*values: Any) -> Any:
    squares = [_real(np.multiply, value, value) for value in values]
    total = squares[0]
    for item in squares[1:]:
        total = total + item
    return square_root(total)


def _modelled(name: str) -> Callable[..., Any]:
    """Return a function whose results are those of its model, in float32 or float64."""

    def run(*values: Any) -> Any:
        is_single = all(isinstance(value, np.float32) for value in values)
        result = modelled(name, 32 if is_single else 64, *values)
        if is_single:
            return np.float32(result)
        return np.float64(result) if any(isinstance(value, np.float64) for value in values) else result

    return run


def _in_one_type(name: str) -> Callable[..., Any]:
    """Return a function of several numbers that has a model; a number of Python adopts the type of the others."""

    def run(*values: Any) -> Any:
        if any(isinstance(value, np.float32) for value in values):
            values = tuple(np.float32(value) if type(value) in (int, float) else value for value in values)
        return _modelled(name)(*values)

    return run


_angle = _in_one_type("atan2")


def _tangent(value: Any) -> Any:
    return _real(np.divide, _modelled("sin")(value), _modelled("cos")(value))


def _of_numpy(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function of one number as NumPy has it: the result for a number of Python is a float64."""
    return lambda value: function(value if isinstance(value, np.floating) else np.float64(value))


def _other_leg(value: Any) -> Any:
    return square_root((1.0 - value) * (1.0 + value))


_MATH: Mapping[str, Callable[..., Any]] = {
    "sqrt": square_root,
    "fabs": lambda value: _real(np.fabs, value),
    "copysign": lambda value, sign: _real(np.copysign, value, type(sign)(1) if math.isnan(sign) else sign),
    "floor": floor_number,
    "ceil": lambda value: -floor_number(-value),
    "trunc": whole_number,
    "hypot": _hypotenuse,
    "atan2": _angle,
    # Python has it from 3.13 on.
    "fma": _in_one_type("multiply_add"),
    "atan": lambda value: _angle(value, 1.0),
    "asin": lambda value: _angle(value, _other_leg(value)),
    "acos": lambda value: _angle(_other_leg(value), value),
    "sin": _modelled("sin"),
    "cos": _modelled("cos"),
    "tan": _tangent,
    "exp": _modelled("exp"),
    "log": _modelled("log"),
}
# Functions that fixed-point numbers have themselves.
_EXACT = ("floor", "ceil", "trunc")
_NUMPY: Mapping[str, Callable[..., Any]] = {
    name: _of_numpy(_MATH[name]) for name in ("sin", "cos", "tan", "exp", "log")
}
_BUILTINS: Mapping[str, Callable[..., Any]] = {
    "int": lambda value=0: whole_number(value, int) if isinstance(value, float | np.floating) else int(value),
    "round": lambda value: (
        whole_number(value, round) if isinstance(value, float | np.floating | FixedNumber) else value
    ),
}


def _through(function: Callable[..., Any], format_: Format, *values: Any) -> Any:
    """Return the result of a function of floats for fixed-point numbers, a float as a fixed-point number."""
    return _owned(function, format_)(*(item.real() if isinstance(item, FixedNumber) else item for item in values))


def _owned(function: Callable[..., Any], format_: Format | None) -> Callable[..., Any]:
    """Return a function whose results are fixed-point numbers in place of floats."""
    if format_ is None:
        return function

    def run(*values: Any) -> Any:
        result = function(*values)
        return format_.number(result) if isinstance(result, float | np.floating) else result

    return run


def begin(module: ModuleType, numbers: str = "") -> None:
    """Give a module, before it runs, the functions that take the place of operators."""
    format_ = format_of(numbers)
    vars(module).update(
        _firm_power=_owned(power, format_),
        _firm_quotient=_owned(quotient, format_),
        _firm_floor_quotient=floor_quotient,
        _firm_remainder=remainder,
        _firm_adopt=partial(_adopt, module, format_),
        # The messages that a function makes have attributes, too.
        dict=Message,
        **_BUILTINS,
    )
    if format_:
        vars(module).update(_firm_number=format_.number, float=lambda value=0: format_.number(value))


def _adopt(module: ModuleType, format_: Format | None) -> None:
    """Give a module the functions of hardware in place of those of `math` and NumPy that it has imported."""
    replaced: dict[int, Any] = {}
    for library, functions in ((math, _MATH), (np, _NUMPY)):
        known = {**functions, **(_fixed(library, functions, format_) if format_ else {})}
        replaced |= {id(vars(library)[name]): function for name, function in known.items() if name in vars(library)}
        replaced[id(library)] = SimpleNamespace(**{**vars(library), **known})
    for name, value in [*vars(module).items()]:
        if id(value) in replaced:
            setattr(module, name, replaced[id(value)])


def _fixed(library: ModuleType, functions: Mapping[str, Callable[..., Any]], format_: Format) -> dict[str, Any]:
    """Return the constants and functions of a library for fixed-point numbers."""
    made: dict[str, Any] = {}
    for full in CONSTANTS:
        module, _, name = full.rpartition(".")
        if module == library.__name__:
            made[name] = format_.number(CONSTANTS[full])
    for full in CALLS:
        module, _, name = full.rpartition(".")
        if module == library.__name__ and name not in _EXACT:
            made[name] = partial(_through, functions.get(name) or getattr(library, name), format_)
    return made | {name: getattr(library, name) for name in _EXACT if name in functions} | _types(library, format_)


def _types(library: ModuleType, format_: Format) -> dict[str, Any]:
    """Return the functions that take the place of NumPy's types of numbers."""
    if library is not np:
        return {}
    integers = {name: partial(number_of, kind) for name, kind in INTEGERS.items()}
    return {"float32": format_.number, "float64": format_.number, **integers}
