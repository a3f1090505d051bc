"""The page's view of a specification: its sections as written, its faults, and the derived facts.

The picture needs only a text that is YAML; the rest of the specification may be faulty or unfinished.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from itertools import pairwise
from typing import Any

import yaml

from fusesoc_firm.system.system_core import LoadedSystem
from fusesoc_firm.system.views.show import derived_description
from fusesoc_firm.system.written.specification import Specification
from fusesoc_firm.text.diagnostics import Diagnostic, Diagnostics, InputError
from fusesoc_firm.text.yaml_edit import path_at
from fusesoc_firm.text.yaml_sections import Key, Section, keys_of
from fusesoc_firm.text.yaml_text import YamlText, data_of, parse_yaml

Load = Callable[[str], LoadedSystem]
"""Derives the system of a text in the specification's place. May raise `InputError`."""


def scene(text: str, file: str, load: Load) -> dict[str, Any]:
    """Return a specification as plain data; diagnostics call it `file`.

    `specification` is the file's content (None if it is not a mapping in YAML), `lines` are the first and the last line
    of each block, `faults` are its faults and warnings, each with the `path` of its item, and `derived` is what
    `firm system show` prints (None if there are faults, or no blocks yet).
    """
    derived = None
    diagnostics: Iterable[Diagnostic]
    try:
        loaded = load(text)
        diagnostics = loaded.warnings
        derived = derived_description(loaded.system)
    except InputError as error:
        diagnostics = error.shown()
    read = _read(text)
    root = read.root if read else None
    written = _written(read)
    faults = [_fault(root, file, item) for item in diagnostics if not _is_of_empty(written["specification"], item)]
    return written | {"faults": faults, "derived": derived}


def outline(text: str) -> dict[str, Any]:
    """Return the part of a scene that needs no derivation."""
    return _written(_read(text)) | {"faults": [], "derived": None}


def grammar() -> dict[str, Any]:
    """Return the keys of each kind of section: name, meaning, form, default, legal values, and the kind of sections."""
    found: dict[str, Any] = {}
    _describe(Specification, found)
    return found


def content_of(text: str) -> dict[str, Any] | None:
    """Return the mapping in a text, or None if the text is anything else."""
    return _content(_read(text))


def _written(read: YamlText | None) -> dict[str, Any]:
    return {"specification": _content(read), "lines": _lines(read.root if read else None)}


def _lines(root: yaml.Node | None) -> list[tuple[int, int]]:
    """Return the first and the last line of each block, counted from 1; a block ends where the next one begins."""
    sections = root.value if isinstance(root, yaml.MappingNode) else ()
    blocks = next((value for key, value in sections if key.value == "blocks"), None)
    if not isinstance(blocks, yaml.SequenceNode):
        return []
    end = blocks.end_mark.line + (blocks.end_mark.column > 0)
    starts = [item.start_mark.line + 1 for item in blocks.value]
    return [(first, max(first, after - 1)) for first, after in pairwise([*starts, end + 1])]


def _content(read: YamlText | None) -> dict[str, Any] | None:
    if read is None or read.is_cut:
        return None
    try:
        content = data_of(read.root)
    except yaml.YAMLError:
        return None
    return content if isinstance(content, dict) else None


def _read(text: str) -> YamlText | None:
    """Return the nodes of a text, or of the part before the first error in its YAML.

    A text that exceeds the limits has no nodes.
    """
    with suppress(InputError):
        return parse_yaml(text, "", Diagnostics())
    return None


def _is_of_empty(content: Mapping[str, Any] | None, fault: Diagnostic) -> bool:
    """Return whether a fault says only that a system has no blocks yet."""
    return content is not None and content.get("blocks") in (None, []) and "'blocks'" in fault.message


def _fault(root: yaml.Node | None, file: str, fault: Diagnostic) -> dict[str, Any]:
    """Return a fault with the path of the value at its place, if the place is in the specification."""
    source = fault.source
    path = path_at(root, source.line, source.column) if root and source and source.file == file else None
    return fault.data() | {"path": path}


def _describe(section: type[Section], found: dict[str, Any]) -> None:
    if section.__name__ in found:
        return
    defaults = {field.name: field.default for field in fields(section)}
    found[section.__name__] = [
        _entry(name, entry) | _default(defaults[field]) for name, (field, entry) in keys_of(section).items()
    ]
    for _, entry in keys_of(section).values():
        if entry.section:
            _describe(entry.section, found)


def _default(value: object) -> dict[str, str]:
    return {"default": str(value) if isinstance(value, str | int) else ""}


def _entry(name: str, entry: Key) -> dict[str, Any]:
    return {
        "name": name,
        "meaning": entry.meaning,
        "form": entry.form,
        "choices": [*entry.choices],
        "isRequired": entry.is_required,
        "onlyOf": entry.only_of,
        "section": entry.section.__name__ if entry.section else None,
    }
