"""Define the parameters of the generators, and check the parameters in a core's calls.

A fault is reported at its place in the requesting `.core` file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fusesoc_firm.builds.call.requesting_core import RequestingCore
from fusesoc_firm.core.request import Plain
from fusesoc_firm.text.diagnostics import Diagnostics, nearest
from fusesoc_firm.text.naming import LONGEST_PATH, text_fault

_TYPES: dict[str, tuple[type, str]] = {
    "str": (str, "a string"),
    "int": (int, "an integer"),
    "list": (list, "a list of strings"),
}


@dataclass(frozen=True)
class Parameter:
    """A parameter: `type` and `meaning` appear in the generator's usage text, `bounds` are the inclusive limits.

    `rule` describes the legal texts and tests a text. A parameter that is neither given nor required has its `default`.
    If a given parameter replaces others (`replaces`), these are neither required nor allowed.
    """

    name: str
    type: str
    meaning: str
    default: Plain = None
    is_required: bool = False
    choices: tuple[str | int, ...] = ()
    bounds: tuple[int, int] | None = None
    replaces: tuple[str, ...] = ()
    rule: tuple[str, Callable[[str], bool]] | None = None

    def usage(self) -> str:
        """Return `name (type): text`, as in the generator core's usage text."""
        facts = []
        if self.choices:
            facts.append(" | ".join(map(str, self.choices)))
        if self.bounds:
            facts.append(f"{self.bounds[0]} to {self.bounds[1]}")
        if self.replaces:
            facts.append(f"instead of {', '.join(self.replaces)}")
        if self.is_required:
            facts.append("required")
        elif self.default is not None:
            facts.append(f"default {self.default}")
        ending = f" ({'; '.join(facts)})" if facts else ""
        return f"{self.name} ({self.type}): {self.meaning}{ending}"


def check_parameters(given: Mapping[str, Any], known: Iterable[Parameter], origin: RequestingCore) -> dict[str, Plain]:
    """Return the given or default value of every known parameter. Raise `InputError` with all faults."""
    table = {parameter.name: parameter for parameter in known}
    replacing = {name: parameter.name for parameter in table.values() for name in parameter.replaces}
    faults = Diagnostics()
    for name in given:
        if name not in table:
            faults.error(f"unknown parameter '{name}'", origin.key(name), nearest(name, table))
        elif replacing.get(name) in given:
            hint = "remove one of these parameters"
            faults.error(f"parameter '{name}' cannot be combined with '{replacing[name]}'", origin.key(name), hint)
    for name, parameter in table.items():
        if name not in given:
            if parameter.is_required and replacing.get(name) not in given:
                hint = f"alternatively, set '{replacing[name]}'" if name in replacing else ""
                faults.error(f"parameter '{name}' is missing: {parameter.meaning}", origin.instance(), hint)
        elif fault := _fault(parameter, given[name]):
            faults.error(f"parameter '{name}' is {given[name]!r}, but must be {fault}", origin.value(name, given[name]))
    faults.raise_if_any()
    return {name: given.get(name, parameter.default) for name, parameter in table.items()}


def _fault(parameter: Parameter, value: object) -> str:
    """Return the legal values if `value` is illegal, or an empty string."""
    expected, words = _TYPES[parameter.type]
    # Types are compared exactly, since in Python a bool is also an integer.
    if type(value) is not expected or (isinstance(value, list) and not all(type(item) is str for item in value)):
        return words
    texts = value if isinstance(value, list) else [value] if isinstance(value, str) else []
    if any(text_fault(text, LONGEST_PATH) for text in texts):
        return f"one line of at most {LONGEST_PATH} printable characters"
    if parameter.choices and value not in parameter.choices:
        return f"one of {', '.join(map(str, parameter.choices))}"
    if parameter.rule and isinstance(value, str) and not parameter.rule[1](value):
        return parameter.rule[0]
    if parameter.bounds and isinstance(value, int) and not parameter.bounds[0] <= value <= parameter.bounds[1]:
        return f"{parameter.bounds[0]} to {parameter.bounds[1]}"
    return ""
