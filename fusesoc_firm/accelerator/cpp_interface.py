"""The comparison of a C++ function for HLS with the interface in the specification.

The wrapper connects the ports of the HLS tool's kernel by the parameters' names, whereas the simulation passes the
arguments by their order.
"""

from __future__ import annotations

from fusesoc_firm.accelerator.cpp import CppFunction, CppParameter, InterfacePragma
from fusesoc_firm.system.derived.cpp_function import Parameter, parameters
from fusesoc_firm.system.derived.model import AcceleratorType
from fusesoc_firm.text.diagnostics import Diagnostics, closest, nearest

# Distinct types, none of which is an alias of another.
_TYPES = ("bool", "float", "double", *(f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)))


def compare_function(type_: AcceleratorType, function: CppFunction, faults: Diagnostics) -> None:
    """Add every difference between the interface of an accelerator and its function."""
    wanted = {item.name: item for item in parameters(type_)}
    given = {item.name: item for item in function.parameters}
    if wanted.keys() == given.keys():
        _compare_order(list(wanted.values()), function, faults)
    else:
        _compare_names(wanted, function, faults)
    for name in given.keys() & wanted.keys():
        _compare_type(given[name], wanted[name], faults)
    _check_streams(wanted, function, faults)
    modes = {item.name: item.mode for item in wanted.values()} | {"return": "ap_ctrl_hs"}
    named = {pragma.port for pragma in function.pragmas}
    for pragma in function.pragmas:
        _compare_pragma(pragma, modes, named, faults)


def _compare_order(wanted: list[Parameter], function: CppFunction, faults: Diagnostics) -> None:
    """Add the first parameter at a different position than in the interface."""
    for number, (found, right) in enumerate(zip(function.parameters, wanted, strict=True), 1):
        if found.name != right.name:
            message = f"parameter {number} is '{found.name}', and the interface needs '{right.name}' here"
            faults.error(message, found.place, "the parameters are in the order of the messages' fields, inputs first")
            return


def _compare_names(wanted: dict[str, Parameter], function: CppFunction, faults: Diagnostics) -> None:
    names = [item.name for item in function.parameters]
    missing = {name: item for name, item in wanted.items() if name not in names}
    places = list(wanted) if len(names) == len(wanted) else [""] * len(names)
    for found, expected in zip(function.parameters, places, strict=True):
        if found.name in wanted:
            continue
        # The name at the same position is the most likely one.
        near = expected if expected in missing else closest(found.name, missing)
        hint = f"needed here: {missing.pop(near).declaration}" if near else "remove it"
        faults.error(f"parameter '{found.name}' is not in the interface", found.place, hint)
    for absent in missing.values():
        message = f"function '{function.name}' has no parameter '{absent.name}'"
        faults.error(message, function.place, f"needed here: {absent.declaration}")


def _compare_type(found: CppParameter, wanted: Parameter, faults: Diagnostics) -> None:
    is_array, needs_reference = found.size is not None, wanted.is_stream or (wanted.is_output and not wanted.count)
    is_wrong = found.type in _TYPES and (
        found.type != wanted.cpp_type.removeprefix("std::")
        or found.is_stream != wanted.is_stream
        or is_array != (wanted.count is not None)
        or ((found.size or "").isdigit() and found.size != str(wanted.count))
        or (needs_reference and not found.is_indirect)
    )
    if is_wrong:
        message = f"the parameter is '{found.declaration}', and the interface needs '{wanted.declaration}'"
        faults.error(message, found.place)


def _check_streams(wanted: dict[str, Parameter], function: CppFunction, faults: Diagnostics) -> None:
    """Add every stream at which the hardware would stall, since the function never uses it.

    An output needs a value, except a string or an array, which may be empty. The input after a string or an array
    arrives only after the function has read them; unread data are dropped when the function returns.
    """
    words = function.words
    if words is None:
        return
    for found in function.parameters:
        item = wanted.get(found.name)
        if not item or not item.is_stream or found.name in words:
            continue
        if item.is_output and not item.may_be_empty:
            hint = f"every message needs its value: {found.name}.write(...)"
            faults.error(f"stream '{found.name}' is never written", found.place, hint)
        elif item.may_be_empty and (later := _next_input(item, wanted, words)):
            hint = f"'{later}' arrives only when all elements before it have been read: {found.name}.read()"
            faults.error(f"stream '{found.name}' is never read", found.place, hint)


def _next_input(item: Parameter, wanted: dict[str, Parameter], words: frozenset[str]) -> str:
    """Return the next used parameter of the same input message, or an empty string."""
    names = [*wanted]
    later = (name for name in names[names.index(item.name) :] if name in words and wanted[name].side == item.side)
    return "" if item.is_output else next(later, "")


def _compare_pragma(pragma: InterfacePragma, modes: dict[str, str], named: set[str], faults: Diagnostics) -> None:
    """Add a wrong port or mode of a pragma; `named` are the ports of all pragmas."""
    if pragma.port not in modes:
        hint = nearest(pragma.port, modes.keys() - named or modes)
        faults.error(f"port '{pragma.port}' is not in the interface", pragma.place, hint)
    elif pragma.mode not in ("", modes[pragma.port]):
        message = f"port '{pragma.port}' has the mode {pragma.mode}, and needs {modes[pragma.port]}"
        faults.error(message, pragma.place)
