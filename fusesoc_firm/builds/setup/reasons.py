"""The reasons why a step runs: the inputs that differ from those of the last run in the same folder.

They result from two kinds of notes: the key of the last action of each step, and the inputs of each key.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fusesoc_firm.builds.step.action import Action
from fusesoc_firm.builds.step.contents import Contents
from fusesoc_firm.builds.step.observed import state
from fusesoc_firm.builds.step.results import Results
from fusesoc_firm.tools.digests import digest_of
from fusesoc_firm.tools.facts import Fact

_NEW = "it has not run in this folder before"
_OTHER = {
    "arguments": "the command",
    "machine": "the machine",
    "python": "Python's version",
    "edalize": "Edalize",
    "sandbox": "--sandbox",
}
# The words before a fact's name in a reason; a path needs none.
_KINDS = {"program": "the program ", "file": "", "folder": "the names in ", "modules": "the modules in ", "there": ""}


def remember(action: Action, facts: tuple[Fact, ...], results: Results) -> None:
    """Note an action that has run or was recalled, as the last one of its step."""
    key, last = action.key(), _last(action)
    if results.note(last) == key:
        return
    results.keep_note(last, key)
    if results.note(_inputs(key)) is None:
        results.keep_note(_inputs(key), {"parts": _plain(action), "facts": facts})


def reasons(action: Action, results: Results, contents: Contents) -> list[str]:
    """Return the known differences from the last run, each in a few words."""
    last = results.note(_last(action))
    if not isinstance(last, str):
        return [_NEW]
    note = results.note(_inputs(last))
    try:
        return [*_differences(note, action, contents)]
    except (LookupError, TypeError, ValueError, AttributeError):
        # The note is missing or damaged.
        return []


def _differences(note: Any, action: Action, contents: Contents) -> Iterator[str]:
    was, now = note["parts"], _plain(action)
    yield from (f"{name} differs" for part, name in _OTHER.items() if was.get(part) != now.get(part))
    yield from _changes("", was["inputs"], now["inputs"])
    yield from _changes("the variable ", was["environment"], now["environment"])
    for kind, name, before in note["facts"]:
        if state(kind, name, contents, action.search) != before:
            yield f"{_KINDS[kind]}{name} differs"


def _changes(what: str, was: Mapping[str, object], now: Mapping[str, object]) -> Iterator[str]:
    for name in sorted({*was, *now}):
        if name not in was:
            yield f"{what}{name} is new"
        elif name not in now:
            yield f"{what}{name} is gone"
        elif was[name] != now[name]:
            yield f"{what}{name} differs"


def _plain(action: Action) -> dict[str, Any]:
    """Return the parts of an action's key; digests replace the values of variables, which may be secret."""
    parts = action.parts()
    variables = {name: digest_of(value) for name, value in parts["environment"].items()}
    return {**parts, "arguments": [*parts["arguments"]], "python": [*parts["python"]], "environment": variables}


def _last(action: Action) -> str:
    return digest_of(["last", str(action.folder), action.name])


def _inputs(key: str) -> str:
    return digest_of(["inputs", key])
