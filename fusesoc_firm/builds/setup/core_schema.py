"""A core file that FuseSoC would ignore, refused with the places of its faults."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fusesoc_firm.core.core_reader import CoreFile, read_core
from fusesoc_firm.text.diagnostics import Diagnostic, InputError, SourceRef, closest, fail

_FIRST = "CAPI=2:"
# Messages about FuseSoC's schema, in which `data` is the core.
_INVALID = re.compile(r"Error validating data(?P<path>\S*) must (?P<rule>.+)")
_UNKNOWN = re.compile(r"not contain \{(?P<keys>.+)\} properties")
_MISSING = re.compile(r"contain \[(?P<keys>.+)\] properties")
_QUOTED = re.compile(r"'([^']+)'")
_KINDS = {"be array": "be a list", "be object": "be a mapping of keys to values", "be string": "be a text"}


def check_loadable(path: Path) -> None:
    """Raise `InputError`, with the places of the faults, if FuseSoC would ignore a core file."""
    from fusesoc_firm.builds.setup.fusesoc_parts import SoundCore

    file = read_core(path)
    text = path.read_text(encoding="utf-8").partition("\n")[0]
    if text.split()[:1] != [_FIRST]:
        fail(
            f"the first line of a core must be '{_FIRST}'", SourceRef(str(path), 1, 1, text), f"write '{_FIRST}' there"
        )
    parser = _parser()
    try:
        SoundCore(parser, str(path), "")
    except SyntaxError as error:
        message = " ".join(str(error.msg).split())
        raise InputError(_faults(file, message, parser.get_schema())) from error


@cache
def _parser() -> Any:
    from fusesoc.config import Config
    from fusesoc.coremanager import CoreManager

    return CoreManager(Config()).core2parser


def _faults(file: CoreFile, message: str, schema: str) -> Iterator[Diagnostic]:
    """Yield the faults of a message by FuseSoC."""
    found = _INVALID.fullmatch(message)
    if not found:
        named = _QUOTED.search(message)
        yield Diagnostic(message, file.place_of(named[1] if named else ""))
        return
    keys = found["path"].split(".")[1:]
    name = f"'{'.'.join(keys)}'" if keys else "a core"
    if unknown := _UNKNOWN.fullmatch(found["rule"]):
        for key in _QUOTED.findall(unknown["keys"]):
            near = closest(key, _words(schema))
            hint = f"did you mean '{near}'?" if near else ""
            yield Diagnostic(f"{name} has no key '{key}'", _place(file, *keys, key), hint)
    elif missing := _MISSING.fullmatch(found["rule"]):
        wanted = " and ".join(f"'{key}'" for key in _QUOTED.findall(missing["keys"]))
        yield Diagnostic(f"{name} needs the key {wanted}", _place(file, *keys))
    else:
        message = f"{name} must {_KINDS.get(found['rule'], found['rule'])}"
        item = file.item(*keys) if found["rule"] == "be array" else None
        hint = f"write [{item[1].value}]" if item and isinstance(item[1].value, str) else ""
        yield Diagnostic(message, _place(file, *keys), hint)


def _place(file: CoreFile, *keys: str) -> SourceRef:
    """Return the place of the last of these nested keys that is written as such."""
    for count in range(len(keys), 0, -1):
        if item := file.item(*keys[:count]):
            return file.source(item[0])
    return SourceRef(str(file.path), 1, 1)


@cache
def _words(schema: str) -> list[str]:
    """Return the names of all keys of FuseSoC's schema, a JSON text."""
    import json

    return sorted(set(_keys(json.loads(schema))) - {""})


def _keys(part: object) -> Iterator[str]:
    for name, item in part.items() if isinstance(part, Mapping) else ():
        if name in ("properties", "patternProperties"):
            yield from (re.sub(r"\W+|\(_append\)", "", key.partition("(")[0]) for key in item)
        yield from _keys(item)
